"""`cpbench verify`."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from cpbench import storage, verification
from cpbench.cli.options import Address, Command, format_option, number, tolerance_option
from cpbench.errors import FormatError


@click.command(cls=Command)
@click.argument("problem", required=False, type=Address())
@click.option("--answer", type=click.Path(path_type=Path), help="Answer file (.h5, .npy, .npz, .csv).")
@click.option("--rejudge", type=click.Path(path_type=Path), help="Judge every kept answer of a results file again.")
@click.option("--measure", metavar="NAME", help="Let this one measure decide (natural, fclib2018, siconos_mlcp, ...).")
@click.option("--strict", is_flag=True, help="Exit with 1 when the answer does not pass.")
@tolerance_option
@format_option
def command(
    problem: str | None,
    answer: Path | None,
    rejudge: Path | None,
    measure: str | None,
    strict: bool,
    tolerance: float,
    file_format: str | None,
) -> None:
    """Measure an answer on a problem; without --answer, the candidate in the file's own /solution.

    With --rejudge, measure the kept answers of a results file again, without solving, and print what changes.
    Ends with 1 when a row is not as a run wrote it, or when a status changes by the row's own measure and tolerance.
    """
    if rejudge is not None:
        from cpbench.bench.results.rejudge import rejudge_file

        tolerance_given = click.get_current_context().get_parameter_source("tolerance")
        asked = tolerance if tolerance_given and tolerance_given.name != "DEFAULT" else None
        for line in rejudge_file(rejudge, measure, asked):
            click.echo(line)
        return
    if problem is None:
        raise click.UsageError("give a PROBLEM, or --rejudge RESULTS")
    asked_problem = storage.load(problem, format=file_format)
    if answer is not None:
        point = storage.load_answer(answer, asked_problem)
    else:
        found = storage.solution(problem)
        if found is None:
            raise FormatError(problem, "solution", "is missing; give an answer with --answer FILE")
        point = found[0]
    verdict = verification.judge(asked_problem, point, tolerance, measure)
    word = "passes" if verdict.solved else "does not pass"
    click.echo(f"{problem}: error {number(verdict.error)}, {word} at {number(tolerance)}")
    for name, value in verdict.judged.items():
        click.echo(f"  judged  {name:<28} {number(value)}")
    for name, value in verdict.parts.items():
        click.echo(f"          {name:<28} {number(value)}")
    if verdict.flags:
        click.echo(f"  flags   {', '.join(verdict.flags)}")
    if strict and not verdict.solved:
        sys.exit(1)
