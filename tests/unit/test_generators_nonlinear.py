"""Nonlinear problems from formulas: known solutions by other means, formulas written a second time, and the same bits
whatever a machine's sines are."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import generated
import mpmath
import numpy as np
import pytest
from planted_nonlinear import graph
from tiers import some_by_day

from cpbench import verification
from cpbench.formulations import NCP, VI, NCPPoint, QVIPoint
from cpbench.formulations.expressions import Map, Operator
from cpbench.formulations.expressions.recording import maximum
from cpbench.foundation import matrices
from cpbench.generators import Instance, generators
from cpbench.testing.checks_problem import _marks
from cpbench_problems.generators import ncp_classics as classics
from cpbench_problems.generators import symbols, walras

FAMILIES = (
    "ncp-classics", "nash-cournot", "walras", "scarf-activities", "harker-pang", "harker-pang-sets",
    "membranes", "traffic-grid", "hock-schittkowski-bounds", "hock-schittkowski-linear",
    "hock-schittkowski-nonlinear", "vi-classics", "vi-planted", "cp-planted",
    "qvi-games", "qvi-friction", "qvi-obstacles", "ge-planted", "equations",
)  # fmt: skip
LISTED = {entry.name: entry for entry in generated.shipped(maps=True) if entry.family in FAMILIES}


def instance(name: str) -> Instance:
    return generated.instance(LISTED[name])


def known_as(known: str, node: str) -> list[str]:
    """Names of the problems of a formulation that are known so."""
    return [name for name, entry in LISTED.items() if (entry.known, entry.node) == (known, node)]


# ------------------------------------------------------------------------------------------ all of them


@pytest.mark.parametrize("family", some_by_day(FAMILIES, 11))
def test_starts_are_where_everything_is_defined(family: str) -> None:
    for one in generated.instances(family):
        problem, starts = one.problem, one.starts
        for point in starts:
            problem.check_point(point)
        begin = [p.arrays()[next(iter(problem.point_sizes))] for p in starts]
        if begin:
            np.testing.assert_array_equal(begin[0], problem.start)
        for z in [problem.start, *begin]:
            for F in problem.maps().values():
                at = np.concatenate([z, z]) if F.inputs == 2 * z.size else z
                assert np.isfinite(F(at)).all()
                assert np.isfinite(F.jacobian(at).data).all()


@pytest.mark.parametrize("name", some_by_day(FAMILIES, 8))
def test_the_last_bits_of_a_library_do_not_matter(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where sines, exponentials and powers are one unit in the last place larger, the problems have the same bits."""
    collection = generators.get(name)
    expected = _marks(list(generated.instances(name)))

    def nudged(function: Any) -> Any:
        return lambda *x: np.nextafter(function(*x), np.inf)

    for function in ("sin", "cos", "exp", "log", "arctan", "power", "exp2"):
        monkeypatch.setattr(np, function, nudged(getattr(np, function)))
    for function in ("sin", "cos", "exp", "log", "atan", "pow"):
        monkeypatch.setattr(math, function, nudged(getattr(math, function)))
    assert _marks(collection.instances()) == expected


_EXACT = {
    Operator.ADD: lambda a, b: a + b,
    Operator.SUB: lambda a, b: a - b,
    Operator.MUL: lambda a, b: a * b,
    Operator.DIV: lambda a, b: a / b,
    Operator.NEG: lambda a: -a,
    Operator.SQRT: lambda a: _root(a),
}


def _root(x: Fraction) -> Fraction:
    root = Fraction(math.isqrt(x.numerator), math.isqrt(x.denominator))
    assert root * root == x
    return root


def _exactly(F: Map, z: np.ndarray) -> list[Fraction]:
    """F(z) without rounding: by the list of operations, and by none of the code that evaluates it."""
    values = [Fraction(float(x)) for x in (*z, *F.constants)]
    for head, a, b in zip(F.heads.tolist(), F.left.tolist(), F.right.tolist(), strict=True):
        values.append(_EXACT[Operator(head)](*(values[k] for k in (a, b) if k >= 0)))
    return [values[k] for k in F.outputs.tolist()]


@pytest.mark.parametrize("name", [n for node in ("ncp", "micp", "vi") for n in known_as("planted", node)])
def test_planted_solutions_hold_without_any_rounding(name: str) -> None:
    problem, point = instance(name).problem, instance(name).solution
    if problem.data().get("cone_kind", np.zeros(0)).size:
        pytest.skip("does not apply: projections on cones have roots")
    z, F = point.z, _exactly(problem.F, point.z)
    lb = getattr(problem, "lb", np.zeros(z.size))
    ub = getattr(problem, "ub", np.full(z.size, np.inf))
    if isinstance(problem, VI):
        for rows, multipliers in ((problem.A, point.lam), (problem.C, point.mu)):
            for row, y in zip(matrices.dense(rows), multipliers, strict=True):
                F = [f - Fraction(float(a)) * Fraction(float(y)) for f, a in zip(F, row, strict=True)]
        slack = matrices.dense(problem.A) @ z - problem.b
        assert ((point.lam >= 0) & (slack >= 0) & (point.lam * slack == 0)).all()
        assert (matrices.dense(problem.C) @ z == problem.d).all()
    for x, f, lo, hi in zip(z, F, lb, ub, strict=True):
        assert lo <= x <= hi
        assert lo == hi or ((f <= 0 or x == lo) and (f >= 0 or x == hi))


# ---------------------------------------------------------------------------------------- NCP classics


def _kojima(second: tuple[int, int], third: tuple[int, int, int]) -> Any:
    return lambda a, b, c, d: (
        3 * a * a + 2 * a * b + 2 * b * b + c + 3 * d - 6,
        2 * a * a + a + b * b + second[0] * c + second[1] * d - 2,
        3 * a * a + a * b + 2 * b * b + third[0] * c + third[1] * d - third[2],
        a * a + 3 * b * b + 2 * c + 3 * d - 3,
    )


def _cournot(c: list[int], beta: list[str], scale: str, gamma: str) -> Any:
    def F(*q: Any) -> Any:
        Q, g = sum(q), mpmath.mpf(gamma)
        price = (5000 / Q) ** (1 / g)
        return [
            k + (mpmath.mpf(scale) * x) ** (1 / mpmath.mpf(b)) - price + x * price / (g * Q)
            for k, b, x in zip(c, beta, q, strict=True)
        ]

    return F


NAMED: dict[str, tuple[Any, tuple[float, ...]]] = {
    "kojima-shindo": (_kojima((10, 2), (2, 9, 9)), (1, 0, 3, 0)),
    "josephy": (_kojima((3, 2), (2, 3, 1)), (1.2247, 0, 0, 0.5)),
    "billups": (lambda x: [(x - 1) ** 2 - mpmath.mpf("1.01")], (2.005,)),
    "munson1": (lambda a, b, c: (a + 2 * b + 3 * c - 1, b - c + 1, a + b + 1), (1, 0, 0)),
    "nash-cournot-5": (
        _cournot([10, 8, 6, 4, 2], ["1.2", "1.1", "1", "0.9", "0.8"], "0.2", "1.1"),
        (36.93, 41.82, 43.71, 42.66, 39.18),
    ),
    "nash-cournot-10": (
        _cournot(
            [5, 3, 8, 5, 1, 3, 7, 4, 6, 3],
            ["1.2", "1", "0.9", "0.6", "1.5", "1", "0.7", "1.1", "0.95", "0.75"],
            "10",
            "1.2",
        ),
        (7.4415, 4.0978, 2.5906, 0.9354, 17.9490, 4.0978, 1.3047, 5.5901, 3.2222, 1.6771),
    ),
}
"""Formulas written a second time, and the solutions as they are printed."""


@pytest.mark.parametrize("name", NAMED)
def test_printed_solutions_refined_by_mpmath_are_those_of_the_instances(name: str) -> None:
    formula, printed = NAMED[name]
    inside = [k for k, x in enumerate(printed) if x > 0]

    def of(values: Any) -> list[Any]:
        z = [mpmath.mpf(0)] * len(printed)
        for k, x in zip(inside, values, strict=True):
            z[k] = x
        return z

    with mpmath.workdps(40):
        square = lambda *x: [formula(*of(x))[k] for k in inside]  # noqa: E731
        refined = of(mpmath.findroot(square, [printed[k] for k in inside], tol=1e-35))
        slack = formula(*refined)
        assert all(w >= -(mpmath.mpf(10) ** -30) for w in slack)
        digits = [float(x) for x in refined]
    np.testing.assert_allclose(instance(name).solution.z, digits, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(digits, printed, atol=6e-3 if name == "nash-cournot-5" else 1e-4)


def test_kojima_and_shindo_have_two_solutions_and_one_is_degenerate() -> None:
    problem = instance("kojima-shindo").problem
    for z, degenerate in ((classics.REGULAR, False), (classics.DEGENERATE, True)):
        point = NCPPoint(z=np.array(z))
        assert verification.judge(problem, point, 1e-12).solved
        assert (np.maximum(point.z, problem.F(point.z)) < 1e-12).any() == degenerate
    assert instance("kojima-shindo").properties["degenerate"] is True
    assert instance("josephy").properties["degenerate"] is False
    w = instance("josephy").problem.F(instance("josephy").solution.z)
    assert w == pytest.approx([0, 2 + math.sqrt(6) / 2, 5, 0], abs=1e-14)
    assert len(instance("kojima-shindo").starts) == len(instance("josephy").starts) == 8
    assert len(instance("nash-cournot-10").starts) == 4


# ----------------------------------------------------------------------------------- firms and markets


@pytest.mark.parametrize("power", [-6, 0, 6])
def test_excess_demand_is_measured_by_its_terms(power: int) -> None:
    """F has degree 0, F′(p)p = 0 at p*; p = 0 solves nothing, so that errors are relative all along the ray."""
    economy = walras.cobb_douglas(4, 3)
    p = economy.solution.z * 2.0**power
    exact = verification.judge(economy.problem, NCPPoint(z=p), 1e-9)
    assert exact.error <= 1e-15
    assert exact.flags == ()
    off = verification.judge(economy.problem, NCPPoint(z=p * [1.01, 1.0, 1.0, 1.0]), 1e-9)
    assert 1e-4 < off.error < 1e-1


def test_degree_1_has_no_constants() -> None:
    """max(z₁, z₂) − 2z₃ and two linear rows, solved by (1, 2, 1) and by 0: errors are absolute."""

    F = graph(3, lambda z: np.array([maximum(z[0], z[1]) - 2.0 * z[2], z[0] - z[2], z[1] - 2.0 * z[2]]))
    assert verification.judge(NCP(F=F), NCPPoint(z=[1.0, 2.0, 1.0]), 1e-9).flags == ("absolute",)


# ------------------------------------------------------------------------------------- sets and cones


def test_portable_functions_are_those_of_the_library() -> None:
    z = np.linspace(-8.0, 8.0, 4001)
    np.testing.assert_allclose(symbols.arctan(z), np.arctan(z), rtol=4e-15, atol=0.0)
    np.testing.assert_allclose(symbols.sine(2 * z), np.sin(2 * z), atol=4e-15)


MONOTONE = [n for n, entry in LISTED.items() if "strongly monotone" in str(entry.properties.get("class"))]


@pytest.mark.parametrize("name", MONOTONE)
def test_monotone_is_as_said(name: str, rng: np.random.Generator) -> None:
    F = instance(name).problem.F
    for _ in range(5):
        J = F.jacobian(rng.uniform(-3.0, 3.0, F.inputs)).toarray()
        assert np.linalg.eigvalsh(J + J.T)[0] > 0


def test_the_river_has_one_price_for_its_first_limit() -> None:
    problem, point = instance("river-basin").problem, instance("river-basin").solution
    assert point.z == pytest.approx([21.149, 16.028, 2.722], abs=6e-3)
    assert point.lam[0] == pytest.approx(0.574, abs=5e-4)
    assert (problem.A @ point.z)[0] == pytest.approx(-100.0, abs=1e-12)
    assert (problem.A @ point.z)[1] > -100.0


@pytest.mark.parametrize("name", ["duopoly", "duopoly-rows"])
def test_the_duopoly_has_the_equilibria_of_the_paper_and_no_others(name: str) -> None:
    problem = instance(name).problem

    def error(a: float, b: float) -> float:
        z = np.array([a, b])
        nu = np.maximum(-problem.F(z), 0.0) if name == "duopoly-rows" and a + b == 15.0 else np.zeros(problem.g.rows)
        if name == "duopoly-rows":
            nu = np.where(z < 10.0, nu, 0.0)
        return verification.judge(problem, QVIPoint(z=z, nu=nu), 1e-12).error

    assert error(5.0, 9.0) <= 1e-15
    for t in (9.0, 9.25, 9.5, 10.0):
        assert error(t, 15.0 - t) <= 1e-15
    for a, b in ((8.0, 7.0), (5.0, 8.0), (10.0, 4.0), (0.0, 0.0)):
        assert error(a, b) > 1e-3


# --------------------------------------------------------------------------------- Hock and Schittkowski

PUBLISHED = {
    1: 0, 3: 0, 5: -1.91322295, 6: 0, 7: -1.73205081, 21: -99.96, 24: -1, 26: 0, 28: 0, 35: 1 / 9,
    39: -1, 43: -44, 49: 0, 71: 17.0140173, 76: -4.681818182,
}  # fmt: skip
"""f* as the book prints it."""
PRINTED = {
    71: (1, 4.7429994, 3.8211503, 1.3794082),
}
"""z* as the book prints it."""
PROGRAMS = [n for n, entry in LISTED.items() if entry.node == "nlp"]


def test_every_program_has_its_published_minimum() -> None:
    assert {int(n.removeprefix("hs")) for n in PROGRAMS} == set(PUBLISHED)
    for number, value in PUBLISHED.items():
        problem, point = instance(f"hs{number}").problem, instance(f"hs{number}").solution
        assert problem.objective(point.z) == pytest.approx(value, rel=2e-8, abs=1e-12)
        assert instance(f"hs{number}").properties["objective"] == pytest.approx(value, rel=2e-8, abs=1e-12)
    for number, z in PRINTED.items():
        assert instance(f"hs{number}").solution.z == pytest.approx(z, abs=4e-6)


def test_convex_is_as_said(rng: np.random.Generator) -> None:
    convex = [one.problem for one in map(instance, PROGRAMS) if one.problem.convex]
    assert len(convex) == 7
    for problem in convex:
        for _ in range(20):
            z = problem.start + rng.uniform(-3.0, 3.0, problem.start.size)
            assert np.linalg.eigvalsh(problem.f.hessian(z, np.ones(1)).toarray())[0] >= -1e-9, problem.name
            for e in np.eye(problem.g.rows):
                assert np.linalg.eigvalsh(problem.g.hessian(z, e).toarray())[-1] <= 1e-9, problem.name
