"""Turns a plan into pairs: every problem is surveyed once, every set selects its own, no pair is planned twice."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

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
AddressedFile = tuple[str, str | None]
"""The address of a problem, and the format of its file where that was said."""


@dataclass(frozen=True)
class PlannedSet:
    """A set of the plan with its solvers, its problems (addresses by fingerprint) and its pairs.

    `named` : the solvers that were asked for by name. `absent` : how to install those of the others that are missing.
    `addresses`, `requests` : addresses to read, and the routes that are asked for from each.
    """

    problem_set: ProblemSet
    entries: Sequence[Entry] = ()
    named: Collection[str] = ()
    absent: Mapping[str, str] = field(default_factory=dict)
    addresses: Sequence[str] = ()
    requests: Sequence[Request] = ()
    problems: Mapping[str, str] = field(default_factory=dict)
    pairs: Sequence[Pair] = ()


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
    def fingerprints(self) -> dict[str, list[str]]:
        """Fingerprints of the problems of every set."""
        return {part.problem_set.name: list(part.problems) for part in self.parts}

    @property
    def idle(self) -> list[str]:
        """Solvers that were asked for by name and that no route leads to from any problem."""
        busy = {pair.entry.solver for part in self.parts for pair in part.pairs}
        names = [
            entry.solver
            for part in self.parts
            if part.problem_set.chosen
            for entry in part.entries
            if not entry.nearest
        ]
        return [name for name in dict.fromkeys(names) if name not in busy]

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
            f"see: cpbench graph {shlex.quote(first)} --explain"
        )


def assemble(run_plan: RunPlan, slot: Slot, builtin: Callable[[], Path], reading: Reading = list) -> Assembly:
    """Return the pairs of a plan; `builtin` is called for the folder of the built-in problems if a set names it.

    Raises CpbenchError when the sets contradict each other, or name something that does not exist.
    """
    begun = [_begun(part, builtin) for part in run_plan.sets]
    wanted: dict[AddressedFile, dict[str, Request]] = {}
    for part in begun:
        for address in part.addresses:
            key = address, part.problem_set.format
            wanted.setdefault(key, {}).update({request.name: request for request in part.requests})
    alone = {entry.solver for part in begun for entry in part.entries}
    if len(alone) == 1 and not run_plan.cluster:  # else the first one depends on the problems
        slot.workers.begin(alone.pop(), run_plan.memory)
    guesses = any(parse_start(start).guess == EVERY for part in run_plan.sets for start in part.start)
    surveys: dict[AddressedFile, Surveyed] = {}
    refused: list[tuple[str, CpbenchError]] = []
    longest = max(part.timeout for part in run_plan.sets)
    for (key, requests), address in zip(wanted.items(), reading([address for address, _ in wanted]), strict=True):
        try:
            surveys[key] = slot.survey(address, list(requests.values()), key[1], longest, guesses=guesses)
        except CpbenchError as reason:
            refused.append((address, reason))
    parts = [_with_pairs(part, surveys, run_plan.threads) for part in begun]
    planned: dict[str, Pair] = {}
    for pair in (pair for part in parts for pair in part.pairs):
        _require_same(planned.setdefault(pair.key, pair), pair)
    return Assembly(
        parts,
        selection.shard(planned.values(), *run_plan.shard),
        dict(surveys.keys()),
        [(address, str(reason)) for address, reason in refused],
        [address for address, reason in refused if isinstance(reason, Unread)],
        _twins(surveys.values()),
        list(surveys.values()),
        {name: how for part in parts for name, how in part.absent.items()},
    )


def _begun(part: ProblemSet, builtin: Callable[[], Path]) -> PlannedSet:
    """Return a set with its solvers and the addresses of its problems."""
    named = grids.named(part.solvers) if part.chosen else set[str]()
    entries = grids.entries(part.solvers) or grids.by_default()
    lacking = {entry.solver: missing(solvers.get(entry.solver).spec) for entry in entries}
    absent = {name: how for name, how in lacking.items() if how and name not in named}
    kept = [entry for entry in entries if entry.solver not in absent]
    return PlannedSet(part, kept, named, absent, selection.addresses(part.problems, builtin), _requests(part))


def _requests(part: ProblemSet) -> list[Request]:
    if part.via:
        pinned = (plan.pinned(part.via, facets) for facets in part.facets)
        return list({request.name: request for request in pinned}.values())
    return plan.requests(part.allowed_routes, part.facets)


def _with_pairs(part: PlannedSet, surveys: Mapping[AddressedFile, Surveyed], threads: int) -> PlannedSet:
    """Return a set with the problems that it selects and its pairs."""
    problem_set = part.problem_set
    here = [
        surveys[address, problem_set.format] for address in part.addresses if (address, problem_set.format) in surveys
    ]
    chosen = selection.select(problem_set, here) if here else []
    pairs = [
        pair
        for tolerance in problem_set.tolerance
        for start, started in _started(problem_set, chosen).items()
        for pair in plan.pairs(
            started,
            part.entries,
            part.requests,
            tolerance,
            problem_set.limits(threads),
            relaxations=problem_set.allowed_routes == "all",
            detours=problem_set.chosen or bool(problem_set.via),
            start=start,
            set=problem_set.name,
            measure=problem_set.measure,
            named=part.named,
        )
    ]
    return replace(part, problems={one.fingerprint: one.address for one in reversed(chosen)}, pairs=pairs)


def _started(part: ProblemSet, chosen: Sequence[Surveyed]) -> dict[str, list[Surveyed]]:
    """Return the problems by start policy: a file with three guesses has three."""
    result: dict[str, list[Surveyed]] = {}
    for policy in part.start:
        for survey in chosen:
            for start in each_start(policy, survey.guesses):
                result.setdefault(start, []).append(survey)
    return result


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
