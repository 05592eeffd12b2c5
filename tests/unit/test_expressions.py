"""Maps: every operator against mpmath, derivatives, the canonical list, CasADi's expressions."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from typing import Any

import casadi as ca
import mpmath
import numpy as np
import pytest
from drawn_cases import maps
from hypothesis import given, settings
from hypothesis import strategies as st
from lecture.numerics.examples.maps import mapped

from cpbench.errors import ProblemError
from cpbench.formulations.expressions import Builder, Map, Operator
from cpbench.formulations.expressions.batches import Batches
from cpbench.formulations.expressions.infix import formulas

# Of every operator: the same function of mpmath, and pairs of arguments (the second one for two).
ANY = ((0.7, 1.3), (-1.2, 0.4), (2.5, -0.6), (0.0, 1.0))
POSITIVE = ((0.7, 1.3), (2.5, -0.6), (1e-3, 2.0))
INSIDE = ((0.3, 0.0), (-0.7, 0.0), (0.0, 0.0))
REFERENCE: dict[Operator, tuple[Callable[..., Any], tuple[tuple[float, float], ...]]] = {
    Operator.NEG: (lambda a: -a, ANY),
    Operator.ABS: (abs, ANY[:3]),
    Operator.SQRT: (mpmath.sqrt, POSITIVE),
    Operator.EXP: (mpmath.exp, ANY),
    Operator.LOG: (mpmath.log, POSITIVE),
    Operator.EXPM1: (mpmath.expm1, (*ANY, (1e-9, 0.0))),
    Operator.LOG1P: (mpmath.log1p, (*POSITIVE, (-0.5, 0.0), (1e-9, 0.0))),
    Operator.SIN: (mpmath.sin, ANY),
    Operator.COS: (mpmath.cos, ANY),
    Operator.TAN: (mpmath.tan, ANY),
    Operator.ASIN: (mpmath.asin, INSIDE),
    Operator.ACOS: (mpmath.acos, INSIDE),
    Operator.ATAN: (mpmath.atan, ANY),
    Operator.SINH: (mpmath.sinh, ANY),
    Operator.COSH: (mpmath.cosh, ANY),
    Operator.TANH: (mpmath.tanh, ANY),
    Operator.ASINH: (mpmath.asinh, ANY),
    Operator.ACOSH: (mpmath.acosh, ((1.5, 0.0), (7.0, 0.0))),
    Operator.ATANH: (mpmath.atanh, INSIDE),
    Operator.ERF: (mpmath.erf, ANY),
    Operator.FLOOR: (mpmath.floor, ANY),
    Operator.CEIL: (mpmath.ceil, ANY),
    Operator.NOT: (lambda a: mpmath.mpf(a == 0), ANY),
    Operator.ADD: (lambda a, b: a + b, ANY),
    Operator.SUB: (lambda a, b: a - b, ANY),
    Operator.MUL: (lambda a, b: a * b, ANY),
    Operator.DIV: (lambda a, b: a / b, ANY),
    Operator.POW: (lambda a, b: a**b, POSITIVE),
    Operator.ATAN2: (mpmath.atan2, ANY),
    Operator.MIN: (min, ANY),
    Operator.MAX: (max, ANY),
    Operator.LT: (lambda a, b: mpmath.mpf(a < b), (*ANY, (1.0, 1.0))),
    Operator.LE: (lambda a, b: mpmath.mpf(a <= b), (*ANY, (1.0, 1.0))),
    Operator.EQ: (lambda a, b: mpmath.mpf(a == b), (*ANY, (1.0, 1.0))),
    Operator.AND: (lambda a, b: mpmath.mpf(a != 0 and b != 0), (*ANY, (1.0, 0.0))),
    Operator.OR: (lambda a, b: mpmath.mpf(a != 0 or b != 0), (*ANY, (0.0, 0.0))),
    Operator.CHOOSE: (lambda a, b: b if a != 0 else mpmath.mpf(0), ANY),
}
STEPS = {
    Operator.FLOOR, Operator.CEIL, Operator.NOT, Operator.LT, Operator.LE, Operator.EQ, Operator.AND, Operator.OR,
    Operator.CHOOSE, Operator.ABS,
}  # fmt: skip
"""Those that jump or bend: mpmath's difference quotients are no derivatives at the places above."""


def _single(operator: Operator) -> Map:
    build = Builder(2)
    return build.finish([build.apply(operator, 0, 1) if operator.binary else build.apply(operator, 0)])


def test_every_operator_has_a_reference() -> None:
    assert set(REFERENCE) == set(Operator)


@pytest.mark.parametrize("operator", Operator)
def test_an_operator_is_what_mpmath_says(operator: Operator) -> None:
    reference, places = REFERENCE[operator]
    F = _single(operator)
    for place in places:
        z = np.array(place)
        value = float(reference(*map(mpmath.mpf, place[: 1 + operator.binary])))
        for mine in (F(z), F.evaluate(z), Batches(F)(z)):
            assert mine[0] == pytest.approx(value, rel=1e-14, abs=1e-15)


@pytest.mark.parametrize("operator", sorted(set(Operator) - STEPS))
def test_a_derivative_is_what_mpmath_says(operator: Operator) -> None:
    reference, places = REFERENCE[operator]
    F = _single(operator)
    for place in places:
        J, H = F.jacobian(np.array(place)).toarray()[0], F.hessian(np.array(place), np.ones(1)).toarray()
        arguments = [mpmath.mpf(x) for x in place[: 1 + operator.binary]]
        for k, at in enumerate(arguments):

            def along(t: Any, k: int = k, arguments: list[Any] = arguments) -> Any:
                return reference(*arguments[:k], t, *arguments[k + 1 :])

            assert J[k] == pytest.approx(float(mpmath.diff(along, at)), rel=1e-12, abs=1e-12)
            assert H[k, k] == pytest.approx(float(mpmath.diff(along, at, 2)), rel=1e-12, abs=1e-12)


def test_choose_does_not_look_at_what_it_leaves_out() -> None:
    build = Builder(1)
    zero = build.constant(0.0)
    F = build.finish([build.apply(Operator.CHOOSE, build.apply(Operator.LT, zero, 0), build.apply(Operator.SQRT, 0))])
    for z, value in ((-4.0, 0.0), (4.0, 2.0)):
        assert F(np.array([z])).tolist() == F.evaluate(np.array([z])).tolist() == [value]


# ------------------------------------------------------------------------------- random lists of operations

SMOOTH = sorted(set(Operator) - STEPS - {Operator.MIN, Operator.MAX})


def _steady(F: Map, z: Any) -> Any:
    """Rows whose value does not hang on the last bits of z."""
    there, near = F.evaluate(z), F.evaluate(z * (1 + 1e-12))
    with np.errstate(all="ignore"):
        return np.isfinite(there) & np.isfinite(near) & (np.abs(there - near) <= 1e-10 * (1 + np.abs(there)))


@settings(max_examples=150, deadline=None, derandomize=True)
@given(maps(SMOOTH), st.integers(0, 1000))
def test_all_ways_to_evaluate_agree(F: Map, seed: int) -> None:
    z = np.random.default_rng(seed).uniform(0.2, 0.9, F.inputs)
    kept = _steady(F, z)
    by_casadi = np.array(ca.Function("F", [s := ca.SX.sym("z", F.inputs)], [F.sx(s)])(z)).ravel()
    slow = F.evaluate(z)
    for other in (F(z), Batches(F)(z), by_casadi):
        np.testing.assert_allclose(other[kept], slow[kept], rtol=1e-9, atol=1e-9)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(maps(SMOOTH))
def test_a_list_is_canonical(F: Map) -> None:
    """Through CasADi, a pickle, or another order of building: the same list and digest."""
    assert pickle.loads(pickle.dumps(F)) == F
    assert Map(F.inputs, *F.arrays().values()).digest == F.digest
    first = F.inputs + F.constants.size
    assert F.only(F.outputs.tolist()) == F
    build = Builder(F.inputs)  # unused operations before, constants first
    build.apply(Operator.SIN, build.constant(17.0))
    numbers = [*range(F.inputs), *(build.constant(c) for c in F.constants[::-1])]
    numbers[F.inputs :] = numbers[F.inputs :][::-1]
    for head, a, b in zip(F.heads.tolist(), F.left.tolist(), F.right.tolist(), strict=True):
        numbers.append(build.apply(Operator(head), numbers[a], numbers[b] if b >= 0 else -1))
    assert len(numbers) == first + F.operations
    assert build.finish(numbers[k] for k in F.outputs.tolist()) == F


def test_signed_zeros_are_two_constants() -> None:
    build = Builder(1)
    F = build.finish([build.apply(Operator.DIV, 0, build.constant(c)) for c in (0.0, -0.0)])
    assert F.constants.size == 2
    assert F.evaluate(np.ones(1)).tolist() == [math.inf, -math.inf]


def test_equal_operations_stand_once() -> None:
    build = Builder(2)
    a = build.apply(Operator.MUL, 0, 1)
    b = build.apply(Operator.MUL, 0, 1)
    assert a == b
    assert build.finish([a, b, a]).operations == 1


# ------------------------------------------------------------------------------------ affine and large ones


def test_what_is_affine_is_split_off() -> None:
    z = ca.SX.sym("z", 3)
    F = Map.from_casadi(z, ca.vertcat(2 * z[0] - (z[1] - 3) / 4 + 1, -(z[2] + z[2]), z[0] * z[1] + 5 * z[2], 7))
    compiled = F.compiled
    np.testing.assert_allclose(compiled.M.toarray(), [[2, -0.25, 0], [0, 0, -2], [0, 0, 5], [0, 0, 0]])
    np.testing.assert_allclose(compiled.q, [1.75, 0, 0, 7])
    np.testing.assert_allclose(compiled.C.toarray(), [[0], [0], [1], [0]])
    assert not compiled.affine
    affine = Map.from_casadi(z, 3 * z + 1)
    assert affine.compiled.affine
    np.testing.assert_allclose(affine.jacobian(np.ones(3)).toarray(), 3 * np.eye(3))
    assert affine.hessian(np.ones(3), np.ones(3)).nnz == 0


def test_an_obstacle_problem_by_hand() -> None:
    """Many terms of one form are evaluated in batches; F and F′ against a sparse product and an exponential."""
    n = 400
    z = ca.SX.sym("z", n)
    A = 2.1 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    F = Map.from_casadi(z, ca.DM(A) @ z - 0.01 * ca.exp(z))
    assert Batches(F.only(F.compiled._terms)).worthwhile
    at = np.random.default_rng(0).standard_normal(n)
    np.testing.assert_allclose(F(at), A @ at - 0.01 * np.exp(at), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(F.jacobian(at).toarray(), A - 0.01 * np.diag(np.exp(at)), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(F.hessian(at, np.ones(n)).toarray(), -0.01 * np.diag(np.exp(at)), rtol=1e-12)


def test_long_chains_need_no_deep_stack() -> None:
    build = Builder(1)
    value = 0
    for _ in range(50_000):
        value = build.apply(Operator.SIN, build.apply(Operator.ADD, value, 0))
    F = pickle.loads(pickle.dumps(build.finish([value])))
    assert F.operations == 100_000
    assert np.isfinite(F.evaluate(np.array([0.1]))).all()


def test_no_unknowns_and_no_rows() -> None:
    assert Map.empty(3)(np.zeros(3)).shape == (0,)
    assert Map.empty(3).jacobian(np.zeros(3)).shape == (0, 3)
    build = Builder(0)
    F = build.finish([build.apply(Operator.EXP, build.constant(0.0))])
    assert F(np.zeros(0)).tolist() == [1.0]
    assert F.jacobian(np.zeros(0)).shape == (1, 0)


@pytest.mark.parametrize("operator", [Operator.EXP, Operator.MUL])
def test_a_wrong_length_is_refused(operator: Operator) -> None:
    with pytest.raises(ValueError, match="3"):
        _single(operator)(np.zeros(3))


# ---------------------------------------------------------------------------------------------------- CasADi


def test_casadis_own_operators() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    expressions = ca.vertcat(
        ca.hypot(x, y), ca.sign(x), x != y, ca.if_else(x < y, x, y), x**2, 2 * x, 1 / x, x**3, ca.fmin(x, y), x**y,
        ca.sqrt(x), ca.logic_and(x > 0, y > 0), ca.expm1(x), ca.log1p(x), ca.erf(x), ca.atan2(x, y), ca.floor(x * 3),
    )  # fmt: skip
    F = Map.from_casadi(ca.vertcat(x, y), expressions)
    reference = ca.Function("f", [ca.vertcat(x, y)], [expressions])
    for at in ([0.7, 1.9], [1.9, 0.7], [1.0, 1.0]):
        np.testing.assert_allclose(F.evaluate(np.array(at)), np.array(reference(at)).ravel(), rtol=1e-14)


def test_casadis_matrix_expressions_are_expanded() -> None:
    z = ca.MX.sym("z", 3)
    F = Map.from_casadi(z, ca.mtimes(np.arange(9.0).reshape(3, 3), ca.sin(z)))
    at = np.array([0.1, 0.2, 0.3])
    np.testing.assert_allclose(F(at), np.arange(9.0).reshape(3, 3) @ np.sin(at))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda z: ca.fmod(z, 2), "OP_FMOD"),
        (lambda z: z + ca.SX.sym("other"), "has the symbol other, which is not a variable"),
        (lambda z: z + ca.SX(math.nan), "finite"),
        (lambda z: ca.copysign(z, -1), "OP_COPYSIGN"),
    ],
)
def test_what_casadi_has_and_a_map_has_not(make: Any, says: str) -> None:
    z = ca.SX.sym("z")
    with pytest.raises(ProblemError, match=says):
        Map.from_casadi(z, make(z))


# ----------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        (([math.nan], [], [], [], [0]), "finite"),
        (([], [99], [0], [-1], [0]), "not an operator"),
        (([], [int(Operator.ADD)], [0], [1], [0]), "right: is 1"),
        (([], [int(Operator.SIN)], [1], [-1], [0]), "left: is 1"),
        (([], [int(Operator.SIN)], [0], [0], [0]), "right: is 0"),
        (([], [], [], [], [1]), "outputs: is 1"),
        (([], [], [], [], [-1]), "outputs: is -1"),
        (([], [int(Operator.SIN)], [], [-1], [0]), "1 heads, 0 left"),
        (([[1.0]], [], [], [], []), "one dimension"),
    ],
)
def test_lists_that_are_no_map(arrays: Any, says: str) -> None:
    with pytest.raises(ProblemError, match=says):
        Map(1, *arrays)


def test_arrays_cannot_be_written() -> None:
    F = _single(Operator.ADD)
    assert not any(array.flags.writeable for array in F.arrays().values())


def test_formulas_for_readers() -> None:
    z = ca.SX.sym("z", 2)
    F = Map.from_casadi(z, ca.vertcat((z[0] - 2) * ca.exp(-z[1]), 1 - (z[0] - z[1]), z[0] ** 2.5 / (z[1] / 3)))
    assert formulas(F, ["x", "y"], 80) == ["(x - 2)*exp(-y)", "1 - (x - y)", "x^2.5/(y/3)"]
    assert formulas(F, ["x", "y"], 6) == ["…", "…", "…"]


def test_terms_that_cancel_are_no_entries_of_the_jacobian() -> None:
    """x + y − x + xy: y + xy, whose derivative by x is y."""
    F = mapped(2, lambda x, y: [x + y - x + x * y, x - x])
    assert F.jacobian(np.array([2.0, 3.0])).toarray().tolist() == [[3.0, 3.0], [0.0, 0.0]]
