"""Answers to LCPs and MLCPs of real files from complementary bases: right ones, and wrong ones from neighbours.

A basis says of each pair which of v and w is 0. Its point solves one linear system, refined with residuals in long
double; it is a solution where v ≥ 0 and w ≥ 0. A neighbour has one pair exchanged.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import real_files
import scipy.linalg

import cpbench
from cpbench.conversions.base import make
from cpbench.errors import CpbenchError
from cpbench.formulations import MLCP
from cpbench.foundation import matrices
from cpbench.verification import judge

Array = np.ndarray
EXACT = np.longdouble
NEGATIVE = 1e-11
"""What a basic variable of a solution may be below 0, over the largest of its kind."""
WRONG = 1000.0
"""A neighbour is wrong where v or w is negative by this many ε (`Mixed.negative`)."""


@dataclass(frozen=True)
class Mixed:
    """0 = Au + Cv + a, w = Du + Bv + b, 0 ≤ v ⟂ w ≥ 0 as one dense matrix; an LCP has no u."""

    M: Array
    q: Array
    free: int

    @classmethod
    def of(cls, p: Any) -> Mixed:
        if p.node == "lcp":
            return cls(matrices.dense(p.M), np.asarray(p.q), 0)
        M = np.block([[matrices.dense(p.A), matrices.dense(p.C)], [matrices.dense(p.D), matrices.dense(p.B)]])
        return cls(M, np.concatenate([p.a, p.b]), p.a.size)

    def point(self, basic: Array) -> Array | None:
        """Return (u, v) of a basis (`basic` : which v may be positive); None where its matrix is singular."""
        index = np.concatenate([np.arange(self.free), self.free + np.flatnonzero(basic)])
        block = self.M[np.ix_(index, index)]
        x = np.zeros(self.q.size)
        if not index.size:
            return x
        scale = np.abs(block).max(axis=1)
        if not scale.all():
            return None
        scale = 2.0 ** -np.round(np.log2(scale))
        lu, order, info = scipy.linalg.lapack.dgetrf(scale[:, None] * block)
        pivots = np.abs(lu.diagonal())
        if info != 0 or not pivots.min() >= 1e-13 * pivots.max():
            return None
        y, exact = np.zeros(index.size, EXACT), block.astype(EXACT)
        for _ in range(4):
            left = -(exact @ y) - self.q[index]
            y = y + scipy.linalg.lu_solve((lu, order), scale * left.astype(float))
        x[index] = y.astype(float)
        return x

    def negative(self, x: Array) -> float:
        """Return how far v or w is below 0: w over the largest terms of a row; v over the largest v, or by what it
        changes in some row over that row's terms, the smaller."""
        below, w = np.maximum(-x, 0.0)[self.free :], (self.M @ x + self.q)[self.free :]
        terms = np.abs(self.M) @ np.abs(x) + np.abs(self.q)
        rows = terms > 0
        effect = (np.abs(self.M[rows, self.free :]) / terms[rows, None]).max(axis=0, initial=0.0) * below
        largest_v, largest_w = np.abs(x[self.free :]).max(initial=0.0), terms[self.free :].max(initial=0.0)
        of_v = np.minimum(effect, below / largest_v) if largest_v > 0 else effect
        return max(float(of_v.max(initial=0.0)), float(-w.min(initial=0.0)) / largest_w if largest_w > 0 else 0.0)


def bases(rng: np.random.Generator, mixed: Mixed, x: Array, most: int) -> Iterator[tuple[str, Array]]:
    """Yield the basis that an answer says, and neighbours of it by one pair."""
    v, w = x[mixed.free :], (mixed.M @ x + mixed.q)[mixed.free :]
    terms = (np.abs(mixed.M) @ np.abs(x) + np.abs(mixed.q))[mixed.free :]
    large = np.abs(v).max(initial=0.0) or 1.0
    basic = v / large > w / np.where(terms > 0, terms, 1.0)
    yield "basis", basic
    for i in rng.permutation(basic.size)[:most]:
        other = basic.copy()
        other[i] = not other[i]
        yield f"pair {i} exchanged", other


@dataclass(frozen=True)
class Based:
    """The verdict on the point of one basis."""

    file: str
    label: str
    right: bool
    solved: bool
    error: float
    negative: float

    @property
    def false(self) -> bool:
        return self.right != self.solved


def judged(name: str, problem: Any, epsilon: float, most: int, seconds: float = 5.0) -> Iterator[Based]:
    """Yield the verdicts on right and wrong points of complementary bases near the automatic choice's answer."""
    try:
        answer = cpbench.solve(problem, tolerance=1e-10, seconds=seconds).x
    except CpbenchError:
        return
    if answer is None or not np.isfinite(answer).all():
        return
    mixed = Mixed.of(problem)
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    for label, basic in bases(rng, mixed, answer, most):
        x = mixed.point(basic)
        if x is None or not np.isfinite(x).all():
            continue
        negative = mixed.negative(x)
        if NEGATIVE < negative < WRONG * epsilon:
            continue
        verdict = judge(problem, problem.point_from_vector(x), epsilon)
        yield Based(name, label, negative <= NEGATIVE, verdict.solved, verdict.error, negative)


def problems(unknowns: int) -> Iterator[tuple[str, Any]]:
    """Yield the LCPs and MLCPs of the files, and the MLCPs of the convex QPs."""
    for name, problem in real_files.problems("lcp", "mlcp"):
        if sum(problem.point_sizes.values()) <= unknowns:
            yield name, problem
    edge = make("qp-mlcp")
    for name, problem in real_files.convex_qps():
        if problem.p.size + problem.b.size + problem.d.size <= unknowns and edge.obstacle(problem) is None:
            target = edge.step(problem)
            if isinstance(target, MLCP) and sum(target.point_sizes.values()) <= unknowns:
                yield name, target
