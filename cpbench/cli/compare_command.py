"""`cpbench compare`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cpbench import brackets
from cpbench.api.sides import base as base_side
from cpbench.api.sides import side
from cpbench.cli.options import Command, ListOption
from cpbench.errors import UnknownName
from cpbench.verification import PROVEN, VERIFIED, Status

if TYPE_CHECKING:
    from cpbench.analysis.comparison import Comparison, ComparisonSide

FAILURES = (
    "regression",
    "inconclusive",
    *(str(s) for s in Status if s not in (*VERIFIED, *PROVEN, Status.NOT_RUN)),
)
"""What --fail-on knows: verdicts on the whole, and statuses that a pair has now and had not before."""
SUFFIXES = (".md", ".json", ".xml")


@click.command(cls=Command)
@click.argument("base", type=click.Path(path_type=Path))
@click.argument("new", required=False, type=click.Path(path_type=Path))
@click.option("--a", "first", metavar="LABEL", help="With one file: the solver or label that is the base.")
@click.option("--b", "second", metavar="LABEL", help="With one file: the solver or label that is compared with it.")
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write .md (summary of a CI job), .xml (JUnit) or .json. Repeatable.",
)
@click.option(
    "--fail-on",
    cls=ListOption,
    metavar="WHAT",
    help="End with 1 on regression, inconclusive, or new wrong,...",
)
@click.option(
    "--margin", type=click.FloatRange(min=0), default=0.05, show_default=True, help="Change of times to find."
)
@click.option(
    "--counter-margin", type=click.FloatRange(min=0), default=0.05, show_default=True, help="The same of counters."
)
@click.option(
    "--alpha",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=0.05,
    show_default=True,
    help="Level of the tests, for all labels together.",
)
@click.option(
    "--noise", metavar="LABEL,LABEL", help="Two labels of equal code in the (new) file: what differs is noise."
)
@click.option("--confirm", is_flag=True, help="Run what alarmed again, by the plan in the file; one alarm is none.")
@click.option("--count-stationary", is_flag=True, help="Count answers that are stationary only among the solved.")
@click.option("--same-machine", is_flag=True, help="The two files are of one machine, whatever its name is in them.")
@click.option("--seed", type=int, default=0, show_default=True, help="Of the bootstrap.")
def command(
    base: Path,
    new: Path | None,
    first: str | None,
    second: str | None,
    outputs: tuple[Path, ...],
    fail_on: tuple[str, ...],
    margin: float,
    counter_margin: float,
    alpha: float,
    noise: str | None,
    confirm: bool,
    count_stationary: bool,
    same_machine: bool,
    seed: int,
) -> None:
    """Compare two results files, or two builds that were interleaved in one run (BASE --a mine@base --b mine@head).
    BASE may be a baseline (.csv).

    Every pair of a problem and a solver is improved, the same, inconclusive or regressed: by status first, then by
    verified error, counters, and by time where both were timed on one machine, beyond its noise.

    With --confirm, pairs that alarmed are run again: of two builds in one file both, of two files the new side, with
    the solvers that are installed now (--plugin for those of a file). What does not alarm twice is inconclusive.

    Ends with 0 whatever is found, 1 for --fail-on and when rows are not as a run wrote them, 2 for bad input.
    """
    from cpbench.analysis.comparison import Thresholds, compare, compare_labels, equal_pairs
    from cpbench.report.comparison import terminal, write

    _checked(base, new, first, second, outputs, fail_on)
    settings = Thresholds(margin, counter_margin, alpha, same_machine, seed, count_stationary)
    equal = _two(noise) if noise is not None else None

    def compared(after: ComparisonSide) -> Comparison:
        if new is None:
            return compare_labels(after, first or "", second or "", settings, equal)
        return compare(base_side(base, after), after, settings, equal_pairs(after, equal) if equal else None)

    results = new or base
    found = compared(side(results))
    if confirm:
        from cpbench.cli.confirm import confirm as run_again

        statuses = [what for what in fail_on or () if what not in ("regression", "inconclusive")]
        found = run_again(found, results, equal or (), statuses, compared)
    for line in terminal.lines(found):
        click.echo(line)
    for path in outputs:
        write(found, path)
        click.echo(f"written: {path}", err=True)
    failed = _failed(found, fail_on)
    if failed:
        click.echo(f"cpbench: {', '.join(f'{count} {what}' for what, count in failed.items())} (--fail-on)", err=True)
        sys.exit(1)


def _checked(
    base: Path,
    new: Path | None,
    first: str | None,
    second: str | None,
    outputs: tuple[Path, ...],
    fail_on: tuple[str, ...],
) -> None:
    """Raises UsageError, CpbenchError on options that do not go together, before any file is read."""
    if new is None and (first is None or second is None):
        missing = "--b" if first is not None else "--a" if second is not None else "NEW, or --a and --b"
        raise click.UsageError(f"{missing} is missing: cpbench compare BASE NEW, or cpbench compare RUN --a X --b Y")
    if new is not None and (first is not None or second is not None):
        raise click.UsageError(f"--a and --b compare two labels of one file: leave {new} out")
    for path in outputs:
        if path.suffix not in SUFFIXES:
            raise click.UsageError(f"-o {path}: unknown suffix '{path.suffix}'; use {', '.join(SUFFIXES)}")
        if not path.parent.is_dir():
            raise click.UsageError(f"-o {path}: there is no folder {path.parent}; make it first")
    for what in fail_on:
        if what not in FAILURES:
            raise UnknownName("outcome for --fail-on", what, FAILURES)


def _two(text: str) -> tuple[str, str]:
    """Two labels; a comma within brackets is part of one."""
    labels = brackets.split(text, ",")
    if len(labels) != 2 or not all(labels):
        raise click.UsageError(f"--noise {text}: takes two labels of equal code, as mine@base,mine@again")
    return labels[0], labels[1]


def _failed(found: Comparison, fail_on: tuple[str, ...]) -> Mapping[str, int]:
    """What --fail-on asks for and is there, with its count."""
    counts: dict[str, int] = {}
    for what in fail_on:
        if what in ("regression", "inconclusive"):
            verdict = "regressed" if what == "regression" else what
            counts[what] = int(found.verdict == verdict)
        else:
            counts[f"new {what}"] = len(found.became(what))
    return {what: count for what, count in counts.items() if count}
