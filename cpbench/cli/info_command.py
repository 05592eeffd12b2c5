"""`cpbench info`."""

from __future__ import annotations

import json
import shlex
import sys
from collections import Counter
from collections.abc import Iterator, Sequence

import click

from cpbench import storage
from cpbench.api import problem_text
from cpbench.api.problem_text import StepFacts
from cpbench.api.results import is_results_file
from cpbench.cli import terminal
from cpbench.cli.answer import print_results
from cpbench.cli.options import Command, format_option, reached_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import ADDRESS
from cpbench.errors import CpbenchError
from cpbench.formulations import facts
from cpbench.foundation.plurals import counted

MANY = 3
"""Number of problems up to which each is shown by itself."""


@click.command(cls=Command)
@click.argument("files", nargs=-1, required=True, type=ADDRESS)
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON: a list with one object per problem.")
@click.option("--facts/--no-facts", "measure", default=True, show_default=True, help="Measure facts of the matrices.")
@format_option
@reached_option
def command(files: tuple[str, ...], as_json: bool, measure: bool, file_format: str | None, reached: bool) -> None:
    """Show formulation, sizes, facts, origin and provenance of problems (FILE, FILE::NAME or folders).

    More than three problems get one line each; a problem that cannot be read does not stop the others. For a results
    file the command shows which solver to use, as at the end of the run.

    Every fact has its method: exact, by a factorization, by a randomized estimate, or not decided.
    """
    if any(map(is_results_file, files)):
        first, *others = files
        if as_json or file_format or others:
            text = "a results file stands alone, with no option but --reached; its rows as JSON: cpbench export"
            raise click.UsageError(text)
        print_results(first, reached)
        return
    if reached:
        raise click.UsageError("--reached is of a results file")
    addresses = storage.problem_files(files) or list(files)
    if len(addresses) > MANY and not as_json:
        rows, steps, refused = _read(addresses, file_format)
        print_lines(_summary(rows, steps))
        print_lines(refused, err=True)
        if refused:
            sys.exit(2)
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


Row = tuple[str, str, str]


def _read(addresses: Sequence[str], file_format: str | None) -> tuple[list[Row], list[StepFacts], list[str]]:
    """Return formulation, sizes and address of each problem, facts of those that are steps, and a line for each that
    cannot be read."""
    rows: list[Row] = []
    steps: list[StepFacts] = []
    refused: list[str] = []
    for address in addresses:
        try:
            problem = storage.load(address, format=file_format)
        except CpbenchError as cause:
            refused.append(f"refused: {cause if address in str(cause) else f'{address}: {cause}'}")
            continue
        rows.append((problem.node, problem_text.sizes_line(problem), address))
        if (step := problem_text.step_of(problem)) is not None:
            steps.append(step)
    return rows, steps, refused


def _summary(rows: Sequence[Row], steps: Sequence[StepFacts]) -> Iterator[str]:
    nodes = Counter(node for node, _, _ in rows)
    kinds = ", ".join(f"{count} {node}" for node, count in nodes.most_common())
    yield f"{counted(len(rows), 'problem')}: {kinds or 'none could be read'}"
    yield from problem_text.sequence_lines(steps)
    if rows:
        yield from terminal.table(rows)
        yield f"all that is known of one: cpbench info {shlex.quote(rows[0][2])}; of all, for programs: --json"
