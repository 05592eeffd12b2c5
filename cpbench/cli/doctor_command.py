"""`cpbench doctor`."""

from __future__ import annotations

import os
import sys

import click

from cpbench.bench import machine


@click.command()
@click.option("--warm", is_flag=True, help="Compile and load every solver now, so that the first run need not.")
def command(warm: bool) -> None:
    """Say what works on this machine and how to get what does not."""
    from cpbench.solvers.base import solvers

    for name, value in machine.describe().items():
        click.echo(f"{name:<12} {value}")
    for name, value in machine.versions().items():
        click.echo(f"{name:<12} {value}")
    click.echo(f"isolation    {_isolation()}")
    click.echo("solvers")
    for solver in solvers:
        state = solver.availability()
        detail = solver.version() if state.ok else state.detail.strip().splitlines()[-1]
        click.echo(f"  {solver.spec.name:<20} {solver.spec.node:<5} {state.state:<8} {detail}")
        if state.ok and warm:
            solver.warmup()
        if state.state == "broken":
            click.echo("\n".join(f"      {line}" for line in state.detail.splitlines()))


def _isolation() -> str:
    if sys.platform != "linux":
        return "no forkserver with process groups and memory limits here: runs need Linux"
    cgroup = os.path.exists("/sys/fs/cgroup/cgroup.controllers")
    return f"forkserver, process groups, RLIMIT_AS{', cgroup v2 present' if cgroup else ''}"
