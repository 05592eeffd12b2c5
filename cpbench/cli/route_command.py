"""Show how a problem reaches a formulation, or why it cannot."""

from __future__ import annotations

from collections.abc import Iterable

import click

from cpbench import graph, storage
from cpbench.cli import terminal
from cpbench.cli.graph_command import solvers_of
from cpbench.cli.options import Command, ListOption, format_option, kinds_option
from cpbench.cli.problem_text import size_after, sizes_line
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import ADDRESS
from cpbench.errors import NoRoute, NotApplicable
from cpbench.formulations import Kind, Problem, formulations
from cpbench.generators.collection import address_text


@click.command(cls=Command)
@click.argument("problem", type=ADDRESS)
@click.option("--to", "nodes", cls=ListOption, metavar="NODE", help="Formulation to reach; default: all. Repeatable.")
@click.option(
    "--all", "every", is_flag=True, help="Show every route, not only the cheapest, with the size it leads to."
)
@click.option("--explain", is_flag=True, help="Show the dead ends, each with its obstacle.")
@kinds_option()
@format_option
def command(
    problem: str, nodes: tuple[str, ...], every: bool, explain: bool, kinds: frozenset[Kind], file_format: str | None
) -> None:
    """Show how a problem reaches each formulation, which solvers work there, and why other formulations cannot be
    reached.

    With --all every route is shown, cheapest first. Sizes marked ~ are predicted without doing the conversion, so that
    a large last step is not needed.
    """
    source = storage.load(problem, format=file_format)
    for node in nodes:
        formulations.get(node)
    _say(f"{address_text(problem)} ({source.node}: {sizes_line(source)})")
    memory = graph.Memory()
    show = _every_route if every else _cheapest_route
    for node in nodes or formulations.names():
        dead = show(source, node, kinds, memory)
        for end in dead if explain else ():
            _say(f"       dead end: {end}")


def _say(line: str) -> None:
    for part in terminal.folded(line, 7):
        print_lines([part])


def _cheapest_route(
    source: Problem, node: str, kinds: frozenset[Kind], memory: graph.Memory
) -> Iterable[graph.DeadEnd]:
    try:
        arrival = graph.arrive(source, node, kinds, apply=memory)
    except NoRoute as refusal:
        _say(f"{node:<6} out of reach: {refusal}")
        return graph.explain(source, node, kinds, apply=memory)
    _say(f"{node:<6} {arrival.route.label} ({arrival.kind}; {sizes_line(arrival.problem)})")
    _say(f"       solvers: {', '.join(solvers_of(node)) or 'none'}")
    return arrival.dead_ends


def _every_route(source: Problem, node: str, kinds: frozenset[Kind], memory: graph.Memory) -> list[graph.DeadEnd]:
    _say(f"{node:<6} solvers: {', '.join(solvers_of(node)) or 'none'}")
    dead: list[graph.DeadEnd] = []
    count = 0
    for arrival in graph.arrivals(source, node, kinds, apply=memory, finish=False, dead=dead):
        route = arrival.route
        try:
            size = size_after(arrival.problem, route.steps[-1], memory) if route.steps else sizes_line(source)
        except NotApplicable as refusal:  # known by converting only
            dead.append(graph.DeadEnd(route, len(route.steps) - 1, route.steps[-1].label, refusal.obstacle))
            continue
        count += 1
        _say(f"       {route.cost:>4g}  {route.label} ({arrival.kind}; {size})")
    if not count:
        _say("       out of reach" + ("" if dead else ": no conversion leads there"))
    return dead
