"""Solving one problem of a file by a solver of others, in processes of their own, as a run does."""

from __future__ import annotations

import shlex
from dataclasses import replace

from cpbench import storage
from cpbench.api.answered import Answered
from cpbench.api.solve_alone import SolveRequest
from cpbench.bench import starts
from cpbench.bench.events import EventHandler, ignore_event
from cpbench.bench.planning import grids, plan
from cpbench.bench.planning.nearest import AUTO
from cpbench.bench.planning.places import located
from cpbench.bench.results.rows import Outcome, unpack_answer
from cpbench.bench.slot import Slot
from cpbench.bench.worker_pool import Setting
from cpbench.errors import NoRoute
from cpbench.generators.collection import address_text, builtin_folder
from cpbench.solvers.base import solvers


def solve_apart(asked: SolveRequest, on_event: EventHandler = ignore_event) -> Answered:
    """Solve a problem of a file by one solver, in a process that is stopped at the limits.

    `on_event` : called with the events of the run.

    Raises NoRoute where no route leads to the solver, UnknownName, CpbenchError on a start that needs several solves.
    """
    address, solver, routes, limits = located(asked.address, builtin_folder), asked.solver, asked.routes, asked.limits
    entries = grids.grid(AUTO) if solver == AUTO else [plan.parse_entry(solver)]
    policy = starts.one_start(asked.start)
    if asked.via:
        requests = [plan.pinned(asked.via, {"facets": asked.facets})]
    else:
        requests = [plan.exact(), *(plan.requests("all", ())[1:] if routes == "all" else [])]
    if len(entries) == 1:
        requests = [replace(request, nodes=_only(entries[0], request)) for request in requests]
    with Slot(Setting(limits.threads, limits.memory)) as slot:
        if len(entries) == 1:
            slot.workers.begin(entries[0].solver, limits.memory)
        survey = slot.survey(address, requests, asked.format, limits.seconds)
        relaxed = routes == "all" or not asked.via
        pairs = plan.pairs([survey], entries, requests, asked.tolerance, limits, relaxations=relaxed, start=str(policy))
        if not pairs:
            raise NoRoute(
                f"no {routes} route from {survey.node} to {solver}; see: cpbench route {shlex.quote(address)} --explain"
            )
        prepared = slot.prepare(pairs[0])
        slot.start([pairs[0].entry.solver], limits, on_event)
        outcome = slot.run(pairs[0], prepared)
    return _answered(pairs[0], outcome)


def _answered(pair: plan.Pair, outcome: Outcome) -> Answered:
    """Return the outcome with the problem and the answer to it, where there is one."""
    known = Answered(address_text(pair.address), pair.problem, pair.node, pair.label, pair.tolerance, outcome)
    if outcome.answer is None:
        return known
    problem = storage.load(pair.address, format=pair.format)
    return replace(known, problem=problem, point=problem.point_from_vector(unpack_answer(outcome.answer)))


def _only(entry: plan.Entry, request: plan.Request) -> tuple[str, ...]:
    """Return the solver's own node where the request is meant for it: no other one is looked for."""
    node = solvers.get(entry.solver).spec.node
    return (node,) if node in request.nodes or not request.nodes else request.nodes
