"""Show the conversions between formulations, as text or as a drawing, or check them all."""

from __future__ import annotations

import sys
from pathlib import Path

import click
from click.core import ParameterSource

from cpbench.cli.options import Command, ListOption, kinds_option
from cpbench.cli.terminal import fitted, print_lines, replaced
from cpbench.cli.types import PATH, POSITIVE
from cpbench.formulations import Kind, formulations
from cpbench.report.graph_drawing import FORMATS, draw


@click.command(cls=Command)
@click.option("--format", "form", type=click.Choice(FORMATS), default="text", show_default=True, help="Output form.")
@click.option("-o", "--output", type=PATH, help="File of a drawing (.svg, .png or .pdf) instead of text.")
@click.option(
    "--check",
    is_flag=True,
    help="Send planted problems along the equivalent routes of every pair of formulations, and back.",
)
@click.option("--node", "nodes", cls=ListOption, metavar="NODE", help="Formulations to --check. Repeatable.")
@click.option(
    "--tolerance", "-t", type=POSITIVE, default=1e-9, show_default=True, help="Largest error on a source, for --check."
)
@kinds_option("all")
def command(
    form: str, output: Path | None, check: bool, nodes: tuple[str, ...], tolerance: float, kinds: frozenset[Kind]
) -> None:
    """Show the formulations, the conversions between them and the solvers on each, as text or in a drawing.

    With --check, print the matrix of residuals. For every ordered pair of formulations that equivalent conversions
    connect, problems with a known solution are converted, written to a file and solved, and the answer is lifted with
    this file. A cell is the largest error on the original problem. The exit code is 1 when one is above --tolerance.
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
        print_lines([f"graph: {replaced(output, before)}"])
        return
    if not check:
        drawn = draw(form, kinds).splitlines()
        print_lines(fitted(drawn) if form == "text" else drawn)
        return
    from cpbench.testing.residual_matrix import lines, measure

    cells = measure(nodes or formulations.names(), tolerance)
    print_lines(lines(cells, tolerance))
    if any(cell.exceeds(tolerance) for cell in cells):
        sys.exit(1)
