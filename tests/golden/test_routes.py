"""The routes between all pairs of formulations, pinned: cheapest first, ties by name, whatever was registered when."""

from __future__ import annotations

import itertools
import random

import pytest

from cpbench import graph
from cpbench.conversions.base import conversions, make
from cpbench.formulations import formulations

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

PAIRS = [(a, b) for a in ("fc", "gfc", "lcp", "mlcp", "qp") for b in ("fc", "gfc", "lcp", "mlcp", "qp") if a != b]


def labels(source: str, target: str, kinds=graph.EXACT, via=()) -> list[str]:
    """Routes over the first edges alone."""
    found = graph.candidates(source, target, kinds, via)
    return [route.label for route in found if {step.name for step in route.steps} <= FIRST]


@pytest.mark.parametrize(("source", "target"), PAIRS)
def test_exact_routes(source, target):
    assert labels(source, target) == EXACT.get((source, target), [])


@pytest.mark.parametrize(("source", "target"), CHEAPEST_OF_ALL)
def test_all_routes_begin_with(source, target):
    expected = CHEAPEST_OF_ALL[source, target]
    assert labels(source, target, graph.ALL)[: len(expected)] == expected


def test_candidates_come_by_cost_then_label():
    for source, target in itertools.product(formulations.names(), repeat=2):
        found = graph.candidates(source, target, graph.ALL)
        assert found == sorted(found, key=lambda route: (route.cost, route.label)), (source, target)
        assert len({route.label for route in found}) == len(found)
        for route in found:
            assert len(set(route.nodes)) == len(route.nodes), route.label


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
