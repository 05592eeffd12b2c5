"""Verdicts against exact truth: small integer problems of which every solution is enumerated in rational arithmetic.

`solved` at ε promises a problem with an exact solution within 10 ε of the data, entry by entry, and that within 10 ε of
the largest unknown; the nearest is found by Oettli and Prager's number of the answer with some unknowns moved to their
bounds. Of a program it promises an objective that is optimal to 10 ε of its terms: a pair of a distance and a force
counts there by its product. Rows of any formulation are a program's where signs of some make their matrix symmetric:
its objective L is least in some unknowns and largest in the others, its multipliers.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from cpbench import verification
from cpbench.formulations import AVI, LCP, MLCP, QP, AVIPoint, LCPPoint, MLCPPoint, QPPoint, Relay

flint = pytest.importorskip("flint", reason="does not apply: exact arithmetic needs python-flint")

INF = np.inf
TOLERANCES = (1e-6, 1e-8)
SEEDS = range(12)
Rational = list[Fraction]


@dataclass(frozen=True, eq=False)
class Boxed:
    """z in [lb, ub] with a force Mz + q, all integers, and what it is as a problem of a node."""

    M: np.ndarray
    q: np.ndarray
    lb: np.ndarray
    ub: np.ndarray
    problem: Any

    def point(self, z: np.ndarray) -> Any:
        node, n = self.problem.node, self.problem.sizes()["n"]
        if node == "mlcp":
            return MLCPPoint(u=z[:n], v=z[n:])
        if node == "avi":
            return AVIPoint(z=z)
        if node == "qp":
            return QPPoint(z=z, lam=[], mu=[], nu=self.M @ z + self.q)
        return LCPPoint(z=z)


def _draw(node: str, rng: np.random.Generator) -> Boxed:
    n = int(rng.integers(2, 7 if node in ("lcp", "mlcp") else 5))
    G = rng.integers(-3, 4, (n, n))
    M = (G @ G.T if node == "qp" else G + np.diag(rng.integers(0, 7, n))).astype(float)
    q = rng.integers(-9, 10, n).astype(float)
    lb, ub = np.zeros(n), np.full(n, INF)
    if node == "mlcp":
        free = n // 2
        lb[:free] = -INF
        parts = {"A": M[:free, :free], "C": M[:free, free:], "D": M[free:, :free], "B": M[free:, free:]}
        return Boxed(M, q, lb, ub, MLCP(**parts, a=q[:free], b=q[free:]))
    if node == "lcp":
        return Boxed(M, q, lb, ub, LCP(M=M, q=q))
    lb = rng.integers(-4, 1, n).astype(float)
    ub = lb + rng.integers(1, 5, n)
    if node != "relay":
        lb[rng.random(n) < 0.3], ub[rng.random(n) < 0.3] = -INF, INF
    problem = {
        "relay": lambda: Relay(M=M, q=q, lb=lb, ub=ub),
        "avi": lambda: AVI(M=M, q=q, lb=lb, ub=ub),
        "qp": lambda: QP.build(M, q, lb=lb, ub=ub),
    }[node]()
    return Boxed(M, q, lb, ub, problem)


def _exact(values: np.ndarray) -> Rational:
    return [Fraction(float(value)) for value in values]


def _rows(M: np.ndarray, z: Rational, q: np.ndarray) -> tuple[Rational, Rational]:
    """Mz + q and |M||z| + |q|, exactly."""
    terms = [
        [Fraction(m) * x for m, x in zip(row, z, strict=True)] + [Fraction(c)] for row, c in zip(M, q, strict=True)
    ]
    return [sum(row, Fraction(0)) for row in terms], [sum(map(abs, row), Fraction(0)) for row in terms]


def _places(p: Boxed) -> Iterator[tuple[float | None, ...]]:
    """Every choice of a bound, or none, for each unknown."""
    yield from itertools.product(
        *([None, *(side for side in pair if np.isfinite(side))] for pair in zip(p.lb, p.ub, strict=True))
    )


def _solutions(p: Boxed) -> tuple[list[np.ndarray], float] | None:
    """All solutions, and the largest condition number of a basis; None where a basis is singular."""
    found, cond = [], 1.0
    for place in _places(p):
        basis = [i for i, side in enumerate(place) if side is None]
        z = [Fraction(0) if side is None else Fraction(side) for side in place]
        if basis:
            right, _ = _rows(p.M, z, p.q)
            square = flint.fmpq_mat([[flint.fmpq(int(p.M[i, j])) for j in basis] for i in basis])
            if square.det() == 0:
                return None
            solved = square.solve(
                flint.fmpq_mat([[flint.fmpq(-right[i].numerator, right[i].denominator)] for i in basis])
            )
            for k, i in enumerate(basis):
                z[i] = Fraction(int(solved[k, 0].p), int(solved[k, 0].q))
            cond = max(cond, float(np.linalg.cond(p.M[np.ix_(basis, basis)], np.inf)))
        if _missed(p, z, place) == 0:
            found.append(np.array([float(x) for x in z]))
    return found, cond


def _missed(p: Boxed, z: Rational, place: tuple[float | None, ...]) -> float:
    """Oettli and Prager's number of z with some unknowns at the given bounds: the least relative change, entry by
    entry, that makes it a solution; ∞ where it is outside of the box."""
    worst = Fraction(0)
    for x, f, size, side, lb, ub in zip(z, *_rows(p.M, z, p.q), place, p.lb, p.ub, strict=True):
        if not lb <= x <= ub:
            return INF
        wrong = abs(f) if side is None else max(-f, Fraction(0)) if side == lb else max(f, Fraction(0))
        worst = max(worst, wrong / size if size else Fraction(0))
    return float(worst)


def _nearest(p: Boxed, z: np.ndarray) -> float:
    """The least of any choice of unknowns to move, to the nearer of their bounds or to 0: the number of what it comes
    to, or the largest move over the largest unknown, where that is more."""
    exact, most = _exact(z), max(1.0, float(np.max(np.abs(z))))
    best = INF
    for choice in itertools.product(*(_targets(*values) for values in zip(z, p.lb, p.ub, strict=True))):
        place = tuple(
            None if to in (None, 0.0) and to not in (lb, ub) else to
            for to, lb, ub in zip(choice, p.lb, p.ub, strict=True)
        )
        moved = [x if to is None else Fraction(to) for x, to in zip(exact, choice, strict=True)]
        move = max(float(abs(x - y)) for x, y in zip(exact, moved, strict=True)) / most
        if move < best:
            best = min(best, max(move, _missed(p, moved, place)))
    return best


def _signs(M: np.ndarray) -> np.ndarray | None:
    """1 for unknowns and −1 for multipliers of a program, so that the rows times these are symmetric; None of no
    program."""
    for signs in itertools.product((1.0, -1.0), repeat=len(M)):
        rows = np.array(signs)[:, None] * M
        if (rows == rows.T).all():
            return np.array(signs)
    return None


def _suboptimal(p: Boxed, signs: np.ndarray, answer: np.ndarray, solution: np.ndarray) -> float:
    """By how much the objective L(z, y) = ½xᵀSKx + qᵀSx of a program is off, L(z, y*) − L(z*, y) over the sizes of the
    terms of both, or x is outside of its bounds; over 1 where that is more: data are integers."""
    off, size = Fraction(0), Fraction(0)
    for sign, own in ((1, signs > 0), (-1, signs < 0)):
        x = _exact(np.where(own, answer, solution))
        forces, terms = _rows(p.M / 2.0, x, p.q)
        off += sign * sum((f * y * int(s) for f, y, s in zip(forces, x, signs, strict=True)), Fraction(0))
        size += sum((f * abs(y) for f, y in zip(terms, x, strict=True)), Fraction(0))
    outside = np.maximum(np.maximum(p.lb - answer, answer - p.ub), 0.0) / np.maximum(1.0, np.abs(answer))
    return max(abs(float(off / max(size, Fraction(1)))), float(np.max(outside, initial=0.0)))


def _targets(z: float, lb: float, ub: float) -> set[float | None]:
    nearer = lb if abs(z - lb) <= abs(z - ub) else ub
    return {None, *({nearer} if np.isfinite(nearer) else ()), *({0.0} if lb < 0.0 < ub else ())}


def _candidates(p: Boxed, solutions: list[np.ndarray], rng: np.random.Generator) -> Iterator[np.ndarray]:
    n = p.q.size
    yield np.clip(np.zeros(n), p.lb, p.ub)
    for z in solutions[:3]:
        yield z
        for size in 10.0 ** np.arange(-10.0, 0.0):
            yield z * (1.0 + size * rng.uniform(-1.0, 1.0, n))
            yield z + size * rng.uniform(-1.0, 1.0, n)
        for i in range(n):
            yield np.where(np.arange(n) == i, 2.0 * z, z)
            yield np.where(np.arange(n) == i, np.clip(0.0, p.lb, p.ub), z)
        yield 1e8 * z


def _drawn(node: str, seed: int) -> tuple[Boxed, list[np.ndarray], float, np.random.Generator]:
    """The first problem of a seed without a singular basis."""
    rng = np.random.default_rng([seed, len(node), ord(node[0])])
    while True:
        p = _draw(node, rng)
        found = _solutions(p)
        if found is not None:
            return p, *found, rng


@pytest.mark.parametrize(
    "seed", [seed if seed < 4 else pytest.param(seed, marks=pytest.mark.nightly) for seed in SEEDS]
)
@pytest.mark.parametrize("node", ["lcp", "mlcp", "relay", "avi", "qp"])
def test_solved_is_near_and_far_is_not_solved(node: str, seed: int) -> None:
    p, solutions, cond, rng = _drawn(node, seed)
    signs = _signs(p.M)
    for z in _candidates(p, solutions, rng):
        for tolerance in TOLERANCES:
            verdict = verification.judge(p.problem, p.point(z), tolerance)
            far = min((_distance(z, x) for x in solutions), default=INF)
            said = f"{node}, seed {seed}, {tolerance:g}: z = {z}, error {verdict.error:.1e}, distance {far:.1e}"
            # where bounds hold a solution by nothing, an objective that is off by ε has unknowns that are off by √ε
            if far > max(1e3 * tolerance * cond, 0.0 if signs is None else 10.0 * tolerance**0.5):
                assert not verdict.solved, said
            if verdict.solved:
                distance = INF if node == "qp" else _nearest(p, z)
                if signs is not None:
                    distance = min(distance, *(_suboptimal(p, signs, z, x) for x in solutions))
                assert distance <= 10.0 * tolerance, said
    for z in solutions:
        assert verification.judge(p.problem, p.point(z), 1e-8).solved, f"{node}, seed {seed}: exactly {z}"


def _distance(z: np.ndarray, solution: np.ndarray) -> float:
    """Relative to the solution, or to 1 where that is less: data are integers."""
    return float(np.max(np.abs(z - solution)) / max(1.0, np.max(np.abs(solution))))
