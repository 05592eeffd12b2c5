"""List formulations, conversions, solvers, formats or problems."""

from __future__ import annotations

import dataclasses
import inspect
import textwrap
from collections.abc import Iterator, Sequence

import click

from cpbench import storage
from cpbench.bench import availability
from cpbench.bench.availability import SolverState
from cpbench.bench.planning import grids
from cpbench.cli.terminal import fitted, print_lines, reading_width, table
from cpbench.conversions.base import conversions, mathematics
from cpbench.formulations import formulations
from cpbench.generators.collection import builtin_folder
from cpbench.graph import edges, promise
from cpbench.solvers.base import Solver, SolverSpec, choices, solvers, written

HEAD = ("solver", "node", "method", "version", "licence")
RESTRICTED = "* figures must not be published without permission: cpbench list solvers NAME"
LICENCE = 24
"""Characters of a licence that a table shows; its own page has all."""
GLANCED = {
    "installed": "its packages are there and were not imported, as cpbench doctor does",
    "untried": "not checked: external program (cpbench doctor starts it)",
}
"""The meaning of a state that was read without importing anything."""


@click.command()
@click.argument("what", type=click.Choice(["formulations", "conversions", "solvers", "formats", "problems"]))
@click.argument("names", nargs=-1, metavar="[NAME|NODE|GLOB]...")
@click.option("--all", "every", is_flag=True, help="Include solvers that run only when they are named.")
def command(what: str, names: tuple[str, ...], every: bool) -> None:
    """List formulations, conversions, solvers, formats or the built-in problems.

    cpbench list solvers NAME shows a solver with its options, cpbench list solvers NODE the solvers of a formulation,
    cpbench list conversions NAME the mathematics of a conversion.
    """
    if what != "solvers" and (every or (names and what != "conversions")):
        raise click.UsageError(f"list {what}: takes no names and no options of solvers")
    if what == "solvers":
        print_lines(_solver_lines(names, every))
    elif what == "problems":
        folder = builtin_folder()
        print_lines(f"builtin/{one.removeprefix(f'{folder}/')}" for one in storage.problem_files([str(folder)]))
    elif what == "formulations":
        print_lines(table((cls.node, f"{cls.title} {cls.equation}") for cls in formulations))
    elif what == "formats":
        print_lines(table((f.name, ", ".join(f.suffixes), f.summary) for f in storage.formats))
    elif names:
        print_lines(line for name in names for line in _conversion_lines(name))
    else:
        print_lines(table((e.name, e.source, "->", e.target, promise(e), e.equation) for e in edges()))


def _conversion_lines(name: str) -> Iterator[str]:
    """Yield the mathematics of a conversion, as its docstring states it; raises UnknownName."""
    edge = conversions.get(name)
    yield f"{edge.name}: {edge.source} -> {edge.target}, {promise(edge)} {edge.equation}".rstrip()
    yield from (f"  {line}".rstrip() for line in mathematics(edge))


def _solver_lines(names: Sequence[str], every: bool) -> Iterator[str]:
    """Yield the solvers that are named, else those that a run takes, with their state on this machine as far as it is
    known without importing anything; raises UnknownName."""
    node = ""
    if len(names) == 1 and names[0] in formulations and names[0] not in solvers:
        node, names = names[0], ()
    candidates = [solvers.get(entry.solver) for entry in grids.entries(names)] if names else list(solvers)
    candidates = [solver for solver in candidates if node in ("", solver.spec.node)]
    shown = [solver for solver in candidates if names or every or solver.spec.by_default]
    states = {solver.spec.name: availability.glance(solver) for solver in shown}
    if names:
        for i, solver in enumerate(shown):
            yield from [""] * bool(i)
            yield from fitted(solver_lines(solver, states[solver.spec.name], reading_width()))
        return
    yield from table(
        [(*HEAD, "here"), *((*cells(one.spec, states[one.spec.name]), states[one.spec.name].line) for one in shown)]
    )
    if any(solver.spec.publishing for solver in shown):
        yield RESTRICTED
    for state, meaning in GLANCED.items():
        if any(one.state == state for one in states.values()):
            yield from fitted([f"{state}: {meaning}"])
    if others := len(candidates) - len(shown):
        yield from fitted([f"{others} more run only when they are named (--all shows them)"])


def cells(spec: SolverSpec, seen: SolverState) -> tuple[str, ...]:
    """Return name, node, kind of method, version and licence; * marks figures whose publishing is restricted."""
    licence = spec.licence if len(spec.licence) <= LICENCE else f"{spec.licence[: LICENCE - 1]}…"
    return spec.name, spec.node, spec.method, seen.version or "-", licence + ("*" if spec.publishing else "")


def solver_lines(solver: Solver, seen: SolverState, width: int) -> Iterator[str]:
    """Yield everything known of one solver, in lines of at most `width` characters."""
    spec = solver.spec
    yield f"{spec.name} {seen.version}".rstrip()
    state, *reason = (f"{seen.state}: {seen.detail.strip() or GLANCED.get(seen.state, '')}".rstrip(": ")).splitlines()
    facts = {
        "solves": f"{spec.node}{'' if spec.kind.exact else f' ({spec.kind}: its answers may not be answers)'}",
        "method": f"{spec.method}: {spec.summary}",
        "can": ", ".join(sorted(spec.traits)),
        "source": spec.citation,
        "licence": spec.licence,
        "publishing": spec.publishing,
        "availability": state,
        "in a run": "by default" if spec.by_default else f"when named: --solver {spec.name}, or --solver all",
    }
    for title, value in facts.items():
        if value:
            yield from _folded(f"  {title:<13}", value, width)
        if title == "availability":
            yield from (f"    {line}" for line in reason)
    yield from _options(spec, width)
    if spec.known_failures:
        yield "  known failures"
        for check, reason in sorted(spec.known_failures.items()):
            yield from _folded(f"    {check}: ", reason, width)


def _options(spec: SolverSpec, width: int) -> Iterator[str]:
    fields = dataclasses.fields(spec.options)
    if not fields:
        yield "  options       none"
        return
    yield f"  options       as in --solver '{spec.name}[{fields[0].name}={written(fields[0].default)}]'"
    rows = [("    option", "type", "default", "choices")]
    for f in fields:
        among = " | ".join(map(written, choices(spec.options, f.name)))
        rows.append((f"    {f.name}", type(f.default).__name__, written(f.default), among or "any"))
    yield from table(rows)
    text = inspect.getdoc(spec.options) or ""
    if not text.startswith(f"{spec.options.__name__}("):  # what a dataclass without a docstring says
        yield from textwrap.wrap(text, width, initial_indent="    ", subsequent_indent="    ")


def _folded(title: str, text: str, width: int) -> Iterator[str]:
    rest = " " * min(len(title) + 1, 16)
    yield from textwrap.wrap(f"{title} {text}", width, subsequent_indent=rest, break_long_words=False)
