"""The plan of a run as text: problems and solvers, its sets, what is done, the longest time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from cpbench.bench.planning import grids
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


def lines(asked: RunPlan, assembly: Assembly, before: Mapping[str, str]) -> Iterator[str]:
    """Yield the plan for a reader; `before` has the status of every row in the results file, by key."""
    pairs = assembly.pairs
    if pairs:
        yield from table(_rows(pairs))
        counts = Counter(pair.entry.solver for pair in pairs)
        yield "pairs by solver: " + ", ".join(f"{name} {counts[name]}" for name in sorted(counts))
        yield ""
    yield from _sets(assembly)
    again = RERUN[asked.rerun] if asked.rerun else ()
    kept = {key for key, status in before.items() if status != "not_run" and again is not None and status not in again}
    todo = [pair for pair in pairs if pair.key not in kept]
    if asked.shard != (1, 1):
        whole = len({pair.key for part in assembly.parts for pair in part.pairs})
        yield f"shard {asked.shard[0]} of {asked.shard[1]}: {len(pairs)} of {counted(whole, 'pair')}"
    if before:
        done = len(pairs) - len(todo)
        yield f"{asked.results} has {done} of the {counted(len(pairs), 'pair')}; {len(todo)} to be run"
    yield f"{counted(len(todo), 'pair')} to run: {_bound(todo, asked)}"


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
        name = f"set {part.asked.name}: " if part.asked.name else ""
        tolerances = ", ".join(f"{tolerance:g}" for tolerance in part.asked.tolerance)
        there = f"{counted(len(part.problems), 'problem')} x {counted(len(part.entries), 'solver')} with options"
        routes = "+".join(part.asked.via) or part.asked.allowed_routes
        pairs = counted(len(part.pairs), "pair")
        yield f"{name}{there}, routes {routes}, tolerance {tolerances}: {pairs} that a route may reach"
        for text in part.asked.solvers:
            entries = grids.grid(text)
            if len(entries) > 1:
                names = {entry.label for entry in entries}
                count = sum(pair.entry.label in names for pair in part.pairs)
                yield f"  {text}: {len(entries)} entries, {counted(count, 'pair')}"


def _bound(todo: Sequence[Pair], asked: RunPlan) -> str:
    """Return the longest time that the solves can take, with its parts, as text."""
    if not todo:
        return "nothing"
    limits = [pair.limits for pair in todo]
    first = sum(limit.seconds + GRACE for limit in limits) / asked.jobs
    repeats = sum(min(limit.repeat_below, limit.seconds) * (limit.repeats - 1) for limit in limits) / asked.jobs
    recorded = sum(pair.limits.seconds + GRACE for pair in todo if _recorded(pair)) / asked.jobs
    shortest, longest = (duration(end(limit.seconds for limit in limits)) for end in (min, max))
    limit = shortest if shortest == longest else f"{shortest} to {longest}"
    parts = [f"{duration(first)} if every solve times out ({limit} and {GRACE:g} s)"]
    if repeats:
        parts.append(f"{duration(repeats)} for repeats of short ones")
    if recorded:
        parts.append(f"{duration(recorded)} for histories")
    if asked.retry:
        parts.append(f"{counted(asked.retry, 'retry', 'retries')}, as much again each")
    slots = f" with {asked.jobs} solves at a time" if asked.jobs > 1 else ""
    whole = (first + repeats + recorded) * (1 + asked.retry)
    return f"worst case {duration(whole)}{slots} ({'; '.join(parts)}); conversions and judging come on top"


def _recorded(pair: Pair) -> bool:
    return pair.limits.history and Trait.HISTORY in solvers.get(pair.entry.solver).spec.traits
