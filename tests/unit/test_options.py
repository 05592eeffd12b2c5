"""Where the options of a solver may lie: what metadata say, and what is derived without."""

from __future__ import annotations

import random
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

import pytest

from cpbench.errors import UnknownName
from cpbench.solvers.base import SolverSpec, parse_options, solvers
from cpbench.solvers.options import Domain, domains, fixed, searched


class Order(StrEnum):
    FORWARD = "forward"
    BACKWARD = "backward"


@dataclass(frozen=True)
class Options:
    omega: float = searched(1.0, low=0.5, high=1.9)
    local: str = searched("newton", choices=("newton", "exact"))
    window: int = fixed(7)
    rho: float = 0.1
    block: int = 4
    shuffle: bool = False
    order: Order = Order.FORWARD
    norm: Literal["2", "inf"] = "2"
    offset: float = 0.0
    max_iterations: int = 100
    name: str = "free"


def test_what_is_searched_and_where() -> None:
    assert domains(Options) == {
        "omega": Domain(low=0.5, high=1.9),
        "local": Domain(choices=("newton", "exact")),
        "rho": Domain(low=0.01, high=1.0, log=True),
        "block": Domain(low=1.0, high=40, log=True, whole=True),
        "shuffle": Domain(choices=(False, True)),
        "order": Domain(choices=(Order.FORWARD, Order.BACKWARD)),
        "norm": Domain(choices=("2", "inf")),
    }


def test_a_draw_lies_in_its_domain_and_can_be_typed() -> None:
    source = random.Random(3)
    spec = SolverSpec(name="mine", node="lcp", summary="", method="", options=Options)
    for _ in range(200):
        drawn = {name: domain.draw(source) for name, domain in domains(Options).items()}
        assert 0.5 <= drawn["omega"] <= 1.9
        assert 0.01 <= drawn["rho"] <= 1.0
        assert drawn["block"] in range(1, 41)
        typed = parse_options(spec, {name: str(value) for name, value in drawn.items()})
        assert {name: getattr(typed, name) for name in drawn} == drawn


def test_choices_are_all_that_is_allowed_and_a_range_is_not() -> None:
    spec = SolverSpec(name="mine", node="lcp", summary="", method="", options=Options)
    assert parse_options(spec, {"omega": "7"}).omega == 7.0
    with pytest.raises(UnknownName, match="newton"):
        parse_options(spec, {"local": "neuton"})
    with pytest.raises(UnknownName):
        parse_options(spec, {"norm": "1"})


def test_the_range_of_every_solver_holds_its_default() -> None:
    for solver in solvers:
        options = solver.spec.options()
        for name, domain in domains(solver.spec.options).items():
            value = getattr(options, name)
            inside = value in domain.choices if domain.choices else domain.low <= value <= domain.high
            assert inside, f"{solver.spec.name}[{name}={value}] is not in {domain}"
