"""Run a bundle again and compare."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from cpbench.cli.options import Command, jobs_option, quiet_option
from cpbench.cli.progress import Display
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import FILE, FOLDER
from cpbench.errors import CpbenchError
from cpbench.foundation.plurals import counted
from cpbench_lab.bundle import differences
from cpbench_lab.bundle.reproduction import Bundle, adopt, compare, load_plugins, open_bundle, plan, run


@click.command(cls=Command)
@click.argument("bundle", type=FILE)
@click.option("-o", "--output", type=FOLDER, help="Output folder; default: name of the bundle.")
@click.option(
    "--yes-run-plugins", "--yes", "agreed", is_flag=True, help="Run the plugins in the bundle without asking."
)
@click.option(
    "--problems",
    multiple=True,
    metavar="FOLDER|FILE",
    help="Folder or file with problems that are missing from the bundle. Repeatable.",
)
@jobs_option(None, "Number of pairs at the same time; default: as in the plan.")
@quiet_option
def command(
    bundle: Path, output: Path | None, agreed: bool, problems: tuple[str, ...], jobs: int | None, quiet: bool
) -> None:
    """Run a bundle again and compare: statuses must agree; times are only shown.

    Every file is checked against its hash. Plugins are code of the author of the bundle: they are shown, and run only
    when you confirm.

    The exit code is 0 when all statuses agree, 1 when some do not, 2 for bad input. After an interruption, the same
    command continues the run.
    """
    from cpbench import storage
    from cpbench.generators.collection import builtin_folder

    folder = output or Path(bundle.stem)
    if output is None and folder == bundle:
        folder = Path(f"{bundle.name}-again")
    opened = open_bundle(bundle, folder)
    click.echo(f"bundle: {bundle}, all {len(opened.about['files'])} files are as they were written; in {folder}")
    _ask(opened, agreed)
    load_plugins(opened)
    if problems:
        click.echo(f"{adopt(opened, storage.problem_files(problems))} problems taken from {', '.join(problems)}")
    again, missing = plan(opened, jobs)
    if missing:
        click.echo(f"not here: {', '.join(missing)} (cpbench doctor says how to get what is known)", err=True)
    display = Display(quiet)
    try:
        assembly = run(opened, again, builtin_folder, display, display.reading)
    except KeyboardInterrupt:
        click.echo(f"cpbench: interrupted; {opened.again} has what was done, the same command goes on", err=True)
        sys.exit(130)
    outcome = compare(opened, assembly)
    print_lines(differences.time_lines(opened, bundle.name))
    print_lines(differences.status_lines(opened, outcome))
    if not outcome.compared:
        raise CpbenchError(f"{bundle}: nothing could be compared: its solvers or its problems are not here")
    if outcome.different:
        sys.exit(1)


def _ask(bundle: Bundle, agreed: bool) -> None:
    """Show the code in a bundle and have it agreed to; raises CpbenchError without a terminal."""
    code = bundle.code()
    if not bundle.loaded:
        return
    click.echo("code in this bundle that is not cpbench's:")
    for name, sha256, size in code:
        print_lines([f"  {bundle.folder / name}  {size} bytes  sha256 {sha256}"])
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
