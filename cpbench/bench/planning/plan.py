"""Pairs to run: every problem with every solver that a requested route may reach, fixed before the run.

A request names how a solver may be reached: `exact` routes only, a pinned facetization (`inner8`), or routes
that are merely necessary. The realised route is found while running and recorded beside it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench import graph
from cpbench.conversions.base import Conversion, find_via, make
from cpbench.errors import CpbenchError, UnknownName
from cpbench.formulations.base import Kind
from cpbench.foundation.text import read_brackets
from cpbench.graph import nodes_of_maps
from cpbench.solvers.base import SolverSpec, automatic_solver, automatic_solvers, parse_options, solvers

if TYPE_CHECKING:
    from cpbench.bench.messages import Surveyed

AUTO = "auto"
"""The name that stands for the automatic choice, whatever the formulation of a problem."""
PREVIOUS = "previous"
"""The start policy by which a step of a sequence starts from the answer to the preceding step."""
EXACT_KINDS = (str(Kind.EQUIVALENT), str(Kind.ONE_WAY))
FACET_NODES = ("lcp", "mlcp")
"""Targets of facet routes: their LCPs are not symmetric, hence not equivalent to a quadratic program."""


BEYOND = {"necessary": Kind.NECESSARY, "relaxed": Kind.RELAXATION}
"""Requests that add a weaker kind to the exact routes, for the nodes that no exact route opens."""


@dataclass(frozen=True)
class Limits:
    """Limits of one solve, and how often it is measured: columns of a row, not part of its identity.

    Attributes
    ----------
    seconds : wall-clock limit of a solve [s]. memory : bytes a solve may add to its process (0: no limit).
    threads : of every library. repeats : solves of a pair that takes less than `repeat_below` seconds.
    history : whether solvers that can are run once more while their iterates are kept.
    """

    seconds: float = 10.0
    memory: int = 4 * 2**30
    threads: int = 1
    repeats: int = 3
    history: bool = False
    repeat_below: float = 1.0


@dataclass(frozen=True)
class Request:
    """One way to reach solvers: allowed kinds, fixed conversions, target nodes (empty: all)."""

    name: str
    kinds: tuple[str, ...] = EXACT_KINDS
    via: tuple[tuple[str, Mapping[str, Any]], ...] = ()
    nodes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Entry:
    """A solver with its options, and its label in tables.

    `nearest` : whether it takes only the problems of which it is the automatic choice.
    """

    solver: str
    options: Mapping[str, Any] = field(default_factory=dict)
    nearest: bool = False

    @property
    def label(self) -> str:
        given = ",".join(f"{k}={v}" for k, v in sorted(self.options.items()))
        return f"{self.solver}[{given}]" if given else self.solver


@dataclass(frozen=True)
class Pair:
    """One planned row: a problem, a request, a solver.

    `format` : how the file is read where that was said. `set` : the part of the plan it belongs to. `measure` : the
    number its answer is judged by, all of them for None. `start` : the start policy. `sequence`, `step` : place in
    a recorded scene. `named` : whether its solver was asked for by its name; only then has it a row where it cannot be
    run.
    """

    address: str
    problem: str
    fingerprint: str
    node: str
    family: str
    sizes: Mapping[str, int]
    request: Request
    entry: Entry
    target: str
    tolerance: float
    limits: Limits = Limits()
    start: str = "cold"
    format: str | None = None
    set: str = ""
    measure: str | None = None
    sequence: str = ""
    step: int = 0
    named: bool = True

    @property
    def scene(self) -> tuple[str, str] | None:
        """The sequence whose steps this pair follows, by the pack or folder it is in and its name; None for others."""
        if self.start != PREVIOUS or not self.sequence:
            return None
        file, pack, _ = self.address.partition("::")
        return (file if pack else str(Path(file).parent)), self.sequence

    @cached_property
    def key(self) -> str:
        """Identity of the row: fingerprint, route request, solver, options, tolerance, start, threads; the measure
        where one decides alone, the place where a sequence is followed."""
        parts = [
            self.fingerprint,
            self.request.name,
            self.entry.solver,
            json.dumps(dict(self.entry.options), sort_keys=True),
            repr(self.tolerance),
            self.start,
            str(self.limits.threads),
            *filter(None, [self.measure]),
            *([Path(self.scene[0]).name, self.scene[1], str(self.step)] if self.scene else []),
        ]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:32]

    @property
    def label(self) -> str:
        """The label in tables: the solver with its options, and how it is reached."""
        return self.entry.label if self.request.name == "exact" else f"{self.entry.label}@{self.request.name}"


def exact() -> Request:
    """Return the default request: routes that give exact answers only."""
    return Request("exact")


def facets(how: str, count: int) -> list[Request]:
    """Return requests that pin the facetization `how` (inner, outer) with `count` facets."""
    edges = [make(name, {"facets": count}) for name in find_via(how)]
    if len(edges) == 1:
        return [Request(f"{how}{count}", EXACT_KINDS, ((edges[0].name, {"facets": count}),), FACET_NODES)]
    return [
        Request(f"{how}{count}-{edge.target}", EXACT_KINDS, ((edge.name, {"facets": count}),), FACET_NODES)
        for edge in edges
    ]


def pinned(via: Iterable[str], facets: int | None = None) -> Request:
    """Return a request through the named conversions; a text may set their knobs: ``compliant[compliance=1e-3]``.

    facets : of those that have facets and whose text sets none. Raises CpbenchError, UnknownName.
    """
    steps: list[tuple[str, Mapping[str, Any]]] = []
    for text in via:
        name, knobs = read_brackets("conversion", text)
        names = find_via(name)
        if len(names) > 1:
            raise CpbenchError(f"'{name}' is the end of several conversions: write {' or '.join(names)}")
        parameters = make(names[0]).parameters
        common = {"facets": facets} if facets is not None and "facets" in parameters else {}
        steps.append((names[0], {**common, **_knobs(names[0], parameters, knobs, text)}))
    name = "+".join(make(n, dict(p)).label for n, p in steps)
    return Request(name, EXACT_KINDS, tuple(steps))


def _knobs(name: str, known: Mapping[str, Any], texts: Mapping[str, str], whole: str) -> dict[str, Any]:
    """Return parameters of a conversion, with the types of their defaults."""
    given: dict[str, Any] = {}
    for knob, value in texts.items():
        if knob not in known:
            raise UnknownName(f"parameter of {name}", knob, known)
        kind = type(known[knob])
        # bool("false") is True
        if kind not in (int, float, str):
            raise CpbenchError(f"'{whole}': {knob} is not a number; set it from Python")
        try:
            given[knob] = kind(value)
        except ValueError:
            raise CpbenchError(f"'{whole}': {knob} is '{value}', expected {kind.__name__}") from None
    return given


def requests(routes: str, counts: Sequence[int]) -> list[Request]:
    """Return the requests of `--routes exact|facets|all` with facet counts."""
    requests = [exact()]
    if routes in ("facets", "all"):
        requests += [r for n in counts for how in ("inner", "facets") for r in facets(how, n)]
    if routes == "all":
        requests += [r for n in counts for r in facets("outer", n)]
        requests += [Request(name, (*EXACT_KINDS, str(kind))) for name, kind in BEYOND.items()]
    return requests


def parse_request(request: Request) -> tuple[frozenset[Kind], tuple[Conversion, ...]]:
    """Return kinds and fixed conversions of a route request."""
    via = tuple(make(name, dict(parameters)) for name, parameters in request.via)
    return frozenset(Kind(k) for k in request.kinds), via


def parse_entry(text: str) -> Entry:
    """Return `nsgs` or `nsgs[omega=1.2,shuffle=true]`; raises UnknownName on a solver, an option or a value."""
    name, given = read_brackets("solver", text)
    return entry_of(solvers.get(name).spec, given)


def entry_of(spec: SolverSpec, given: Mapping[str, str]) -> Entry:
    """Give options, written as text, the types that the solver declares; raises UnknownName."""
    typed = parse_options(spec, given)
    return Entry(spec.name, {option: getattr(typed, option) for option in given})


def pairs(
    surveys: Iterable[Surveyed],
    entries: Sequence[Entry],
    requests: Sequence[Request],
    tolerance: float,
    limits: Limits = Limits(),
    *,
    relaxations: bool = False,
    detours: bool = True,
    start: str = "cold",
    set: str = "",
    measure: str | None = None,
    named: Collection[str] | None = None,
) -> list[Pair]:
    """Return every pair of the plan. Solvers that drop a term (kind relaxation) take part with `relaxations` only.
    `named` : the solvers that were asked for by name, None for all.

    The requests of BEYOND take only the nodes that no exact route opens. Without `detours`, problems of matrices do not
    go to solvers of nonlinear maps.
    """
    planned: dict[str, Pair] = {}
    maps = nodes_of_maps()
    for survey in surveys:
        for request in requests:
            nodes = {*survey.nodes[request.name]}
            # else a solver would have two rows, one of them by a way that only promises less
            if request.name in BEYOND:
                nodes -= {*survey.nodes.get("exact", ())}
            if not (detours or survey.node in maps):
                nodes -= maps
            for entry in entries:
                spec = solvers.get(entry.solver).spec
                if spec.node not in nodes or (spec.kind == Kind.RELAXATION and not relaxations):
                    continue
                if entry.nearest and entry.solver != nearest_reached(survey.node, frozenset(nodes)):
                    continue
                pair = Pair(
                    address=survey.address,
                    problem=survey.problem,
                    fingerprint=survey.fingerprint,
                    node=survey.node,
                    family=survey.family,
                    sizes=survey.sizes,
                    request=request,
                    entry=entry,
                    target=spec.node,
                    tolerance=tolerance,
                    limits=limits,
                    start=start,
                    format=survey.format,
                    set=set,
                    measure=measure,
                    sequence=survey.sequence,
                    step=survey.step,
                    named=named is None or entry.solver in named,
                )
                # two files may hold one problem: it is run once, under its first name
                planned.setdefault(pair.key, pair)
    return list(planned.values())


# ----------------------------------------------------------------------------------- the automatic choice


def nearest_automatic(node: str) -> Iterator[str]:
    """Yield the automatic choices that a path of conversions reaches from a formulation, cheapest first; then our
    other solvers of that formulation."""
    own = automatic_solver(node)
    if own is not None:
        yield own
    automatic = automatic_solvers()
    # only the cheapest path of each: they come in this order
    first = {other: next(iter(graph.candidates(node, other)), None) for other in automatic if other != node}
    ordered = sorted((route.cost, automatic[other]) for other, route in first.items() if route is not None)
    yield from (name for _, name in ordered)
    yield from (name for name in _own(node) if name not in automatic.values())


def all_automatic() -> list[str]:
    """Return every solver that may be the automatic choice of some problem."""
    automatic = automatic_solvers()
    without = [node for node in graph.formulations.names() if node not in automatic]
    return [*automatic.values(), *(name for node in without for name in _own(node))]


@lru_cache(maxsize=2**10)
def nearest_reached(node: str, nodes: frozenset[str]) -> str:
    """Return the first of `nearest_automatic` whose formulation is one of `nodes`; '' where there is none."""
    return next((name for name in nearest_automatic(node) if solvers.get(name).spec.node in nodes), "")


def _own(node: str) -> Iterator[str]:
    ours = (one for one in solvers if one.spec.node == node and one.origin == "native")
    return (one.spec.name for one in ours if one.spec.by_default)
