"""Maps by their own lists of operations: the interpreter at special numbers, derivatives beside CasADi's, corners."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpbench.formulations.expressions import Builder, Map, Operator
from cpbench.formulations.expressions.derivatives import derivative, second_derivative
from cpbench.formulations.expressions.evaluation import Interpreted
from cpbench.formulations.expressions.recording import (
    MapRecorder,
    either,
    less,
    maximum,
    minimum,
    product,
    recorded,
    where,
)

SPECIAL = (0.0, -0.0, 1.0, -1.0, 0.5, -3.2, 1e300, 1e-300, np.inf, -np.inf, np.nan)
SMOOTH = (
    Operator.ADD, Operator.SUB, Operator.MUL, Operator.DIV, Operator.EXP, Operator.SIN, Operator.TANH, Operator.SQRT,
    Operator.MIN, Operator.MAX, Operator.ABS, Operator.ATAN2, Operator.NEG, Operator.POW,
)  # fmt: skip


@pytest.mark.parametrize("operator", Operator)
def test_the_interpreter_is_numpy_at_special_numbers(operator: Operator) -> None:
    """But for the root of −∞ by a power, which C says is ∞ and NumPy is none."""
    build = Builder(2)
    F = build.finish([build.apply(operator, 0, 1) if operator.binary else build.apply(operator, 0)])
    mine = Interpreted(F)
    for a in SPECIAL:
        for b in SPECIAL if operator.binary else (0.0,):
            if (operator, a, b) != (Operator.POW, -np.inf, 0.5):
                np.testing.assert_allclose(mine(np.array([a, b])), F.evaluate(np.array([a, b])), rtol=4e-16)


@st.composite
def maps(draw: st.DrawFn) -> Map:
    n = draw(st.integers(1, 4))
    build = Builder(n)
    numbers = [*range(n), *(build.constant(c) for c in draw(st.lists(st.floats(-3, 3), max_size=2)))]
    for operator in draw(st.lists(st.sampled_from(SMOOTH), min_size=1, max_size=10)):
        numbers.append(build.apply(operator, *(draw(st.sampled_from(numbers)) for _ in range(1 + operator.binary))))
    return build.finish(draw(st.lists(st.sampled_from(numbers), min_size=1, max_size=4)))


@settings(max_examples=25, deadline=None, derandomize=True)
@given(maps(), st.integers(0, 1000))
def test_derivatives_are_casadis(F: Map, seed: int) -> None:
    """Where CasADi's are numbers; at a step that is not evaluated ours may be one where CasADi has 0·∞."""
    rng = np.random.default_rng(seed)
    z, w = rng.uniform(0.2, 0.9, F.inputs), rng.standard_normal(F.rows)
    s, v = ca.SX.sym("z", F.inputs), ca.SX.sym("w", F.rows)
    value = F.sx(s)
    theirs = ca.Function("d", [s, v], [ca.densify(ca.jacobian(value, s)), ca.hessian(ca.dot(v, value), s)[0]])
    J, H = (np.array(ca.densify(part)) for part in theirs(z, w))
    for mine, other in ((F.jacobian(z), J), (F.hessian(z, w), H)):
        mine = mine.toarray()
        known = np.isfinite(other) & (np.abs(other) < 1e8)
        np.testing.assert_allclose(mine[known], other[known], rtol=1e-7, atol=1e-7)


def test_both_ways_through_a_list_give_the_same() -> None:
    """One row of many unknowns goes backwards, many rows of one unknown forwards: each beside a derivative by hand."""
    n = 30
    a, z = np.arange(1.0, n + 1.0), np.linspace(0.1, 0.9, n)
    row = recorded(n, lambda x: np.log((a * np.exp(x)).sum()))
    total = a @ np.exp(z)
    share = a * np.exp(z) / total
    np.testing.assert_allclose(row.jacobian(z).toarray()[0], share, rtol=1e-14)
    np.testing.assert_allclose(
        row.hessian(z, np.ones(1)).toarray(), np.diag(share) - np.outer(share, share), atol=1e-16
    )
    column = recorded(1, lambda x: a * np.sin(a * x[0]))
    np.testing.assert_allclose(column.jacobian(z[:1]).toarray()[:, 0], a * a * np.cos(a * z[0]), rtol=1e-14)


@pytest.mark.parametrize(
    ("formula", "at", "slope"),
    [
        (np.abs, 0.0, 0.0),
        (lambda x: minimum(x, 2.0 * x), 0.0, 1.0),
        (lambda x: maximum(2.0 * x, x), 0.0, 2.0),
        (lambda x: where(less(0.0, x), np.sqrt(either(less(0.0, x), x, 1.0))), 0.0, 0.0),
        (lambda x: x**3, 0.0, 0.0),
        (lambda x: x**0.5, 4.0, 0.25),
    ],
)
def test_a_corner_has_one_derivative(formula: Any, at: float, slope: float) -> None:
    assert recorded(1, formula).jacobian(np.array([at])).toarray().tolist() == [[slope]]


def test_what_is_constant_has_no_entry() -> None:
    F = recorded(2, lambda z: np.array([3.0 * z[0] + 1.0, z[0] * z[0], 7.0]))
    entries, indices, indptr = derivative(F)
    assert (indices.tolist(), indptr.tolist()) == ([0, 0], [0, 1, 2, 2])
    assert entries(np.array([5.0, 0.0])).tolist() == [3.0, 10.0]
    second, indices, _ = second_derivative(F)
    assert indices.tolist() == [0]
    assert second(np.array([5.0, 0.0, 1.0, 4.0, 1.0])).tolist() == [8.0]


def test_maps_of_maps() -> None:
    """G(z) = F(z) + F′(z)ᵀw with F = (ab, a − b), by hand."""
    F = recorded(2, lambda z: np.array([z[0] * z[1], z[0] - z[1]]))
    record = MapRecorder(4)
    z, w = record.z[:2], record.z[2:]
    G = record.map(record(F, z) + record.transposed(F, z, w))
    a, b, u, v = at = np.array([2.0, 3.0, 0.5, 0.25])
    assert G(at).tolist() == [a * b + b * u + v, a - b + a * u - v]


def test_products_with_stored_numbers_only() -> None:
    M = np.array([[0.0, 2.0], [0.0, 0.0]])
    F = recorded(2, lambda z: product(M, z))
    assert F(np.array([1.0, 3.0])).tolist() == [6.0, 0.0]
    assert recorded(0, lambda z: product(np.zeros((1, 0)), z) + 2.0)(np.zeros(0)).tolist() == [2.0]


def test_a_symbol_has_no_truth() -> None:
    with pytest.raises(TypeError, match="where"):
        recorded(1, lambda z: z if z[0] else -z)


def test_numbers_beside_a_wrong_length_are_refused() -> None:
    with pytest.raises(ValueError, match="has 1 unknowns"):
        Interpreted(recorded(1, np.sin))(np.zeros(2))
