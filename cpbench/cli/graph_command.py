"""Show the conversions between formulations with the solvers on each, or how a problem reaches a formulation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import click

from cpbench import graph, storage
from cpbench.cli.info_command import size_after, sizes_line
from cpbench.cli.options import ListOption, format_option, kinds_option
from cpbench.cli.terminal import fitted, folded, print_lines
from cpbench.cli.types import ADDRESS
from cpbench.conversions import Conversion
from cpbench.errors import NoRoute, NotApplicable
from cpbench.formulations import Kind, Problem, formulations
from cpbench.generators.collection import address_text
from cpbench.graph import best_kind, edges, promise
from cpbench.solvers.base import solvers


@click.command()
@click.argument("problem", required=False, type=ADDRESS)
@click.option(
    "--to",
    "nodes",
    cls=ListOption,
    metavar="NODE",
    help="Formulation to reach; default: all. Repeatable.",
)
@click.option("--all", "every", is_flag=True, help="Show every route of PROBLEM with the size it leads to.")
@click.option("--explain", is_flag=True, help="Show the dead ends of PROBLEM, each with its obstacle.")
@kinds_option(", without PROBLEM all")
@format_option
def command(
    problem: str | None,
    nodes: tuple[str, ...],
    every: bool,
    explain: bool,
    kinds: frozenset[Kind] | None,
    file_format: str | None,
) -> None:
    """Show the formulations, the conversions between them and the solvers on each.

    Of a PROBLEM, show how it reaches each formulation, which solvers work there, and why others cannot be reached; with
    --all every route, cheapest first. Sizes marked ~ are predicted without doing the conversion, so that a large last
    step is not needed: `cpbench graph builtin/lcp/american-put.h5::american-put-100 --to qp --explain`.
    """
    for node in nodes:
        formulations.get(node)
    if problem is not None:
        _print_routes(problem, nodes or formulations.names(), kinds or graph.EXACT, every, explain, file_format)
    elif every or explain or file_format or nodes:
        raise click.UsageError("--to, --all, --explain and --format are of a PROBLEM: give one")
    else:
        print_lines(fitted(draw(kinds or graph.ALL).splitlines()))


def _print_routes(
    address: str, nodes: Sequence[str], kinds: frozenset[Kind], every: bool, explain: bool, file_format: str | None
) -> None:
    source = storage.load(address, format=file_format)
    _say(f"{address_text(address)} ({source.node}: {sizes_line(source)})")
    memory = graph.Memory()
    show = _every_route if every else _cheapest_route
    for node in nodes:
        dead = show(source, node, kinds, memory)
        for end in dead if explain else ():
            _say(f"       dead end: {end}")


def _say(line: str) -> None:
    print_lines(folded(line, 7))


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


def solvers_of(node: str) -> list[str]:
    """Return the names of the registered solvers of a node; one that drops a term of the law is marked."""
    specs = [solver.spec for solver in solvers if solver.spec.node == node]
    return [spec.name if spec.kind.exact else f"{spec.name} ({spec.kind})" for spec in specs]


def draw(kinds: frozenset[Kind]) -> str:
    """Return the nodes, and the edges that may be of one of `kinds`, as text."""
    shown = [edge for edge in edges() if best_kind(edge) in kinds]
    wide = max((len(edge.name) for edge in shown), default=0)
    across = max(len(name) for name in formulations.names())
    loops = sum(edge.source == edge.target for edge in shown)
    alone = f", {loops} of them from a node to itself (taken only with --via)" if loops else ""
    lines = [f"{len(formulations)} formulations, {len(shown)} conversions{alone}, {len(solvers)} solvers"]
    for cls in formulations:
        lines.append(f"{cls.node}: {cls.title} {cls.equation}".rstrip())
        lines.append(f"  solvers: {', '.join(solvers_of(cls.node)) or 'none'}")
        lines += [
            f"  -> {edge.target:<{across}}  {edge.name:<{wide}}  {promise(edge)}  {edge.equation}".rstrip()
            for edge in _by_target(shown, cls.node)
        ]
    return "\n".join(lines)


def _by_target(shown: Iterable[Conversion], source: str) -> list[Conversion]:
    return sorted((edge for edge in shown if edge.source == source), key=lambda e: (e.target, e.name))
