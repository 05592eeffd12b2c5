"""Lines on a run: what is planned, and how it ended."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cpbench.bench import skipped
from cpbench.bench.planning.assembly import Assembly
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.processes.isolation import address_space, address_space_allowed
from cpbench.bench.results.store import Store
from cpbench.foundation import kernel_cache
from cpbench.foundation.plain_text import on_one_line, printable
from cpbench.foundation.plurals import counted, some_of, summary
from cpbench.verification import CONTRADICTION, Status

if TYPE_CHECKING:
    import pandas as pd

    from cpbench.analysis.contradictions import Contradiction

ABSENT = 4
"""Largest number of solvers of which the end of a run says why they could not run."""


@dataclass(frozen=True)
class Ending:
    """The last lines of a run: results and files (`lines`), what went wrong (`failures`), and whether it failed."""

    lines: tuple[str, ...]
    failures: tuple[str, ...]
    failed: bool


def planned(assembly: Assembly) -> Iterator[str]:
    """Yield what a reader of the results should know before they are there."""
    if remark := kernel_cache.remark():
        yield on_one_line(remark)
    allowed = address_space_allowed()
    if any(allowed < (pair.limits.memory or 0) + address_space() for pair in assembly.pairs):
        yield (
            f"the system allows a process {allowed / 2**30:.3g} GiB of address space (ulimit -v), less than the memory "
            "limit of a solve: solvers get what is left of it"
        )
    yield from (on_one_line(f"same problem, run once: {address} is {twin}") for address, twin in assembly.twins)
    if assembly.pairs and assembly.idle:
        yield f"no route leads to {', '.join(assembly.idle)}: no row"


def refused(addresses: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Yield the problems that could not be read, with the reasons."""
    for address, reason in addresses:
        yield on_one_line(f"refused: {reason if address in reason else f'{address}: {reason}'}")


def named(plan: RunPlan, refused: Sequence[tuple[str, str]]) -> list[str]:
    """Return the refused problems that the plan names, and does not only find in a folder or by a pattern."""
    asked = {str(text) for part in plan.sets for text in part.problems}
    return [on_one_line(address) for address, _ in refused if {address, address.partition("::")[0]} & asked]


def not_available(store: Store) -> Iterator[str]:
    """Yield the reasons why solvers could not run, a line for each of the first; the report has all."""
    rows = [row for row in store.rows() if row.status == Status.UNAVAILABLE]
    reasons = {row.solver: ((row.message or "").strip().splitlines() or ["no reason"])[-1] for row in rows}
    for name, reason in sorted(reasons.items())[:ABSENT]:
        yield f"not available: {name}: {printable(reason)}"
    if len(reasons) > ABSENT:
        yield f"and {counted(len(reasons) - ABSENT, 'more solver')}: cpbench doctor says what each lacks"


def title(plan: RunPlan) -> str:
    """Return the title of the report."""
    if plan.builtin:
        return "The built-in suite"
    return f"The {plan.suite} suite" if plan.suite else plan.results.stem


def ending(
    plan: RunPlan, store: Store, assembly: Assembly, table: pd.DataFrame, found: Sequence[Contradiction]
) -> Ending:
    """Return the outcome of a run; it failed where rows are missing, or as `fail_on` says.

    Parameters
    ----------
    table : all rows of the store. found : the contradictions between them.
    """
    from cpbench.analysis.contradictions import involving
    from cpbench.analysis.remarks import remarks

    counts = store.counts()
    nothing = "none in this shard" if plan.shard != (1, 1) else "none could be run"
    lines = [f"{counted(sum(counts.values()), 'pair')}: {summary(counts) or nothing}"]
    wrong = table["label"][table["status"] == str(Status.WRONG)].value_counts()
    if len(wrong):
        lines.append(f"wrong answers by {', '.join(f'{label} ({count})' for label, count in wrong.items())}")
    lines += [*map(on_one_line, remarks(table)), f"results: {plan.results}"]
    failures: list[str] = []
    gaps = skipped.gaps(store, assembly)
    if gaps:
        failures.append(f"rows are missing: {', '.join(gaps)}; the same command goes on")
    absent = skipped.not_run(store, assembly)
    if absent:
        failures.append(f"named and not run: {some_of(absent, ABSENT)}")
    unreadable = named(plan, assembly.refused)
    if unreadable:
        failures.append(f"named and not read: {some_of(unreadable, ABSENT)}")
    listed = skipped.failures(store, plan, assembly.pairs)
    if CONTRADICTION in plan.fail_on:
        listed += Counter({CONTRADICTION: len(involving(found, (pair.key for pair in assembly.pairs)))})
    if listed:
        failures.append(f"{summary(listed)} (--fail-on)")
    empty = not counts and plan.shard == (1, 1)
    return Ending(tuple(lines), tuple(failures), bool(failures) or empty)
