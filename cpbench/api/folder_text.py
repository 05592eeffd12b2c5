"""Many problems as lines for a reader: formulations, families, sizes, steps, problems that are there twice, and what
cannot be read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from cpbench import storage
from cpbench.api import problem_text
from cpbench.api.problem_text import StepFacts
from cpbench.errors import CpbenchError
from cpbench.formulations import Problem
from cpbench.foundation import matrices
from cpbench.foundation.plain_text import printable
from cpbench.foundation.plurals import counted, some_of, summary
from cpbench.storage.base import split_address

TWINS = 12
"""The most problems that are named as copies of others."""
SUFFIXES = 6
"""The most suffixes of files that are not problems."""


@dataclass(frozen=True)
class ProblemFacts:
    """One of many problems: formulation, family, sizes by symbol, and what its line says."""

    address: str
    node: str
    family: str
    fingerprint: str
    sizes: dict[str, int]
    line: str


@dataclass
class CollectedProblems:
    """Facts of many problems, in their order.

    Attributes
    ----------
    members : those that could be read. steps : facts of those that are steps. refused : a line for each that could not.
    """

    members: list[ProblemFacts] = field(default_factory=list)
    steps: list[StepFacts] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)


def collect(addresses: Iterable[str], file_format: str | None) -> CollectedProblems:
    """Read the problems one after the other; one that cannot be read does not stop the others."""
    collected = CollectedProblems()
    for address in addresses:
        try:
            problem = storage.load(address, format=file_format)
        except CpbenchError as cause:
            collected.refused.append(f"refused: {cause if address in str(cause) else f'{address}: {cause}'}")
            continue
        collected.members.append(_member(address, problem))
        if (step := problem_text.step_of(problem)) is not None:
            collected.steps.append(step)
    return collected


def _member(address: str, problem: Problem) -> ProblemFacts:
    sizes = {**problem.sizes(), "nonzeros": sum(matrices.nnz(v) for v in problem.data().values() if v.ndim == 2)}
    line = problem_text.sizes_line(problem)
    return ProblemFacts(address, problem.node, problem.info.family, problem.fingerprint, sizes, line)


def headline(found: CollectedProblems) -> str:
    """Return how many problems of which formulation there are, and how many could not be read."""
    kinds = summary(Counter(member.node for member in found.members))
    more = f"; {counted(len(found.refused), 'file')} could not be read" if found.refused else ""
    return f"{counted(len(found.members), 'problem')}: {kinds or 'none could be read'}{more}"


def classes(members: Sequence[ProblemFacts]) -> Iterator[tuple[str, str, str]]:
    """Yield formulation and family, number of problems, and the range of each size, for each formulation and family."""
    grouped: dict[tuple[str, str], list[ProblemFacts]] = {}
    for member in members:
        grouped.setdefault((member.node, member.family), []).append(member)
    for (node, family), own in sorted(grouped.items()):
        ranges = [f"{symbol} = {_range(own, symbol)}" for symbol in own[0].sizes if symbol != "nonzeros"]
        text = ", ".join([*ranges, f"{_range(own, 'nonzeros')} nonzeros"])
        yield printable(f"{node} {family}".strip()), str(len(own)), text


def _range(members: Sequence[ProblemFacts], symbol: str) -> str:
    values = [member.sizes[symbol] for member in members]
    return " to ".join(map(str, dict.fromkeys((min(values), max(values)))))


def twins(members: Sequence[ProblemFacts]) -> Iterator[str]:
    """Yield the problems that are there twice, the first of them named."""
    first: dict[str, str] = {}
    pairs = [(member.address, first.setdefault(member.fingerprint, member.address)) for member in members]
    again = [f"{address} is {before}" for address, before in pairs if address != before]
    if again:
        yield f"{counted(len(again), 'problem')} there before under another name: {some_of(again, TWINS)}"


def others(places: Iterable[str], addresses: Iterable[str]) -> Iterator[str]:
    """Yield how many files of the folders among `places` are no problems, by their suffix."""
    read = {split_address(address)[0] for address in addresses}
    suffixes: Counter[str] = Counter()
    for folder in filter(Path.is_dir, map(Path, places)):
        inside = (path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("."))
        suffixes.update(path.suffix or path.name for path in inside if not {path, *path.parents} & read)
    if suffixes:
        kinds = [f"{count} {suffix}" for suffix, count in suffixes.most_common()]
        yield printable(f"{counted(suffixes.total(), 'file')} of no format of problems: {some_of(kinds, SUFFIXES)}")
