"""The plan of a run as text: problems and solvers, its sets, what is done, the longest time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from cpbench.bench.planning.assembly import Assembly
from cpbench.bench.planning.plan import Pair
from cpbench.bench.planning.quantities import duration
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.planning.selection import RERUN
from cpbench.bench.time_limits import GRACE
from cpbench.cli.terminal import table
from cpbench.foundation.text import counted
from cpbench.solvers.base import Trait, solvers

ROWS = 60
"""Most problems that are listed singly; more are counted by family."""


def lines(run_plan: RunPlan, assembly: Assembly, before: Mapping[str, str]) -> Iterator[str]:
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
