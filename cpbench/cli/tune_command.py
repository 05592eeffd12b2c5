"""`cpbench tune`."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Any

import click

from cpbench.api import next_command
from cpbench.cli.options import (
    Sections,
    force_option,
    jobs_option,
    limit_options,
    problem_options,
    quiet_option,
    seed_option,
    tolerance_option,
)
from cpbench.cli.progress import Display
from cpbench.cli.types import COUNT, DURATION, FILE
from cpbench.storage.base import require_new

SECTIONS = {
    "Search": ["budget", "configurations", "seed", "jobs"],
    "Problems": ["split", "keyword", "family", "where", "max_problems"],
    "Accuracy and limits": ["tolerance", "timeout", "memory", "threads", "repeats"],
    "Results": ["output", "trials", "force", "quiet", "help"],
}
EXAMPLES = (
    "cpbench tune nsgs scenes/ --budget 1h",
    "cpbench tune 'psor[omega=0.8:1.9:0.05]' builtin/lcp --budget 5m -o psor.toml",
    "cpbench run --plan psor.toml",
)


@click.command(cls=Sections, sections=SECTIONS, examples=EXAMPLES)
@click.argument("solver", metavar="SOLVER[opt=value]")
@click.argument("problems", nargs=-1, metavar="[PROBLEM|FOLDER|GLOB]...")
@click.option("--budget", type=DURATION, default="10m", show_default=True, help="Wall time of the search.")
@click.option(
    "--configurations", type=click.IntRange(min=2), metavar="N", help="Largest number of configurations to try."
)
@seed_option("Random seed of configurations and orders.")
@jobs_option(1, "Number of solves at the same time.")
@problem_options("dev")
@tolerance_option
@limit_options
@click.option("--repeats", type=COUNT, default=1, show_default=True, help="Number of solves of a short pair.")
@click.option("-o", "--output", type=FILE, help="Plan file to write; default: SOLVER.tuned.toml.")
@click.option("--trials", type=FILE, help="Results file to keep every solve in.")
@force_option
@quiet_option
def command(
    solver: str,
    problems: tuple[str, ...],
    budget: float,
    configurations: int | None,
    seed: int,
    jobs: int,
    threads: int,
    output: Path | None,
    trials: Path | None,
    force: bool,
    quiet: bool,
    **filters: Any,
) -> None:
    """Search for the options with which a solver solves the most problems, and is fastest.

    Random search with successive halving, in the ranges that the solver declares (cpbench list solvers SOLVER); an
    option with one value in the brackets is fixed; one with several takes only these. Every configuration is run and
    judged as by cpbench run. The result is written as a plan, which compares it with the default options on the other
    half of the problems, and records the cost of the search, which reports then show. Ctrl-C ends the search, and the
    best options so far are written.
    """
    from cpbench.advice.tune import problem_set, tune

    plan = output or Path(f"{solver.partition('[')[0]}.tuned.toml")
    require_new(plan, force)
    tuned = tune(
        solver,
        problem_set(solver, problems, seed, **filters),
        plan,
        budget=budget,
        configurations=configurations,
        seed=seed,
        jobs=jobs,
        threads=threads,
        trials=trials,
        command=shlex.join(["cpbench", *sys.argv[1:]]),
        reading=Display(quiet).reading,
        report=lambda line: None if quiet else click.echo(line, err=True),
    )
    click.echo("\n".join(tuned.lines))
    click.echo(f"plan: {plan}; compare on the other problems with: {next_command.line('run', '--plan', str(plan))}")
    if tuned.interrupted:
        click.echo("cpbench: interrupted; the plan has the best so far", err=True)
        sys.exit(130)
