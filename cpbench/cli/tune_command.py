"""`cpbench tune`."""

from __future__ import annotations

import math
import os
import platform
import shlex
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click

from cpbench.bench import machine
from cpbench.bench.lane import Lane
from cpbench.bench.outcome import Outcome
from cpbench.bench.planning import plan_file, plan_text, quantities
from cpbench.bench.planning.assembly import assemble
from cpbench.bench.planning.plan import Pair
from cpbench.bench.planning.run_plan import BUILTIN, ProblemSet, RunPlan
from cpbench.bench.results.store import Store
from cpbench.bench.runner import Lanes, settings
from cpbench.bench.staff import Setting
from cpbench.bench.tuning import record
from cpbench.bench.tuning.search import Search
from cpbench.bench.tuning.space import space
from cpbench.cli import next_command
from cpbench.cli.options import Duration, ListOption, Sections, force_option, limit_options, tolerance_option
from cpbench.cli.progress import Display
from cpbench.errors import CpbenchError
from cpbench.plurals import counted

SECTIONS = {
    "Search": ["budget", "configurations", "seed", "jobs"],
    "Problems": ["split", "keyword", "family", "where", "max_problems"],
    "Accuracy and limits": ["tolerance", "timeout", "memory", "threads", "repeats"],
    "Results": ["output", "trials", "force", "quiet", "help"],
}
EXAMPLES = (
    "cpbench tune nsgs scenes/ --budget 1h",
    "cpbench tune 'psor[omega=0.8:1.9:0.05]' builtin/lcp --budget 5m -o psor.toml",
    "cpbench run --plan psor.toml",
)


@click.command(cls=Sections, sections=SECTIONS, examples=EXAMPLES)
@click.argument("solver", metavar="SOLVER[opt=value]")
@click.argument("problems", nargs=-1, metavar="[PROBLEM|FOLDER|GLOB]...")
@click.option("--budget", type=Duration(), default="10m", show_default=True, help="Wall clock of the search.")
@click.option("--configurations", type=click.IntRange(min=2), metavar="N", help="Try at most so many.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of configurations and orders.")
@click.option("-j", "--jobs", type=click.IntRange(min=1), default=1, show_default=True, help="Lanes side by side.")
@click.option(
    "--split",
    type=click.Choice(plan_file.SPLITS),
    default="dev",
    show_default=True,
    help="Half of the problems, by a hash of their mathematics; what is tuned on dev can be compared on test.",
)
@click.option("-k", "--keyword", default="", metavar="WORDS", help="Problems with these words, as for cpbench run.")
@click.option("--family", cls=ListOption, metavar="NAME", help="Problems of this family (a glob).")
@click.option("--where", default="", metavar="CONDITION", help="Problems whose facts fulfil it.")
@click.option("--max-problems", type=click.IntRange(min=1), metavar="N", help="At most N problems, drawn by --seed.")
@tolerance_option
@limit_options
@click.option("--repeats", type=click.IntRange(min=1), default=1, show_default=True, help="Solves of a short pair.")
@click.option("-o", "--output", type=click.Path(path_type=Path, dir_okay=False), help="Plan file (SOLVER.tuned.toml).")
@click.option("--trials", type=click.Path(path_type=Path, dir_okay=False), help="Results file with every solve.")
@force_option
@click.option("-q", "--quiet", is_flag=True, help="No progress.")
def command(
    solver: str,
    problems: tuple[str, ...],
    budget: float,
    configurations: int | None,
    seed: int,
    jobs: int,
    threads: int,
    output: Path | None,
    trials: Path | None,
    force: bool,
    quiet: bool,
    **asked: Any,
) -> None:
    """Search for the options with which a solver solves most problems, and fastest.

    Random search with successive halving, where the solver says that its options lie (cpbench list solvers SOLVER);
    an option with one value in the brackets is fixed, one with several is searched among them. Every configuration is
    run and judged as by cpbench run. What was found is written as a plan, which compares it with the default options
    on the other half of the problems, and tells results and reports what the search cost. Ctrl-C ends the search; the
    best so far is written.
    """
    where = space(solver)
    path = output or Path(f"{where.entry.solver}.tuned.toml")
    if path.exists() and not force:
        raise CpbenchError(f"{path}: exists; --force replaces it")
    if not os.access(path.absolute().parent, os.W_OK):  # found out after the search it would have been in vain
        raise CpbenchError(f"{path}: its folder is not there or cannot be written; name another file with -o")
    if not math.isfinite(asked["timeout"]):
        raise CpbenchError("--timeout none: a search needs a limit, which a solve that fails is charged")
    part = _part(solver, problems, asked, seed)
    plan = RunPlan(sets=(part,), threads=threads, jobs=jobs, report=None, seed=seed)
    display = Display(quiet)
    with ExitStack() as stack:
        common = Setting(threads, part.memory)
        lanes = [stack.enter_context(Lane(setting)) for setting in settings(common, jobs)]
        planned = _one_a_problem(plan, lanes[0], display)
        entries = where.configurations(seed)
        store = stack.enter_context(Store(trials, create=True, keep="none")) if trials else None
        search = Search(
            planned,
            (entry for _, entry in zip(range(configurations), entries, strict=False)) if configurations else entries,
            budget,
            seed,
            told=lambda line: None if quiet else click.echo(line, err=True),
            keep=_Keeper(store) if store is not None else lambda *_: None,
        )
        if not quiet:
            click.echo(f"{counted(len(planned), 'problem')}, {quantities.duration(budget)}, seed {seed}", err=True)
        interrupted = False
        try:
            search.run(Lanes(lanes))
        except KeyboardInterrupt:
            interrupted = True
        if store is not None:
            store.require_unchanged()
    found = search.found
    made = record.tuning(found, part, budget, seed)
    plan_text.write(path, record.plan_text(made, where.entry, part, threads, path.parent))
    for label, told in ((made.solver, made.found), (f"{record.as_text(where.entry)}, default", made.default)):
        click.echo(f"{label}: {told}")
    if not found.score.gains_on(found.default):
        click.echo("no gain on the default options: the difference is within what times differ from run to run")
    if not found.final:
        click.echo("measured at different times, not side by side: the search ended before the final")
    if not found.whole:
        of = counted(len(planned), "problem")
        click.echo(f"compared on {found.score.problems} of {of}: the budget was too short for more")
    click.echo(
        f"{counted(found.configurations, 'configuration')}, {counted(found.solves, 'solve')}, {found.seconds:.1f} s"
    )
    click.echo(f"plan: {path}; compare on the other problems with: {next_command.line('run', '--plan', str(path))}")
    if interrupted:
        click.echo("cpbench: interrupted; the plan has the best so far", err=True)
        sys.exit(130)


def _part(solver: str, problems: tuple[str, ...], asked: dict[str, Any], seed: int) -> ProblemSet:
    said = {
        "problems": problems or (BUILTIN,),
        "solvers": (solver,),
        "routes": "exact",
        "tolerance": (asked["tolerance"],),
        "seed": seed,
        **{key: asked[key] for key in ("timeout", "memory", "repeats", "split", "keyword", "family", "where")},
    }
    checked = {key: plan_file.check(key, value) for key, value in said.items() if value not in ("", ())}
    return ProblemSet(**checked, max_problems=asked["max_problems"])


def _one_a_problem(plan: RunPlan, lane: Lane, display: Display) -> list[Pair]:
    """A pair a problem that a route leads from; raises CpbenchError, NoRoute where there is none."""
    from cpbench.generators.collection import builtin_folder

    assembly = assemble(plan, lane, builtin_folder, display.reading)
    assembly.require_pairs()
    found: dict[str, Pair] = {}
    for pair in assembly.pairs:
        found.setdefault(pair.fingerprint, pair)
    return list(found.values())


class _Keeper:
    """Puts every solve into a results file, for `cpbench report`."""

    def __init__(self, store: Store) -> None:
        self._store = store
        store.set_meta(
            command=shlex.join(["cpbench", *sys.argv[1:]]),
            date=time.strftime("%Y-%m-%d %H:%M"),
            machine=machine.describe(),
            versions=machine.versions(),
        )
        store.note_machine(platform.node(), machine.describe())

    def __call__(self, pair: Pair, outcome: Outcome, host: str) -> None:
        self._store.plan([pair])
        self._store.finish(pair.key, {**outcome.row, "host": host}, history=outcome.history)
