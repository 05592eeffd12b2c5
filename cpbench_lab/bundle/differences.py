"""How a bundle that was run again compares with the run in it, in lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError
from cpbench.foundation.plurals import counted
from cpbench_lab.bundle.agreement import Agreement, ordered
from cpbench_lab.bundle.reproduction import Bundle

LISTED = 20
"""Differences that are shown; the two results files have all."""


def status_lines(bundle: Bundle, outcome: Agreement) -> Iterator[str]:
    """Yield the statuses that differ, what was not compared, and how many agree."""
    for difference in ordered(outcome.different)[:LISTED]:
        now = difference.now or "not planned here"
        why = " (a limit: another machine may end otherwise)" if difference.limited else ""
        message = f": {difference.message.splitlines()[0][:120]}" if difference.message.strip() else ""
        yield f"differs: {difference.problem}, {difference.label}: {difference.before} → {now}{why}{message}"
    if len(outcome.different) > LISTED:
        yield f"and {len(outcome.different) - LISTED} more: cpbench compare {bundle.results} {bundle.again}"
    yield from _not_compared("solver is missing here", outcome.absent)
    yield from _not_compared("problem is not here", outcome.lost)
    if outcome.elsewhere:
        yield f"not compared: {counted(outcome.elsewhere, 'pair')} that did not run there, or elsewhere"
    yield f"{outcome.same} of {outcome.compared} statuses agree"


def _not_compared(cause: str, counts: Mapping[str, int]) -> Iterator[str]:
    if counts:
        named = ", ".join(f"{name} ({count})" for name, count in list(counts.items())[:LISTED])
        more = f" and {len(counts) - LISTED} more" if len(counts) > LISTED else ""
        yield f"not compared: {counted(sum(counts.values()), 'pair')} whose {cause}: {named}{more}"


def time_lines(bundle: Bundle, name: str) -> Iterator[str]:
    """Yield the times of both runs beside each other, as `cpbench compare` does; they decide nothing here."""
    from cpbench.analysis.comparison import ComparisonSide, Thresholds
    from cpbench.analysis.comparison import compare as compare_runs
    from cpbench.report.comparison import words
    from cpbench.report.text import cut, one_line

    with Store(bundle.results) as store:
        there = ComparisonSide(name, store.table(), store.meta(), store.machines())
    with Store(bundle.again) as store:
        here = ComparisonSide("here", store.table(), store.meta(), store.machines())
    try:
        # the ratio of two machines is what is asked for here: it tells how fast this one is, and decides nothing
        comparison = compare_runs(there, here, Thresholds(same_machine=True))
    except CpbenchError:
        return  # no pair in common, which the statuses show
    timed = [suite for suite in comparison.suites if suite.timed]
    if timed:
        yield "time here over there, geometric mean of each label (decides nothing, machines differ):"
    for suite in timed:
        yield f"  {one_line(suite.label)}: {words.times_of(suite)} ({counted(suite.timed, 'pair')})"
    yield from (f"note: {cut(note, 300)}" for note in comparison.notes)
