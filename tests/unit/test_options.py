"""Options of a solver: which values they may have."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

import pytest

from cpbench.errors import UnknownName
from cpbench.solvers.base import SolverSpec, parse_options, solvers
from cpbench.solvers.options import choices


class Order(StrEnum):
    FORWARD = "forward"
    BACKWARD = "backward"


@dataclass(frozen=True)
class Options:
    omega: float = 1.0
    order: Order = Order.FORWARD
    norm: Literal["2", "inf"] = "2"
    name: str = "free"


def test_enums_and_literals_limit_an_option() -> None:
    assert choices(Options, "order") == (Order.FORWARD, Order.BACKWARD)
    assert choices(Options, "norm") == ("2", "inf")
    assert choices(Options, "omega") == choices(Options, "name") == ()


def test_other_values_are_refused_by_name() -> None:
    spec = SolverSpec(name="mine", node="lcp", summary="", method="", options=Options)
    assert parse_options(spec, {"omega": "7"}).omega == 7.0
    assert parse_options(spec, {"order": "backward"}).order is Order.BACKWARD
    with pytest.raises(UnknownName, match="inf"):
        parse_options(spec, {"norm": "1"})
    with pytest.raises(UnknownName, match="forward"):
        parse_options(spec, {"order": "sideways"})


@pytest.mark.needs("cpbench_solvers")
def test_the_default_of_every_limited_option_is_one_of_its_choices() -> None:
    limited = 0
    for solver in solvers:
        options = solver.spec.options()
        for name in vars(options):
            if among := choices(solver.spec.options, name):
                limited += 1
                assert getattr(options, name) in among, f"{solver.spec.name}[{name}]"
    assert limited
