"""A part of a table's rows, read by another process meanwhile."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cpbench.bench.results.whole import Rows

_COMMAND = "import sys; sys.path[:] = {path!r}; from cpbench.bench.results.other_reader import tell; tell()"


class OtherReader:
    """Reads the rows with these numbers of a results file, from when it is made until `rows` asks for them."""

    def __init__(self, file: Path, first: int, last: int) -> None:
        command = [sys.executable, "-c", _COMMAND.format(path=sys.path), str(file), str(first), str(last)]
        try:
            self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        except OSError:
            self._process = None

    def rows(self) -> Rows | None:
        """What it read, None where it could not."""
        if self._process is None or self._process.stdout is None:
            return None
        try:
            return pickle.load(self._process.stdout)
        except (OSError, EOFError, MemoryError, pickle.UnpicklingError):
            return None

    def __enter__(self) -> OtherReader:
        return self

    def __exit__(self, kind: type[BaseException] | None, _: BaseException | None, __: TracebackType | None) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()


def tell() -> None:
    """The other end: the rows that the command line names, to standard output."""
    from cpbench.bench.results.database import Database
    from cpbench.bench.results.whole import read_rows

    file, first, last = sys.argv[1:]
    database = Database(Path(file))
    found = pickle.dumps(read_rows(database, int(first), int(last)), protocol=pickle.HIGHEST_PROTOCOL)
    database.close()
    sys.stdout.buffer.write(found)
