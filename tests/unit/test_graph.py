"""Routes on made-up graphs against plain enumeration; how often a search converts; the diagrams."""

from __future__ import annotations

import itertools
import random
import re
import time
from collections import Counter
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cpbench import graph
from cpbench.cli.graph_command import draw, solvers_of
from cpbench.conversions import Conversion
from cpbench.errors import NoRoute
from cpbench.formulations import Kind, Problem
from cpbench.formulations.base import Point, Residuals, formulations, vector_field
from cpbench.foundation.matrices import Vector
from cpbench.graph import routes

SIZE, EDGES = 14, 35


@dataclass(frozen=True, eq=False)
class Nothing(Point):
    pass


@dataclass(frozen=True, eq=False, kw_only=True)
class Word(Problem):
    """A problem that remembers in `x` how it came about, or nothing of it when the edges forget."""

    title = equation = ""
    relations: ClassVar[tuple[str, ...]] = ()
    point_type = Nothing
    x: Vector = vector_field("n")

    @property
    def point_sizes(self) -> dict[str, int]:
        return {}

    def measure(self, point, tolerance: float) -> Residuals:
        return Residuals({})


NODES = [f"n{k:02d}" for k in range(SIZE)]
WORDS = {name: dataclass(frozen=True, eq=False, kw_only=True)(type(name, (Word,), {"node": name})) for name in NODES}


class Edge(Conversion):
    """An edge of a made-up graph. It refuses a problem whose history, with this edge, is in `refused`."""

    kind = Kind.EQUIVALENT

    def __init__(self, number: int, source: str, target: str, cost: float, refused=frozenset(), forget=False) -> None:
        self.name, self.number = f"{source}-{target}-{number:03d}", number
        self.source, self.target, self.cost = source, target, cost
        self.refused, self.forget = refused, forget

    def obstacle(self, problem):
        history = (*(int(k) for k in problem.x), self.number)
        return f"history {history}" if self.refused is None or history in self.refused else None

    def apply(self, problem):
        x = [] if self.forget else [*problem.x, float(self.number)]
        return WORDS[self.target](x=np.array(x)), {}

    def lift(self, point, trace):
        return point


class Counting:
    """`Conversion.step`, counted by what is converted."""

    def __init__(self) -> None:
        self.done: Counter[str] = Counter()

    def __call__(self, edge: Conversion, problem: Problem) -> Problem:
        way = " > ".join(s.conversion for s in problem.provenance)
        self.done[f"{way} > {edge.label}" if way else edge.label] += 1
        return edge.step(problem)


@pytest.fixture
def registered(monkeypatch):
    """Puts made-up edges in the place of the registry."""

    def put(made):
        monkeypatch.setattr(routes, "edges", lambda extra=(): sorted(made, key=lambda e: e.name))
        return made

    return put


def made_up(seed: int, nodes: int, count: int, **how) -> list[Edge]:
    """A random graph: costs 1 to 3, so that there are ties."""
    rng = random.Random(seed)
    return [
        Edge(k, rng.choice(NODES[:nodes]), rng.choice(NODES[:nodes]), float(rng.randint(1, 3)), **how)
        for k in range(count)
    ]


def enumerated(edges, source, target, pinned=frozenset()):
    """All paths that pass no node twice, and pinned loops once, in the order of cost and label."""
    found = []

    def walk(node, path, seen):
        if node == target and pinned <= {e.name for e in path}:
            found.append(graph.Route(tuple(path)))
        for edge in edges:
            if edge.source == node and edge not in path:
                loop = edge.target == node
                if (loop and edge.name in pinned) or (not loop and edge.target not in seen):
                    walk(edge.target, [*path, edge], seen | {edge.target})

    walk(source, [], {source})
    ends_early = [r for r in found if not any(r.steps[:k] in {f.steps for f in found} for k in range(len(r.steps)))]
    return sorted(ends_early, key=lambda r: (r.cost, r.label))


@settings(max_examples=150, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(seed=st.integers(0, 2**31), pins=st.integers(0, 2))
def test_candidates_are_all_simple_paths_in_order(registered, seed, pins):
    made = registered(made_up(seed, 6, 18))
    via = random.Random(seed).sample(made, pins)
    expected = enumerated(made, "n00", "n05", frozenset(e.name for e in via))
    assert [r.label for r in graph.candidates("n00", "n05", via=via)] == [r.label for r in expected]


@settings(max_examples=150, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(seed=st.integers(0, 2**31), share=st.floats(0.0, 0.6))
def test_arrive_takes_the_first_candidate_without_a_refusal(registered, seed, share):
    """The refusals depend on the whole way: what one prefix may not, another one may."""
    made = made_up(seed, 6, 18)
    rng = random.Random(seed)
    every = {tuple(e.number for e in r.steps[:k]) for r in enumerated(made, "n00", "n05") for k in range(1, 7)}
    refused = frozenset(h for h in sorted(every) if rng.random() < share)
    for edge in made:
        edge.refused = refused
    registered(made)

    def steps(route):
        return [tuple(e.number for e in route.steps[:k]) for k in range(1, len(route.steps) + 1)]

    working = [r for r in enumerated(made, "n00", "n05") if not refused & set(steps(r))]
    apply, start = Counting(), WORDS["n00"](x=np.zeros(0))
    if working:
        arrival = graph.arrive(start, "n05", apply=apply)
        assert arrival.route.label == working[0].label
        assert tuple(arrival.problem.x) == tuple(e.number for e in working[0].steps)
        for end in arrival.dead_ends:
            assert end.route.cost <= arrival.route.cost
    else:
        with pytest.raises(NoRoute):
            graph.arrive(start, "n05", apply=apply)
    assert not apply.done or max(apply.done.values()) == 1  # every prefix once
    led_on = {" > ".join(e.label for e in r.steps[:k]) for r in enumerated(made, "n00", "n05") for k in range(1, 7)}
    assert set(apply.done) <= led_on  # nothing from where no path leads on
    dead = graph.explain(start, "n05")
    assert len({end.route.label for end in dead}) == len(dead)  # every refusal once
    assert all(end.obstacle == f"history {tuple(e.number for e in end.route.steps)}" for end in dead)
    everywhere = [a.route.label for a in graph.arrivals(start, "n05")]
    assert everywhere == [r.label for r in working]
    before = [(a.route.label, len(a.problem.x)) for a in graph.arrivals(start, "n05", finish=False)]
    assert before == [(r.label, len(r.steps) - 1) for r in working]


@pytest.mark.parametrize("seed", range(5))
def test_a_search_in_vain_stays_small(registered, seed):
    """14 nodes, 35 edges, and whatever leads into the target refuses. Edges that forget make equal problems."""
    made = made_up(seed, SIZE, EDGES, forget=True)
    target = NODES[-1]
    for edge in made:
        if edge.target == target:
            edge.refused = None
    registered(made)
    apply = Counting()
    begun = time.process_time()
    dead = graph.explain(WORDS["n00"](x=np.zeros(0)), target, apply=apply)
    assert time.process_time() - begun < 5.0
    # the first prefix of a node goes on; another one only with a node less behind it
    assert sum(apply.done.values()) <= 4 * EDGES
    assert len({end.route.label for end in dead}) == len(dead)


def test_a_dead_first_edge_kills_all_behind_it(registered):
    """Two hundred routes begin with one edge: it is asked once, nothing is converted."""
    first = Edge(0, "n00", "n01", 1.0)
    first.refused = None
    layers = [NODES[k : k + 3] for k in range(2, 14, 3)]
    made = [first, *(Edge(1 + k, "n01", name, 1.0) for k, name in enumerate(layers[0]))]
    for above, below in itertools.pairwise(layers):
        made += [Edge(len(made) + 3 * i + j, a, b, 1.0) for i, a in enumerate(above) for j, b in enumerate(below)]
    registered(made)
    asked = Counter()
    first.obstacle = lambda problem: asked.update(["first"]) or "no"
    apply = Counting()
    dead = graph.explain(WORDS["n00"](x=np.zeros(0)), NODES[-1], apply=apply)
    assert len(graph.candidates("n00", NODES[-1])) == 27
    assert [str(end) for end in dead] == [f"{first.name} refuses: no"]
    assert (asked["first"], sum(apply.done.values())) == (1, 0)


def test_a_loop_is_taken_when_pinned_and_once(registered):
    loop, ahead = Edge(0, "n00", "n00", 1.0), Edge(1, "n00", "n01", 1.0)
    loop_there = Edge(2, "n01", "n01", 1.0)
    registered([loop, ahead, loop_there])
    assert [r.label for r in graph.candidates("n00", "n00")] == ["direct"]
    assert [r.label for r in graph.candidates("n00", "n01")] == [ahead.name]
    assert [r.label for r in graph.candidates("n00", "n01", via=[loop])] == [f"{loop.name} > {ahead.name}"]
    assert [r.label for r in graph.candidates("n00", "n00", via=[loop])] == [loop.name]
    both = [r.label for r in graph.candidates("n00", "n01", via=[loop_there, loop])]
    assert both == [f"{loop.name} > {ahead.name} > {loop_there.name}"]  # in whatever order they were named
    arrival = graph.arrive(WORDS["n00"](x=np.zeros(0)), "n01", via=[loop_there, loop])
    assert [s.conversion for s in arrival.problem.provenance] == [loop.name, ahead.name, loop_there.name]


def test_pinned_conversions_that_no_path_joins_are_named(registered):
    one, other = Edge(0, "n00", "n01", 1.0), Edge(1, "n02", "n01", 1.0)
    registered([one, other])
    with pytest.raises(NoRoute, match=f"no path takes {one.name} and {other.name} and no node twice"):
        graph.arrive(WORDS["n00"](x=np.zeros(0)), "n01", via=[one, other])


def test_a_memory_keeps_apart_what_came_by_other_ways(registered):
    """Two ways to equal problems: each keeps its own provenance."""
    made = registered([Edge(k, "n00", "n01", 1.0 + k, forget=True) for k in range(2)])
    ahead = Edge(2, "n01", "n02", 1.0, forget=True)
    registered([*made, ahead])
    memory, start = graph.Memory(), WORDS["n00"](x=np.zeros(0))
    for _ in range(2):
        for edge in made:
            arrival = graph.arrive(start, "n02", via=[edge], apply=memory)
            assert [s.conversion for s in arrival.problem.provenance] == [edge.name, ahead.name]
            assert memory.seconds(start, arrival.route) > 0


@pytest.mark.nightly
def test_every_real_search_is_short():
    """Over the registered graph, all kinds: no pair has so many routes that a list of them would hurt."""
    begun = time.process_time()
    most = max(len(graph.candidates(a, b, graph.ALL)) for a in formulations.names() for b in formulations.names())
    assert most < 4000  # to `equation`, where the last step alone is one of five
    assert time.process_time() - begun < 20.0


@pytest.mark.parametrize("kinds", [graph.EXACT, graph.ALL], ids=["exact", "all"])
def test_the_text_has_every_edge_under_its_source(kinds):
    text = draw(kinds) + "\n"
    blocks = dict(re.findall(r"^(\w+): .*\n((?:  .*\n)*)", text, re.MULTILINE))
    assert set(blocks) == set(formulations.names())
    for node, block in blocks.items():
        assert block.startswith(f"  solvers: {', '.join(solvers_of(node)) or 'none'}\n")
        arrows = [tuple(found) for found in re.findall(r"-> (\w+) +(\S+)", block)]
        shown = [e for e in graph.edges() if e.source == node and graph.best_kind(e) in kinds]
        assert sorted(arrows) == sorted((e.target, e.name) for e in shown)
