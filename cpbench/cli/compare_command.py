"""Compare two results files, or two builds: report regressions, and differences too small to call."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from cpbench.api.results import compare_files
from cpbench.cli.options import ListOption, stationary_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import FILE, LABELS, PATH
from cpbench.errors import UnknownName
from cpbench.foundation.text import printable
from cpbench.verification import CONTRADICTION, PROVEN, VERIFIED, Status

WHOLE = ("regression", "inconclusive")
FAILURES = (*WHOLE, CONTRADICTION, *(str(s) for s in Status if s not in (*VERIFIED, *PROVEN, Status.NOT_RUN)))
"""Values of --fail-on: verdicts on the whole, new contradictions, and statuses that a pair has now and had not
before."""
NOT_NEGATIVE = click.FloatRange(min=0)


@click.command()
@click.argument("base", type=PATH)
@click.argument("new", required=False, type=PATH)
@click.option("--a", "first", metavar="LABEL", help="Solver or label that is the base, with one file.")
@click.option("--b", "second", metavar="LABEL", help="Solver or label that is compared with it, with one file.")
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    type=FILE,
    help="Output file .md (summary of a CI job) or .json. Repeatable.",
)
@click.option(
    "--fail-on",
    cls=ListOption,
    metavar="NAMES",
    help="Outcomes with which the command ends with 1: regression, inconclusive, or new contradiction,wrong,...",
)
@click.option("--margin", type=NOT_NEGATIVE, default=0.05, show_default=True, help="Change of times to find.")
@click.option(
    "--noise",
    type=LABELS,
    metavar="LABEL,LABEL",
    help="Two labels of equal code: the difference between them is noise.",
)
@stationary_option
@click.option(
    "--same-machine", is_flag=True, help="Treat the two files as measured on one machine, even if its name differs."
)
def command(
    base: Path,
    new: Path | None,
    first: str | None,
    second: str | None,
    outputs: tuple[Path, ...],
    fail_on: tuple[str, ...],
    margin: float,
    noise: tuple[str, str] | None,
    count_stationary: bool,
    same_machine: bool,
) -> None:
    """Compare two results files, or two builds that were interleaved in one run (BASE --a mine@base --b mine@head).

    Every pair of a problem and a solver is improved, the same, inconclusive or regressed. The status decides first,
    then the verified error, then the counters. The time decides last, only where both were timed on one machine and
    differ by more than its noise.

    The exit code is 0 for any difference, 1 for --fail-on and when rows were changed after the run, 2 for bad input.
    """
    from cpbench.analysis.comparison import Thresholds
    from cpbench.report.comparison import words, write

    _require_sense(base, new, first, second, fail_on)
    settings = Thresholds(margin, same_machine=same_machine, count_stationary=count_stationary)
    comparison = compare_files(base, new, (first or "", second or ""), settings, noise)
    print_lines(words.lines(comparison))
    for path in outputs:
        write(comparison, path)
        print_lines([f"written: {path}"], err=True)
    failed = comparison.failures(fail_on)
    if CONTRADICTION in fail_on:
        print_lines((f"new contradiction: {printable(str(one))}" for one in comparison.contradictions), err=True)
    if failed:
        print_lines(
            [f"cpbench: {', '.join(f'{count} {name}' for name, count in failed.items())} (--fail-on)"], err=True
        )
        sys.exit(1)


def _require_sense(
    base: Path, new: Path | None, first: str | None, second: str | None, fail_on: tuple[str, ...]
) -> None:
    """Raise UsageError, CpbenchError on options that do not go together, before any file is read."""
    if new is None and (first is None or second is None):
        missing = "--b" if first is not None else "--a" if second is not None else "NEW, or --a and --b"
        raise click.UsageError(f"{missing} is missing: cpbench compare BASE NEW, or cpbench compare RUN --a X --b Y")
    if new is not None and (first is not None or second is not None):
        raise click.UsageError(f"--a and --b compare two labels of one file: leave {new} out")
    for name in fail_on:
        if name not in FAILURES:
            raise UnknownName("outcome for --fail-on", name, FAILURES)
