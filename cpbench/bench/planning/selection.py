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
from cpbench.bench.planning.plan import PREVIOUS, Pair
from cpbench.bench.planning.run_plan import ProblemSet
from cpbench.errors import CpbenchError, FormatError, UnknownName
from cpbench.storage.base import SEPARATOR, split_address

FAILED = (
    "approximate", "lost", "inaccurate", "wrong", "unresolvable", "failed", "max_iter", "timeout", "memout", "crash",
    "error", "unavailable",
)  # fmt: skip
RERUN: Mapping[str, tuple[str, ...] | None] = {"failed": FAILED, "timeouts": ("timeout",), "all": None}
"""Statuses that `--rerun` runs again; None for any. An `unsupported` pair stays one until the code changes: `all`."""
RETRIED = ("crash", "timeout", "memout")
"""Statuses that may be accidents of the machine, which `--retry` runs again."""

_WILD = set("*?[")


def addresses(texts: Iterable[str], builtin: Callable[[], Path]) -> list[str]:
    """Return the addresses of problems in files, packs, folders, globs and `builtin`.

    Raises CpbenchError when one of them has no problem.
    """
    found: list[str] = []
    for text in texts:
        here = storage.problem_files(_expanded(located(text, builtin)))
        if not here:
            raise CpbenchError(f"no problem file in {text}; see cpbench list formats")
        found += here
    return list(dict.fromkeys(found))


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
    """Return the surveyed problems that a set selects; raises CpbenchError on an unknown family."""
    chosen = list(surveys)
    if part.family:
        families = {survey.family for survey in surveys}
        for family in part.family:
            if not any(fnmatch.fnmatchcase(known, family) for known in families):
                raise UnknownName("family", family, families)
        chosen = [s for s in chosen if any(fnmatch.fnmatchcase(s.family, family) for family in part.family)]
    if part.keyword:
        words = where.words(part.keyword)
        above = _above(surveys)
        chosen = [s for s in chosen if words.holds(_texts(s, above))]
    if part.where:
        condition = where.condition(part.where, features.known())
        chosen = [s for s in chosen if condition.holds(s.features)]
    if part.split:
        chosen = [s for s in chosen if split_of(s.fingerprint) == part.split]
    return chosen if part.max_problems is None else _some(chosen, part)


def split_of(fingerprint: str) -> str:
    """Return `dev` or `test`: a hash of the problem's mathematics decides, one half each, on every machine alike.

    A solver may be developed on the one, and then be compared on the other. A copy of a problem, whatever
    its name and place, is in the same half.
    """
    return "test" if _hash(f"split {fingerprint}")[0] % 2 else "dev"


def _above(surveys: Sequence[Surveyed]) -> str:
    """Return the common folder of all files, whose name does not distinguish them."""
    files = [os.path.abspath(str(split_address(survey.address)[0])) for survey in surveys]
    return os.path.commonpath([os.path.dirname(file) for file in files]) if files else ""


def _texts(survey: Surveyed, above: str) -> dict[str, str]:
    """Return the texts that are searched for words: path in the common folder, name, family and node."""
    file, member = split_address(survey.address)
    place = os.path.relpath(os.path.abspath(str(file)), above)
    return {"place": place, "member": member, "problem": survey.problem, "family": survey.family, "node": survey.node}


def _some(surveys: Sequence[Surveyed], part: ProblemSet) -> list[Surveyed]:
    """Return at most `max_problems` different problems, drawn by the seed; of sequences run step by step, the first
    steps."""
    unique = {survey.fingerprint: survey for survey in reversed(surveys)}

    def draw(survey: Surveyed) -> tuple[str, int]:
        scene = survey.sequence if PREVIOUS in part.start else ""
        return _hash(f"{part.seed} {scene or survey.fingerprint}").hex(), int(survey.step)

    drawn = {s.fingerprint for s in sorted(unique.values(), key=draw)[: part.max_problems]}
    return [survey for survey in surveys if survey.fingerprint in drawn]


def shard(pairs: Iterable[Pair], part: int, parts: int) -> list[Pair]:
    """Return the pairs of one of several shards: blocks stay whole, and the choice is the same on every machine.

    >>> shard([], 1, 4)
    []
    """
    if parts == 1:
        return list(pairs)
    return [p for p in pairs if int.from_bytes(_hash(_unit(p))[:8], "big") % parts == part - 1]


def _unit(pair: Pair) -> str:
    """Return the name of a pair's block, a folder by its last part, which is the same on every machine."""
    return f"sequence {Path(pair.scene[0]).name} {pair.scene[1]}" if pair.scene else f"problem {pair.fingerprint}"


def _hash(text: str) -> bytes:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).digest()
