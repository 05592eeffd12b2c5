"""Rows of answers made elsewhere: judged here on the source problem, and marked by their origin.

Every problem of a formulation with some answer has a row, even without an answer. Its times, `solve` and `reported`,
are those that were reported, by another machine, under unknown limits.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cpbench import storage, verification
from cpbench.bench import machine, multipliers
from cpbench.bench.judging import with_others
from cpbench.bench.planning.plan import Entry, Limits, Pair, Request
from cpbench.bench.results import answer_files
from cpbench.bench.results.answer_files import ENDINGS, ForeignAnswer, Names, Reported
from cpbench.bench.results.rows import Outcome, Planned, pack_answer
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError, FormatError, PointError, StoreError
from cpbench.formulations.base import Problem
from cpbench.verification import Status

REQUEST = "imported"
"""In place of a route, which is not known here. It ends the label, so that tables show it."""
NO_ANSWER = "no answer in the folder"
ELSEWHERE = "another machine"
"""The origin of answers without a more precise one."""


@dataclass(frozen=True)
class Origin:
    """The origin of answers: what made them, where, with how many threads, and by what they are judged."""

    solver: str
    machine: str = ELSEWHERE
    threads: int = 1
    tolerance: float = 1e-6
    measure: str | None = None


@dataclass
class Imported:
    """The outcome of an import: rows by status, answers without a time, problems without an answer, a line for every
    answer that is none and for everything that was not used."""

    counts: Counter[str] = field(default_factory=Counter)
    untimed: int = 0
    unanswered: int = 0
    broken: list[str] = field(default_factory=list)
    stray: list[str] = field(default_factory=list)
    refused: list[tuple[str, str]] = field(default_factory=list)
    unasked: Counter[str] = field(default_factory=Counter)


def import_answers(
    store: Store,
    source: Path,
    addresses: Sequence[str],
    origin: Origin,
    *,
    format: str | None = None,
    times: Path | None = None,
    command: str = "",
    force: bool = False,
) -> Imported:
    """Put a row for every problem into `store`; `force` replaces rows of an earlier import.

    Raises CpbenchError when answers or reported facts are ambiguous, StoreError when a row exists.
    """
    done = Imported()
    asked = _survey(addresses, format, origin, done)
    names = Names((pair.problem, pair.fingerprint) for pair in asked.values())
    found, stray = answer_files.find(source, names)
    reported, unknown = answer_files.reported(times, names)
    done.stray = [*stray, *unknown]
    if not found:
        raise CpbenchError(f"{source}: none of its answers is to a problem that was asked ({done.stray[0]})")
    nodes = {asked[fingerprint].node for fingerprint in found}
    done.unasked = Counter(pair.node for pair in asked.values() if pair.node not in nodes)
    wanted = [pair for pair in asked.values() if pair.node in nodes]
    _require_new(store, wanted, force)
    _note(store, origin, wanted, command, format, done)
    for pair in wanted:
        answer = found.get(pair.fingerprint)
        outcome = _judged(pair, answer, reported.get(pair.fingerprint, Reported()), origin)
        store.put(Planned.of(pair), outcome)
        done.counts[outcome.status] += 1
        if answer is None:
            done.unanswered += 1
        elif outcome.status == Status.ERROR:
            done.broken.append(str(outcome.message))
        else:
            done.untimed += outcome.solve is None
    return done


def _survey(addresses: Iterable[str], format: str | None, origin: Origin, done: Imported) -> dict[str, Pair]:
    """Return the pairs by fingerprint; files that cannot be read are noted."""
    result: dict[str, Pair] = {}
    limits: Any = Limits(None, None, origin.threads, None)  # pyright: ignore[reportArgumentType]
    for address in addresses:
        try:
            problem = storage.load(address, format=format)
        except FormatError as reason:
            done.refused.append((address, str(reason)))
            continue
        sequence = getattr(problem, "sequence", None)
        pair = Pair(
            address=address,
            problem=problem.name,
            fingerprint=problem.fingerprint,
            node=problem.node,
            family=problem.info.family,
            sizes=problem.sizes(),
            request=Request(REQUEST),
            entry=Entry(origin.solver),
            target=problem.node,
            tolerance=origin.tolerance,
            limits=limits,
            format=format,
            measure=origin.measure,
            sequence=sequence.name if sequence else "",
            step=sequence.step if sequence else 0,
        )
        result.setdefault(pair.fingerprint, pair)
    return result


def _require_new(store: Store, wanted: Sequence[Pair], force: bool) -> None:
    there = {row.key for row in store.rows()} & {pair.key for pair in wanted}
    if there and not force:
        first = next(pair for pair in wanted if pair.key in there)
        more = f" (and {len(there) - 1} more)" if len(there) > 1 else ""
        raise StoreError(f"{store.path}: has {first.label} on {first.problem} already{more}; --force replaces it")


def _note(
    store: Store, origin: Origin, wanted: Sequence[Pair], command: str, format: str | None, done: Imported
) -> None:
    """Note the facts of the solver for the report, and those of the file when it is new."""
    meta = store.meta()
    if "command" not in meta:
        store.set_meta(
            command=command, cpbench=machine.versions().get("cpbench", ""), date=time.strftime("%Y-%m-%d %H:%M")
        )
    label = wanted[0].label
    sheet = {"name": label, "node": "", "version": "", "summary": f"answers made elsewhere: {origin.machine}"}
    store.set_meta(solvers={**meta.get("solvers", {}), label: sheet})
    if format is not None:
        store.set_meta(formats={**meta.get("formats", {}), **{pair.address: format for pair in wanted}})
    store.note_files([pair.address for pair in wanted], done.refused)


def _judged(pair: Pair, answer: ForeignAnswer | None, reported: Reported, origin: Origin) -> Outcome:
    """Return the outcome of an answer, or of what is reported without one."""
    ending = reported.claim if reported.claim in ENDINGS else ""
    claim = "" if ending else reported.claim or ("solved" if answer is not None else "")
    verdict, blob, message, verify = verification.no_answer(pair.tolerance), None, "", None
    if answer is None:
        message = NO_ANSWER
    else:
        try:
            problem: Problem = storage.load(pair.address, format=pair.format)
            begun = time.perf_counter()
            point, message = multipliers.whole(problem, answer.read(problem), pair.tolerance)
            verdict = with_others(verification.judge(problem, point, pair.tolerance, pair.measure), problem, point)
            if message:
                verdict = multipliers.marked(verdict)
            verify, blob = time.perf_counter() - begun, pack_answer(point)
        except (FormatError, PointError) as refusal:
            message = f"the answer is not valid: {refusal}"
    status = ending or str(verification.status(verdict, claim))
    if answer is not None and blob is None and not ending:
        status = str(Status.ERROR)
    counters: Mapping[str, int] = {} if reported.iterations is None else {"iterations": reported.iterations}
    return Outcome(
        status=status,
        claim=claim,
        error=verdict.error,
        flags=",".join(verdict.flags),
        message=message,
        parts=json.dumps({**verdict.judged, **verdict.parts}),
        counters=json.dumps(counters),
        solve=reported.seconds,
        reported=reported.seconds,
        verify=verify,
        attempts=1,
        origin=origin.machine,
        finished=time.strftime("%Y-%m-%dT%H:%M:%S"),
        answer=blob,
    )
