"""Show the contents of a problem file, and measured facts about its matrices."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Sequence

import click

from cpbench import storage
from cpbench.api import folder_text, problem_text
from cpbench.api.results import is_results_file
from cpbench.cli import terminal
from cpbench.cli.answer import print_results
from cpbench.cli.options import Command, format_option
from cpbench.cli.steps import Steps
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import ADDRESS
from cpbench.formulations import facts

MANY = 3
"""Number of problems up to which each is shown by itself."""
LISTED = 60
"""Number of problems up to which each has a line."""


@click.command(cls=Command)
@click.argument("files", nargs=-1, required=True, type=ADDRESS)
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON: a list with one object per problem.")
@click.option("--facts/--no-facts", "measure", default=True, show_default=True, help="Measure facts of the matrices.")
@format_option
def command(files: tuple[str, ...], as_json: bool, measure: bool, file_format: str | None) -> None:
    """Show formulation, sizes, facts, origin and provenance of problems (FILE, FILE::NAME or folders).

    More than three problems get one line each, more than sixty a line for each formulation and family; problems that
    are there twice are named. A problem that cannot be read does not stop the others. For a results file the command
    shows which solver to use, as at the end of the run.

    Every fact has its method: exact, by a factorization, by a randomized estimate, or not decided.
    """
    if any(map(is_results_file, files)):
        first, *others = files
        if as_json or file_format or others:
            raise click.UsageError("a results file stands alone, without options; its rows: cpbench results export")
        print_results(first)
        return
    addresses = storage.problem_files(files) or list(files)
    if len(addresses) > MANY and not as_json:
        _print_many(files, addresses, file_format)
        return
    records: list[dict[str, object]] = []
    for address in addresses:
        problem = storage.load(address, format=file_format)
        measured = facts.of_problem(problem) if measure else ()
        if as_json:
            records.append(problem_text.record(address, problem, measured, len(storage.guesses(address))))
        else:
            print_lines(problem_text.lines(address, problem, measured, len(storage.guesses(address))))
    if as_json:
        click.echo(json.dumps(records, indent=2, ensure_ascii=False, allow_nan=False))


def _print_many(places: Sequence[str], addresses: Sequence[str], file_format: str | None) -> None:
    """Print what is in a folder; exits with 2 where something cannot be read."""
    with Steps(quiet=False) as steps:
        listing = folder_text.collect(steps.through(addresses, "reading", "problem"), file_format)
    print_lines([folder_text.headline(listing)])
    print_lines(problem_text.sequence_lines(listing.steps))
    many = len(listing.members) > LISTED
    rows = [(m.node, m.line, m.address) for m in listing.members]
    print_lines(terminal.table(folder_text.classes(listing.members) if many else rows))
    print_lines(folder_text.twins(listing.members))
    print_lines(folder_text.others(places, addresses))
    if rows:
        print_lines([f"all that is known of one: cpbench info {shlex.quote(rows[0][2])}; of all, for programs: --json"])
    print_lines(listing.refused, err=True)
    if listing.refused:
        sys.exit(2)
