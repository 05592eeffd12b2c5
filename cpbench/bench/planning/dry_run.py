"""A plan in lines of text: the matrix of problems and solvers, its sets, what is done, the longest time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence

from cpbench.bench.planning import grids
from cpbench.bench.planning.assembly import Assembly
from cpbench.bench.planning.plan import Pair
from cpbench.bench.planning.quantities import duration
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.planning.selection import RERUN
from cpbench.bench.time_limits import GRACE
from cpbench.foundation.plurals import counted
from cpbench.solvers.base import Trait, solvers

ROWS = 60
"""Most problems that are listed singly; more are counted by family."""
WIDTH = 44


def lines(asked: RunPlan, assembly: Assembly, before: Mapping[str, str], room: int | None = None) -> Iterator[str]:
    """Yield the plan for a reader; `before` has the status of every row in the results file, by key.

    Of a matrix that is wider than `room` columns only the sums are shown.
    """
    yield from _matrix(assembly.pairs, room)
    yield ""
    yield from _sets(assembly)
    todo = to_run(assembly.pairs, before, asked.rerun)
    if asked.shard != (1, 1):
        whole = len({pair.key for part in assembly.parts for pair in part.pairs})
        yield f"shard {asked.shard[0]} of {asked.shard[1]}: {len(assembly.pairs)} of {counted(whole, 'pair')}"
    if before:
        done, every = len(assembly.pairs) - len(todo), len(assembly.pairs)
        yield f"{asked.results} has {done} of the {counted(every, 'pair')}; {len(todo)} to be run"
    yield f"{counted(len(todo), 'pair')} to run: {_bound(todo, asked)}"


def to_run(pairs: Sequence[Pair], before: Mapping[str, str], rerun: str) -> list[Pair]:
    """Return the pairs without those whose rows are kept."""
    again: Collection[str] | None = RERUN[rerun] if rerun else ()
    done = {pair.key: before[pair.key] for pair in pairs if before.get(pair.key, "not_run") != "not_run"}
    skipped = {key for key, status in done.items() if again is not None and status not in again}
    return [pair for pair in pairs if pair.key not in skipped]


def _matrix(pairs: Sequence[Pair], room: int | None) -> Iterator[str]:
    """Yield the numbers of pairs by problem and solver, or their sums; a key below names the solvers."""
    names = sorted({pair.entry.solver for pair in pairs})
    single = len({pair.address for pair in pairs}) <= ROWS
    counts = Counter((_row(pair, single), pair.entry.solver) for pair in pairs)
    rows = list(
        dict.fromkeys(_row(pair, single) for pair in sorted(pairs, key=lambda p: (p.node, p.family, p.address)))
    )
    width = max(3, *(len(str(n)) for n in counts.values()), 0) + 1
    problems = Counter({row: len(there) for row, there in _problems(pairs, single).items()})
    head = "problem" if single else "family"
    fits = room is None or WIDTH + width * (len(names) + 1) + 3 <= room
    numbers = "".join(f"{i:>{width}}" for i in range(1, len(names) + 1)) if fits else ""
    yield f"{head:<{WIDTH}}{numbers}{'all' if fits else 'pairs':>{width + 3}}"
    for row in rows:
        title = row if single else f"{row}, {counted(problems[row], 'problem')}"
        cells = [counts[row, name] for name in names]
        shown = "".join(f"{count or '.':>{width}}" for count in cells) if fits else ""
        yield f"{_fitted(title):<{WIDTH}}{shown}{sum(cells):>{width + 3}}"
    yield "solvers: " + ", ".join(f"{i} {name}" if fits else name for i, name in enumerate(names, 1))


def _row(pair: Pair, single: bool) -> str:
    return f"{pair.node} {pair.problem or pair.address}" if single else f"{pair.node} {pair.family}".strip()


def _problems(pairs: Sequence[Pair], single: bool) -> dict[str, set[str]]:
    result: dict[str, set[str]] = {}
    for pair in pairs:
        result.setdefault(_row(pair, single), set()).add(pair.fingerprint)
    return result


def _fitted(text: str) -> str:
    return text if len(text) < WIDTH else f"{text[: WIDTH - 2]}…"


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


def _shares(todo: Sequence[Pair], asked: RunPlan) -> tuple[float, float, float]:
    """Return the parts of the longest time of a run [s]: first solves, repeats, solves whose history is kept."""
    first = sum(pair.limits.seconds + GRACE for pair in todo) / asked.jobs
    more = (
        sum(min(pair.limits.repeat_below, pair.limits.seconds) * (pair.limits.repeats - 1) for pair in todo)
        / asked.jobs
    )
    again = sum(pair.limits.seconds + GRACE for pair in todo if _recorded(pair)) / asked.jobs
    return first, more, again


def _bound(todo: Sequence[Pair], asked: RunPlan) -> str:
    """Return the longest time that the solves can take, with its parts, as text."""
    if not todo:
        return "nothing"
    first, more, again = _shares(todo, asked)
    limits = sorted({pair.limits.seconds for pair in todo})
    limit = duration(limits[0]) if len(limits) == 1 else f"{duration(limits[0])} to {duration(limits[-1])}"
    parts = [f"{duration(first)} if every solve times out ({limit} and {GRACE:g} s)"]
    if more:
        parts.append(f"{duration(more)} for repeats of short ones")
    if again:
        parts.append(f"{duration(again)} for histories")
    if asked.retry:
        parts.append(f"{counted(asked.retry, 'retry', 'retries')}, as much again each")
    slots = f" with {asked.jobs} solves at a time" if asked.jobs > 1 else ""
    longest = (first + more + again) * (1 + asked.retry)
    return f"worst case {duration(longest)}{slots} ({'; '.join(parts)}); conversions and judging come on top"


def _recorded(pair: Pair) -> bool:
    return pair.limits.history and Trait.HISTORY in solvers.get(pair.entry.solver).spec.traits
