"""What is said of convexity: checked where second derivatives are constants, elsewhere the word of the author; and how
far inside Slater's point has to be."""

from __future__ import annotations

import numpy as np
import pytest
from planted_nonlinear import graph as formula

from cpbench.conversions import make
from cpbench.formulations import NLP, VI, Kind, NLPPoint
from cpbench.formulations.programs import Convexity
from cpbench.verification import Status, judge, status

INF = np.inf
SADDLE = NLP(f=formula(2, lambda z: z[1] * z[1] - z[0] * z[0]), lb=[-1, -1], ub=[1, 1], convex=True)
BOWL = NLP(f=formula(2, lambda z: z[1] * z[1] + z[0] * z[0]), lb=[-1, -1], ub=[1, 1], convex=True)
WORD = NLP(f=formula(2, lambda z: np.exp(z[0]) + np.exp(-z[0]) + z[1] * z[1]), lb=[-1, -1], ub=[1, 1], convex=True)
ORIGIN = NLPPoint(z=np.zeros(2), lam=np.zeros(0), mu=np.zeros(0), nu=np.zeros(2))


@pytest.mark.parametrize(
    ("f", "g", "declared", "known"),
    [
        (lambda z: z[0] * z[0] - z[1] * z[1], None, True, "refuted"),
        (lambda z: z[0] * z[0] + z[1] * z[1], None, True, "checked"),
        (lambda z: z[0] * z[0] + z[1] * z[1], None, False, "unknown"),
        (lambda z: z[0] + z[1], lambda z: np.array([z[0], z[1]]), True, "checked"),
        (lambda z: z[0], lambda z: np.array([z[1], 1.0 - z @ z]), True, "checked"),
        (lambda z: z[0], lambda z: np.array([1.0 - z @ z, z @ z - 0.5]), True, "refuted"),
        (lambda z: z[0], lambda z: np.array([z[0] * z[1]]), True, "refuted"),
        (lambda z: np.exp(z[0]), lambda z: np.array([z @ z]), True, "refuted"),
        (lambda z: np.exp(z[0]), lambda z: np.array([1.0 - z @ z]), True, "declared"),
        (lambda z: z[0], lambda z: np.array([np.log(z[1])]), True, "declared"),
        (lambda z: z[0] * z[0] - z[1] * z[1], lambda z: np.array([np.log(z[1])]), True, "refuted"),
    ],
)
def test_declared_convexity_is_checked_where_second_derivatives_are_constants(f, g, declared, known):
    problem = NLP(f=formula(2, f), g=None if g is None else formula(2, g), convex=declared)
    assert problem.convexity == Convexity(known)
    assert problem.taken_as_convex == (known in ("declared", "checked"))


@pytest.mark.parametrize(("n", "known"), [(700, Convexity.CHECKED), (1_300, Convexity.DECLARED)])
def test_a_program_of_more_than_2000_operations_is_convex_by_the_word_of_its_author(n, known):
    """The sum of n squares has about 2n operations."""
    assert NLP(f=formula(n, lambda z: (z * z).sum()), convex=True).convexity is known


def test_a_saddle_of_a_program_declared_convex_is_stationary_and_a_minimum_is_solved():
    for problem, flags, expected in (
        (SADDLE, ("stationary",), Status.STATIONARY),
        (BOWL, (), Status.SOLVED),
        (WORD, ("convexity declared",), Status.SOLVED),
    ):
        verdict = judge(problem, ORIGIN, 1e-6)
        assert (verdict.error, verdict.flags) == (0.0, flags)
        assert status(verdict, "solved") == expected
        assert verdict.within
        assert verdict.solved == (expected == Status.SOLVED)


@pytest.mark.parametrize("edge", ["nlp-micp", "nlp-ge"])
def test_an_edge_does_not_believe_what_second_derivatives_refute(edge):
    assert make(edge).exactness(SADDLE) == Kind.NECESSARY
    assert "second derivatives show" in make(edge).reservation(SADDLE)
    assert make(edge).exactness(BOWL) == Kind.EQUIVALENT


# ---------------------------------------------------------------------------------------------- Slater


@pytest.mark.parametrize("miss", [1e-10, 1e-11, 1e-12])
def test_a_point_that_is_inside_by_rounding_alone_is_not_slaters(miss):
    """min z₂ with z₁ ≥ 1 in the unit disk: the set is the point (1, 0), where z₂ has no multipliers."""
    disk, right, start = formula(2, lambda z: np.array([1.0 - z @ z])), [1.0, -INF], [1.0 - miss, 0.0]
    f = formula(2, lambda z: z[1])
    both = formula(2, lambda z: np.array([1.0 - z @ z, z[0] - 1.0]))
    for problem in (
        NLP(f=f, g=disk, lb=right, ub=[INF, INF], start=start, convex=True),
        NLP(f=f, g=both, start=start, convex=True),
    ):
        assert [make(edge).exactness(problem) for edge in ("nlp-micp", "nlp-ge")] == [Kind.ONE_WAY] * 2
    F = formula(2, lambda z: np.array([0.0 * z[0], 1.0 + 0.0 * z[1]]))
    for rows in ({"lb": right}, {"A": [[1.0, 0.0]], "b": [1.0]}, {"C": [[1.0, 0.0]], "d": [1.0]}):
        inequality = VI(F=F, g=disk, start=start, **rows)
        assert [make(edge).exactness(inequality) for edge in ("vi-micp", "vi-ge")] == [Kind.ONE_WAY] * 2


@pytest.mark.parametrize(
    ("depth", "miss", "scale", "kind"),
    [
        # the start is (1, 0), so that the distance that counts as rounding is 1e-10 (1 + 1); the gradient has size 1
        (2.2e-10, 0.0, None, Kind.EQUIVALENT),
        (1.8e-10, 0.0, None, Kind.ONE_WAY),
        # a bound may be missed by as much
        (1.0, 1.8e-10, None, Kind.EQUIVALENT),
        (1.0, 2.2e-10, None, Kind.ONE_WAY),
        # a row s z₁ − s ≥ 0 has terms that add up to twice its size: 1e-10 (1 + 2), whatever s is
        *((1.0, 2.7e-10, s, Kind.EQUIVALENT) for s in (1e-6, 1.0, 1e6)),
        *((1.0, 3.3e-10, s, Kind.ONE_WAY) for s in (1e-6, 1.0, 1e6)),
    ],
)
def test_how_far_slaters_point_is_inside_and_how_far_it_may_miss_affine_rows(depth, miss, scale, kind):
    """depth + z₂ − z₂² ≥ 0 at z₂ = 0, and z₁ ≥ 1 at 1 − miss, as a bound or as a row in units `scale`."""
    f, curved = formula(2, lambda z: z[0]), lambda z: depth + z[1] - z[1] * z[1]
    rows = [curved] if scale is None else [curved, lambda z: scale * z[0] - scale]
    problem = NLP(
        f=f,
        g=formula(2, lambda z: np.array([row(z) for row in rows])),
        lb=[1.0 if scale is None else -INF, -INF],
        ub=[INF, INF],
        start=[1.0 - miss, 0.0],
        convex=True,
    )
    assert make("nlp-micp").exactness(problem) == kind
