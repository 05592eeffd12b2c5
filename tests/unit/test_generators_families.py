"""Families from formulas, against closed forms, enumeration in exact arithmetic, and methods that are written here."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from rational import exact, solved

from cpbench.formulations import LCP
from cpbench.foundation import matrices
from cpbench.generators.collection import builtin_folder, catalogue
from cpbench_problems.generators import (
    belts,
    bimatrix,
    linear_twins,
)
from cpbench_problems.generators.lcp_classics import isolated, munson1
from cpbench_problems.generators.lcp_hard import csizmadia_degenerate, cycling


def _solutions(problem: LCP) -> set[tuple[Fraction, ...]]:
    """Return the solutions of an LCP at its complementary bases, by trying all 2ⁿ of them."""
    M, q = exact(problem.M), [Fraction(float(value)) for value in problem.q]
    n = len(q)
    found: set[tuple[Fraction, ...]] = set()
    for size in range(n + 1):
        for basis in itertools.combinations(range(n), size):
            part = solved([[M[i][j] for j in basis] for i in basis], [-q[i] for i in basis])
            if part is None or any(value < 0 for value in part):
                continue
            z = dict(zip(basis, part, strict=True))
            if all(sum((M[i][j] * z[j] for j in basis), q[i]) >= 0 for i in range(n) if i not in z):
                found.add(tuple(z.get(i, Fraction(0)) for i in range(n)))
    return found


@pytest.mark.parametrize(
    ("instance", "count"),
    [
        (isolated(), 1),
        (munson1(), 1),
        (csizmadia_degenerate(6), 1),
        (cycling(6), 1),
        (cycling(7), 1),
        (linear_twins.lcp_many(4), 16),
        (linear_twins.lcp_infeasible(5), 0),
        (bimatrix.coordination(3), 7),
        (bimatrix.long_paths(4), 1),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_the_number_of_solutions_is_found_by_trying_all_bases(instance: object, count: int) -> None:
    assert len(_solutions(instance.problem)) == count


@pytest.mark.nightly
def test_a_game_of_half_supports_has_one_equilibrium() -> None:
    assert len(_solutions(bimatrix.half_supports(2).problem)) == 1


def test_small_problems_have_as_many_solutions_as_their_sheets_say() -> None:
    """LCPs of at most 5 unknowns whose number of solutions is known and finite."""
    from cpbench import storage

    small = [e for e in catalogue() if e.node == "lcp" and e.unknowns <= 5 and e.solutions.isdigit()]
    assert len(small) >= 6
    for entry in small:
        problem = storage.load(f"{builtin_folder()}/{entry.address.removeprefix('builtin/')}")
        assert len(_solutions(problem)) == int(entry.solutions), entry.address


def _newton_min(problem: LCP, z: np.ndarray, steps: int) -> list[bytes]:
    """Iterate plain Newton-min (Ben Gharbia and Gilbert 2012, algorithm 1.1), and return the active sets."""
    M, q = matrices.dense(problem.M), problem.q
    seen: list[bytes] = []
    for _ in range(steps):
        inside = z > M @ z + q
        seen.append(inside.tobytes())
        z = np.zeros(q.size)
        z[inside] = np.linalg.solve(M[np.ix_(inside, inside)], -q[inside])
    return seen


@pytest.mark.parametrize("n", [3, 4, 5, 6, 7, 33, 64])
def test_newton_min_runs_in_a_cycle_of_n_sets(n: int) -> None:
    instance = cycling(n)
    sets = _newton_min(instance.problem, np.asarray(instance.starts[0].z), 3 * n)
    later = sets[n:]
    assert later[:n] == later[n:]
    assert len(set(later)) == n


def _path(A: list[list[Fraction]], B: list[list[Fraction]], label: int) -> int:
    """Count the pivots of Lemke and Howson's path from the artificial equilibrium, in exact arithmetic."""
    m, n = len(A), len(A[0])
    least = min(min(map(min, A)), min(map(min, B))) - 1  # payoffs > 0: the polytopes are bounded
    one = Fraction(1)
    tables = (
        [[*(B[i][j] - least for i in range(m)), *(Fraction(int(k == j)) for k in range(n)), one] for j in range(n)],
        [[*(Fraction(int(k == i)) for k in range(m)), *(A[i][j] - least for j in range(n)), one] for i in range(m)],
    )
    bases = ([m + j for j in range(n)], list(range(m)))
    side, entering, count = (0 if label < m else 1), label, 0
    while True:
        table, basis = tables[side], bases[side]
        row = min((table[r][-1] / table[r][entering], r) for r in range(len(table)) if table[r][entering] > 0)[1]
        table[row] = [value / table[row][entering] for value in table[row]]
        for r in range(len(table)):
            if r != row and table[r][entering]:
                table[r] = [a - table[r][entering] * b for a, b in zip(table[r], table[row], strict=True)]
        leaving, basis[row] = basis[row], entering
        count += 1
        if leaving == label:
            return count
        entering, side = leaving, 1 - side


@pytest.mark.parametrize(
    ("d", "longest"), [(2, 4), (4, 20), pytest.param(6, 88, marks=pytest.mark.nightly),
                       pytest.param(8, 376, marks=pytest.mark.nightly)]
)  # fmt: skip
def test_paths_of_lemke_and_howson_grow_as_published(d: int, longest: int) -> None:
    """Savani and von Stengel 2006: a(d) = 4 a(d − 2) + a(d − 4) + 4 for the labels 1 and d, so by 4.236 a step."""
    payoffs = [exact(payoff) for payoff in bimatrix.long_path_payoffs(d)]
    lengths = [_path(*payoffs, label) for label in range(2 * d)]
    assert max(lengths) == lengths[0] == lengths[d - 1] == longest


def test_games_of_half_supports_are_those_of_quantecon() -> None:
    games = pytest.importorskip("quantecon.game_theory.game_generators", reason="needs a package: quantecon")
    for k in (2, 5):
        first, second = (player.payoff_array for player in games.sgc_game(k).players)
        M, n = matrices.dense(bimatrix.half_supports(k).problem.M), 4 * k - 1
        assert np.allclose(M[:n, n:] + first, M[0, n] + first[0, 0], atol=1e-15)  # costs are a number minus payoffs
        assert np.allclose(M[n:, :n] + second, M[n, 0] + second[0, 0], atol=1e-15)


@pytest.mark.parametrize("mu", [0.25, 0.75])
def test_the_pull_on_a_rope_tends_to_the_exponential(mu: float) -> None:
    """Euler and Eytelwein: e^(μθ); the error of n links is of second order in their angle."""
    errors: list[float] = []
    for bits in (4, 5, 6):
        n = 2**bits
        angle = 4.0 * n * np.arctan(2.0**-bits)
        errors.append(abs(float(belts.limit_ratio(n, bits, mu)) / np.exp(mu * angle) - 1.0))
    assert errors[0] < 0.03
    assert np.allclose(np.divide(errors[:-1], errors[1:]), 4.0, rtol=0.05)
