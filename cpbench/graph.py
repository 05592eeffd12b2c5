"""Routes between formulations: cheapest first, ties by name. Knows no mathematics.

Nodes are formulations, edges are conversions. Which edges a problem can take is only known while converting
it, so a search walks candidate paths in order of cost and applies them step by step until one arrives; dead
ends are kept, with their obstacles, for `explain`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from cpbench.conversions.base import Conversion, conversions, lift_step, make
from cpbench.errors import NoRoute, NotApplicable
from cpbench.formulations.base import Kind, Problem, formulations

EXACT = frozenset({Kind.EQUIVALENT, Kind.ONE_WAY})
ALL = frozenset(Kind)


@dataclass(frozen=True)
class Route:
    """Conversions in order of application; the empty route is the problem itself."""

    steps: tuple[Conversion, ...] = ()

    @property
    def cost(self) -> float:
        return sum(step.cost for step in self.steps)

    @property
    def label(self) -> str:
        return " > ".join(step.label for step in self.steps) or "direct"

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.steps[0].source, *(step.target for step in self.steps)) if self.steps else ()

    @property
    def kind(self) -> Kind:
        """The weakest static promise along the way."""
        return max((step.kind for step in self.steps), key=lambda k: k.rank, default=Kind.EQUIVALENT)


@dataclass(frozen=True)
class DeadEnd:
    """A route that stopped: after `done` steps, `edge` refused with `obstacle`."""

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


def edges(extra: Iterable[Conversion] = ()) -> list[Conversion]:
    """Every registered conversion with default knobs; `extra` ones replace their namesakes."""
    by_name = {name: make(name) for name in conversions.names()}
    by_name |= {edge.name: edge for edge in extra}
    return [by_name[name] for name in sorted(by_name)]


def candidates(source: str, target: str, kinds: frozenset[Kind] = EXACT, via: Sequence[Conversion] = ()) -> list[Route]:
    """Paths from node to node that pass no node twice, cheapest first, ties by label.

    An edge is considered when one of `kinds` could be its promise; with `via`, a path must contain those
    conversions, which are allowed whatever their kind.
    """
    pinned = {edge.name for edge in via}
    usable = [e for e in edges(via) if e.name in pinned or best_kind(e) in kinds]
    found: list[Route] = []

    def walk(node: str, path: tuple[Conversion, ...], seen: frozenset[str]) -> None:
        if node == target:
            if pinned <= {step.name for step in path}:
                found.append(Route(path))
            return
        for edge in usable:
            if edge.source == node and edge.target not in seen:
                walk(edge.target, (*path, edge), seen | {edge.target})

    walk(source, (), frozenset({source}))
    return sorted(found, key=lambda r: (r.cost, r.label))


def best_kind(edge: Conversion) -> Kind:
    """The strongest promise an edge can make on some problem."""
    return getattr(edge, "best_kind", edge.kind)


def arrive(
    problem: Problem,
    target: str,
    kinds: frozenset[Kind] = EXACT,
    via: Sequence[Conversion] = (),
    apply: Callable[[Conversion, Problem], Problem] = lambda edge, p: edge.step(p),
) -> Arrival:
    """Bring `problem` to `target` by the first candidate that works; raises NoRoute with every obstacle met.

    `apply` may be a memoising stand-in for `Conversion.step`, so that shared prefixes are converted once.
    """
    arrival, dead = _try(problem, target, kinds, via, apply)
    if arrival is None:
        raise NoRoute(_no_route(problem, target, kinds, dead))
    return arrival


def explain(
    problem: Problem, target: str, kinds: frozenset[Kind] = EXACT, via: Sequence[Conversion] = ()
) -> tuple[DeadEnd, ...]:
    """The routes that do not bring `problem` to `target`, each with its obstacle, up to the first one that does."""
    return _try(problem, target, kinds, via, lambda edge, p: edge.step(p))[1]


def _try(
    problem: Problem,
    target: str,
    kinds: frozenset[Kind],
    via: Sequence[Conversion],
    apply: Callable[[Conversion, Problem], Problem],
) -> tuple[Arrival | None, tuple[DeadEnd, ...]]:
    dead: list[DeadEnd] = []
    pinned = {edge.name for edge in via}
    for route in candidates(problem.node, target, kinds, via):
        current, worst = problem, Kind.EQUIVALENT
        for done, edge in enumerate(route.steps):
            why = edge.obstacle(current)
            if why is None:  # a promise means something only where the edge applies
                kind = edge.exactness(current)
                worst = max(worst, kind, key=lambda k: k.rank)
                if kind not in kinds and edge.name not in pinned:
                    why = f"is {kind} for this problem, only {', '.join(sorted(kinds))} routes were asked for"
            if why is None:
                try:
                    current = apply(edge, current)
                    continue
                except NotApplicable as refusal:
                    why = refusal.obstacle
            dead.append(DeadEnd(route, done, edge.label, why))
            break
        else:
            return Arrival(current, route, worst, tuple(dead)), tuple(dead)
    return None, tuple(dead)


def _no_route(problem: Problem, target: str, kinds: frozenset[Kind], dead: Sequence[DeadEnd]) -> str:
    tried = "; ".join(dict.fromkeys(f"{d.edge}: {d.obstacle}" for d in dead)) or "no conversion leads there"
    message = f"no {'exact ' if kinds == EXACT else ''}route from {problem.node} to {target}: {tried}"
    others = [r for r in candidates(problem.node, target, ALL) if not r.kind.exact]
    if kinds != ALL and others:
        shown = ", ".join(f"{r.label} ({r.kind})" for r in others[:4])
        message += f". With --routes all: {shown}"
    return message


def reachable(node: str, kinds: frozenset[Kind] = EXACT) -> list[str]:
    """Nodes that some path of edges of these kinds connects to `node`, itself included."""
    return [target for target in formulations.names() if target == node or candidates(node, target, kinds)]


def lift(problem: Problem, point: Any, steps: int | None = None) -> Any:
    """Carry an answer to a converted problem back through its provenance (`steps` of it, default all)."""
    recorded = problem.provenance if steps is None else problem.provenance[len(problem.provenance) - steps :]
    for step in reversed(recorded):
        point = lift_step(step, point)
    return point


def push(problem: Problem, point: Any) -> Any:
    """Carry an answer to the source of a converted problem forward through its provenance."""
    for step in problem.provenance:
        point = make(step.conversion, dict(step.parameters)).push(point, step.trace)
    return point


def tolerance(problem: Problem, asked: float, steps: int) -> float:
    """What to ask of a solver of a converted problem (its last `steps` conversions) to get `asked` on the source."""
    for step in problem.provenance[len(problem.provenance) - steps :]:
        asked = make(step.conversion, dict(step.parameters)).tolerance(asked)
    return asked
