"""Run every reachable solver on every problem, judge the answers, write the report."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from cpbench.bench.planning import plan_file, run_plan
from cpbench.bench.planning.run_plan import SETTINGS
from cpbench.bench.run import open_run
from cpbench.cli.options import MEMORY_HELP, TIMEOUT_HELP, VIA_HELP, ListOption, Sections, quiet_option
from cpbench.cli.progress import Display
from cpbench.cli.run_output import announce, finish, print_plan, require_places
from cpbench.cli.terminal import print_lines
from cpbench.errors import CpbenchError
from cpbench.foundation.imports import import_ahead
from cpbench.foundation.text import counted
from cpbench.generators.collection import builtin_folder
from cpbench.generators.quick import quick_problems
from cpbench.storage.base import require_new

HELP = {
    "suite": "Built-in problems, where none are named. quick (default): few and small, 5 s each at most; standard: "
    "all, by the same solvers; full: all, by all solvers and routes.",
    "where": "Condition on facts: 'nc > 100 and 3*nc/ndof > 1'. Problems without that fact are skipped.",
    "shard": "Part I of N of the problems, the same on every machine; cpbench results merge joins the results.",
    "solvers": "Solvers to run: names, globs, all, and grids as nsgs[omega=0.8:1.4:0.2,shuffle=true|false].",
    "routes": "Conversions that may be used; facets adds inner facets, all adds outer ones, relaxations and merely "
    "necessary conversions. Default: exact; for builtin: facets.",
    "via": VIA_HELP,
    "start": "Starts of solvers: cold, file, file:K or previous (the step before of a sequence); a row each.",
    "tolerance": "Largest measured error of an answer that solves the problem; a row each for 1e-4,1e-8.",
    "history": "Solve once more to keep the iterates, where a solver can.",
    "timeout": TIMEOUT_HELP,
    "memory": MEMORY_HELP,
    "repeats": "Number of solves of a pair below 1 s.",
    "seed": "Random seed of the order.",
    "jobs": "Number of pairs at the same time; their times are marked.",
    "cluster": "Address of a Dask scheduler, or local: processes here.",
    "output": "Results file (SQLite).",
    "rerun": "Rows to run again; failed is everything but solved, stationary, infeasible and unsupported.",
    "keep": "Answers to keep.",
    "fail_on": "Statuses with which the command ends with 1, or contradiction: wrong,crash,...",
}
"""The settings of a plan that are options."""
FLAGS = {
    "solvers": ("-s", "--solver"),
    "tolerance": ("-t", "--tolerance"),
    "history": ("--history/--no-history",),
    "jobs": ("-j", "--jobs"),
    "output": ("-o", "--output"),
}
"""The flags of options that are not the name alone."""
SECTIONS = {
    "Plan": ["plan_path"],
    "Problems": ["suite", "where", "shard"],
    "Solvers and routes": ["solvers", "routes", "via", "start"],
    "Accuracy": ["tolerance", "history"],
    "Limits": ["timeout", "memory", "repeats"],
    "Order and machines": ["seed", "jobs", "cluster"],
    "Results": ["output", "rerun", "keep", "no_report", "fail_on"],
    "Output": ["dry_run", "quiet", "help"],
}
EXAMPLES = (
    "cpbench run",
    "cpbench run scenes/ -s nsgs -s 'newton-*' -t 1e-4,1e-8 --timeout 1m",
    "cpbench run 'scenes/*.hdf5' -s 'nsgs[omega=0.8:1.4:0.2,shuffle=true|false]' --where 'nc > 100' --dry-run",
    "cpbench run --suite full --shard 1/4 -o part1.sqlite",
)


def setting_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add an option for each setting in HELP, with its default as text."""
    for key, text in reversed(HELP.items()):
        setting = SETTINGS[key]
        flags = FLAGS.get(key, (f"--{key.replace('_', '-')}",))
        default = setting.default_text() or None
        more: dict[str, Any] = {"help": text, "default": default, "show_default": default is not None}
        if key != "history":
            more["metavar"] = setting.metavar
        if setting.many:
            more |= {"cls": ListOption, "default": default and (default,)}
        command = click.option(*flags, key, **more)(command)
    return command


@click.command(cls=Sections, sections=SECTIONS, examples=EXAMPLES)
@click.argument("problems", nargs=-1, metavar="[PROBLEM|FOLDER|GLOB]...")
@click.option("--plan", "plan_path", metavar="FILE", help="Plan file (TOML); default: cpbench.toml here; or none.")
@setting_options
@click.option("--no-report", is_flag=True, help="Write no report.")
@click.option("--dry-run", is_flag=True, help="Print what would be run, and how long at most; write nothing.")
@quiet_option
@click.pass_context
def command(
    context: click.Context,
    plan_path: str | None,
    no_report: bool,
    dry_run: bool,
    quiet: bool,
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
    file = _plan_from(plan_path, quiet)
    given = _given_options(context)
    if no_report:
        given["report"] = None
    values = (file.top, file.sets) if file is not None else ({}, [])
    suite = partial(run_plan.suite_values, problems=lambda: quick_problems(builtin_folder()))
    plan = run_plan.make(given, *values, suite=suite)
    if not dry_run:
        require_new(plan.results, force=True)
    display = Display(quiet)
    display.steps.say("looking for problems")
    # which a run of few pairs does not draw
    figures = ("matplotlib.figure", "matplotlib.backends.backend_agg") if plan.suite and plan.report is not None else ()
    # while processes start and files are read
    import_ahead("cpbench.cli.answer", "rich.table", "cpbench.api.reports", *figures)
    try:
        with open_run(plan, builtin_folder, display.reading) as run:
            display.steps.stop()
            announce(run.assembly)
            if dry_run:
                print_plan(run)
                return
            require_places(plan, run.assembly)
            store = run.open_results()
            display.steps.say(f"entering {counted(len(run.assembly.pairs), 'pair')} into {plan.results}")
            run.execute(store, display, shlex.join(["cpbench", *sys.argv[1:]]))
            finish(plan, store, run.assembly, display.steps.say)
    except KeyboardInterrupt:
        how = "the same command without --rerun" if plan.rerun else "the same command"
        print_lines([f"cpbench: interrupted; {plan.results} has what was done, {how} goes on"], err=True)
        sys.exit(130)
    finally:
        display.steps.stop()


def _plan_from(path: str | None, quiet: bool) -> plan_file.PlanFile | None:
    """Return the plan file that is named, or lies here; None where there is none or `none` is given."""
    plan_path = Path(plan_file.NAME if path is None else path)
    if path == "none" or (path is None and not plan_path.is_file()):
        return None
    file = plan_file.read(plan_path)
    if not quiet:
        click.echo(f"plan: {plan_path}", err=True)
    return file


def _given_options(context: click.Context) -> dict[str, Any]:
    """Return the values from the command line, by the keys of a plan."""
    given: dict[str, Any] = {}
    for parameter in context.command.params:
        key = parameter.name or ""
        value = context.params.get(key)
        default = context.get_parameter_source(key) is ParameterSource.DEFAULT
        if default or key not in SETTINGS or value == ():
            continue
        try:
            given[key] = SETTINGS[key].from_texts(value if isinstance(value, tuple) else (value,))
        except CpbenchError as cause:
            raise click.BadParameter(str(cause), context, parameter) from None
    return given
