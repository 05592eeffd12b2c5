"""List formulations, conversions, solvers, formats or problems."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import click

from cpbench import storage
from cpbench.bench import availability
from cpbench.bench.availability import SolverState
from cpbench.bench.planning import grids
from cpbench.cli.options import Command
from cpbench.cli.solver_tables import GLANCED, HEAD, as_data, cells, families, sheet
from cpbench.cli.terminal import fitted, print_lines, reading_width, table
from cpbench.conversions.base import conversions, mathematics
from cpbench.formulations import formulations
from cpbench.generators.collection import builtin_folder
from cpbench.graph import edges, promise
from cpbench.solvers.base import Solver, SolverSpec, solvers


@click.command(cls=Command)
@click.argument("what", type=click.Choice(["formulations", "conversions", "solvers", "formats", "problems"]))
@click.argument("names", nargs=-1, metavar="[NAME|GLOB]...")
@click.option("--all", "every", is_flag=True, help="Include solvers that run only when they are named.")
@click.option("--available", is_flag=True, help="Show only solvers that can run here.")
@click.option("--node", metavar="NODE", help="Formulation of the solvers.")
@click.option(
    "--check", is_flag=True, help="Import the packages of all solvers, instead of looking whether they are installed."
)
@click.option("--json", "as_json", is_flag=True, help="Print the solvers as JSON.")
def command(
    what: str, names: tuple[str, ...], every: bool, available: bool, node: str | None, check: bool, as_json: bool
) -> None:
    """List formulations, conversions, solvers, formats or the built-in problems.

    cpbench list solvers NAME shows a solver with its options, cpbench list solvers NODE the solvers of a formulation,
    cpbench list conversions NAME the mathematics of a conversion.
    """
    if what == "solvers":
        listed = solver_list(names, node=node, every=every, available=available, check=check)
        if as_json:
            click.echo(json.dumps(listed.records(), indent=1))
        elif listed.named:
            print_lines(fitted(listed.sheets(reading_width())))
        else:
            print_lines(table(listed.rows()))
            print_lines(fitted(listed.notes()))
        return
    if every or available or node or check or as_json or (names and what != "conversions"):
        raise click.UsageError(f"list {what}: takes no names and no options of solvers")
    if what == "problems":
        print_lines(builtin_problems())
    elif names:
        print_lines(conversion_sheets(names))
    else:
        rows = {
            "formulations": formulation_rows,
            "conversions": conversion_rows,
            "formats": format_rows,
        }
        print_lines(table(rows[what]()))


def formulation_rows() -> list[tuple[str, ...]]:
    """Return node and law of each formulation."""
    return [(cls.node, f"{cls.title} {cls.equation}") for cls in formulations]


def conversion_rows() -> list[tuple[str, ...]]:
    """Return name, source, target, promise and equation of each conversion."""
    return [(e.name, e.source, "->", e.target, promise(e), e.equation) for e in edges()]


def conversion_sheets(names: Sequence[str]) -> Iterator[str]:
    """Yield the mathematics of conversions, as their docstrings state it; raises UnknownName."""
    for name in names:
        edge = conversions.get(name)
        yield f"{edge.name}: {edge.source} -> {edge.target}, {promise(edge)} {edge.equation}".rstrip()
        yield from (f"  {line}".rstrip() for line in mathematics(edge))


def format_rows() -> list[tuple[str, ...]]:
    """Return name, suffixes and summary of each file format."""
    return [(f.name, ", ".join(f.suffixes), f.summary) for f in storage.formats]


def builtin_problems() -> list[str]:
    """Return the addresses of the built-in problems."""
    folder = builtin_folder()
    return [f"builtin/{address.removeprefix(f'{folder}/')}" for address in storage.problem_files([str(folder)])]


@dataclass(frozen=True)
class SolverList:
    """Solvers that were asked for (`shown`), what is known of each here (`states`), and what was left out.

    Attributes
    ----------
    named : whether each was asked for by its name. unusable : those that cannot run here. others : those that run only
    when they are named.
    """

    shown: tuple[Solver, ...]
    states: dict[str, SolverState]
    named: bool
    unusable: int
    others: tuple[SolverSpec, ...]

    def records(self) -> list[dict[str, object]]:
        """Return everything known of each solver, as JSON takes it."""
        return [as_data(solver, self.states[solver.spec.name]) for solver in self.shown]

    def sheets(self, width: int) -> Iterator[str]:
        """Yield everything known of each solver, in lines of at most `width` characters."""
        for i, solver in enumerate(self.shown):
            yield from [""] * bool(i)
            yield from sheet(solver, self.states[solver.spec.name], width)

    def rows(self) -> list[tuple[str, ...]]:
        """Return a row for each solver, below the names of the columns."""
        seen = [(solver.spec, self.states[solver.spec.name]) for solver in self.shown]
        return [(*HEAD, "here"), *((*cells(spec, one), one.line) for spec, one in seen)]

    def notes(self) -> Iterator[str]:
        """Yield what the table means, and what it leaves out."""
        if any(solver.spec.publishing for solver in self.shown):
            yield "* figures must not be published without permission: cpbench list solvers NAME"
        for state, meaning in GLANCED.items():
            if any(self.states[solver.spec.name].state == state for solver in self.shown):
                yield f"{state}: {meaning}"
        if self.unusable:
            yield f"{self.unusable} more cannot run here: cpbench doctor says why"
        if self.others:
            yield f"{len(self.others)} more run only when they are named (--all shows them): {families(self.others)}"


def solver_list(
    names: Sequence[str] = (),
    *,
    node: str | None = None,
    every: bool = False,
    available: bool = False,
    check: bool = False,
) -> SolverList:
    """Return the solvers that are named, else those that a run takes, with their state on this machine.

    Parameters
    ----------
    names : names or globs; one formulation stands for its solvers. node : formulation. every : also those that run only
    when they are named. available : only those that can run here. check : import every guest, in another process.

    Raises UnknownName.
    """
    if node is None and len(names) == 1 and names[0] in formulations and names[0] not in solvers:
        node, names = names[0], ()
    if node is not None:
        formulations.get(node)
    named = [solvers.get(entry.solver) for entry in grids.entries(names)] if names else list(solvers)
    of_node = [solver for solver in named if node in (None, solver.spec.node)]
    chosen = [solver for solver in of_node if names or every or solver.spec.by_default]
    states = {one.name: one for one in (availability.examine(chosen) if check else map(availability.glance, chosen))}
    shown = [solver for solver in chosen if states[solver.spec.name].usable or not available]
    others = [solver.spec for solver in of_node if solver not in chosen]
    return SolverList(tuple(shown), states, bool(names), len(chosen) - len(shown), tuple(others))
