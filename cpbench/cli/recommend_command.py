"""`cpbench recommend`."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import click

from cpbench.api import next_command
from cpbench.cli.options import Command, force_option, format_option
from cpbench.cli.types import ADDRESS
from cpbench.storage.base import require_new


@click.command(cls=Command)
@click.argument("problem", type=ADDRESS, required=False)
@click.option(
    "--results",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Results of a run, or a table that --make wrote, instead of the shipped table. Repeatable.",
)
@click.option(
    "-t",
    "--tolerance",
    type=click.FloatRange(min=0, min_open=True),
    help="Tolerance of the rows to go by (with --results of runs).",
)
@click.option("--warm", is_flag=True, help="Name solvers for a start from a point near the answer.")
@click.option("--top", type=click.IntRange(min=1), default=3, show_default=True, help="Number of solvers to name.")
@click.option("--any", "missing", is_flag=True, help="Name solvers that are not installed here, too.")
@click.option(
    "--routes",
    type=click.Choice(["exact", "all"]),
    default="exact",
    show_default=True,
    help="Routes to consider; all: also those that promise less than an answer.",
)
@click.option("--evaluate", is_flag=True, help="Measure how often the advice is good, each origin left out in turn.")
@click.option(
    "--make",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="TABLE",
    help="Table to write from --results.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@format_option
@force_option
def command(
    problem: str | None,
    results: tuple[Path, ...],
    tolerance: float | None,
    warm: bool,
    top: int,
    missing: bool,
    routes: str,
    evaluate: bool,
    make: Path | None,
    as_json: bool,
    file_format: str | None,
    force: bool,
) -> None:
    """Say which solver suits a problem, by what route, how sure that is, and the command that runs it.

    It is based on features of the problem (cpbench info shows more of them), and on results of solvers on problems like
    it: the built-in ones, or those of your own runs. How sure it is depends on how many problems like it were measured,
    and on how often such advice is good for problems of an origin that was left out.
    """
    if sum((problem is not None, evaluate, make is not None)) != 1:
        raise click.UsageError("give a PROBLEM, or --evaluate, or --make TABLE")
    from cpbench import storage
    from cpbench.advice import evaluation, evidence, recommend_text
    from cpbench.advice.recommend import recommended

    if make is not None:
        if not results:
            raise click.UsageError("--make: give the results to make it of: --results FILE")
        require_new(make, force)
        for line in evaluation.write_table(make, results):
            click.echo(line)
        return
    known, source, remarks = evidence.gather(results, warm, routes == "all", tolerance)
    if problem is None:
        rates = evaluation.rates(known, source)
        data = {"source": source, "unsolved": known.unsolved, "rates": rates, "remarks": remarks}
        lines = [json.dumps(data, indent=1)] if as_json else evaluation.lines(rates, known, source, remarks)
        click.echo("\n".join(lines))
        return
    asked = storage.load(problem, format=file_format)
    advised = recommended(asked, known, source, remarks, warm=warm, top=top, missing=missing)
    checked = recommend_text.checked_rates(known, asked.node)
    if warm and getattr(asked, "sequence", None) is None and not storage.guesses(problem):
        warm = False
        remark = "the file has no starting point (guesses), so the command starts cold"
        advised = replace(advised, remarks=(*advised.remarks, remark))
    words = [recommend_text.command_words(problem, asked, one, tolerance, warm) for one in advised.taken]
    commands = [next_command.line(*command) for command in words]
    if as_json:
        click.echo(json.dumps(recommend_text.record(asked, advised, checked, commands), indent=1))
        return
    click.echo(f"{asked.name or problem} ({asked.node}), by {source}")
    for line in recommend_text.lines(asked, advised, checked, commands):
        click.echo(line)
