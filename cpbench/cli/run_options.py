"""The options of `cpbench run`, by the sections of its help, and their values as a plan has them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from cpbench.bench.planning import plan_file, suites
from cpbench.bench.planning.run_plan import RUN_KEYS, SET_KEYS
from cpbench.bench.results.store import KEEP
from cpbench.cli.options import (
    ListOption,
    chained,
    fail_on_option,
    jobs_option,
    memory_option,
    quiet_option,
    seed_option,
    timeout_option,
    via_option,
)
from cpbench.cli.types import COUNT, NUMBERS
from cpbench.errors import CpbenchError

SECTIONS = {
    "Plan": ["plan_path"],
    "Problems": ["suite", "where", "shard"],
    "Solvers and routes": ["solvers", "routes", "via", "start", "plugin_files"],
    "Accuracy": ["tolerance", "history"],
    "Limits": ["timeout", "memory", "repeats"],
    "Order and machines": ["seed", "jobs", "cluster"],
    "Results": ["output", "rerun", "retry", "keep", "no_report", "fail_on"],
    "Output": ["dry_run", "quiet", "verbose", "help"],
}
EXAMPLES = (
    "cpbench run",
    "cpbench run scenes/ -s nsgs -s 'newton-*' -t 1e-4,1e-8 --timeout 1m",
    "cpbench run 'scenes/*.hdf5' -s 'nsgs[omega=0.8:1.4:0.2,shuffle=true|false]' --where 'nc > 100' --dry-run",
    "cpbench run --suite full --shard 1/4 -o part1.sqlite",
)

run_options = chained(
    click.option("--plan", "plan_path", metavar="FILE", help="Plan file (TOML); default: cpbench.toml here; or none."),
    click.option(
        "--suite",
        type=click.Choice(suites.SUITES),
        help="Built-in problems, where none are named. quick (default): few and small, 5 s each at most; standard: "
        "all, by the same solvers; full: all, by all solvers and routes.",
    ),
    click.option(
        "--where",
        metavar="CONDITION",
        help="Condition on facts: 'nc > 100 and 3*nc/ndof > 1'. Problems without that fact are skipped.",
    ),
    click.option(
        "--shard",
        metavar="I/N",
        help="Part I of N of the problems, the same on every machine; cpbench results merge joins the results.",
    ),
    click.option(
        "-s",
        "--solver",
        "solvers",
        cls=ListOption,
        metavar="NAME[opt=value]",
        help="Solvers to run: names, globs, all, and grids as nsgs[omega=0.8:1.4:0.2,shuffle=true|false]. Repeatable.",
    ),
    click.option(
        "--routes",
        type=click.Choice(plan_file.ROUTES),
        help="Conversions that may be used; facets adds inner facets, all adds outer ones, relaxations and "
        "merely necessary conversions. Default: exact; for builtin: facets.",
    ),
    via_option,
    click.option(
        "--start",
        cls=ListOption,
        default=("cold",),
        show_default="cold",
        metavar="POLICY",
        help="Starts of solvers: cold, file, file:K or previous (the step before of a sequence); a row each.",
    ),
    click.option(
        "-t",
        "--tolerance",
        cls=ListOption,
        type=NUMBERS,
        default=("1e-6",),
        show_default="1e-6",
        help="Largest measured error of an answer that solves the problem; a row each for 1e-4,1e-8.",
    ),
    click.option("--history/--no-history", help="Solve once more to keep the iterates, where a solver can."),
    timeout_option,
    memory_option,
    click.option("--repeats", type=COUNT, default=3, show_default=True, help="Number of solves of a pair below 1 s."),
    seed_option("Random seed of the order."),
    jobs_option(1, "Number of pairs at the same time; their times are marked."),
    click.option(
        "--cluster",
        metavar="ADDRESS|KIND|FILE",
        help="Workers of a Dask scheduler, or to start: local, slurm, pbs, or a file that describes them.",
    ),
    click.option("-o", "--output", type=click.Path(dir_okay=False), help="Results file (SQLite)."),
    click.option(
        "--rerun",
        type=click.Choice(["failed", "timeouts", "all"]),
        help="Rows to run again; failed is everything but solved, stationary, infeasible and unsupported.",
    ),
    click.option(
        "--retry",
        type=click.IntRange(min=0),
        default=0,
        show_default=True,
        help="Number of times that a crash, timeout or memout is run again.",
    ),
    click.option("--keep", type=click.Choice(KEEP), default="all", show_default=True, help="Answers to keep."),
    click.option("--no-report", is_flag=True, help="Write no report."),
    fail_on_option("Statuses with which the command ends with 1, or contradiction: wrong,crash,..."),
    click.option("--dry-run", is_flag=True, help="Print what would be run, and how long at most; write nothing."),
    quiet_option,
    click.option("-v", "--verbose", is_flag=True, help="Print a line for each event to stderr."),
)


def plan_from(path: str | None, quiet: bool) -> plan_file.PlanFile | None:
    """Return the plan file that is named, or lies here; None where there is none or `none` is given."""
    place = plan_file.find() if path is None else Path(path)
    if place is None or path == "none":
        return None
    file = plan_file.read(place)
    if not quiet:
        click.echo(f"plan: {place}", err=True)
    return file


def require_near(file: plan_file.PlanFile, given: Mapping[str, Any]) -> None:
    """Raise CpbenchError where a plan decides to write outside its own folder and the current one: a plan of somebody
    else must not choose where files go."""
    folders = (file.path.resolve().parent, Path.cwd().resolve())
    for key, flag in (("output", "-o"), ("report", "--report")):
        value = file.top.get(key)
        if not value or key in given:
            continue
        target = Path(str(value)).resolve()
        if not any(target.is_relative_to(folder) for folder in folders):
            raise CpbenchError(
                f"{file.path}: {key} = '{value}' is outside the folder of the plan and the current one; if that is "
                f"meant, say it on the command line: {flag} {value}"
            )


def given_options(context: click.Context) -> dict[str, Any]:
    """Return the values from the command line, by the keys of a plan, checked as those of a file are."""
    given: dict[str, Any] = {}
    for name, value in context.params.items():
        key = "format" if name == "file_format" else name
        default = context.get_parameter_source(name) is ParameterSource.DEFAULT
        if default or key not in (*SET_KEYS, *RUN_KEYS) or (key == "problems" and not value):
            continue
        try:
            given[key] = plan_file.check(key, value)
        except CpbenchError as cause:
            flag = {"solvers": "--solver", "problems": "PROBLEM"}.get(key, f"--{key.replace('_', '-')}")
            raise CpbenchError(f"{flag}: {cause}") from None
    return given
