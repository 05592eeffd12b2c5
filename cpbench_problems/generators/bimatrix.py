"""Bimatrix games as LCPs: those on which Lemke and Howson's paths are exponentially long, on which all supports have to
be searched, and one with every pure and mixed coordination as equilibrium."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense
from cpbench.generators.base import Instance, collection
from cpbench_problems.applications import GAME, game_problem

SCALE = 2.0**40
"""Entries of the games with long paths are rounded to multiples of 1/SCALE, and the equilibrium is of what they are."""


@collection(
    "bimatrix-games",
    "lcp",
    "bimatrix games with long paths, large supports, or many equilibria",
    "Savani and von Stengel 2006, Econometrica 74:397; Sandholm, Gilpin, Conitzer 2005, AAAI 20:495; Quint and Shubik "
    "1997, Int. J. Game Theory 26:353 (number of equilibria)",
)
def build() -> list[Instance]:
    return [
        *(long_paths(d) for d in (4, 6, 8, 10)),
        *(half_supports(k) for k in (2, 5, 10)),
        *(coordination(n) for n in (3, 6)),
    ]


@collection(
    "bimatrix-games-large",
    "lcp",
    "bimatrix games of up to 500 strategies",
    "Sandholm, Gilpin, Conitzer 2005, AAAI 20:495",
    tier="standard",
)
def build_large() -> list[Instance]:
    return [half_supports(k) for k in (40, 125)]


def _payoffs(labels: list[int], vertices: list[list[Fraction]]) -> list[list[Fraction]]:
    """Return B of the polytope {x ≥ 0, Bᵀx ≤ 1} that the dual of a cyclic polytope becomes when its facets
    labels[:d] are x_i ≥ 0: row i belongs to x_i, column j to facet labels[d + j]."""
    d = len(vertices[0])
    first = [vertices[k] for k in labels[:d]]
    inverse = _inverse([list(row) for row in first])
    columns: list[list[Fraction]] = []
    for k in labels[d:]:
        row = [sum((vertices[k][i] * inverse[i][j] for i in range(d)), Fraction(0)) for j in range(d)]
        room = 1 - sum(row)
        columns.append([-value / room for value in row])
    return [[columns[j][i] for j in range(d)] for i in range(d)]


def _inverse(rows: list[list[Fraction]]) -> list[list[Fraction]]:
    """Return the inverse of a square matrix over the rationals."""
    n = len(rows)
    table = [row + [Fraction(int(i == j)) for j in range(n)] for i, row in enumerate(rows)]
    for c in range(n):
        pivot = next(r for r in range(c, n) if table[r][c])
        table[c], table[pivot] = table[pivot], table[c]
        table[c] = [value / table[c][c] for value in table[c]]
        for r in range(n):
            if r != c and table[r][c]:
                factor = table[r][c]
                table[r] = [a - factor * b for a, b in zip(table[r], table[c], strict=True)]
    return [row[n:] for row in table]


def long_path_payoffs(d: int) -> tuple[Dense, Dense]:
    """Return the d × d games of Savani and von Stengel, d even: A of the player who chooses the row, and B.

    Both best-response polytopes are dual to the cyclic polytope with 2d vertices on the moment curve in dimension d.
    Its facets have the labels 1, ..., 2d in order for one player; for the other 1 and d stay, k and k + 1 are swapped
    for k = 2, 4, ..., d − 2, and so are k and k + 1 for k = d + 1, d + 3, ..., 2d − 1. The only equilibrium has full
    support. Units of the unknowns are such that it is nearly uniform; entries are multiples of 1/SCALE.
    """
    on_curve = [[Fraction(t) ** power for power in range(1, d + 1)] for t in _chebyshev(2 * d)]
    centre = [sum(column, Fraction(0)) / (2 * d) for column in zip(*on_curve, strict=True)]
    vertices = [[value - c for value, c in zip(row, centre, strict=True)] for row in on_curve]
    order = list(range(2 * d))
    swapped = [k + (-1) ** (k + 1) if 1 <= k <= d - 2 else k + (-1) ** k if k >= d else k for k in order]
    # x_i ≥ 0 has label i, the column constraint j of Bᵀx ≤ 1 label d + j; Ay ≤ 1 has label i, y_j ≥ 0 label d + j
    B = _payoffs(order, vertices)
    A = _payoffs([*swapped[d:], *swapped[:d]], vertices)
    return _rounded(A).T, _rounded(B)


def _chebyshev(count: int) -> list[Fraction]:
    """Return increasing points in (−1, 1), dense at both ends, so that the games are better scaled: multiples of
    1/1024 near cosines, by the quadratic that agrees with them at the ends and in the middle."""
    points: list[Fraction] = []
    for k in range(count):
        s = Fraction(2 * k + 1 - count, count)
        points.append(s * (3 - s * s) / 2)
    return points


def _rounded(rows: list[list[Fraction]]) -> Dense:
    """Return B with row i times x_i where Bᵀx = 1, which only changes the unit of x_i, in multiples of 1/SCALE: every
    column then has the sum 1."""
    d = len(rows)
    inverse = _inverse(rows)
    units = [sum((inverse[j][i] for j in range(d)), Fraction(0)) for i in range(d)]
    scaled = [[unit * value for value in row] for unit, row in zip(units, rows, strict=True)]
    return np.array([[round(value * int(SCALE)) / SCALE for value in row] for row in scaled])


def long_paths(d: int) -> Instance:
    """Build the game of `long_path_payoffs` as an LCP; u and v of the only equilibrium in exact arithmetic."""
    problem = _by_rows(game_problem(*long_path_payoffs(d), name=f"long-paths-{d}"))
    M = matrices.dense(problem.M)
    costs = [[[Fraction(float(value)) for value in row] for row in block] for block in (M[d:, :d], M[:d, d:])]
    z = [float(sum(row)) for block in costs for row in _inverse(block)]
    facts = {"class": "bimatrix game", GAME: [d, d], "solutions": "1"}
    return Instance(problem, LCPPoint(z=z), "planted to rounding", properties=facts)


def _by_rows(problem: LCP) -> LCP:
    """Return the problem with M in CSR, whose product with z has one order of sums on every machine: that of a dense
    one with a z that is not exact depends on threads and kernels of BLAS, and a file has w = Mz + q."""
    return replace(problem, M=sp.csr_array(problem.M))


def half_supports(k: int) -> Instance:
    """Build the games of 4k − 1 strategies of Sandholm, Gilpin and Conitzer, whose only equilibrium has supports of
    2k − 1 strategies: 2k − 1 of them in a cycle beside 2k that are played in pairs.

    Within the cycle the payoff is 1 against the strategy before (cyclically), ½ against the one after, ¾ otherwise;
    ½ against all others. A strategy outside has ¾ against its partner (the first player's is the same number, the
    second player's the other one of its pair), 0 otherwise.
    """
    m, n = 2 * k - 1, 4 * k - 1
    A = np.zeros((n, n))
    A[:m, :m], A[:m, m:] = 0.75, 0.5
    ring = np.arange(m)
    A[ring, (ring + 1) % m] = 0.5
    A[ring, (ring - 1) % m] = 1.0
    C = A.copy()
    rest = np.arange(2 * k)
    A[m + rest, m + rest] = 0.75
    C[m + rest, m + (rest ^ 1)] = 0.75
    problem = _by_rows(game_problem(A, C.T, name=f"half-supports-{k}"))
    z = np.zeros(2 * n)
    z[:m] = z[n : n + m] = 0.8 / m  # payoffs in the cycle are ¾ in the mean, costs 2 − ¾
    facts = {"class": "bimatrix game", GAME: [n, n], "solutions": "1"}
    return Instance(problem, LCPPoint(z=z), "planted to rounding", properties=facts)


def coordination(n: int) -> Instance:
    """Build the game in which both get 1 where they choose the same of n strategies, else 0: 2ⁿ − 1 equilibria, one for
    each set of strategies that both play alike. The first strategy of both is the one that is given."""
    problem = game_problem(np.eye(n), np.eye(n), name=f"coordination-{n}")
    z = np.zeros(2 * n)
    z[0] = z[n] = 1.0
    facts = {"class": "bimatrix game", GAME: [n, n], "solutions": str(2**n - 1)}
    return Instance(problem, LCPPoint(z=z), "closed form", properties=facts)
