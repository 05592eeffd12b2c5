"""Lemke's method on degenerate LCPs of small whole numbers, beside the same method in exact arithmetic.

Ties occur at almost every pivot. The compiled loops have to take the very pivots of the exact method, and so to end:
the lexicographic rule excludes cycles. What the solvers claim is checked by exact arithmetic as well.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import exact_lemke
import numpy as np
import pytest

from cpbench.formulations import AVI, LCP, MLCP
from cpbench.proofs import prove
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.kernels import pivoting, tableau
from cpbench_solvers.lcp.lemke_columns import PivotingState

Rng = np.random.Generator
Integers = tuple[Any, Any]
LIMIT, TOLERANCES = 1000, (1e-11, 1e-13)
TIGHT = Budget(tolerance=1e-10)


def any_matrix(rng: Rng, n: int) -> Integers:
    """Any entries: rays about as often as solutions."""
    return rng.integers(-2, 3, (n, n)), rng.integers(-2, 2, n)


def semidefinite(rng: Rng, n: int) -> Integers:
    """AAᵀ and a skew part: a ray says that nothing is feasible."""
    A, S = rng.integers(-1, 2, (2, n, n))
    return A @ A.T + S - S.T, rng.integers(-2, 2, n)


def copositive(rng: Rng, n: int) -> Integers:
    """No entry is negative."""
    return rng.integers(0, 3, (n, n)), rng.integers(-2, 2, n)


def duplicated(rng: Rng, n: int) -> Integers:
    """Rows come several times, right-hand sides too."""
    M, q = any_matrix(rng, n)
    rows = rng.integers(0, n, n)
    return M[rows], q[rows]


def bimatrix(rng: Rng, n: int) -> Integers:
    """Costs 1, 2 and 3 of two players (Lemke and Howson 1964): the first ray is no proof of anything."""
    M, half = np.zeros((n, n), int), n // 2
    M[:half, half:] = rng.integers(1, 4, (half, n - half))
    M[half:, :half] = rng.integers(1, 4, (n - half, half))
    return M, np.full(n, -1)


def facets(rng: Rng, n: int) -> Integers:
    """Contacts in the plane after Stewart and Trinkle (1996), redundant ones: (normal, both ways along, speed) each."""
    nc = max(1, n // 4)
    H = rng.integers(-1, 2, (2 * nc, rng.integers(1, 4)))
    J, E = np.zeros((2 * nc, 3 * nc), int), np.zeros((3 * nc, nc), int)
    for c in range(nc):
        J[2 * c, c] = J[2 * c + 1, nc + 2 * c] = 1
        J[2 * c + 1, nc + 2 * c + 1] = -1
        E[nc + 2 * c : nc + 2 * c + 2, c] = 1
    bottom = np.hstack([np.diag(rng.integers(0, 3, nc)), -E[nc:].T, np.zeros((nc, nc), int)])
    M = np.vstack([np.hstack([J.T @ H @ H.T @ J, E]), bottom])
    velocity = H @ rng.integers(-2, 2, H.shape[1])
    return M, np.concatenate([J.T @ velocity, np.zeros(nc, int)])


FAMILIES: dict[str, Callable[[Rng, int], Integers]] = {
    family.__name__: family for family in (any_matrix, semidefinite, copositive, duplicated, bimatrix, facets)
}
PUBLISHED: dict[str, Integers] = {
    # the P-matrix on which principal pivots (Murty 1974) and Lemke's (Kostreva 1979) cycle
    "kostreva": ([[1, 2, 0], [0, 1, 2], [2, 0, 1]], [-1, -1, -1]),
    # programs on which the simplex method cycles, times the common denominators
    "beale": exact_lemke.simplex_as_lcp([[1, -32, -4, 36], [1, -24, -1, 6], [0, 0, 1, 0]], [0, 0, 1], [-3, 80, -2, 24]),
    "kuhn": exact_lemke.simplex_as_lcp([[-2, -9, 1, 9], [1, 3, -1, -6], [2, 3, -1, -12]], [0, 0, 2], [-2, -3, 1, 12]),
}


def drawn(family: str, count: int) -> list[Integers]:
    """Problems of 2 to 8 unknowns."""
    rng = np.random.default_rng([2026, list(FAMILIES).index(family)])
    return [FAMILIES[family](rng, int(rng.integers(2, 9))) for _ in range(count)]


def first_row(M: Any, q: Any) -> int:
    """The row in which the compiled loops begin."""
    return int(tableau.first_row(M, q, np.empty(len(q), np.int64)))


def by_tableau(kernel: Any, M: Any, q: Any, z: Any) -> int:
    """The loop for few unknowns."""
    return kernel.lemke(M, q, z, LIMIT, *TOLERANCES)


def by_columns(kernel: Any, M: Any, q: Any, z: Any) -> int:
    """The loop for more unknowns, on few; pivots are forgotten on the way."""
    n = q.size
    room = np.empty((n + 1, n)), np.empty((2, n)), np.empty((2, n)), np.empty((7, 2 * n + 2), np.int64)
    return kernel.solve(M, q, z, *room, LIMIT, *TOLERANCES)


def by_pieces(kernel: Any, M: Any, q: Any, z: Any) -> int:
    """The loop for hundreds of unknowns, which forgets its pivots from outside, on few."""
    m, p = abs(M).max() or 1.0, abs(q).max()
    if q.min() >= 0.0:
        z[:] = 0.0
        return kernel.COMPLEMENTARY
    state = PivotingState(kernel, M.T, q / p, factor=-1.0 / m, room=4)
    while (status := state.advance(LIMIT, *TOLERANCES)) == kernel.FULL:
        state.forget_pivots()
    z[:] = state.z * (p / m)
    return state.pivots * kernel.CODES + status


def outcomes_are_exact(problems: list[Integers]) -> Counter[str]:
    """Check all loops on all problems; count the exact outcomes, with those of the topmost of tied rows."""
    kernel = pivoting
    words = {kernel.COMPLEMENTARY: exact_lemke.COMPLEMENTARY, kernel.RAY: exact_lemke.RAY, kernel.LIMIT: "limit"}
    counted = Counter[str]()
    for given in problems:
        M, q = (np.array(a, dtype=float) for a in given)
        first = first_row(M, q)
        outcome, pivots, exact = exact_lemke.lemke(*given, first)
        counted[outcome] += 1
        counted["topmost " + exact_lemke.lemke(*given, first, lexicographic=False)[0]] += 1
        for loop in (by_tableau, by_columns, by_pieces):
            z = np.empty(q.size)
            code = loop(kernel, M, q, z)
            assert (words.get(code % kernel.CODES), code // kernel.CODES) == (outcome, pivots), (loop.__name__, M, q)
            if outcome == exact_lemke.COMPLEMENTARY:
                np.testing.assert_allclose(z, [float(x) for x in exact], rtol=1e-9, atol=1e-11)
    return counted


def claims_hold(family: str, problems: list[Integers]) -> None:
    """Check what the solvers say: of a solution of the exact method nothing else, of a ray only what is proved."""
    for given in problems:
        M, q = (np.array(a, dtype=float) for a in given)
        outcome = exact_lemke.lemke(*given, first_row(M, q))[0]
        none = np.zeros((0, q.size))
        mixed = MLCP(A=np.zeros((0, 0)), B=M, C=none, D=none.T, a=np.zeros(0), b=q)
        box = AVI(M=M, q=q, A=none, b=np.zeros(0), lb=np.zeros(q.size), ub=np.full(q.size, np.inf))
        for problem, name in ((LCP(M=M, q=q), "lemke"), (mixed, "lemke-mlcp"), (box, "lemke-avi")):
            output = solvers.get(name).run(problem, TIGHT)
            assert output.claim is not Claim.MAX_ITER, (name, M, q)
            if name == "lemke" or family == "semidefinite":  # elsewhere another covering vector may end in a ray
                assert output.claim is Claim.SOLVED or outcome == exact_lemke.RAY, (name, output.message, M, q)
            if family == "bimatrix" and name == "lemke":  # every game has an equilibrium
                assert output.claim is Claim.SOLVED, (output.message, M, q)
            if family == "semidefinite" and outcome == exact_lemke.RAY and name != "lemke-avi":  # looks for no proof
                assert output.claim is Claim.INFEASIBLE, (name, output.message, M, q)
            if output.claim is Claim.SOLVED:
                assert judge(problem, output.point, 1e-8).solved, (name, M, q)
            elif output.claim is Claim.INFEASIBLE:
                attempt = prove(problem, str(output.claim), output.certificate, 10.0)
                assert attempt.proof is not None, (name, attempt.message, M, q)


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_cycles(name: str) -> None:
    outcomes_are_exact([PUBLISHED[name]])
    claims_hold(name, [PUBLISHED[name]])


def test_kostrevas_example_cycles_without_the_rule() -> None:
    """By hand: z = (1/3, 1/3, 1/3)."""
    assert exact_lemke.lemke(*PUBLISHED["kostreva"], 0, lexicographic=False)[0] == exact_lemke.CYCLES
    assert exact_lemke.lemke(*PUBLISHED["kostreva"], 0) == (exact_lemke.COMPLEMENTARY, 4, [Fraction(1, 3)] * 3)


@pytest.mark.parametrize("family", FAMILIES)
def test_compiled_pivots_are_the_exact_ones(family: str) -> None:
    problems = drawn(family, 60)
    outcomes_are_exact(problems)
    claims_hold(family, problems[:10])


@pytest.mark.nightly
@pytest.mark.parametrize("family", FAMILIES)
def test_compiled_pivots_are_the_exact_ones_on_ten_thousand(family: str) -> None:
    """Solutions occur, but for games, and of any matrices several would cycle without the rule: else these prove
    nothing."""
    problems = drawn(family, 1700)
    counted = outcomes_are_exact(problems)
    assert (counted[exact_lemke.COMPLEMENTARY] > 100) == (family != "bimatrix")
    assert counted["topmost cycles"] > 0 or family not in ("any_matrix", "copositive")
    claims_hold(family, problems)
