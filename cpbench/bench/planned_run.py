"""A planned run: its pairs in the results file, with how they were made; running them, retries, and what is missing."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from cpbench.bench import machine, reference, skipped
from cpbench.bench.block import predecessors
from cpbench.bench.events import Done, Event
from cpbench.bench.pair_run import FELL_BACK
from cpbench.bench.planning import grids
from cpbench.bench.planning.assembly import Assembly
from cpbench.bench.planning.plan import Pair
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.planning.selection import RERUN, RETRIED
from cpbench.bench.results import problem_files
from cpbench.bench.results.store import Store
from cpbench.bench.runner import Executor, execute
from cpbench.bench.slot import Slot
from cpbench.errors import CpbenchError
from cpbench.foundation.plurals import counted
from cpbench.solvers.base import Trait, solvers
from cpbench.solvers.external import declared
from cpbench.verification import Status


class RoundObserver(Protocol):
    """An observer of the rounds of a run."""

    def begin(self, planned: Sequence[Pair], pending: Collection[str]) -> None:
        """Take note that a round begins: the first run of pending pairs, or a retry."""
        ...

    def progress(self, event: Event) -> None:
        """Take an event of the runner."""
        ...

    def end(self) -> None:
        """Take note that the round has ended, whatever the reason."""
        ...


def require_answers(asked: RunPlan, planned: Sequence[Pair]) -> None:
    """Raise CpbenchError where steps are to start from answers that are not kept."""
    if asked.keep != "all" and any(pair.scene for pair in planned):
        raise CpbenchError(
            f"--keep {asked.keep} with --start previous: a step starts from the kept answer to the one before; leave "
            "--keep out"
        )


def enter_pairs(store: Store, asked: RunPlan, assembly: Assembly, command: str) -> list[Pair]:
    """Enter a plan in the results: its rows, its files, what is to be run again, and the plan itself.

    Returns the pairs that have a row: all but those that an earlier command skipped. Raises StoreError, with the rows
    unchanged, when the file was made with other limits.
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
        files={**before.get("files", {}), **problem_files.digests(assembly.read)},
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
    """Run the pending pairs, then retry those that crashed or timed out as often as the plan says. Pairs that cannot be
    run are skipped, as are `absent` solvers (`skipped.settle`).
    """
    mine = store.pending() & {pair.key for pair in planned}
    versions: dict[str, str] = {}

    def on_event(event: Event) -> None:
        if isinstance(event, Done) and event.outcome.version:
            versions[event.pair.entry.solver] = event.outcome.version
        observer.progress(event)

    try:
        for attempt in range(1 + asked.retry):
            # only rows of this command: those of earlier ones are retried when somebody asks for it
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
        store.set_meta(solvers=_sheets(store.meta().get("solvers", {}), planned, versions))


def _reset_followers(store: Store, planned: Sequence[Pair]) -> None:
    """Plan steps again that began cold because the preceding step had failed, where that one is run again."""
    ordered = sorted((pair for pair in planned if pair.scene), key=lambda pair: pair.step)
    before = predecessors(ordered)
    pending = store.pending()
    again: list[str] = []
    for pair in ordered:
        if pair.key in pending or pair.key not in before or before[pair.key].key not in pending:
            continue
        # a step that did start from an answer keeps its row: another solve of the same step would give the same start
        if (store.row(pair.key).started or "").startswith(FELL_BACK):
            again.append(pair.key)
            pending.add(pair.key)
    if again:
        store.reset(None, again)


def statuses(path: Path) -> dict[str, str]:
    """Return the status of every row and of every skipped pair of a results file, by key; nothing where there is no
    such file."""
    if not path.exists():
        return {}
    with Store(path) as store:
        return {**skipped.statuses(store), **{row.key: row.status for row in store.rows()}}


def gaps(store: Store, assembly: Assembly) -> list[str]:
    """Return what the plan asked for and the results lack; nothing after a complete run."""
    waiting = store.pending() & {pair.key for pair in assembly.pairs}
    rows = [f"{len(waiting)} of {counted(len(assembly.pairs), 'pair')} not run"] if waiting else []
    files = [f"the content of {address} is unknown" for address in assembly.unread[:1]]
    more = [f"and that of {len(assembly.unread) - 1} more files"] if len(assembly.unread) > 1 else []
    return [*rows, *files, *more]


def not_run(store: Store, assembly: Assembly) -> list[str]:
    """Return the solvers that were named and could not be run: those with rows that are `unavailable`, and those that
    no route leads to."""
    status = str(Status.UNAVAILABLE)
    absent: Counter[str] = Counter()
    if store.counts().get(status):
        named = {pair.key for pair in assembly.pairs if pair.named}
        absent = Counter(row.solver for row in store.rows() if row.status == status and row.key in named)
    asked = {name for part in assembly.parts if part.asked.chosen for name in grids.named(part.asked.solvers)}
    return [
        *(f"{name} ({counted(rows, 'row')} {status})" for name, rows in sorted(absent.items())),
        *(f"{name} (no route)" for name in assembly.idle if name in asked),
    ]


def failures(store: Store, asked: RunPlan, planned: Sequence[Pair]) -> Counter[str]:
    """Count the planned pairs that ended in a status which the plan calls a failure."""
    if not asked.fail_on:
        return Counter()
    keys = {pair.key for pair in planned}
    ended = [*((row.key, row.status) for row in store.rows()), *skipped.statuses(store).items()]
    return Counter(status for key, status in ended if key in keys and status in asked.fail_on)


def _formats(before: Mapping[str, str], read: Mapping[str, str | None]) -> dict[str, str]:
    """Return the format by which each file of the results was read, where one was given."""
    kept = {address: name for address, name in before.items() if address not in read}
    return kept | {address: name for address, name in read.items() if name is not None}


def _plugin_of_variant(name: str) -> str:
    """Return the file that declares the solver of which `name` is a variant: another command needs both."""
    solver, at, _ = name.partition(declared.AT)
    return declared.origin(solver) if at and solver in solvers else ""


def _sheets(
    before: Mapping[str, Mapping[str, Any]],
    planned: Sequence[Pair],
    versions: Mapping[str, str],
) -> dict[str, Any]:
    """Return the facts of each solver for the results: those of earlier commands are kept, and so is the version of a
    solver that had nothing left to do."""
    sheets: dict[str, Any] = dict(before)
    for pair in planned:
        spec = solvers.get(pair.entry.solver).spec
        sheets[pair.label] = dict(before.get(pair.label, {})) | {
            "name": spec.name,
            "node": spec.node,
            "method": spec.method,
            "native": solvers.get(pair.entry.solver).origin == "native",
            "launches": Trait.LAUNCHES in spec.traits,
            "version": versions.get(spec.name) or before.get(pair.label, {}).get("version", ""),
            "licence": spec.licence,
            "publishing": spec.publishing,
            "summary": spec.summary,
            "citation": spec.citation,
            "plugin": declared.origin(spec.name),
            "variant_of": _plugin_of_variant(spec.name),
        }
    return sheets
