"""`cpbench route`."""

from __future__ import annotations

import click

from cpbench import graph, storage
from cpbench.cli.options import format_option
from cpbench.cli.routes import kinds_option, sizes_line
from cpbench.errors import NoRoute
from cpbench.formulations import Kind, formulations
from cpbench.solvers.base import solvers


@click.command()
@click.argument("problem")
@click.option("--to", "nodes", multiple=True, metavar="NODE", help="Only to this formulation (default: all).")
@click.option("--explain", is_flag=True, help="Show the dead ends, each with its obstacle.")
@kinds_option
@format_option
def command(
    problem: str, nodes: tuple[str, ...], explain: bool, kinds: frozenset[Kind], file_format: str | None
) -> None:
    """Show how a problem reaches the formulations, which solvers wait there, and why the rest is out of reach."""
    source = storage.load(problem, format=file_format)
    for node in nodes:
        formulations.get(node)
    click.echo(f"{problem} ({source.node}: {sizes_line(source)})")
    for node in nodes or formulations.names():
        waiting = ", ".join(s.spec.name for s in solvers if s.spec.node == node) or "none"
        try:
            arrival = graph.arrive(source, node, kinds)
        except NoRoute as refusal:
            click.echo(f"{node:<5} out of reach: {refusal}")
            continue
        click.echo(f"{node:<5} {arrival.route.label} ({arrival.kind}; {sizes_line(arrival.problem)})")
        click.echo(f"      solvers: {waiting}")
        if explain:
            for end in arrival.dead_ends:
                click.echo(f"      dead end: {end}")
