"""The routes between all pairs of formulations, pinned: cheapest first, ties by name, whatever was registered when."""

from __future__ import annotations

import itertools
import random
from pathlib import Path

import pytest

from cpbench import graph
from cpbench.conversions.base import conversions, make
from cpbench.errors import NoRoute
from cpbench.formulations import formulations
from cpbench.graph import routes
from cpbench.testing import cases

FIRST = frozenset(
    {
        "fc-lcp-2d",
        "fc-lcp-inner",
        "fc-lcp-outer",
        "fc-mlcp-outer",
        "gfc-fc",
        "lcp-mlcp",
        "lcp-qp",
        "lcp-qp-nonsymmetric",
        "mlcp-lcp-schur",
        "mlcp-lcp-split",
        "qp-mlcp",
    }
)
"""The edges between the first five nodes. What is pinned of them holds whatever else there is."""

EXACT = {
    ("fc", "lcp"): ["fc-lcp-2d"],
    ("fc", "mlcp"): [
        "fc-lcp-2d > lcp-mlcp",
        "fc-lcp-2d > lcp-qp > qp-mlcp",
        "fc-lcp-2d > lcp-qp-nonsymmetric > qp-mlcp",
    ],
    ("fc", "qp"): ["fc-lcp-2d > lcp-qp", "fc-lcp-2d > lcp-qp-nonsymmetric"],
    ("gfc", "fc"): ["gfc-fc"],
    ("gfc", "lcp"): ["gfc-fc > fc-lcp-2d"],
    ("gfc", "mlcp"): [
        "gfc-fc > fc-lcp-2d > lcp-mlcp",
        "gfc-fc > fc-lcp-2d > lcp-qp > qp-mlcp",
        "gfc-fc > fc-lcp-2d > lcp-qp-nonsymmetric > qp-mlcp",
    ],
    ("gfc", "qp"): ["gfc-fc > fc-lcp-2d > lcp-qp", "gfc-fc > fc-lcp-2d > lcp-qp-nonsymmetric"],
    ("lcp", "mlcp"): ["lcp-mlcp", "lcp-qp > qp-mlcp", "lcp-qp-nonsymmetric > qp-mlcp"],
    ("lcp", "qp"): ["lcp-qp", "lcp-qp-nonsymmetric"],
    ("mlcp", "lcp"): ["mlcp-lcp-schur", "mlcp-lcp-split"],
    ("mlcp", "qp"): [
        "mlcp-lcp-schur > lcp-qp",
        "mlcp-lcp-schur > lcp-qp-nonsymmetric",
        "mlcp-lcp-split > lcp-qp",
        "mlcp-lcp-split > lcp-qp-nonsymmetric",
    ],
    ("qp", "lcp"): ["qp-mlcp > mlcp-lcp-schur", "qp-mlcp > mlcp-lcp-split"],
    ("qp", "mlcp"): ["qp-mlcp"],
}
"""Every other ordered pair of the first five nodes has no exact route over those edges."""

CHEAPEST_OF_ALL = {
    ("fc", "lcp"): ["fc-lcp-2d", "fc-lcp-inner", "fc-lcp-outer", "fc-mlcp-outer > mlcp-lcp-schur"],
    ("fc", "mlcp"): ["fc-lcp-2d > lcp-mlcp", "fc-lcp-2d > lcp-qp > qp-mlcp", "fc-mlcp-outer"],
    ("gfc", "lcp"): ["gfc-fc > fc-lcp-2d", "gfc-fc > fc-lcp-inner"],
}
"""The first routes when approximate ones are asked for too."""

SHORTCUTS = {"fc-lcp-frictionless", "gfc-mlcp", "avi-lcp-bounds"}
"""Edges that came later and are cheaper where they apply: no friction, nothing but bounds."""

CHOSEN = Path(__file__).parent / "chosen_routes.txt"
"""The first exact candidate of every ordered pair of nodes."""

PAIRS = [(a, b) for a in ("fc", "gfc", "lcp", "mlcp", "qp") for b in ("fc", "gfc", "lcp", "mlcp", "qp") if a != b]


def labels(source: str, target: str, kinds=graph.EXACT, via=()) -> list[str]:
    """Routes over the first edges alone."""
    found = graph.candidates(source, target, kinds, via)
    return [route.label for route in found if {step.name for step in route.steps} <= FIRST]


@pytest.mark.parametrize(("source", "target"), PAIRS)
def test_exact_routes(source, target):
    assert labels(source, target) == EXACT.get((source, target), [])


def chosen_routes() -> str:
    """What CHOSEN holds; `print(chosen_routes(), end="")` makes it again."""
    lines: list[str] = []
    for source, target in itertools.permutations(formulations.names(), 2):
        found = graph.candidates(source, target)
        lines += [f"{source} {target}: {found[0].label}\n"] if found else []
    return "".join(lines)


def test_the_first_candidate_of_every_pair():
    assert chosen_routes() == CHOSEN.read_text()


def test_planted_problems_take_the_routes_they_took(monkeypatch):
    """Over all edges a problem goes as it goes over the first ones alone, or by a shortcut that costs no more."""
    every = {pair: _arrivals(*pair) for pair in PAIRS}
    real = routes.edges
    monkeypatch.setattr(routes, "edges", lambda extra=(): [e for e in real(extra) if e.name in FIRST])
    for pair in PAIRS:
        for name, before in _arrivals(*pair).items():
            now = every[pair][name]
            if before is not None and now.label != before.label:
                assert SHORTCUTS & {step.name for step in now.steps}, (pair, name, now.label)
                assert now.cost <= before.cost, (pair, name, now.label)


def _arrivals(source: str, target: str) -> dict[str, graph.Route | None]:
    """By planted case, the route taken."""
    found: dict[str, graph.Route | None] = {}
    for case in cases(source):
        try:
            found[case.name] = graph.arrive(case.problem, target).route
        except NoRoute:
            found[case.name] = None
    return found


@pytest.mark.parametrize(("source", "target"), CHEAPEST_OF_ALL)
def test_all_routes_begin_with(source, target):
    expected = CHEAPEST_OF_ALL[source, target]
    assert labels(source, target, graph.ALL)[: len(expected)] == expected


def test_the_pinned_pairs_are_all_pairs():
    assert {node for pair in PAIRS for node in pair} <= set(formulations.names())


@pytest.mark.parametrize("seed", range(3))
def test_order_of_registration_does_not_matter(seed, monkeypatch):
    expected = {pair: labels(*pair, graph.ALL) for pair in PAIRS}
    items = list(conversions._items.items())
    random.Random(seed).shuffle(items)
    monkeypatch.setattr(conversions, "_items", dict(items))
    assert {pair: labels(*pair, graph.ALL) for pair in PAIRS} == expected


def test_a_pinned_conversion_is_on_every_route_with_its_knobs():
    edge = make("fc-lcp-inner", {"facets": 16})
    found = labels("gfc", "qp", via=[edge])
    assert found == [
        "gfc-fc > fc-lcp-inner[facets=16] > lcp-qp",
        "gfc-fc > fc-lcp-inner[facets=16] > lcp-qp-nonsymmetric",
    ]


def test_reachable():
    assert {"fc", "gfc", "lcp", "mlcp", "qp"} <= set(graph.reachable("gfc"))
    assert {"lcp", "mlcp", "qp"} <= set(graph.reachable("qp"))
    for source, target in itertools.product(formulations.names(), repeat=2):
        leads = source == target or bool(graph.candidates(source, target))
        assert (target in graph.reachable(source)) == leads, (source, target)
