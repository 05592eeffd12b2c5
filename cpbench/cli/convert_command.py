"""`cpbench convert`."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench import graph, storage
from cpbench.bench import plan
from cpbench.bench.referee import parse_request
from cpbench.cli.options import Counts, force_option, format_option
from cpbench.cli.routes import kinds_option, sizes_line
from cpbench.formulations import Kind, formulations


@click.command()
@click.argument("source", metavar="IN")
@click.argument("target_file", metavar="OUT", type=click.Path(path_type=Path))
@click.option("--to", "node", required=True, metavar="NODE", help="Formulation to reach (cpbench list formulations).")
@click.option("--via", multiple=True, metavar="CONVERSION", help="Go through this conversion (full name or its end).")
@click.option("--facets", type=Counts(), default="8", show_default=True, help="Facets of a facet conversion.")
@click.option("--angle", type=float, default=0.0, show_default=True, help="Angle of the first facet [rad].")
@kinds_option
@format_option
@force_option
def command(
    source: str,
    target_file: Path,
    node: str,
    via: tuple[str, ...],
    facets: tuple[int, ...],
    angle: float,
    kinds: frozenset[Kind],
    file_format: str | None,
    force: bool,
) -> None:
    """Convert a problem to another formulation; OUT knows how to lift an answer back (cpbench lift)."""
    formulations.get(node)
    problem = storage.load(source, format=file_format)
    pinned = parse_request(plan.pinned(via, {"facets": facets[0], "angle": angle}).header())[1] if via else ()
    arrival = graph.arrive(problem, node, kinds, pinned)
    storage.save(arrival.problem, target_file, force=force)
    click.echo(f"{source} ({problem.node}: {sizes_line(problem)})")
    click.echo(f"  by {arrival.route.label} ({arrival.kind})")
    click.echo(f"{target_file} ({node}: {sizes_line(arrival.problem)})")
