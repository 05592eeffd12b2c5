"""`cpbench graph`."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import click
from click.core import ParameterSource

from cpbench.cli import terminal
from cpbench.cli.options import Command, ListOption, number
from cpbench.cli.outputs import replaced
from cpbench.cli.routes import kinds_option
from cpbench.formulations import Kind, formulations
from cpbench.plurals import counted
from cpbench.report.graph_drawing import FORMATS, draw


@click.command(cls=Command)
@click.option("--format", "form", type=click.Choice(FORMATS), default="text", show_default=True)
@click.option("-o", "--output", type=click.Path(path_type=Path), help="Draw a map to this .svg, .png or .pdf instead.")
@click.option("--check", is_flag=True, help="Send planted problems along every pair's equivalent routes and back.")
@click.option("--node", "nodes", cls=ListOption, metavar="NODE", help="With --check: only pairs of these.")
@click.option(
    "--tolerance",
    "-t",
    type=click.FloatRange(min=0, min_open=True),
    default=1e-9,
    show_default=True,
    help="With --check: the largest error on a source.",
)
@partial(kinds_option, default="all")
def command(
    form: str, output: Path | None, check: bool, nodes: tuple[str, ...], tolerance: float, kinds: frozenset[Kind]
) -> None:
    """Show the formulations, the conversions between them and the solvers on each, as text or in a drawing.

    With --check, print the matrix of residuals: for every ordered pair of formulations that equivalent conversions
    join, planted problems are converted, written to a file, solved, and lifted through the file; a cell is the worst
    error on the source. Exits with 1 when one is above --tolerance.
    """
    for node in nodes:
        formulations.get(node)
    if output is not None:
        if check or click.get_current_context().get_parameter_source("form") is not ParameterSource.DEFAULT:
            raise click.UsageError("-o draws a map: leave --check and --format out")
        from cpbench.report import canvas
        from cpbench.report.graph_map import graph_drawing

        before = [output] if output.exists() else []
        with canvas.drawing():
            canvas.write(graph_drawing(kinds), output)
        click.echo(f"graph: {replaced(output, before)}")
        return
    if not check:
        for line in draw(form, kinds).splitlines():
            for part in terminal.folded(line) if form == "text" else [line]:
                click.echo(part)
        return
    from cpbench.testing.residual_matrix import measure, table

    found = measure(nodes or formulations.names(), tolerance)
    click.echo(table(found))
    for cell in found:
        if cell.error is None:
            click.echo(f"{cell.source} -> {cell.target}: {cell.reason}")
    above = [cell for cell in found if cell.exceeds(tolerance)]
    for cell in above:
        said = cell.reason or f"error {cell.error:.1e}"
        click.echo(f"{cell.source} -> {cell.target}: above {number(tolerance)}: '{cell.case}' by {cell.route}: {said}")
    for cell in found:
        if cell.amplified:
            name, error = max(cell.amplified, key=lambda item: item[1])
            click.echo(
                f"{cell.source} -> {cell.target}: answers that pass there do not pass here in {len(cell.amplified)} of "
                f"{cell.cases} cases, the worst has error {error:.1e} on '{name}'"
            )
    rounded = [cell for cell in found if cell.error is not None and tolerance < cell.error <= cell.rounding]
    for cell in rounded:
        click.echo(
            f"{cell.source} -> {cell.target}: error {cell.error:.1e} on '{cell.case}', whose planted solution has "
            f"{cell.rounding:.1e} when its last digits change"
        )
    taken = sum(cell.error is not None for cell in found)
    within = taken - len(above) - len(rounded)
    more = f", {len(rounded)} more within rounding" if rounded else ""
    click.echo(f"{within} of {counted(taken, 'pair')} within {number(tolerance)}{more}")
    if above:
        sys.exit(1)
