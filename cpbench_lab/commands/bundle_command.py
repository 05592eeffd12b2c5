"""Put a run, with everything needed to repeat it, into one zip file."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.cli.options import Command, ListOption, force_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import FILE, PATH
from cpbench.foundation.plurals import counted
from cpbench_lab.bundle.making import BundleOptions, make
from cpbench_lab.bundle.report import write_report


@click.command(cls=Command)
@click.argument("results", type=PATH)
@click.option("-o", "--output", required=True, type=FILE, help="Zip file.")
@click.option("--withhold", cls=ListOption, metavar="GLOB", help="Problems to leave out, by name, family or file.")
@click.option("--report/--no-report", default=None, help="Include a report; default: where reports/NAME exists.")
@force_option
def command(results: Path, output: Path, withhold: tuple[str, ...], report: bool | None, force: bool) -> None:
    """Put a run, with everything needed to repeat it, into one zip file: plan, versions, machine, plugins, problems,
    results.

    Built-in problems are included by name; problems whose licence forbids copies, and those of collections of others
    (cpbench collection), by fingerprint and source. cpbench reproduce runs a bundle again and compares.
    """
    from cpbench.generators.collection import builtin_folder

    wanted = (Path("reports") / results.stem / "report.md").is_file() if report is None else report
    options = BundleOptions(withhold, builtin_folder(), write_report if wanted else None, force)
    summary = make(results, output, options)
    print_lines(summary.remarks, err=True)
    problems = f"{counted(summary.problems, 'problem')} ({summary.withheld} withheld)"
    click.echo(f"{counted(summary.pairs, 'pair')}, {problems}, {counted(summary.plugins, 'plugin')}")
    print_lines([f"bundle: {output} ({summary.bytes} bytes)"])
