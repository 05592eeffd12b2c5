"""`cpbench reproduce`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import click

from cpbench.bench.bundle.agreement import Agreement, ordered
from cpbench.bench.bundle.reproduction import Bundle, adopt, compare, load_plugins, open_bundle, plan, run
from cpbench.bench.results.store import Store
from cpbench.cli.options import Command
from cpbench.cli.progress import Display
from cpbench.errors import CpbenchError
from cpbench.plurals import counted

LISTED = 20
"""Differences that are shown; the two results files have all."""


@click.command(cls=Command)
@click.argument("bundle", type=click.Path(path_type=Path, dir_okay=False))
@click.option("-o", "--output", type=click.Path(path_type=Path, file_okay=False), help="Folder (default: its name).")
@click.option("--yes-run-plugins", "--yes", "agreed", is_flag=True, help="Run the plugins in it without being asked.")
@click.option(
    "--problems", multiple=True, metavar="FOLDER|FILE", help="Where problems are that the bundle does not have."
)
@click.option("-j", "--jobs", type=click.IntRange(min=1), help="Lanes side by side (default: as in the plan).")
@click.option("-q", "--quiet", is_flag=True, help="No progress.")
def command(
    bundle: Path, output: Path | None, agreed: bool, problems: tuple[str, ...], jobs: int | None, quiet: bool
) -> None:
    """Run a bundle again and compare: statuses must agree, times are told.

    Every file is checked against its hash. Plugins are code of whoever made the bundle: they are shown, and run when
    you say so.

    Ends with 0 when all statuses agree, 1 when some do not, 2 for bad input; the same command goes on with a run that
    was interrupted.
    """
    from cpbench import storage
    from cpbench.generators.collection import builtin_folder

    folder = output or Path(bundle.stem)
    if output is None and folder == bundle:
        folder = Path(f"{bundle.name}-again")
    found = open_bundle(bundle, folder)
    click.echo(f"bundle: {bundle}, all {len(found.about['files'])} files are as they were written; in {folder}")
    _ask(found, agreed)
    load_plugins(found)
    if problems:
        click.echo(f"{adopt(found, storage.problem_files(problems))} problems taken from {', '.join(problems)}")
    asked, missing = plan(found, jobs)
    if missing:
        click.echo(f"not here: {', '.join(missing)} (cpbench doctor says how to get what is known)", err=True)
    display = Display(quiet)
    try:
        assembly = run(found, asked, builtin_folder, display, display.reading)
    except KeyboardInterrupt:
        click.echo(f"cpbench: interrupted; {found.again} has what was done, the same command goes on", err=True)
        sys.exit(130)
    outcome = compare(found, assembly)
    _tell_times(found, bundle.name)
    _tell(found, outcome)
    if not outcome.compared:
        raise CpbenchError(f"{bundle}: nothing could be compared: its solvers or its problems are not here")
    if outcome.different:
        sys.exit(1)


def _ask(bundle: Bundle, agreed: bool) -> None:
    """Show the code in a bundle and have it agreed to; raises CpbenchError where nobody can be asked."""
    code = bundle.code()
    if not bundle.loaded:
        return
    click.echo("code in this bundle that is not cpbench's:")
    for name, sha256, size in code:
        click.echo(f"  {bundle.folder / name}  {size} bytes  sha256 {sha256}")
    for started in bundle.programs():
        click.echo(f"  starts {started!r}")
    if agreed:
        return
    if not sys.stdin.isatty():
        raise CpbenchError(
            f"{bundle.path}: has {counted(len(bundle.loaded), 'plugin')}, and nobody can be asked whether to run them: "
            f"read them in {bundle.folder}, then add --yes-run-plugins"
        )
    if not click.confirm("Run it, with your rights on this machine?", default=False):
        raise CpbenchError(f"{bundle.path}: its plugins were not run, and nothing else")


def _tell(bundle: Bundle, outcome: Agreement) -> None:
    for difference in ordered(outcome.different)[:LISTED]:
        now = difference.now or "not planned here"
        why = " (a limit: another machine may end otherwise)" if difference.limited else ""
        said = f": {difference.message.splitlines()[0][:120]}" if difference.message.strip() else ""
        click.echo(f"differs: {difference.problem}, {difference.label}: {difference.before} → {now}{why}{said}")
    if len(outcome.different) > LISTED:
        click.echo(f"and {len(outcome.different) - LISTED} more: cpbench compare {bundle.results} {bundle.again}")
    _tell_left("solver is missing here", outcome.absent)
    _tell_left("problem is not here", outcome.lost)
    if outcome.elsewhere:
        click.echo(f"not compared: {counted(outcome.elsewhere, 'pair')} that did not run there, or elsewhere")
    click.echo(f"{outcome.same} of {outcome.compared} statuses agree")


def _tell_left(what: str, counts: Mapping[str, int]) -> None:
    if counts:
        named = ", ".join(f"{name} ({count})" for name, count in list(counts.items())[:LISTED])
        more = f" and {len(counts) - LISTED} more" if len(counts) > LISTED else ""
        click.echo(f"not compared: {counted(sum(counts.values()), 'pair')} whose {what}: {named}{more}")


def _tell_times(bundle: Bundle, name: str) -> None:
    """Times beside each other, as `cpbench compare` tells them; they decide nothing here."""
    from cpbench.analysis.comparison import ComparisonSide, Thresholds
    from cpbench.analysis.comparison import compare as compare_runs
    from cpbench.report.comparison import words
    from cpbench.report.text import cut, one_line

    with Store(bundle.results) as store:
        there = ComparisonSide(name, store.table(), store.meta(), store.machines())
    with Store(bundle.again) as store:
        here = ComparisonSide("here", store.table(), store.meta(), store.machines())
    try:
        # the ratio of two machines is what is asked for here: it tells how fast this one is, and decides nothing
        found = compare_runs(there, here, Thresholds(same_machine=True))
    except CpbenchError:
        return  # no pair in common, which is told with the statuses
    timed = [suite for suite in found.suites if suite.timed]
    if timed:
        click.echo("time here over there, geometric mean of each label (decides nothing, machines differ):")
    for suite in timed:
        click.echo(f"  {one_line(suite.label)}: {words.times_of(suite)} ({counted(suite.timed, 'pair')})")
    for note in found.notes:
        click.echo(f"note: {cut(note, 300)}")
