"""Run every reachable solver on every problem, judge the answers, write the report."""

from __future__ import annotations

import shlex
import sys
from functools import partial
from typing import Any

import click

from cpbench.bench.planning import run_plan, suites
from cpbench.bench.run import open_run
from cpbench.cli.options import Sections
from cpbench.cli.progress import Display
from cpbench.cli.run_options import EXAMPLES, SECTIONS, given_options, plan_from, require_near, run_options
from cpbench.cli.run_output import announce, finish, print_plan, require_places
from cpbench.cli.terminal import print_lines
from cpbench.foundation.imports import import_ahead
from cpbench.foundation.plurals import counted
from cpbench.generators.collection import builtin_folder
from cpbench.generators.quick import quick_problems


@click.command(cls=Sections, sections=SECTIONS, examples=EXAMPLES)
@click.argument("problems", nargs=-1, metavar="[PROBLEM|FOLDER|GLOB]...")
@run_options
@click.pass_context
def command(
    context: click.Context,
    plan_path: str | None,
    no_report: bool,
    dry_run: bool,
    quiet: bool,
    verbose: bool,
    **_: Any,
) -> None:
    """Run every reachable solver on every problem, judge every answer on the original problem, and report.

    Problems are files, packs (FILE::NAME), folders, globs or the word builtin; without any, those of the plan file, or
    the quick suite. After an interruption, the same command resumes. An option overrides the plan file.

    The exit code is 0 when every pair has its row, whatever its status. It is 1 for --fail-on, when rows are missing
    because pairs were not run, when a solver that was named (not matched by a pattern) could not run here or no route
    leads to it, when a file that was named (not found in a folder) could not be read, and when the results were changed
    after a run wrote them. It is 2 for bad input, and 130 after an interruption, with a file that can be resumed.
    """
    file = plan_from(plan_path, quiet)
    given = given_options(context)
    if file is not None:
        require_near(file, {**given, "report": None} if no_report else given)
    if no_report:
        given["report"] = None
    values = (file.top, file.sets) if file is not None else ({}, [])
    suite = partial(suites.values, problems=lambda: quick_problems(builtin_folder()))
    plan = run_plan.make(given, *values, suite=suite)
    display = Display(quiet, verbose)
    display.step("looking for problems")
    import_ahead("cpbench.cli.answer", "rich.table", "cpbench.api.reports")  # while processes start and files are read
    try:
        with open_run(plan, builtin_folder, display.reading) as run:
            display.rest()
            announce(run.assembly)
            if dry_run:
                print_plan(run)
                return
            require_places(plan, run.assembly)
            store = run.open_results()
            display.step(f"entering {counted(len(run.assembly.pairs), 'pair')} into {plan.results}")
            run.execute(store, display, shlex.join(["cpbench", *sys.argv[1:]]))
            finish(plan, store, run.assembly, display.step)
    except KeyboardInterrupt:
        how = "the same command without --rerun" if plan.rerun else "the same command"
        print_lines([f"cpbench: interrupted; {plan.results} has what was done, {how} goes on"], err=True)
        sys.exit(130)
    finally:
        display.rest()
