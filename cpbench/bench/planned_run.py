"""Carries a plan out: its pairs into the results file, what it was made with beside them, retries, and the verdict."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from cpbench.bench import machine, reference, skipped
from cpbench.bench.block import predecessors
from cpbench.bench.events import Done, Event
from cpbench.bench.planning.assembly import Assembly
from cpbench.bench.planning.plan import Pair
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.planning.selection import RERUN, RETRIED
from cpbench.bench.planning.tunings import Tuning
from cpbench.bench.results.store import Store
from cpbench.bench.runner import Executor, execute
from cpbench.bench.slot import FELL_BACK, Slot
from cpbench.errors import CpbenchError
from cpbench.plurals import counted
from cpbench.solvers.base import Trait, solvers
from cpbench.solvers.external import declared


class RoundObserver(Protocol):
    """An observer of how a run goes."""

    def begin(self, planned: Sequence[Pair], pending: Collection[str]) -> None:
        """Note that the run, or another round of it, begins."""
        ...

    def progress(self, event: Event) -> None:
        """Take an event of the runner."""
        ...

    def end(self) -> None:
        """Note that the round ended, whatever the reason."""
        ...


def require_answers(asked: RunPlan, planned: Sequence[Pair]) -> None:
    """Refuse steps that are to start from answers that nobody keeps."""
    if asked.keep != "all" and any(pair.scene for pair in planned):
        raise CpbenchError(
            f"--keep {asked.keep} with --start previous: a step starts from the kept answer to the one before; leave "
            "--keep out"
        )


def enter_pairs(store: Store, asked: RunPlan, assembly: Assembly, command: str) -> list[Pair]:
    """Put the plan into the results: its rows, its files, what is to be run again, and how it was asked for. The pairs
    that have a row: all but those that an earlier command had to leave out.

    Raises StoreError, with the rows as they were, when the file was made with other limits.
    """
    before = store.meta()
    pairs = skipped.planned(store, assembly.pairs, asked.rerun)
    store.plan(pairs)
    if asked.rerun:
        store.reset(RERUN[asked.rerun], [pair.key for pair in pairs])
        _reset_followers(store, pairs)
    planned = {pair.fingerprint for pair in pairs}
    surveyed = {survey.fingerprint: survey.features for survey in reversed(assembly.surveys)}
    store.note_features({fingerprint: facts for fingerprint, facts in surveyed.items() if fingerprint in planned})
    store.note_files(assembly.read, assembly.refused)
    store.set_meta(
        command=command,
        cpbench=machine.versions().get("cpbench", ""),
        date=time.strftime("%Y-%m-%d %H:%M"),
        seed=asked.seed,
        machine=machine.describe(),
        versions=machine.versions(),
        jobs=asked.jobs,
        reference=reference.NAME,
        builtin=asked.builtin,
        formats=_formats(before.get("formats", {}), assembly.read),
        plan=asked.effective(assembly.found),
    )
    return pairs


def run_pending(
    executor: Executor | Sequence[Slot],
    store: Store,
    asked: RunPlan,
    planned: Sequence[Pair],
    observer: RoundObserver,
    absent: Mapping[str, str] | None = None,
) -> None:
    """Run what is pending, then again what crashed or ran out of time, as often as the plan says. What cannot be run is
    left out, with the solvers that are `absent` (`skipped.settle`).

    Raises SealError when, at the end, a row is not as this run wrote it.
    """
    mine = store.pending() & {pair.key for pair in planned}
    versions: dict[str, str] = {}

    def on_event(event: Event) -> None:
        if isinstance(event, Done) and event.outcome.version:
            versions[event.pair.entry.solver] = event.outcome.version
        observer.progress(event)

    try:
        for attempt in range(1 + asked.retry):
            if attempt and not store.reset(RETRIED, mine):
                break
            _reset_followers(store, planned)
            observer.begin(planned, store.pending())
            try:
                execute(executor, store, planned, asked.seed, on_event)
            finally:
                observer.end()
    finally:
        skipped.settle(store, planned, absent or {})
        store.set_meta(solvers=_sheets(store.meta().get("solvers", {}), planned, versions, asked.tunings))
    store.require_unchanged()


def _reset_followers(store: Store, planned: Sequence[Pair]) -> None:
    """Plan steps that began cold, because the step before had failed, again when that one is."""
    ordered = sorted((pair for pair in planned if pair.scene), key=lambda pair: pair.step)
    before = predecessors(ordered)
    pending = store.pending()
    again: list[str] = []
    for pair in ordered:
        if pair.key in pending or pair.key not in before or before[pair.key].key not in pending:
            continue
        if (store.row(pair.key).started or "").startswith(FELL_BACK):
            again.append(pair.key)
            pending.add(pair.key)
    if again:
        store.reset(None, again)


def statuses(path: Path) -> dict[str, str]:
    """Return status of every row of a results file by key, and of the pairs that were left out; of none where there
    is no such file."""
    if not path.exists():
        return {}
    with Store(path) as store:
        return {**skipped.statuses(store), **{row.key: row.status for row in store.rows()}}


def gaps(store: Store, assembly: Assembly) -> list[str]:
    """Return what the plan asked for and the results lack: nothing after a run that was carried out to its end."""
    waiting = store.pending() & {pair.key for pair in assembly.pairs}
    rows = [f"{len(waiting)} of {counted(len(assembly.pairs), 'pair')} not run"] if waiting else []
    files = [f"nobody could say what {address} holds" for address in assembly.unread[:1]]
    more = [f"nor what {len(assembly.unread) - 1} more files hold"] if len(assembly.unread) > 1 else []
    return [*rows, *files, *more]


def failures(store: Store, asked: RunPlan, planned: Sequence[Pair]) -> Counter[str]:
    """Return how many of the planned pairs ended in a status that the plan calls a failure."""
    if not asked.fail_on:
        return Counter()
    keys = {pair.key for pair in planned}
    ended = [*((row.key, row.status) for row in store.rows()), *skipped.statuses(store).items()]
    return Counter(status for key, status in ended if key in keys and status in asked.fail_on)


def _formats(before: Mapping[str, str], read: Mapping[str, str | None]) -> dict[str, str]:
    """Return the format by which each file of the results was read, where one was said."""
    kept = {address: name for address, name in before.items() if address not in read}
    return kept | {address: name for address, name in read.items() if name is not None}


def _plugin_of_variant(name: str) -> str:
    """Return the file that makes the solver known of which `name` is a variant: another command needs both."""
    solver, at, _ = name.partition(declared.AT)
    return declared.origin(solver)[0] if at and solver in solvers else ""


def _sheets(
    before: Mapping[str, Mapping[str, Any]],
    planned: Sequence[Pair],
    versions: Mapping[str, str],
    tunings: Sequence[Tuning],
) -> dict[str, Any]:
    """Return what the results say of each solver in them: those of earlier commands stay, and so do the version of one
    that had nothing left to do and how one was tuned."""
    sheets: dict[str, Any] = dict(before)
    tuned = {tuning.label: tuning.as_data() for tuning in tunings}
    for pair in planned:
        spec = solvers.get(pair.entry.solver).spec
        plugin, written = declared.origin(spec.name)
        sheets[pair.label] = {
            "name": spec.name,
            "node": spec.node,
            "method": spec.method,
            "launches": Trait.LAUNCHES in spec.traits,
            "version": versions.get(spec.name) or before.get(pair.label, {}).get("version", ""),
            "licence": spec.licence,
            "publishing": spec.publishing,
            "summary": spec.summary,
            "citation": spec.citation,
            "plugin": plugin,
            "variant_of": _plugin_of_variant(spec.name),
            "written": written,
            "tuned": tuned.get(pair.entry.label) or before.get(pair.label, {}).get("tuned"),
        }
    return sheets
