"""Output of `cpbench run` before the first solve and after the last."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from cpbench.bench import skipped
from cpbench.bench.planning.assembly import Assembly
from cpbench.bench.planning.plan import Pair
from cpbench.bench.planning.quantities import duration
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.planning.selection import RERUN
from cpbench.bench.processes.isolation import address_space, address_space_allowed
from cpbench.bench.results.store import Store
from cpbench.bench.run import OpenRun, require_answers
from cpbench.bench.time_limits import GRACE
from cpbench.cli.terminal import fitted, print_lines, table
from cpbench.foundation.text import counted, on_one_line, printable, some_of, summary
from cpbench.solvers.base import Trait, solvers
from cpbench.storage.base import require_folder
from cpbench.verification import CONTRADICTION, Status

if TYPE_CHECKING:
    import pandas as pd

    from cpbench.analysis.contradictions import Contradiction

ABSENT = 4
"""Largest number of solvers of which the end of a run says why they could not run."""


def announce(assembly: Assembly) -> None:
    """Print what a reader of the results should know before they are there; raises CpbenchError where there is nothing
    to run."""
    allowed = address_space_allowed()
    lines: list[str] = []
    if any(allowed < pair.limits.memory + address_space() for pair in assembly.pairs):
        lines.append(
            f"the system allows a process {allowed / 2**30:.3g} GiB of address space (ulimit -v), less than the memory "
            "limit of a solve: solvers get what is left of it"
        )
    lines += [f"same problem, run once: {address} is {twin}" for address, twin in assembly.twins]
    if assembly.pairs and assembly.idle:
        lines.append(f"no route leads to {', '.join(assembly.idle)}: no row")
    print_lines(lines, err=True)
    assembly.require_pairs()


def print_plan(run: OpenRun) -> None:
    """Print the plan, its number of pairs and how long they take at most; nothing is written."""
    plan, assembly = run.plan, run.assembly
    before = skipped.statuses_of(plan.results)
    print_lines(fitted(plan_lines(plan, assembly, before)))
    _print_refused(assembly)


def require_places(plan: RunPlan, assembly: Assembly) -> None:
    """Raise CpbenchError where the results could not be used as the plan asks, or the report could not be written."""
    require_answers(plan, assembly.pairs)
    if plan.report_folder is not None:
        require_folder(plan.report_folder)  # before hours of work


def finish(plan: RunPlan, store: Store, assembly: Assembly, step: Callable[[str], None]) -> None:
    """Print the answer and the last lines, and write the report; exits with 1 where the run failed. `step` notes what
    is being done, '' where lines follow."""
    from cpbench.analysis.run_table import RunTable
    from cpbench.api.concluding import conclude
    from cpbench.cli.answer import print_answer

    _print_refused(assembly)
    counts = store.counts()
    if counts.get(Status.UNAVAILABLE):
        print_lines(_not_available(store), err=True)
    step("looking for contradictions")
    run = RunTable.of(store.table(), store.meta())
    conflicts = conclude(store, run.rows, lambda line: print_lines([line], err=True))
    run = replace(run, meta=store.meta())  # with the contradictions and the collection
    step("")
    print_answer(run)
    print_lines(["", *_last_lines(plan, counts, run.stored)])
    if counts and plan.report_folder is not None:
        from cpbench.api.reports import write_report

        step("writing the report")
        files, _ = write_report(store, plan.report_folder, _title(plan), run)
        step("")
        print_lines(f"report: {path}" for path in files)
    failures = list(_failures(plan, store, assembly, conflicts))
    print_lines((f"cpbench: {line}" for line in failures), err=True)
    if failures or (not counts and plan.shard == (1, 1)):
        sys.exit(1)


def _print_refused(assembly: Assembly) -> None:
    """Print the problems that could not be read, with the reasons."""
    lines = ((reason if address in reason else f"{address}: {reason}") for address, reason in assembly.refused)
    print_lines((f"refused: {line}" for line in lines), err=True)


def _not_available(store: Store) -> Iterator[str]:
    """Yield the reasons why solvers could not run, a line for each of the first; the report has all."""
    rows = [row for row in store.rows() if row.status == Status.UNAVAILABLE]
    reasons = {row.solver: ((row.message or "").strip().splitlines() or ["no reason"])[-1] for row in rows}
    for name, reason in sorted(reasons.items())[:ABSENT]:
        yield f"not available: {name}: {printable(reason)}"
    if len(reasons) > ABSENT:
        yield f"and {counted(len(reasons) - ABSENT, 'more solver')}: cpbench doctor says what each lacks"


def _title(plan: RunPlan) -> str:
    """Return the title of the report."""
    if plan.builtin:
        return "The built-in suite"
    return f"The {plan.suite} suite" if plan.suite else plan.results.stem


def _last_lines(plan: RunPlan, counts: dict[str, int], table: pd.DataFrame) -> Iterator[str]:
    """Yield how many pairs ended how, what to beware of, and the results file."""
    from cpbench.analysis.cautions import remarks

    nothing = "none in this shard" if plan.shard != (1, 1) else "none could be run"
    yield f"{counted(sum(counts.values()), 'pair')}: {summary(counts) or nothing}"
    wrong = table["label"][table["status"] == str(Status.WRONG)].value_counts()
    if len(wrong):
        yield f"wrong answers by {', '.join(f'{label} ({count})' for label, count in wrong.items())}"
    yield from remarks(table)
    yield f"results: {plan.results}"


def _failures(
    plan: RunPlan, store: Store, assembly: Assembly, contradictions: Sequence[Contradiction]
) -> Iterator[str]:
    """Yield why a run failed: rows are missing, what was named could not be used, or as `fail_on` says."""
    from cpbench.analysis.contradictions import involving

    if gaps := skipped.gaps(store, assembly):
        yield f"rows are missing: {', '.join(gaps)}; the same command goes on"
    if absent := skipped.not_run(store, assembly):
        yield f"named and not run: {some_of(absent, ABSENT)}"
    texts = {str(text) for part in plan.sets for text in part.problems}
    refused = [address for address, _ in assembly.refused]
    if named := [on_one_line(one) for one in refused if {one, one.partition("::")[0]} & texts]:
        yield f"named and not read: {some_of(named, ABSENT)}"
    listed = skipped.failures(store, plan, assembly.pairs)
    if CONTRADICTION in plan.fail_on:
        listed += Counter({CONTRADICTION: len(involving(contradictions, (pair.key for pair in assembly.pairs)))})
    if listed:
        yield f"{summary(listed)} (--fail-on)"


# ------------------------------------------------------------------------------------------------------------- the plan

ROWS = 60
"""Most problems that are listed singly; more are counted by family."""


def plan_lines(run_plan: RunPlan, assembly: Assembly, before: Mapping[str, str]) -> Iterator[str]:
    """Yield the plan for a reader; `before` has the status of every row in the results file, by key."""
    pairs = assembly.pairs
    if pairs:
        yield from table(_rows(pairs))
        counts = Counter(pair.entry.solver for pair in pairs)
        yield "pairs by solver: " + ", ".join(f"{name} {counts[name]}" for name in sorted(counts))
        yield ""
    yield from _sets(assembly)
    again = RERUN[run_plan.rerun] if run_plan.rerun else ()
    kept = {key for key, status in before.items() if status != "not_run" and again is not None and status not in again}
    todo = [pair for pair in pairs if pair.key not in kept]
    if run_plan.shard != (1, 1):
        whole = len({pair.key for part in assembly.parts for pair in part.pairs})
        yield f"shard {run_plan.shard[0]} of {run_plan.shard[1]}: {len(pairs)} of {counted(whole, 'pair')}"
    if before:
        done = len(pairs) - len(todo)
        yield f"{run_plan.results} has {done} of the {counted(len(pairs), 'pair')}; {len(todo)} to be run"
    yield f"{counted(len(todo), 'pair')} to run: {_bound(todo, run_plan)}"


def _rows(pairs: Sequence[Pair]) -> Iterator[tuple[str, ...]]:
    """Yield a head and a row for each problem, or for each family where there are many problems."""
    single = len({pair.address for pair in pairs}) <= ROWS
    yield "formulation", "problem" if single else "family", "problems", "solvers", "pairs"
    rows: dict[tuple[str, str], list[Pair]] = {}
    for pair in sorted(pairs, key=lambda pair: (pair.node, pair.family, pair.address)):
        rows.setdefault((pair.node, pair.problem or pair.address if single else pair.family), []).append(pair)
    for (node, name), own in rows.items():
        problems, names = {pair.fingerprint for pair in own}, {pair.entry.solver for pair in own}
        yield node, name, str(len(problems)), str(len(names)), str(len(own))


def _sets(assembly: Assembly) -> Iterator[str]:
    for part in assembly.parts:
        name = f"set {part.problem_set.name}: " if part.problem_set.name else ""
        tolerances = ", ".join(f"{tolerance:g}" for tolerance in part.problem_set.tolerance)
        extent = f"{counted(len(part.problems), 'problem')} x {counted(len(part.entries), 'solver')} with options"
        routes = "+".join(part.problem_set.via) or part.problem_set.allowed_routes
        pairs = counted(len(part.pairs), "pair")
        yield f"{name}{extent}, routes {routes}, tolerance {tolerances}: {pairs} that a route may reach"


def _bound(todo: Sequence[Pair], run_plan: RunPlan) -> str:
    """Return as text the longest time that the solves can take, with their repeats and histories."""
    if not todo:
        return "nothing"
    whole = 0.0
    for pair in todo:
        limit = pair.limits
        whole += (limit.seconds + GRACE) * (2 if _recorded(pair) else 1)
        whole += min(limit.repeat_below, limit.seconds) * (limit.repeats - 1)
    slots = f" with {run_plan.jobs} solves at a time" if run_plan.jobs > 1 else ""
    longest = duration(whole / run_plan.jobs)
    return f"worst case {longest}{slots}, where every solve times out; conversions and judging come on top"


def _recorded(pair: Pair) -> bool:
    return pair.limits.history and Trait.HISTORY in solvers.get(pair.entry.solver).spec.traits
