"""`cpbench bundle`."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.bundle.making import BundleOptions, make
from cpbench.bundle.report import write_report
from cpbench.cli.options import Command, ListOption, force_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import FILE, PATH
from cpbench.errors import CpbenchError
from cpbench.plurals import counted


@click.command(cls=Command)
@click.argument("results", type=PATH)
@click.option("-o", "--output", required=True, type=FILE, help="Zip file.")
@click.option("--anonymous", is_flag=True, help="Strip host, user, paths, variables and remotes.")
@click.option("--rename", "renames", multiple=True, metavar="OLD=NEW", help="New name of a word. Repeatable.")
@click.option("--withhold", cls=ListOption, metavar="GLOB", help="Problems to leave out, by name, family or file.")
@click.option("--report/--no-report", default=None, help="Include a report; default: where reports/NAME exists.")
@force_option
def command(
    results: Path,
    output: Path,
    anonymous: bool,
    renames: tuple[str, ...],
    withhold: tuple[str, ...],
    report: bool | None,
    force: bool,
) -> None:
    """Put a run, with everything needed to repeat it, into one zip file: plan, versions, machine, plugins, problems,
    results.

    Built-in problems are included by name, and problems whose licence forbids copies by fingerprint and source.
    cpbench reproduce runs a bundle again and compares.
    """
    from cpbench.generators.collection import builtin_folder

    wanted = (Path("reports") / results.stem / "report.md").is_file() if report is None else report
    options = BundleOptions(
        anonymous, _renamed(renames), withhold, builtin_folder(), write_report if wanted else None, force
    )
    summary = make(results, output, options)
    print_lines(summary.remarks, err=True)
    problems = f"{counted(summary.problems, 'problem')} ({summary.withheld} withheld)"
    click.echo(f"{counted(summary.pairs, 'pair')}, {problems}, {counted(summary.plugins, 'plugin')}")
    click.echo(f"bundle: {output} ({summary.bytes} bytes)")


def _renamed(texts: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    """Return old and new names; raises CpbenchError on one that becomes two."""
    pairs = tuple(dict.fromkeys(map(_pair, texts)))
    names = dict(pairs)
    for old, new in pairs:
        if names[old] != new:
            raise CpbenchError(f"--rename {old}: becomes {new} and {names[old]}; give it once")
    return pairs


def _pair(text: str) -> tuple[str, str]:
    old, equals, new = text.partition("=")
    if not old or not equals:
        raise CpbenchError(f"--rename {text}: write OLD=NEW, as in mine=A")
    return old, new
