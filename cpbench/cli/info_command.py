"""Show the contents of a problem file, and measured facts about its matrices."""

from __future__ import annotations

import json
import shlex
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import click

from cpbench import storage
from cpbench.api.results import is_results_file
from cpbench.cli import problem_text, terminal
from cpbench.cli.answer import print_results
from cpbench.cli.options import Command, format_option
from cpbench.cli.problem_text import StepFacts
from cpbench.cli.steps import Steps
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import ADDRESS
from cpbench.errors import CpbenchError
from cpbench.formulations import Problem
from cpbench.foundation import extensions, matrices
from cpbench.foundation.plain_text import printable
from cpbench.foundation.plurals import counted, some_of, summary
from cpbench.storage.base import split_address

MANY = 3
"""Number of problems up to which each is shown by itself."""
LISTED = 60
"""Number of problems up to which each has a line."""
TWINS = 12
"""The most problems that are named as copies of others."""
SUFFIXES = 6
"""The most suffixes of files that are not problems."""


@click.command(cls=Command)
@click.argument("files", nargs=-1, required=True, type=ADDRESS)
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON: a list with one object per problem.")
@click.option("--facts/--no-facts", "measure", default=True, show_default=True, help="Measure facts of the matrices.")
@format_option
def command(files: tuple[str, ...], as_json: bool, measure: bool, file_format: str | None) -> None:
    """Show formulation, sizes, facts, origin and provenance of problems (FILE, FILE::NAME or folders).

    More than three problems get one line each, more than sixty a line for each formulation and family; problems that
    are there twice are named. A problem that cannot be read does not stop the others. For a results file the command
    shows which solver to use, as at the end of the run.

    Every fact has its method: exact, by a factorization, by a randomized estimate, or not decided.
    """
    if any(map(is_results_file, files)):
        first, *others = files
        if as_json or file_format or others:
            raise click.UsageError("a results file stands alone, without options; its rows: cpbench results export")
        print_results(first)
        return
    addresses = storage.problem_files(files) or list(files)
    if len(addresses) > MANY and not as_json:
        _print_many(files, addresses, file_format)
        return
    records: list[dict[str, object]] = []
    known = measure and "facts" in extensions.added(extensions.HOOKS)
    for address in addresses:
        problem = storage.load(address, format=file_format)
        measured = extensions.hook("facts")(problem) if known else ()
        if as_json:
            records.append(problem_text.record(address, problem, measured, len(storage.guesses(address))))
        else:
            print_lines(problem_text.lines(address, problem, measured, len(storage.guesses(address))))
    if as_json:
        click.echo(json.dumps(records, indent=2, ensure_ascii=False, allow_nan=False))


def _print_many(places: Sequence[str], addresses: Sequence[str], file_format: str | None) -> None:
    """Print what is in a folder; exits with 2 where something cannot be read."""
    with Steps(quiet=False) as steps:
        listing = collect(steps.through(addresses, "reading", "problem"), file_format)
    print_lines([headline(listing)])
    print_lines(problem_text.sequence_lines(listing.steps))
    many = len(listing.members) > LISTED
    rows = [(m.node, m.line, m.address) for m in listing.members]
    print_lines(terminal.table(classes(listing.members) if many else rows))
    print_lines(twins(listing.members))
    print_lines(others(places, addresses))
    if rows:
        print_lines([f"all that is known of one: cpbench info {shlex.quote(rows[0][2])}; of all, for programs: --json"])
    print_lines(listing.refused, err=True)
    if listing.refused:
        sys.exit(2)


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
