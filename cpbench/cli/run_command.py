"""`cpbench run`."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from cpbench.bench import campaign
from cpbench.bench.execution import execute_plan
from cpbench.bench.planning import dry_run, plan_file, quantities, run_plan, suites
from cpbench.bench.planning.assembly import Assembly
from cpbench.bench.planning.run_plan import RUN_KEYS, SET_KEYS, RunPlan
from cpbench.bench.results.store import KEEP, Store
from cpbench.cli.options import Counts, ListOption, Numbers, Sections, format_option, limit_options
from cpbench.cli.outputs import require_folder
from cpbench.cli.progress import Display
from cpbench.cli.terminal import folded, width
from cpbench.errors import CpbenchError, StoreError
from cpbench.plain_text import printable
from cpbench.report.text import counted
from cpbench.verification import Status

SECTIONS = {
    "Plan": ["plan_path", "only_sets"],
    "Problems": ["suite", "keyword", "family", "where", "split", "max_problems", "shard", "file_format"],
    "Solvers and routes": ["solvers", "routes", "facets", "via", "start", "plugin_files"],
    "Accuracy": ["tolerance", "measure", "history"],
    "Limits": ["timeout", "memory", "threads", "repeats", "isolate"],
    "Order and machines": ["seed", "jobs", "affinity", "dask", "cluster"],
    "Results": ["output", "no_resume", "rerun", "retry", "keep", "report", "no_report", "fail_on"],
    "What is shown": ["dry_run", "quiet", "verbose", "log", "help"],
}
MANY = 100
"""Pairs from which on it is said how long they may take."""
ABSENT = 4
"""The most solvers of which the end of a run tells why they could not run."""
EXAMPLES = (
    "cpbench run",
    "cpbench run scenes/ -s nsgs -s 'newton-*' -t 1e-4,1e-8 --timeout 1m",
    "cpbench run 'scenes/*.hdf5' -s 'nsgs[omega=0.8:1.4:0.2,shuffle=true|false]' --where 'nc > 100' --dry-run",
    "cpbench run --suite full --shard 1/4 -o part1.sqlite",
)


@click.command(cls=Sections, sections=SECTIONS, examples=EXAMPLES)
@click.argument("problems", nargs=-1, metavar="[PROBLEM|FOLDER|GLOB]...")
@click.option(
    "--plan", "plan_path", metavar="FILE", help="Plan file (TOML); default cpbench.toml here, if any. none: no file."
)
@click.option(
    "--set",
    "only_sets",
    cls=ListOption,
    metavar="NAME",
    help="Only this [[set]] of the plan. Repeatable.",
)
@click.option(
    "--suite",
    type=click.Choice(suites.SUITES),
    help="Built-in problems, where none are named. quick (default): few and small, 5 s each at most; standard: all, by "
    "the same solvers; full: all, by all solvers and routes.",
)
@click.option(
    "-k", "--keyword", metavar="WORDS", help="Problems with these words in path, name, family or node: 'a and not b'."
)
@click.option("--family", cls=ListOption, metavar="NAME", help="Problems of this family (a glob).")
@click.option(
    "--where",
    metavar="CONDITION",
    help="Problems whose facts fulfil it: 'nc > 100 and 3*nc/ndof > 1'. Problems without that fact are skipped.",
)
@click.option(
    "--split",
    type=click.Choice(plan_file.SPLITS),
    help="Half of the problems, by a hash of their mathematics: dev to tune on, test to compare on.",
)
@click.option("--max-problems", type=int, metavar="N", help="At most N different problems of a set, drawn by --seed.")
@click.option("--shard", metavar="I/N", help="The I-th of N parts; each machine decides alone. See: cpbench merge.")
@format_option
@click.option(
    "-s",
    "--solver",
    "solvers",
    cls=ListOption,
    metavar="NAME[opt=value]",
    help="Only these solvers: names, globs, all, and grids as nsgs[omega=0.8:1.4:0.2,shuffle=true|false]. Repeatable.",
)
@click.option(
    "--routes",
    type=click.Choice(plan_file.ROUTES),
    help="Which conversions may be used; facets adds inner facets, all adds outer ones, relaxations and "
    "merely necessary conversions. Default: exact; for builtin: facets.",
)
@click.option(
    "--facets",
    cls=ListOption,
    type=Counts(),
    default=("8,16",),
    show_default="8,16",
    help="Facets of approximate routes.",
)
@click.option(
    "--via",
    cls=ListOption,
    metavar="CONVERSION",
    help="Only routes through this conversion; NAME[knob=value] sets its knobs. Repeatable.",
)
@click.option(
    "--start",
    cls=ListOption,
    default=("cold",),
    show_default="cold",
    metavar="POLICY",
    help="Starts of solvers: cold, file, file:K, previous (the step before of a sequence) or perturbed:σ; a row each.",
)
@click.option(
    "-t",
    "--tolerance",
    cls=ListOption,
    type=Numbers(),
    default=("1e-6",),
    show_default="1e-6",
    help="An answer solves the problem when its measured error is at most this; a row each for 1e-4,1e-8.",
)
@click.option("--measure", metavar="NAME", help="The one number that decides; default: all of them.")
@click.option("--history/--no-history", help="Solve once more while the iterates are kept, where a solver can.")
@limit_options
@click.option("--repeats", type=int, default=3, show_default=True, help="Solves of a pair that takes less than 1 s.")
@click.option(
    "--isolate",
    type=click.Choice(plan_file.ISOLATE),
    default="worker",
    show_default=True,
    help="A process a solver, or a fresh one a solve.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Of the random order and of --max-problems.")
@click.option("-j", "--jobs", type=int, default=1, show_default=True, help="Lanes side by side; times are marked.")
@click.option("--affinity/--no-affinity", default=True, show_default=True, help="Give each lane cores of its own.")
@click.option("--dask", metavar="ADDRESS", help="Run on the workers of this Dask scheduler.")
@click.option("--cluster", metavar="KIND|FILE", help="Start workers: local, slurm, pbs, or as a file says.")
@click.option("-o", "--output", type=click.Path(dir_okay=False), help="Results file (SQLite).")
@click.option("--no-resume", is_flag=True, help="Start again: refuse an existing results file.")
@click.option(
    "--rerun",
    type=click.Choice(["failed", "timeouts", "all"]),
    help="Run rows of an old file again; failed is everything but solved, stationary, infeasible and unsupported.",
)
@click.option("--retry", type=int, default=0, show_default=True, help="Times a crash, timeout or memout is run again.")
@click.option("--keep", type=click.Choice(KEEP), default="all", show_default=True, help="Answers to keep.")
@click.option("--report", type=click.Path(file_okay=False), help="Folder of the report.")
@click.option("--no-report", is_flag=True, help="Write no report.")
@click.option("--fail-on", cls=ListOption, metavar="STATUSES", help="End with 1 when a pair is wrong,crash,...")
@click.option("--dry-run", is_flag=True, help="Print what would be run, and how long at most. Writes nothing.")
@click.option("-q", "--quiet", is_flag=True, help="No progress.")
@click.option("-v", "--verbose", is_flag=True, help="A line an event on stderr.")
@click.option("--log", type=click.Path(path_type=Path, dir_okay=False), help="The same lines in this file.")
@click.pass_context
def command(
    context: click.Context,
    plan_path: str | None,
    only_sets: tuple[str, ...],
    no_resume: bool,
    no_report: bool,
    dry_run: bool,
    quiet: bool,
    verbose: bool,
    log: Path | None,
    **_: Any,
) -> None:
    """Run every reachable solver on every problem, judge every answer on the problem that was asked, and report.

    Problems are files, packs (FILE::NAME), folders, globs or the word builtin; without any, those of the plan file,
    or the quick suite. The same command after an interruption resumes. What is said here wins over the file.

    Ends with 0 when every pair has its row, whatever is in it; 1 for --fail-on, and when rows are missing because
    pairs were not run or nobody could say what a file holds, or are not as a run wrote them; 2 for bad input; 130 when
    interrupted, with a file that can be resumed.
    """
    file = _plan_file(plan_path, quiet)
    given = _given(context)
    if no_report and "report" in given:
        raise click.UsageError("--report and --no-report: one of them")
    if no_resume and "rerun" in given:
        raise click.UsageError("--rerun runs rows of an old file again, --no-resume refuses one: one of them")
    if no_report:
        given["report"] = None
    said = (file.top, file.sets) if file is not None else ({}, [])
    asked = run_plan.make(given, *said, only=only_sets, tunings=file.tunings if file is not None else (), suite=_suite)
    if "facets" in given and all(not part.via and part.allowed_routes == "exact" for part in asked.sets):
        raise click.UsageError("--facets: no route of this run has facets; add --routes facets")
    if no_resume and asked.results.exists():
        raise StoreError(f"{asked.results}: exists; remove it or leave --no-resume out to go on with it")
    display = Display(quiet, verbose, log)
    try:
        command = shlex.join(["cpbench", *sys.argv[1:]])
        announce = partial(_announce, asked, quiet, dry_run)
        finish = partial(_finish, asked)
        execute_plan(asked, _builtin_folder, display, command, announce, finish, _tell_removed)
    except KeyboardInterrupt:
        how = "the same command without --rerun" if asked.rerun else "the same command"
        click.echo(f"cpbench: interrupted; {asked.results} has what was done, {how} goes on", err=True)
        sys.exit(130)


def _announce(asked: RunPlan, quiet: bool, dry_run: bool, assembly: Assembly) -> bool:
    """Say what will be run; whether it is to be."""
    _tell(assembly)
    if not quiet:
        _tell_estimate(asked, assembly)
    if dry_run:
        _print_plan(asked, assembly)
        return False
    assembly.require_pairs()
    campaign.require_answers(asked, assembly.pairs)
    if asked.report_folder is not None:
        require_folder(asked.report_folder)  # before hours of work
    return True


def _plan_file(path: str | None, quiet: bool) -> plan_file.PlanFile | None:
    found = plan_file.find() if path is None else Path(path)
    if found is None or path == "none":
        return None
    file = plan_file.read(found)
    if not quiet:
        click.echo(f"plan: {found}", err=True)
    return file


def _given(context: click.Context) -> dict[str, Any]:
    """The values that were said on the command line, by the keys of a plan, checked as those of a file are."""
    given: dict[str, Any] = {}
    for name, value in context.params.items():
        key = "format" if name == "file_format" else name
        said = context.get_parameter_source(name) is not ParameterSource.DEFAULT
        if not said or key not in (*SET_KEYS, *RUN_KEYS) or (key == "problems" and not value):
            continue
        try:
            given[key] = plan_file.check(key, value)
        except CpbenchError as cause:
            flag = {"solvers": "--solver", "problems": "PROBLEM"}.get(key, f"--{key.replace('_', '-')}")
            raise CpbenchError(f"{flag}: {cause}") from None
    return given


def _suite(name: str) -> dict[str, Any]:
    from cpbench.generators.collection import quick_problems

    return suites.values(name, lambda: quick_problems(_builtin_folder()))


def _builtin_folder() -> Path:
    from cpbench.generators.collection import builtin_folder

    return builtin_folder()


def _tell(assembly: Assembly) -> None:
    """What a reader of the results should know before they are there."""
    for address, twin in assembly.twins:
        click.echo(f"same problem, run once: {address} is {twin}", err=True)
    if assembly.pairs and assembly.idle:
        click.echo(f"no route leads to {', '.join(assembly.idle)}: no row", err=True)


def _tell_estimate(asked: RunPlan, assembly: Assembly) -> None:
    """How long it will take, where that is not over before it is read."""
    todo = dry_run.to_run(assembly.pairs, campaign.statuses(asked.results), asked.rerun)
    if len(todo) >= MANY:
        from cpbench.cli.estimate import estimate

        longest = quantities.duration(dry_run.longest(todo, asked))
        click.echo("\n".join(folded(f"{estimate(todo, asked)}; at most {longest}")), err=True)


def _tell_removed(store: Store) -> None:
    """Which rows of an earlier run cannot be believed and are run again, and what could not be checked."""
    for row in store.opened.broken:
        click.echo(f"removed, to be run again where it is planned: {row}", err=True)
    if store.opened.note:
        click.echo(store.opened.note, err=True)


def _print_plan(asked: RunPlan, assembly: Assembly) -> None:
    for line in dry_run.lines(asked, assembly, campaign.statuses(asked.results), width()):
        click.echo("\n".join(folded(line)))
    _tell_refused(assembly.refused)


def _tell_refused(refused: Sequence[tuple[str, str]]) -> None:
    for address, reason in refused:
        click.echo(printable(f"refused: {reason if address in reason else f'{address}: {reason}'}"), err=True)


def _finish(asked: RunPlan, store: Store, assembly: Assembly) -> None:
    from cpbench.analysis.remarks import remarks  # with pandas: what is said at the end need not keep from beginning
    from cpbench.cli.answer import print_answer

    _tell_refused(assembly.refused)
    counts = store.counts()
    if counts.get(Status.UNAVAILABLE):
        _tell_absent(store)
    print_answer(store)
    click.echo(f"\n{counted(sum(counts.values()), 'pair')}: {_summary(counts) or _nothing(asked)}")
    table = store.table()
    for remark in remarks(table):
        click.echo(printable(remark))
    click.echo(f"results: {asked.results}")
    if counts and asked.report_folder is not None:
        from cpbench.api.reports import write_report
        from cpbench.report.html import vega

        for path in write_report(store, asked.report_folder, _title(asked), table)[0]:
            click.echo(f"report: {path}")
        if vega.lacking():
            click.echo(vega.lacking(), err=True)
    gaps = campaign.gaps(store, assembly)
    if gaps:
        click.echo(f"cpbench: rows are missing: {', '.join(gaps)}; the same command goes on", err=True)
    failed = campaign.failures(store, asked, assembly.pairs)
    if failed:
        click.echo(f"cpbench: {_summary(failed)} (--fail-on)", err=True)
    removed = len(store.opened.broken)
    if removed:
        click.echo(f"cpbench: {asked.results}: removed {counted(removed, 'row')} that could not be believed", err=True)
    if gaps or failed or removed or not (counts or asked.shard != (1, 1)):
        sys.exit(1)


def _title(asked: RunPlan) -> str:
    if asked.builtin:
        return "The built-in suite"
    return f"The {asked.suite} suite" if asked.suite else asked.results.stem


def _tell_absent(store: Store) -> None:
    """Why solvers could not run, in a line for each of the first; the report has all."""
    rows = [row for row in store.rows() if row["status"] == Status.UNAVAILABLE]
    reasons = {str(row["solver"]): (str(row["message"] or "").strip().splitlines() or ["not told"])[-1] for row in rows}
    for name, reason in sorted(reasons.items())[:ABSENT]:
        click.echo(f"not available: {name}: {printable(reason)}", err=True)
    if len(reasons) > ABSENT:
        click.echo(
            f"and {counted(len(reasons) - ABSENT, 'more solver')}: cpbench doctor says what each lacks", err=True
        )


def _nothing(asked: RunPlan) -> str:
    return "none in this shard" if asked.shard != (1, 1) else "none could be run"


def _summary(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{counts[status]} {status}" for status in sorted(counts, key=lambda s: -counts[s]))
