"""`cpbench info`."""

from __future__ import annotations

import click

from cpbench import matrices, storage
from cpbench.cli.options import format_option, number
from cpbench.formulations import Problem


@click.command()
@click.argument("files", nargs=-1, required=True)
@format_option
def command(files: tuple[str, ...], file_format: str | None) -> None:
    """Show formulation, sizes, facts, origin and provenance of problems (FILE, FILE::NAME or folders)."""
    for address in storage.problem_files(files) or list(files):
        _print(address, storage.load(address, format=file_format))


def _print(address: str, problem: Problem) -> None:
    click.echo(f"{address}: {problem.title} {problem.equation}")
    click.echo(f"  node         {problem.node}")
    click.echo(f"  name         {problem.name}")
    click.echo(f"  fingerprint  {problem.fingerprint}")
    for symbol, size in problem.sizes().items():
        click.echo(f"  {symbol:<12} {size}")
    for name, value in problem.data().items():
        click.echo(f"  {name:<12} {_describe(value)}")
    for label in ("title", "description", "math_info", "family", "source", "licence", "citation"):
        text = getattr(problem.info, label)
        if text:
            click.echo(f"  {label:<12} {text}")
    for key, value in problem.info.properties.items():
        click.echo(f"  property     {key} = {value}")
    for step in problem.provenance:
        parameters = ", ".join(f"{k}={v}" for k, v in step.parameters.items())
        click.echo(
            f"  made by      {step.conversion}({parameters}), {step.kind}, from {step.source_node} {step.source}"
        )


def _describe(value: matrices.Matrix | matrices.Vector) -> str:
    if value.ndim == 1:
        return f"vector of {value.size}, max |.| {number(matrices.max_abs(value))}"
    rows, cols = value.shape
    storage_kind = "sparse" if matrices.is_sparse(value) else "dense"
    text = f"{storage_kind} {rows}x{cols}, {matrices.nnz(value)} nonzeros, max |.| {number(matrices.max_abs(value))}"
    if rows == cols and rows:
        skew = matrices.asymmetry(value)
        text += ", symmetric" if skew <= matrices.SYMMETRY_TOLERANCE else f", asymmetry {number(skew)}"
        if rows <= 3000:
            text += ", positive semidefinite" if matrices.is_psd(value) else ", not positive semidefinite"
    return text
