"""Solving one problem of a file in processes of their own, as a run does, and the answer as lines and as a file."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cpbench import storage
from cpbench.bench import starts
from cpbench.bench.events import EventHandler, ignore_event
from cpbench.bench.planning import plan
from cpbench.bench.results import answers
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.schema import MEASURED
from cpbench.bench.slot import Slot
from cpbench.bench.worker_pool import Setting
from cpbench.errors import CpbenchError, NoRoute
from cpbench.plain_text import printable
from cpbench.solvers.base import solvers
from cpbench.storage.vectors import save_vector
from cpbench.verification import MET_TOLERANCE, PROVEN, error_text


@dataclass(frozen=True)
class SolvedApart:
    """Outcome of one solve, and the pair that it is of."""

    pair: plan.Pair
    outcome: Outcome

    def __bool__(self) -> bool:
        return self.outcome.status in (*MET_TOLERANCE, *PROVEN)

    def record(self) -> dict[str, Any]:
        """Return what was measured with its problem and label, as JSON takes it."""
        measured = {name: getattr(self.outcome, name) for name in MEASURED}
        found = {name: value for name, value in measured.items() if value is not None}
        return {"problem": self.pair.problem, "solver": self.pair.label, **found}

    def lines(self) -> Iterator[str]:
        """Yield what the answer is worth, by what route it came, and what it took."""
        pair, row = self.pair, self.outcome
        yield f"{pair.problem} ({pair.node}) by {pair.label}: {row.status}"
        if row.started not in (None, "cold"):
            yield f"  started    {row.started}"
        if row.route:
            yield f"  route      {row.route} ({row.kind})"
        if row.error is not None:
            yield f"  error      {error_text(row.error)}, asked for {pair.tolerance:.3g}; claimed {row.claim}"
        if row.route != "direct" and row.target_error is not None:
            there, wanted = row.target_error, row.target_tolerance
            yield f"  there      {error_text(there)}, asked for {wanted:.3g}: the error on the solver's own problem"
        if row.flags:
            yield f"  flags      {row.flags}"
        for name, value in json.loads(row.parts or "{}").items():
            yield f"    {name:<28} {value:.3g}"
        parts = ("load", "convert", "setup", "solve", "lift", "verify")
        times = {part: getattr(row, part) for part in parts if getattr(row, part) is not None}
        if times:
            yield "  seconds    " + ", ".join(f"{k} {v:.3g}" for k, v in times.items())
        counters = json.loads(row.counters or "{}")
        if counters:
            yield "  counters   " + ", ".join(f"{k} {v}" for k, v in counters.items())
        if row.message:
            yield f"  message    {printable(row.message)}"

    def save(self, path: Path, *, format: str | None = None, force: bool = False) -> None:
        """Write the answer, as a plain vector (.npy, .csv, .txt) or with its problem and verdict (.h5).

        Raises CpbenchError where there is no answer, FormatError where the file exists (unless `force`).
        """
        if self.outcome.answer is None:
            raise CpbenchError(f"{self.pair.label}: no answer to write")
        problem = storage.load(self.pair.address, format=format)
        point = problem.point_from_vector(answers.unpack(self.outcome.answer))
        if not save_vector(point, path, force=force):
            row = self.outcome
            facts = {"solver": self.pair.label, "claim": row.claim, "verdict": row.status}
            facts |= {"residual": row.error, "tolerance": self.pair.tolerance}
            storage.save_answer(path, problem, point, facts, force=force, with_problem=True)


def solve_apart(
    address: str,
    solver: str,
    *,
    via: Sequence[str] = (),
    facets: int = 8,
    routes: str = "exact",
    start: str = "cold",
    tolerance: float = 1e-6,
    limits: plan.Limits,
    format: str | None = None,
    on_event: EventHandler = ignore_event,
) -> SolvedApart:
    """Solve a problem of a file by one solver, in a process that is stopped at the limits.

    Parameters
    ----------
    address : the file, or ``FILE::NAME``. solver : a name with options. via : conversions to go through.
    facets : for conversions of `via` that have them. routes : exact, or all. start : where the solver begins.
    tolerance : the largest error of an answer that counts as solved. limits : seconds, bytes and threads of a solve.
    on_event : called with the events of the run.

    Raises NoRoute where no route leads to the solver, UnknownName, CpbenchError on a start that needs several solves.
    """
    entry = plan.parse_entry(solver)
    policy = starts.parse_start(start)
    if policy.kind is starts.StartKind.PREVIOUS:
        raise CpbenchError(
            "--start previous: a problem by itself has no step before it; see cpbench run --start previous"
        )
    if policy.guess == starts.EVERY:
        raise CpbenchError("--start file:all: one solve has one start, as file:2; see cpbench run --start file:all")
    if via:
        requests = [plan.pinned(via, {"facets": facets})]
    else:
        requests = [plan.exact(), *(plan.requests("all", ())[1:] if routes == "all" else [])]
    requests = [replace(request, nodes=_only(entry, request)) for request in requests]
    with Slot(Setting(limits.threads, limits.memory, single=True)) as slot:
        slot.workers.begin(entry.solver, limits.memory)
        survey = slot.survey(address, requests, format, limits.seconds)
        relaxed = routes == "all" or not via
        pairs = plan.pairs([survey], [entry], requests, tolerance, limits, relaxations=relaxed, start=str(policy))
        if not pairs:
            raise NoRoute(
                f"no {routes} route from {survey.node} to {solver}; see: cpbench route {shlex.quote(address)} --explain"
            )
        prepared = slot.prepare(pairs[0])
        slot.start([entry.solver], limits, on_event)
        outcome = slot.run(pairs[0], prepared)
    return SolvedApart(pairs[0], outcome)


def _only(entry: plan.Entry, request: plan.Request) -> tuple[str, ...]:
    """Return the solver's own node where the request is meant for it: no other one is looked for."""
    node = solvers.get(entry.solver).spec.node
    return (node,) if node in request.nodes or not request.nodes else request.nodes
