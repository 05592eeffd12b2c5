"""`cpbench doctor`."""

from __future__ import annotations

import click

from cpbench.bench import machine
from cpbench.bench.processes import isolation


@click.command()
@click.option("--warm", is_flag=True, help="Compile and load every solver now, so that the first run need not.")
def command(warm: bool) -> None:
    """Say what works on this machine and how to get what does not."""
    from cpbench.solvers.base import solvers

    for name, value in machine.describe().items():
        click.echo(f"{name:<12} {value}")
    for name, value in machine.versions().items():
        click.echo(f"{name:<12} {value}")
    click.echo("isolation")
    for what, told in isolation.detect().told():
        click.echo(f"  {what:<10} {told}")
    click.echo("solvers")
    for solver in solvers:
        state = solver.availability()
        detail = solver.version() if state.ok else state.detail.strip().splitlines()[-1]
        click.echo(f"  {solver.spec.name:<20} {solver.spec.node:<5} {state.state:<8} {detail}")
        if state.ok and warm:
            solver.warmup()
        if state.state == "broken":
            click.echo("\n".join(f"      {line}" for line in state.detail.splitlines()))
