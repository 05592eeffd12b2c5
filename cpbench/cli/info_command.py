"""Show the contents of problem files: sizes, facts about their matrices, equations and data."""

from __future__ import annotations

import shlex
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

import click
import numpy as np

from cpbench import storage
from cpbench.api.results import is_results_file
from cpbench.cli.answer import print_results
from cpbench.cli.options import format_option
from cpbench.cli.progress import Steps
from cpbench.cli.terminal import print_lines, table
from cpbench.cli.types import ADDRESS
from cpbench.conversions import Conversion
from cpbench.errors import CpbenchError
from cpbench.formulations import Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.derivatives import derivative
from cpbench.foundation import extensions, matrices
from cpbench.foundation.text import counted, printable, summary
from cpbench.generators.collection import address_text
from cpbench.graph import Apply
from cpbench.report import show

MANY, LISTED = 3, 60
"""Number of problems up to which each is shown by itself, and up to which each has a line."""
LABELS = ("title", "description", "math_info", "family", "source", "licence", "citation")
SHOWN = 8
"""Items of a list, such as names of unknowns, that are shown."""
_KNOWN = {"id": "ids", "bodies": "bodies", "position": "positions", "frame": "frames"}
"""Parts of what is known of contacts, in words."""


@click.command()
@click.argument("files", nargs=-1, required=True, type=ADDRESS)
@click.option("--facts/--no-facts", "measure", default=True, show_default=True, help="Measure facts of the matrices.")
@click.option("--data", is_flag=True, help="Show equations and data instead: numbers of a small problem, else blocks.")
@format_option
def command(files: tuple[str, ...], measure: bool, data: bool, file_format: str | None) -> None:
    """Show formulation, sizes, facts, origin and provenance of problems (FILE, FILE::NAME or folders).

    With --data, show the equations of each problem, those of the conversions that made it, and its data.

    More than three problems get one line each, more than sixty a line for each formulation and family. A
    problem that cannot be read does not stop the others. For a results file the command
    shows which solver to use, as at the end of the run.

    Every fact has its method: exact, by a factorization, or not decided.
    """
    if any(map(is_results_file, files)):
        first, *others = files
        if file_format or others or data:
            raise click.UsageError("a results file stands alone, without options; its rows: cpbench results export")
        print_results(first)
        return
    addresses = storage.problem_files(files) or list(files)
    if len(addresses) > MANY and not data:
        _print_many(addresses, file_format)
        return
    with_facts = measure and "facts" in extensions.added(extensions.HOOKS)
    for address in addresses:
        problem = storage.load(address, format=file_format)
        if data:
            click.echo(show.text(problem))
            continue
        facts = extensions.hook("facts")(problem) if with_facts else ()
        print_lines(_lines(address, problem, facts, len(storage.guesses(address))))


def _print_many(addresses: Sequence[str], file_format: str | None) -> None:
    """Print what is in a folder; exits with 2 where something cannot be read."""
    members: list[dict[str, Any]] = []
    refused: list[str] = []
    with Steps(quiet=False) as steps:
        for address in steps.through(addresses, f"reading {counted(len(addresses), 'problem')}"):
            try:
                members.append(_member(address, storage.load(address, format=file_format)))
            except CpbenchError as cause:
                refused.append(f"refused: {cause if address in str(cause) else f'{address}: {cause}'}")
    kinds = summary(Counter(member["node"] for member in members)) or "none could be read"
    unread = f"; {counted(len(refused), 'file')} could not be read" if refused else ""
    print_lines([f"{counted(len(members), 'problem')}: {kinds}{unread}", *_sequence_lines(members)])
    each = ((member["node"], member["line"], member["address"]) for member in members)
    print_lines(table(_classes(members) if len(members) > LISTED else each))
    if members:
        one = shlex.quote(members[0]["address"])
        print_lines([f"all that is known of one: cpbench info {one}"])
    print_lines(refused, err=True)
    if refused:
        sys.exit(2)


def _member(address: str, problem: Problem) -> dict[str, Any]:
    """Return what is shown of one of many problems."""
    nonzeros = sum(matrices.nnz(value) for value in problem.data().values() if value.ndim == 2)
    return {
        "address": address,
        "node": problem.node,
        "family": problem.info.family,
        "sizes": {**problem.sizes(), "nonzeros": nonzeros},
        "line": sizes_line(problem),
        "step": _step(problem),
    }


def _step(problem: Problem) -> tuple[str, float, float, int, bool] | None:
    """Return sequence, dt, time, contacts of a step, and whether all of them have ids; None of any other problem."""
    if not isinstance(problem, ContactProblem) or problem.sequence is None:
        return None
    sequence, contacts = problem.sequence, problem.contacts
    return (
        sequence.name,
        sequence.dt,
        sequence.time,
        problem.nc,
        contacts is not None and contacts.id.size == problem.nc,
    )


def _sequence_lines(members: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield a line for each sequence: its steps, dt, end, contacts from and to, and whether they have ids."""
    sequences: dict[str, list[Any]] = {}
    for name, *step in (member["step"] for member in members if member["step"] is not None):
        sequences.setdefault(name, []).append(step)
    for name, steps in sequences.items():
        dt, times, contacts, identified = zip(*steps, strict=True)
        ids = "ids in all" if all(identified) else f"ids in {sum(identified)}" if any(identified) else "no ids"
        of = f"sequence {printable(name)}: {counted(len(steps), 'step')}, dt = {_range(dt)} s, to {max(times):g} s"
        yield f"{of}, {_range(contacts)} contacts, {ids}"


def _classes(members: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, str, str]]:
    """Yield formulation and family, number of problems, and the range of each size, for each formulation and family."""
    kind = lambda member: (member["node"], member["family"])  # noqa: E731
    for (node, family), group in groupby(sorted(members, key=kind), kind):
        own = [member["sizes"] for member in group]
        ranges = [f"{symbol} = {_range(sizes[symbol] for sizes in own)}" for symbol in own[0] if symbol != "nonzeros"]
        text = ", ".join([*ranges, f"{_range(sizes['nonzeros'] for sizes in own)} nonzeros"])
        yield printable(f"{node} {family}".strip()), str(len(own)), text


def _range(values: Iterable[float]) -> str:
    values = list(values)
    texts = [str(value) if isinstance(value, int) else f"{value:g}" for value in (min(values), max(values))]
    return " to ".join(dict.fromkeys(texts))


def sizes_line(problem: Problem) -> str:
    """Return the sizes of a problem, as in `n = 20, m = 3, 61 nonzeros`."""
    sizes = ", ".join(f"{symbol} = {size}" for symbol, size in problem.sizes().items())
    nonzeros = sum(matrices.nnz(v) for v in problem.data().values() if v.ndim == 2)
    operations = sum(F.operations for F in problem.maps().values())
    return f"{sizes}, {nonzeros} nonzeros" + (f", {operations} operations" if problem.maps() else "")


def size_after(problem: Problem, edge: Conversion, apply: Apply) -> str:
    """Return the size that `edge` leads to: predicted where the edge can (~, at most), else measured by converting."""
    foreseen = edge.predict(problem)
    return sizes_line(apply(edge, problem)) if foreseen is None else f"~ {foreseen}"


def _lines(address: str, problem: Problem, facts: Sequence[Any], starts: int = 0) -> Iterator[str]:
    """Yield formulation, sizes, data, origin and provenance of a problem, how many starting points its file has
    (`starts`), and the facts that were measured of it."""
    yield f"{address_text(address)}: {problem.title} {problem.equation}".rstrip()
    yield f"  node         {problem.node}"
    yield f"  name         {printable(problem.name)}"
    yield f"  fingerprint  {problem.fingerprint}"
    for symbol, size in problem.sizes().items():
        yield f"  {symbol:<12} {size}"
    for name, value in problem.data().items():
        yield f"  {name:<12} {show.sized(show.shape(problem, name), value)}, {show.entries(value)}"
    for name, F in problem.maps().items():
        yield f"  {name:<12} map {F.rows}x{F.inputs}, {F.operations} operations, {F.constants.size} constants"
        yield f"  {'':<12} {_derivative_line(F)}"
    for name, value in problem.parameters.items():
        yield f"  parameter    {name} = {value:.17g}"
    for label in LABELS:
        text = getattr(problem.info, label)
        if text:
            yield f"  {label:<12} {printable(text)}"
    for key, value in problem.info.properties.items():
        yield printable(f"  property     {key} = {_short(value)}")
    if starts:
        yield f"  starts       {counted(starts, 'guess', 'guesses')} in the file: --start file:all runs from each"
    if isinstance(problem, ContactProblem):
        yield from _contact_lines(problem)
    for step in problem.provenance:
        yield f"  made by      {show.history(step)[0].removeprefix('made by ')}"
    for fact in facts:
        yield f"  fact         {fact}"


def _derivative_line(F: Map) -> str:
    """Return how many entries the Jacobian of a map may have, and what of the map is affine."""
    compiled = F.compiled
    affine = int((np.diff(compiled.C.indptr) == 0).sum())
    entries = counted(derivative(F)[1].size, "entry", "entries")
    return (
        f"Jacobian of {entries}, {affine} of {counted(F.rows, 'row')} affine, "
        f"affine part of {counted(compiled.M.nnz, 'entry', 'entries')}"
    )


def _contact_lines(problem: ContactProblem) -> Iterator[str]:
    """Yield the place of a problem in a sequence, and what is known of its contacts."""
    if (sequence := problem.sequence) is not None:
        step = f"step {sequence.step}, at {sequence.time:g} s, dt = {sequence.dt:g} s"
        yield f"  sequence     {printable(sequence.name)}: {step}"
    contacts = problem.contacts
    if contacts is not None and contacts.count:
        words = [word for part, word in _KNOWN.items() if contacts.knows(part)]
        yield f"  contacts     {', '.join(words)} known"


def _short(value: Any) -> Any:
    """Return a list of more than SHOWN items, as the names of unknowns, by its first ones and its length."""
    if not isinstance(value, (list, tuple)) or len(value) <= SHOWN:
        return value
    return f"{', '.join(map(str, value[:SHOWN]))}, ... ({len(value)})"
