"""Problems on their way between formulations: routes, dead ends, lifting. Knows no mathematics.

Nodes are formulations, edges are conversions. Which edges a problem can take is only known while converting it, so a
search converts prefixes of paths as `routes.best_first` grows them: each once, from what its parent became, and not
at all when something cheaper arrives. An edge that refuses ends everything behind it; it is kept, with its obstacle,
for `explain`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, TypeAlias

from cpbench.conversions.base import Conversion, lift_step, make
from cpbench.errors import NoRoute, NotApplicable
from cpbench.formulations.base import Kind, Problem, Step, formulations
from cpbench.graph.routes import Prefix, Route, best_first, best_kind, edges, nodes_of_maps, weakest
from cpbench.graph.routes import beginnings as beginnings
from cpbench.graph.routes import promise as promise

EXACT = frozenset({Kind.EQUIVALENT, Kind.ONE_WAY})
ALL = frozenset(Kind)
SHOWN = 4
"""Routes, or obstacles, that a message names."""

Apply: TypeAlias = Callable[[Conversion, Problem], Problem]


@dataclass(frozen=True)
class DeadEnd:
    """A route that stopped: its first `done` steps were taken, its last one, `edge`, refused with `obstacle`."""

    route: Route
    done: int
    edge: str
    obstacle: str

    def __str__(self) -> str:
        whole = f"{self.route.label}: " if len(self.route.steps) > 1 else ""
        return f"{whole}{self.edge} refuses: {self.obstacle}"


@dataclass(frozen=True)
class Arrival:
    """A problem brought to a node, by which route, and what was tried before."""

    problem: Problem
    route: Route
    kind: Kind
    dead_ends: tuple[DeadEnd, ...] = field(default=())


class Memory:
    """A stand-in for `Conversion.step` that converts a problem by an edge once, and knows how long that took.

    Problems are distinguished by identity: equal ones that came by other ways must keep their own provenance.
    """

    def __init__(self) -> None:
        self._done: dict[tuple[int, str], tuple[Problem, Problem, float]] = {}

    def __call__(self, edge: Conversion, problem: Problem) -> Problem:
        key = (id(problem), edge.label)
        if key not in self._done:
            begun = time.perf_counter()
            converted = edge.step(problem)
            # the problem is kept, so that its id stays its own
            self._done[key] = (problem, converted, time.perf_counter() - begun)
        return self._done[key][1]

    def seconds(self, problem: Problem, route: Route) -> float:
        """Return what the conversions of a route that was taken from `problem` on took."""
        total = 0.0
        for edge in route.steps:
            _, problem, spent = self._done[id(problem), edge.label]
            total += spent
        return total


@dataclass(frozen=True)
class _State:
    """Problem that a prefix of a route ends in, and the weakest promise on the way."""

    problem: Problem
    kind: Kind


def candidates(source: str, target: str, kinds: frozenset[Kind] = EXACT, via: Sequence[Conversion] = ()) -> list[Route]:
    """Return paths from node to node that pass no node twice, cheapest first, ties by label.

    An edge is considered when one of `kinds` could be its promise; with `via`, a path must contain those
    conversions, which are allowed whatever their kind. An edge from a node to itself is taken only then, once.
    """
    return [route for route, _ in best_first(source, target, kinds, via, True, lambda prefix: True)]


def arrive(
    problem: Problem,
    target: str,
    kinds: frozenset[Kind] = EXACT,
    via: Sequence[Conversion] = (),
    apply: Apply = Conversion.step,
) -> Arrival:
    """Bring `problem` to `target` by the first candidate that works; raises NoRoute with the obstacles met.

    `apply` may be a stand-in for `Conversion.step` that outlives this search, such as a `Memory`.
    """
    dead: list[DeadEnd] = []
    for arrival in arrivals(problem, target, kinds, via, apply, once=True, dead=dead):
        return arrival
    raise NoRoute(_no_route(problem, target, kinds, via, dead))


def explain(
    problem: Problem,
    target: str,
    kinds: frozenset[Kind] = EXACT,
    via: Sequence[Conversion] = (),
    apply: Apply = Conversion.step,
) -> tuple[DeadEnd, ...]:
    """Return the routes that do not bring `problem` to `target`, each with its obstacle, up to the first one that
    does."""
    dead: list[DeadEnd] = []
    next(arrivals(problem, target, kinds, via, apply, once=True, dead=dead), None)
    return tuple(dead)


def arrivals(
    problem: Problem,
    target: str,
    kinds: frozenset[Kind] = EXACT,
    via: Sequence[Conversion] = (),
    apply: Apply = Conversion.step,
    *,
    once: bool = False,
    finish: bool = True,
    dead: list[DeadEnd] | None = None,
) -> Iterator[Arrival]:
    """Bring `problem` to `target` by every route that works, cheapest first; `dead` gets the refusals.

    Without `finish`, the last conversion of each is left to the caller: an arrival holds what it is to be applied to.
    With `once`, a prefix that made the same problem as an earlier one is dropped if it has passed every node that
    the earlier one passed: nothing is behind it that was not behind the other, for less.
    """
    met = [] if dead is None else dead
    pinned = {edge.name for edge in via}
    passed: dict[tuple[str, frozenset[str]], list[frozenset[str]]] = {}

    def take(prefix: Prefix[_State]) -> _State | None:
        before, edge = prefix.state, prefix.path[-1]
        why = edge.obstacle(before.problem)
        kind = before.kind
        if why is None:  # a promise means something only where the edge applies
            exactness = edge.exactness(before.problem)
            kind = weakest((kind, exactness))
            if exactness not in kinds and edge.name not in pinned:
                because = f" because {reason}" if (reason := edge.reservation(before.problem)) else ""
                why = f"is {exactness} for this problem{because}; only {', '.join(sorted(kinds))} routes were asked for"
        if why is None:
            arrives = edge.target == target and not prefix.left
            if arrives and not finish:
                return _State(before.problem, kind)
            try:
                after = _State(apply(edge, before.problem), kind)
                return after if arrives or not once or is_new(after, prefix) else None
            except NotApplicable as refusal:
                why = refusal.obstacle
        met.append(DeadEnd(Route(prefix.path), len(prefix.path) - 1, edge.label, why))
        return None

    def is_new(after: _State, prefix: Prefix[_State]) -> bool:
        earlier = passed.setdefault((after.problem.fingerprint, prefix.left), [])
        if any(seen <= prefix.seen for seen in earlier):
            return False
        earlier.append(prefix.seen)
        return True

    start = _State(problem, Kind.EQUIVALENT)
    for route, state in best_first(problem.node, target, kinds, via, start, take):
        yield Arrival(state.problem, route, state.kind, tuple(met))


def _no_route(
    problem: Problem, target: str, kinds: frozenset[Kind], via: Sequence[Conversion], dead: Sequence[DeadEnd]
) -> str:
    met = list(dict.fromkeys(f"{d.edge}: {d.obstacle}" for d in dead))
    tried = "; ".join(met[:SHOWN]) + (f"; and {len(met) - SHOWN} more" if len(met) > SHOWN else "")
    nothing = (
        f"no path takes {' and '.join(e.label for e in via)} and no node twice" if via else "no conversion leads there"
    )
    message = f"no {'exact ' if kinds == EXACT else ''}route from {problem.node} to {target}: {tried or nothing}"
    inexact = (
        r
        for r, _ in best_first(problem.node, target, ALL, (), True, lambda prefix: True)
        if not r.kind.exact and r.steps[0].obstacle(problem) is None
    )
    others = list(islice(inexact, SHOWN)) if kinds != ALL else []
    if others:
        shown = ", ".join(f"{r.label} ({r.kind})" for r in others)
        message += f". With --routes all: {shown}"
    return message


def reachable(node: str, kinds: frozenset[Kind] = EXACT) -> list[str]:
    """Return nodes that some path of edges of these kinds connects to `node`, itself included."""
    usable, maps = [edge for edge in edges() if best_kind(edge) in kinds], nodes_of_maps()
    onward = [edge for edge in usable if edge.source not in maps or edge.target in maps]
    new = {edge.target for edge in usable if edge.source == node}
    reached = {node, *new}
    while new:
        new = {edge.target for edge in onward if edge.source in new} - reached
        reached |= new
    return [name for name in formulations.names() if name in reached]


def lift(problem: Problem, point: Any, steps: int | None = None) -> Any:
    """Carry an answer to a converted problem back through its provenance (`steps` of it, default all)."""
    for step in reversed(_last(problem, steps)):
        point = lift_step(step, point)
    return point


def remarks(problem: Problem, point: Any, steps: int | None = None) -> list[str]:
    """Return what the conversions that `lift` undoes have to say of this answer, each with its name."""
    result: list[str] = []
    for step in reversed(_last(problem, steps)):
        edge = make(step.conversion, dict(step.parameters))
        remark = edge.remark(point, step.trace)
        result += [f"{edge.label}: {remark}"] if remark else []
        point = edge.lift(point, step.trace)
    return result


def push(problem: Problem, point: Any, steps: int | None = None) -> Any:
    """Carry an answer to the source of a converted problem forward through its provenance (its last `steps`)."""
    for step in _last(problem, steps):
        point = make(step.conversion, dict(step.parameters)).push(point, step.trace)
    return point


def tolerance(problem: Problem, wanted: float, steps: int) -> float:
    """Return what to ask of a solver of a converted problem (its last `steps` conversions) to get `wanted` on the
    source."""
    for step in _last(problem, steps):
        wanted = make(step.conversion, dict(step.parameters)).tolerance(wanted, step.trace)
    return wanted


def _last(problem: Problem, steps: int | None) -> tuple[Step, ...]:
    """Return the last `steps` recorded conversions, all of them for None."""
    recorded = problem.provenance
    return recorded if steps is None else recorded[len(recorded) - steps :]
