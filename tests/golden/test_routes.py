"""The routes between all pairs of formulations, pinned: cheapest first, ties by name, whatever was registered when."""

from __future__ import annotations

import itertools
import random
from pathlib import Path

import pytest

from cpbench import graph
from cpbench.conversions.base import conversions, make
from cpbench.formulations import formulations

CHOSEN = Path(__file__).parent / "chosen_routes.txt"
"""The first exact candidate of every ordered pair of nodes."""


def chosen_routes() -> str:
    """What CHOSEN holds; `print(chosen_routes(), end="")` makes it again."""
    lines: list[str] = []
    for source, target in itertools.permutations(formulations.names(), 2):
        found = graph.candidates(source, target)
        lines += [f"{source} {target}: {found[0].label}\n"] if found else []
    return "".join(lines)


def test_the_first_candidate_of_every_pair():
    assert chosen_routes() == CHOSEN.read_text()


@pytest.mark.parametrize("seed", range(2))
def test_order_of_registration_does_not_matter(seed, monkeypatch):
    items = list(conversions._items.items())
    random.Random(seed).shuffle(items)
    monkeypatch.setattr(conversions, "_items", dict(items))
    assert chosen_routes() == CHOSEN.read_text()


def test_exact_routes_come_before_the_cheapest_facets():
    found = [route.label for route in graph.candidates("fc", "lcp", graph.ALL)]
    assert [label for label in found if " > " not in label][:4] == [
        "fc-lcp-frictionless", "fc-lcp-2d", "fc-lcp-inner", "fc-lcp-outer",
    ]  # fmt: skip


def test_a_pinned_conversion_is_on_every_route_with_its_knobs():
    found = [route.label for route in graph.candidates("gfc", "qp", via=[make("fc-lcp-inner", {"facets": 16})])]
    assert "gfc-fc > fc-lcp-inner[facets=16] > lcp-qp" in found
    assert all(" fc-lcp-inner[facets=16] " in label for label in found)


def test_reachable():
    assert {"fc", "gfc", "lcp", "mlcp", "qp"} <= set(graph.reachable("gfc"))
    assert {"lcp", "mlcp", "qp"} <= set(graph.reachable("qp"))
    for source, target in itertools.product(formulations.names(), repeat=2):
        leads = source == target or bool(graph.candidates(source, target))
        assert (target in graph.reachable(source)) == leads, (source, target)
