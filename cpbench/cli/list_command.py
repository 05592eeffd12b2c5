"""`cpbench list`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence

import click

from cpbench.cli import terminal
from cpbench.cli.options import Command


@click.command(cls=Command)
@click.argument("what", type=click.Choice(["formulations", "conversions", "solvers", "formats", "problems"]))
@click.argument("names", nargs=-1, metavar="[NAME|GLOB]...")
@click.option("--all", "every", is_flag=True, help="Solvers: those too that run only when they are named.")
@click.option("--available", is_flag=True, help="Solvers: only those that can run here.")
@click.option("--node", metavar="NODE", help="Solvers: only those of this formulation.")
@click.option(
    "--check", is_flag=True, help="Solvers: import every guest and see, instead of looking whether it is there."
)
@click.option("--json", "as_json", is_flag=True, help="Solvers: for programs.")
def command(
    what: str,
    names: tuple[str, ...],
    every: bool,
    available: bool,
    node: str | None,
    check: bool,
    as_json: bool,
) -> None:
    """List formulations, conversions, solvers, formats or the built-in problems.

    cpbench list solvers NAME shows one solver with its options, cpbench list solvers NODE those of a formulation,
    cpbench list conversions NAME the mathematics of a conversion.
    """
    if what == "solvers":
        for line in _solvers(names, every, available, node, check, as_json):
            click.echo(line if as_json or len(line) < terminal.NARROWEST else "\n".join(terminal.folded(line)))
        return
    if every or available or node or check or as_json or (names and what != "conversions"):
        raise click.UsageError(f"list {what}: takes no names and no options of solvers")
    if names:
        for line in _told(names):
            click.echo(line)
        return
    for line in {
        "formulations": _formulations,
        "conversions": _conversions,
        "formats": _formats,
        "problems": _problems,
    }[what]():
        click.echo(line)


def _formulations() -> Iterator[str]:
    from cpbench.formulations import formulations

    return terminal.table((cls.node, f"{cls.title} {cls.equation}") for cls in formulations)


def _conversions() -> Iterator[str]:
    from cpbench.graph import edges
    from cpbench.report.graph_drawing import promise

    return terminal.table((e.name, e.source, "->", e.target, promise(e), e.equation) for e in edges())


def _told(names: Sequence[str]) -> Iterator[str]:
    """The mathematics of conversions, as their modules tell it. Raises UnknownName."""
    from cpbench.conversions import conversions
    from cpbench.report.graph_drawing import promise

    for name in names:
        edge = conversions.get(name)
        yield f"{edge.name}: {edge.source} -> {edge.target}, {promise(edge)} {edge.equation}".rstrip()
        yield from (f"  {line}".rstrip() for line in (sys.modules[edge.__module__].__doc__ or "").strip().splitlines())


def _solvers(
    names: Sequence[str], every: bool, available: bool, node: str | None, check: bool, as_json: bool
) -> Iterator[str]:
    """Those that were named, each with its sheet; else a table of those that a run takes, or of all."""
    from cpbench.bench import checkup
    from cpbench.bench.planning import grids
    from cpbench.cli import solver_tables
    from cpbench.formulations import formulations
    from cpbench.solvers.base import solvers

    if node is None and len(names) == 1 and names[0] in formulations and names[0] not in solvers:
        node, names = names[0], ()
    if node is not None:
        formulations.get(node)
    named = [solvers.get(entry.solver) for entry in grids.entries(names)] if names else list(solvers)
    of_node = [solver for solver in named if node in (None, solver.spec.node)]
    chosen = [solver for solver in of_node if names or every or solver.spec.by_default]
    looked = checkup.examine(chosen) if check else map(checkup.glance, chosen)
    seen = {one.name: one for one in looked}
    shown = [solver for solver in chosen if seen[solver.spec.name].usable or not available]
    if as_json:
        yield json.dumps([solver_tables.as_data(solver, seen[solver.spec.name]) for solver in shown], indent=1)
        return
    if names:
        for i, solver in enumerate(shown):
            yield from [""] * bool(i)
            yield from solver_tables.sheet(solver, seen[solver.spec.name])
        return
    rows = [(*solver_tables.cells(s.spec, seen[s.spec.name]), seen[s.spec.name].line) for s in shown]
    yield from terminal.table([(*solver_tables.HEAD, "here"), *rows])
    if any(solver.spec.publishing for solver in shown):
        yield "* figures must not be published without permission: cpbench list solvers NAME"
    for state, meaning in solver_tables.GLANCED.items():
        if any(seen[solver.spec.name].state == state for solver in shown):
            yield f"{state}: {meaning}"
    if available and len(shown) < len(chosen):
        yield f"{len(chosen) - len(shown)} more cannot run here: cpbench doctor says why"
    rest = [solver.spec for solver in of_node if solver not in chosen]
    if rest:
        told = f"{len(rest)} more run only when they are named (--all shows them): {solver_tables.families(rest)}"
        yield told


def _formats() -> Iterator[str]:
    from cpbench.storage import formats

    return terminal.table((f.name, ", ".join(f.suffixes), f.summary) for f in formats)


def _problems() -> list[str]:
    from cpbench import storage
    from cpbench.generators.collection import builtin_folder

    folder = builtin_folder()
    return [f"builtin/{address.removeprefix(f'{folder}/')}" for address in storage.problem_files([str(folder)])]
