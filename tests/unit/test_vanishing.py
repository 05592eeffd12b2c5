"""Equations that say that an unknown is 0 are judged as the complementarity problem that they are made of."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from lecture.numerics.examples.maps import mapped

from cpbench.conversions.base import make
from cpbench.formulations import LCP, Equation
from cpbench.formulations.nonlinear import EquationPoint
from cpbench.verification.verdict import judge


def _equation(formula: Any, n: int) -> Equation:
    return Equation(F=mapped(n, formula), start=np.ones(n))


def test_a_linear_row_with_a_small_constant_counts_in_full() -> None:
    """x = 1e-9 is data: 1 is as wrong there as anywhere, though x has little effect on a row that is not linear."""
    problem = _equation(lambda x, y: [x - 1e-9, x + y * y - 1e12], 2)
    z = np.array([1.0, np.sqrt(1e12 - 1.0)])
    assert judge(problem, EquationPoint(z=z), 1e-6).error >= 0.5


@pytest.mark.parametrize("size", [0.3, 1e-3, 1e-6])
def test_a_curved_row_has_the_size_at_which_it_bends(size: float) -> None:
    """x(1 - x) = 0 has the roots 0 and 1: x is off by itself, however little effect it has elsewhere."""
    problem = _equation(lambda x, y: [x * (1 - x), 1e-9 * x + y - 1], 2)
    error = judge(problem, EquationPoint(z=np.array([size, 1.0])), 1e-9).error
    assert size / 4 <= error <= 4 * size


@pytest.mark.parametrize("function", ["min", "fb", "pfb", "ep"])
@pytest.mark.parametrize(("z", "right"), [(1e-13, True), (1e-3, False)])
def test_rounding_of_a_pair_tells_nothing_of_other_unknowns(function: str, z: float, right: bool) -> None:
    """Two pairs with w = 0 beside z = 1, and z₃ = 0 beside w₃ = z₂ + z₃.

    The first w is 1e-13, which a rounded entry of its row, 1.2e-13, would explain by z₂ = 1; without that z₃ does not
    vanish beside w₃.
    """
    M = np.array([[1.0, 1.2e-13, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0]])
    mixed = make("lcp-mlcp").apply(LCP(M=M, q=np.array([-1.0 - 2e-14, -1.0, 0.0])))[0]
    equation = make(f"micp-equation-{function}").apply(make("mlcp-micp").apply(mixed)[0])[0]
    assert judge(equation, EquationPoint(z=np.array([1.0, 1.0, z])), 1e-6).solved == right
