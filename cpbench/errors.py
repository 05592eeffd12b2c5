"""The exceptions of cpbench: one class a *cause*, one line a message.

Every message says what is wrong, shows the evidence and names what to do. All of them derive from
:class:`CpbenchError`, which the command line prints in one line and turns into exit code 2.
"""

from __future__ import annotations

import traceback
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

LISTED = 30
"""Known names that a message shows where none is near the unknown one."""


class CpbenchError(Exception):
    """Something the user can mend: bad input, an unknown name, a missing route."""


def described(error: BaseException) -> str:
    """Return class and message of an exception, with the last line outside installed packages that it passed."""
    try:
        message = f": {error}"[:1_800]
    except BaseException:
        message = ", without a message (its __str__ raised)"
    frames = traceback.extract_tb(error.__traceback__)
    mine = next((frame for frame in reversed(frames) if "site-packages" not in frame.filename), *frames[-1:])
    return f"{type(error).__name__}{message} ({mine.filename.rpartition('/')[2]}, line {mine.lineno})"


class FormatError(CpbenchError):
    """A file could not be read or written: `file: field: cause`."""

    def __init__(self, path: str | Path, field: str, cause: str) -> None:
        # both may quote the file, which may hold anything
        self.path, self.field, self.cause = str(path), _spelled(field), _spelled(cause)
        super().__init__(f"{path}: {self.field}: {self.cause}" if field else f"{path}: {self.cause}")


class ProblemError(CpbenchError):
    """Problem data are inconsistent: `node.field: cause` (a shape, a NaN, a negative friction)."""

    def __init__(self, field: str, cause: str) -> None:
        self.field, self.cause = field, cause
        super().__init__(f"{field}: {cause}")


class PointError(CpbenchError):
    """An answer does not have the shape of the problem's unknowns."""


class NotApplicable(CpbenchError):
    """A conversion or a solver refuses a problem; the message is its obstacle, with the number."""

    def __init__(self, name: str, obstacle: str) -> None:
        self.name, self.obstacle = name, obstacle
        super().__init__(f"{name}: {obstacle}")


class NoRoute(CpbenchError):
    """Error: no conversion route leads from the problem to the wanted formulation."""


class UnknownName(CpbenchError):
    """A name is in no registry; the nearest known ones are offered."""

    def __init__(self, kind: str, name: str, names: Iterable[str]) -> None:
        import difflib  # not for `cpbench --help`, which no name is sought for

        names = sorted(names)
        near = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
        more = f", and {len(names) - LISTED} more" if len(names) > LISTED else ""
        hint = f"did you mean {', '.join(near)}?" if near else f"known: {', '.join(names[:LISTED])}{more}"
        if kind == "solver":  # there are many, and some are known only where their file is loaded
            hint = hint if near else "cpbench list solvers --all has the names"
            hint += "; one that a plan file or a plugin declares needs --plugin FILE"
        super().__init__(f"unknown {kind} '{name}': {hint}")


class DuplicateName(CpbenchError):
    """Two plugins claim one name."""


class StoreError(CpbenchError):
    """A results file cannot be used: wrong schema, other limits, not a results file."""


class Unavailable(CpbenchError):
    """A solver that is installed cannot run after all: a licence that ran out, a program that does not start.

    `state` : missing, broken or licence, as in `Availability`; `detail` : what it said, and what to do.
    """

    def __init__(self, state: str, detail: str) -> None:
        self.state, self.detail = state, detail
        super().__init__(f"{state}: {detail}")


class Ended(CpbenchError):
    """The process in which a solver works ended in the middle of its work.

    `code` : its exit code, or minus the number of the signal that killed it (as `subprocess` has it).
    """

    def __init__(self, name: str, code: int) -> None:
        self.name, self.code = name, code
        how = f"was killed by signal {-code}" if code < 0 else f"exited with code {code}"
        super().__init__(f"{name} {how} before it answered")


def _spelled(text: str) -> str:
    r"""Return the text with the characters spelled out that are not printed.

    >>> _spelled("5 \x1b[31m")
    '5 \\x1b[31m'
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)
