"""Paths through the graph of formulations and conversions, cheapest first, ties by label; no problem is looked at.

The search grows prefixes of paths, best first: the next one is that with the least cost so far plus the least that
any path would add from there to the target (A*). What a prefix makes of its parent is the caller's business.

A path leaves a node whose problems have maps for one whose problems have matrices with its first step or not at all:
an affine problem is one of matrices at once, and a detour through nonlinear nodes ends where shorter paths end. Without
this rule most of the paths would be such detours.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from cpbench.conversions.base import Conversion, conversions, make
from cpbench.formulations.base import Kind, formulations

S = TypeVar("S")


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
        return weakest(step.kind for step in self.steps)


@dataclass(frozen=True, order=True)
class Prefix(Generic[S]):
    """A path not yet taken to its end: `state` is that of its parent, `left` the pinned conversions still to take."""

    bound: float
    label: str
    path: tuple[Conversion, ...] = field(compare=False)
    state: S = field(compare=False)
    seen: frozenset[str] = field(compare=False)
    left: frozenset[str] = field(compare=False)


def edges(extra: Iterable[Conversion] = ()) -> list[Conversion]:
    """Return every registered conversion with default knobs; `extra` ones replace their namesakes."""
    by_name = {name: make(name) for name in conversions.names()}
    by_name |= {edge.name: edge for edge in extra}
    return [by_name[name] for name in sorted(by_name)]


def nodes_of_maps() -> frozenset[str]:
    """Return the nodes whose problems have a nonlinear map."""
    return frozenset(name for name in formulations.names() if formulations.get(name).has_maps())


def best_kind(edge: Conversion) -> Kind:
    """Return the strongest promise an edge can make on some problem."""
    return getattr(edge, "best_kind", edge.kind)


def promise(edge: Conversion) -> str:
    """Return `equivalent, one-way or necessary` where the promise depends on the problem, else the one word."""
    kind, best = edge.kind, best_kind(edge)
    return str(kind) if kind == best else f"{', '.join([best, *edge.between])} or {kind}"


def weakest(kinds: Iterable[Kind]) -> Kind:
    """Return what a chain of promises is worth."""
    return max(kinds, key=lambda k: k.rank, default=Kind.EQUIVALENT)


def best_first(
    source: str,
    target: str,
    kinds: frozenset[Kind],
    via: Sequence[Conversion],
    start: S,
    take: Callable[[Prefix[S]], S | None],
) -> Iterator[tuple[Route, S]]:
    """Yield paths from `source` to `target` with what `take` made of them step by step; None ends a path.

    They come in the order of cost and label, because a prefix comes before all that begin with it: its bound is at
    most theirs, and its label is the beginning of theirs.
    """
    pinned = frozenset(edge.name for edge in via)
    usable, onward = _usable(kinds, via)
    ahead = _cost_ahead(target, onward, pinned)
    heap = [Prefix(0.0, "", (), start, frozenset({source}), pinned)]
    while heap:
        prefix = heapq.heappop(heap)
        path, node, state = prefix.path, source, prefix.state
        if path:
            node, reached = path[-1].target, take(prefix)
            if reached is None:
                continue
            state = reached
        if node == target and not prefix.left:
            yield Route(path), state
            continue
        for edge in onward if path else usable:
            left = prefix.left - {edge.name}
            # a loop may be taken at the node where the path stands, but once
            again = edge.target in prefix.seen and (edge.target != node or left == prefix.left)
            if edge.source == node and not again and (edge.target, left) in ahead:
                seen = prefix.seen | {edge.target}
                # the bound knows nothing of the nodes seen: without this look, problems would be converted on ways
                # with no end
                if _is_open(edge.target, target, onward, seen):
                    longer = Route((*path, edge))
                    bound = round(longer.cost + ahead[edge.target, left], 9)  # sums in any order are the same
                    heapq.heappush(heap, Prefix(bound, longer.label, longer.steps, state, seen, left))


def beginnings(
    source: str, kinds: frozenset[Kind], via: Sequence[Conversion] = ()
) -> dict[str, tuple[Conversion | None, ...]]:
    """Return, by target, the first conversions of all paths of `candidates`; None stands for the empty path."""
    first: dict[str, dict[Conversion | None, None]] = {}
    if via:
        for target in formulations.names():
            for route, _ in best_first(source, target, kinds, via, True, lambda prefix: True):
                first.setdefault(target, {})[route.steps[0]] = None
    else:  # what is reached without passing the source again: no path has to be followed to its end
        first[source] = {None: None}
        usable, onward = _usable(kinds)
        for edge in (edge for edge in usable if edge.source == source):
            for target in _reached(edge.target, onward, frozenset({source})):
                first.setdefault(target, {})[edge] = None
    return {target: tuple(steps) for target, steps in first.items()}


def _usable(kinds: frozenset[Kind], via: Sequence[Conversion] = ()) -> tuple[list[Conversion], list[Conversion]]:
    """Return the edges with which a path may begin, and those with which it may go on."""
    pinned = {edge.name for edge in via}
    # a loop (qp-qp-dual) leads nowhere: it is taken only where it is named
    usable = [e for e in edges(via) if e.name in pinned or (best_kind(e) in kinds and e.source != e.target)]
    maps = nodes_of_maps()
    return usable, [e for e in usable if e.source not in maps or e.target in maps or e.name in pinned]


def _is_open(node: str, target: str, usable: Sequence[Conversion], seen: frozenset[str]) -> bool:
    """Return whether a path leads from `node` to the target that passes none of the nodes seen."""
    return target in _reached(node, usable, seen, target)


def _reached(node: str, usable: Sequence[Conversion], seen: frozenset[str], target: str = "") -> set[str]:
    """Return the nodes that paths from `node` reach which pass none of the nodes seen, or some of them with the
    target."""
    reached, new = {node}, {node}
    while new and target not in reached:
        new = {edge.target for edge in usable if edge.source in new} - reached - seen
        reached |= new
    return reached


def _cost_ahead(
    target: str, usable: Sequence[Conversion], pinned: frozenset[str]
) -> dict[tuple[str, frozenset[str]], float]:
    """Return least cost of getting from a node to the target when these pinned conversions are still to be taken.

    No entry where nothing leads there. Dijkstra backwards; out of the target lead only its own loops.
    """
    ahead: dict[tuple[str, frozenset[str]], float] = {}
    heap: list[tuple[float, str, tuple[str, ...]]] = [(0.0, target, ())]
    while heap:
        cost, node, names = heapq.heappop(heap)
        left = frozenset(names)
        if (node, left) in ahead:
            continue
        ahead[node, left] = cost
        for edge in usable:
            if edge.target == node and edge.name not in left and (edge.source != target or node == target):
                before = tuple(sorted(left | ({edge.name} & pinned)))
                heapq.heappush(heap, (cost + edge.cost, edge.source, before))
    return ahead
