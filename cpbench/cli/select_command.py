"""`cpbench select`."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.api import next_command
from cpbench.bench.planning import plan_text
from cpbench.cli.options import Command, force_option
from cpbench.cli.types import DURATION
from cpbench.errors import CpbenchError
from cpbench.storage.base import require_new


@click.command(cls=Command)
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="RESULTS...")
@click.option("--budget", type=DURATION, default="10m", show_default=True, help="Wall time of a run of the plan.")
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Random seed, which decides between equal problems.",
)
@click.option(
    "--safety",
    type=click.FloatRange(min=1.0),
    default=1.25,
    show_default=True,
    help="Safety factor on the expected time, as the other machine may be slower.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    default="ci.toml",
    show_default=True,
    help="Plan file.",
)
@force_option
def command(files: tuple[Path, ...], budget: float, seed: int, safety: float, output: Path, force: bool) -> None:
    """Select problems for short runs: a plan for cpbench run, from results of all problems.

    Every family that fits the budget is represented by its cheapest problem. The rest of the budget goes to problems
    that distinguish the solvers; problems that all solvers solve at once, or none solves, add nothing. Solvers, routes,
    limits and expected times come from the results: on a slower machine, raise --safety.
    """
    from cpbench.advice.select import select

    if output.suffix != ".toml":
        raise CpbenchError(f"-o {output}: a plan is a .toml file")
    require_new(output, force)
    chosen = select(files, output.absolute().parent, budget=budget, safety=safety, seed=seed)
    plan_text.write(output, chosen.text)
    for line in chosen.text.splitlines():
        if line.startswith("#"):
            click.echo(line.removeprefix("# "))
    click.echo(f"plan: {output}; run it with: {next_command.line('run', '--plan', str(output))}")
    for remark in chosen.remarks:
        click.echo(remark, err=True)
    if chosen.declared:
        names = ", ".join(chosen.declared)
        click.echo(f"declared elsewhere: {names}; the command above needs --plugin FILE for them", err=True)
