"""Selects problems: globs and packs become addresses, and conditions on surveyed facts choose among them.

Choices are by fingerprint, not by place: the same problems give the same choice on every machine, in whatever order
the files come.
"""

from __future__ import annotations

import fnmatch
import glob
import hashlib
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from cpbench import storage
from cpbench.bench.messages import Surveyed
from cpbench.bench.planning import features, where
from cpbench.bench.planning.places import located
from cpbench.bench.planning.plan import Pair
from cpbench.bench.planning.run_plan import ProblemSet
from cpbench.errors import CpbenchError, FormatError
from cpbench.storage.base import SEPARATOR

FAILED = (
    "approximate", "lost", "inaccurate", "wrong", "unresolvable", "failed", "max_iter", "timeout", "memout", "crash",
    "error", "unavailable",
)  # fmt: skip
RERUN: Mapping[str, tuple[str, ...] | None] = {"failed": FAILED, "timeouts": ("timeout",), "all": None}
"""Statuses that `--rerun` runs again; None for any. An `unsupported` pair stays one until the code changes: `all`."""

_WILD = set("*?[")


def addresses(texts: Iterable[str], builtin: Callable[[], Path]) -> list[str]:
    """Return the addresses of problems in files, packs, folders, globs and `builtin`.

    Raises CpbenchError when one of them has no problem.
    """
    files: list[str] = []
    for text in texts:
        here = storage.problem_files(_expanded(located(text, builtin)))
        if not here:
            raise CpbenchError(f"no problem file in {text}; see cpbench list formats")
        files += here
    return list(dict.fromkeys(files))


def _expanded(text: str) -> list[str]:
    """Return the paths and members that match a glob; any other text unchanged."""
    file, separator, member = text.rpartition(SEPARATOR) if SEPARATOR in text else (text, "", "")
    if os.path.exists(text) or not _WILD & set(text):
        return [text]
    files = sorted(glob.glob(file, recursive=True)) if _WILD & set(file) and not os.path.exists(file) else [file]
    if not separator:
        result = files
    else:
        named = [(f, m) for f in files for m in _members(f) if fnmatch.fnmatchcase(m, member)]
        result = [f"{f}{SEPARATOR}{m}" if m else f for f, m in named]
    if not result:
        raise CpbenchError(f"nothing matches {text}")
    return result


def _members(file: str) -> list[str]:
    try:
        return storage.members(file)
    except FormatError:
        return []  # no pack, so that nothing in it is meant


# ---------------------------------------------------------------------------------------------- by facts


def select(part: ProblemSet, surveys: Sequence[Surveyed]) -> list[Surveyed]:
    """Return the surveyed problems that a set selects; raises CpbenchError where pandas refuses the condition."""
    if not part.where:
        return list(surveys)
    held = where.holds(part.where, [survey.features for survey in surveys], features.known())
    return [survey for survey, holds in zip(surveys, held, strict=True) if holds]


def shard(pairs: Iterable[Pair], part: int, parts: int) -> list[Pair]:
    """Return the pairs of one of several shards: blocks stay whole, and the choice is the same on every machine.

    >>> shard([], 1, 4)
    []
    """
    if parts == 1:
        return list(pairs)
    return [p for p in pairs if _number(p) % parts == part - 1]


def _number(pair: Pair) -> int:
    """Return a number of a pair's block, with a folder by its last part, which is the same on every machine."""
    name = f"sequence {Path(pair.scene[0]).name} {pair.scene[1]}" if pair.scene else f"problem {pair.fingerprint}"
    return int.from_bytes(hashlib.sha256(name.encode("utf-8", "surrogateescape")).digest()[:8], "big")
