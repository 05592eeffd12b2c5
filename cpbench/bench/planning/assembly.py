"""Turns a plan into pairs: every problem is surveyed once, every set selects its own, no pair is planned twice."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from cpbench.bench import readers
from cpbench.bench.messages import Surveyed
from cpbench.bench.planning import grids, plan, selection
from cpbench.bench.planning.plan import Entry, Pair, Request
from cpbench.bench.planning.run_plan import ProblemSet, RunPlan
from cpbench.bench.slot import Slot, Unread
from cpbench.bench.starts import EVERY, each_start, parse_start
from cpbench.errors import CpbenchError, NoRoute
from cpbench.solvers.base import missing, solvers

Reading = Callable[[Sequence[str]], Iterable[str]]
"""Shows the progress of reading files."""


@dataclass(frozen=True)
class PlannedSet:
    """A set of the plan with its problems (addresses by fingerprint), its solvers and its pairs."""

    asked: ProblemSet
    problems: Mapping[str, str]
    entries: Sequence[Entry]
    pairs: Sequence[Pair]


@dataclass(frozen=True)
class Assembly:
    """The pairs of a plan, and findings about its files.

    `read`, `refused` : addresses of files that are problems, and of those that are none, with the reason. `unread` :
    those among the latter whose content is unknown: the plan lacks their pairs, if they have any.
    `absent` : how to install the solvers that are missing and were not asked for by name.
    `twins` : (address, address of the same problem before it). `surveys` : facts of problems, in their order.
    """

    parts: Sequence[PlannedSet]
    pairs: Sequence[Pair]
    read: Mapping[str, str | None]
    refused: Sequence[tuple[str, str]]
    unread: Sequence[str]
    twins: Sequence[tuple[str, str]]
    surveys: Sequence[Surveyed] = field(repr=False)
    absent: Mapping[str, str] = field(default_factory=dict)

    @property
    def found(self) -> dict[str, list[str]]:
        """Fingerprints of the problems of every set."""
        return {part.asked.name: list(part.problems) for part in self.parts}

    @property
    def idle(self) -> list[str]:
        """Solvers that were asked for by name and that no route leads to from any problem."""
        busy = {pair.entry.solver for part in self.parts for pair in part.pairs}
        asked = [
            entry.solver for part in self.parts if part.asked.chosen for entry in part.entries if not entry.nearest
        ]
        return [name for name in dict.fromkeys(asked) if name not in busy]

    def require_pairs(self) -> None:
        """Raise CpbenchError or NoRoute for a plan without pairs, before anything is written.

        A shard may be empty: it gets an empty results file, so that all shards can be merged.
        """
        if any(part.pairs for part in self.parts):
            return
        if not self.surveys:
            more = f" (and {len(self.refused) - 1} more files refused)" if len(self.refused) > 1 else ""
            raise CpbenchError(f"{self.refused[0][1]}{more}")
        first = next((address for part in self.parts for address in part.problems.values()), None)
        if first is None:
            raise CpbenchError(f"none of {len(self.surveys)} problems is what the plan selects")
        raise NoRoute(
            f"no route leads from {first} to any of the solvers asked for; "
            f"see: cpbench route {shlex.quote(first)} --explain"
        )


def assemble(asked: RunPlan, slot: Slot, builtin: Callable[[], Path], reading: Reading = list) -> Assembly:
    """Return the pairs of a plan; `builtin` is called for the folder of the built-in problems if a set names it.

    Raises CpbenchError when the sets contradict each other, or name something that does not exist.
    """
    named = [grids.named(part.solvers) if part.chosen else set[str]() for part in asked.sets]
    every = [_entries(part) for part in asked.sets]
    entries = [
        [e for e in all_ if e.solver in named_here or not _missing(e)]
        for all_, named_here in zip(every, named, strict=True)
    ]
    requests = [_requests(part) for part in asked.sets]
    places = [selection.addresses(part.problems, builtin) for part in asked.sets]
    wanted: dict[tuple[str, str | None], dict[str, Request]] = {}
    for part, asks, addresses in zip(asked.sets, requests, places, strict=True):
        for address in addresses:
            wanted.setdefault((address, part.format), {}).update({request.name: request for request in asks})
    alone = {entry.solver for kept in entries for entry in kept}
    if len(alone) == 1 and not asked.cluster:  # else the first one depends on the problems
        slot.workers.begin(alone.pop(), asked.memory)
    guesses = any(parse_start(start).guess == EVERY for part in asked.sets for start in part.start)
    surveys, refused, unread = _survey(slot, wanted, max(part.timeout for part in asked.sets), reading, guesses)
    parts: list[PlannedSet] = []
    planned: dict[str, Pair] = {}
    for part, solvers_, named_here, asks, addresses in zip(asked.sets, entries, named, requests, places, strict=True):
        here = [surveys[a, part.format] for a in addresses if (a, part.format) in surveys]
        chosen = selection.select(part, here) if here else []
        pairs = _pairs(part, chosen, solvers_, named_here, asks, asked.threads)
        for pair in pairs:
            _require_same(planned.setdefault(pair.key, pair), pair)
        parts.append(PlannedSet(part, {s.fingerprint: s.address for s in reversed(chosen)}, solvers_, pairs))
    return Assembly(
        parts,
        selection.shard(planned.values(), *asked.shard),
        dict(surveys.keys()),
        refused,
        unread,
        _twins(surveys.values()),
        list(surveys.values()),
        {e.solver: _missing(e) for all_, kept in zip(every, entries, strict=True) for e in all_ if e not in kept},
    )


def _entries(part: ProblemSet) -> list[Entry]:
    return grids.entries(part.solvers) or grids.by_default()


def _missing(entry: Entry) -> str:
    return missing(solvers.get(entry.solver).spec)


def _requests(part: ProblemSet) -> list[Request]:
    if part.via:
        found = (plan.pinned(part.via, {"facets": facets}) for facets in part.facets)
        return list({request.name: request for request in found}.values())
    return plan.requests(part.allowed_routes, part.facets)


def _pairs(
    part: ProblemSet,
    chosen: Sequence[Surveyed],
    entries: Sequence[Entry],
    named: Collection[str],
    requests: Sequence[Request],
    threads: int,
) -> list[Pair]:
    return [
        pair
        for tolerance in part.tolerance
        for start, surveys in _started(part, chosen).items()
        for pair in plan.pairs(
            surveys,
            entries,
            requests,
            tolerance,
            part.limits(threads),
            relaxations=part.allowed_routes == "all",
            detours=part.chosen or bool(part.via),
            start=start,
            set=part.name,
            measure=part.measure,
            named=named,
        )
    ]


def _started(part: ProblemSet, chosen: Sequence[Surveyed]) -> dict[str, list[Surveyed]]:
    """Return the problems by start policy: a file with three guesses has three."""
    result: dict[str, list[Surveyed]] = {}
    for asked in part.start:
        for survey in chosen:
            for start in each_start(asked, survey.guesses):
                result.setdefault(start, []).append(survey)
    return result


def _survey(
    slot: Slot,
    wanted: Mapping[tuple[str, str | None], Mapping[str, Request]],
    timeout: float,
    reading: Reading,
    guesses: bool,
) -> tuple[dict[tuple[str, str | None], Surveyed], list[tuple[str, str]], list[str]]:
    surveys: dict[tuple[str, str | None], Surveyed] = {}
    refused: list[tuple[str, str]] = []
    unread: list[str] = []
    asked = [
        readers.ReadRequest(address, list(requests.values()), format) for (address, format), requests in wanted.items()
    ]
    with closing(readers.surveys(slot, asked, timeout, guesses=guesses)) as answers:
        read = zip(asked, answers, strict=True)
        for address, (problem, answer) in zip(reading([one.address for one in asked]), read, strict=True):
            if not isinstance(answer, CpbenchError):
                surveys[address, problem.format] = answer
                continue
            refused.append((address, str(answer)))
            if isinstance(answer, Unread):
                unread.append(address)
    return surveys, refused, unread


def _twins(surveys: Iterable[Surveyed]) -> list[tuple[str, str]]:
    """Return files that hold the same problem, which is run once, under the first file's name."""
    first: dict[str, str] = {}
    twins = [(s.address, first.setdefault(s.fingerprint, s.address)) for s in surveys]
    return [(address, before) for address, before in twins if address != before]


def _require_same(first: Pair, again: Pair) -> None:
    """Raise CpbenchError where two sets share a pair with different limits: a row has one limit."""
    if first.limits != again.limits:
        raise CpbenchError(
            f"sets '{first.set}' and '{again.set}' both ask for {again.label} on {again.address}, with other limits: "
            f"{first.limits} and {again.limits}"
        )
