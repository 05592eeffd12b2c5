"""Many problems in a few lines, for `cpbench info`."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterator, Sequence

from cpbench import storage
from cpbench.cli import terminal
from cpbench.cli.routes import sizes_line
from cpbench.errors import CpbenchError
from cpbench.plurals import counted

MANY = 3
"""Problems from which on they are not shown one by one."""


def lines(addresses: Sequence[str], file_format: str | None) -> tuple[list[str], list[str]]:
    """What to say of problems, and of those that cannot be read."""
    rows: list[tuple[str, str, str]] = []
    refused: list[str] = []
    for address in addresses:
        try:
            problem = storage.load(address, format=file_format)
        except CpbenchError as cause:
            refused.append(f"refused: {cause if address in str(cause) else f'{address}: {cause}'}")
        else:
            rows.append((problem.node, sizes_line(problem), address))
    return list(_told(rows)), refused


def _told(rows: Sequence[tuple[str, str, str]]) -> Iterator[str]:
    nodes = Counter(node for node, _, _ in rows)
    kinds = ", ".join(f"{count} {node}" for node, count in nodes.most_common())
    yield f"{counted(len(rows), 'problem')}: {kinds or 'none could be read'}"
    if rows:
        yield from terminal.table(rows)
        yield f"all that is known of one: cpbench info {shlex.quote(rows[0][2])}; of all, for programs: --json"
