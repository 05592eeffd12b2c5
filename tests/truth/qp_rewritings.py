"""One QP and one answer to it, written in other ways: what the judge says must depend on neither."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.programs import QP, QPPoint
from cpbench.verification import judge

ROUNDING = 1e-13
"""Errors below this are rounding: ratios are taken over at least this much."""

Written = tuple[str, Any, Any]


def _bounds_as_rows(p: Any, x: QPPoint) -> Written:
    lower, upper = np.flatnonzero(np.isfinite(p.lb)), np.flatnonzero(np.isfinite(p.ub))
    eye = sp.eye_array(p.p.size, format="csr")
    A = sp.csr_array(sp.vstack([sp.csr_array(p.A), eye[lower], -eye[upper]]))
    b = np.concatenate([p.b, p.lb[lower], -p.ub[upper]])
    lam = np.concatenate([x.lam, np.maximum(x.nu[lower], 0.0), np.maximum(-x.nu[upper], 0.0)])
    problem = QP.build(sp.csr_array(p.Q), p.p, A, b, sp.csr_array(p.C), p.d)
    return "bounds as rows", problem, QPPoint(z=x.z, lam=lam, mu=x.mu, nu=np.zeros(p.p.size))


def _equalities_as_pairs(p: Any, x: QPPoint) -> Written:
    C = sp.csr_array(p.C)
    A = sp.csr_array(sp.vstack([sp.csr_array(p.A), C, -C]))
    problem = QP.build(sp.csr_array(p.Q), p.p, A, np.concatenate([p.b, p.d, -p.d]), lb=p.lb, ub=p.ub)
    lam = np.concatenate([x.lam, np.maximum(x.mu, 0.0), np.maximum(-x.mu, 0.0)])
    return "equalities as pairs of rows", problem, QPPoint(z=x.z, lam=lam, mu=np.zeros(0), nu=x.nu)


def _slacks(p: Any, x: QPPoint) -> Written:
    """Write Az − s = b, s ≥ 0; the slacks of an answer are Az − b."""
    n, m = p.p.size, p.b.size
    Q = sp.csr_array(sp.block_diag([sp.csr_array(p.Q), sp.csr_array((m, m))]))
    C = sp.csr_array(sp.block_array([[sp.csr_array(p.C), sp.csr_array((p.d.size, m))], [p.A, -sp.eye_array(m)]]))
    free = np.full(m, np.inf)
    problem = QP.build(
        Q,
        np.concatenate([p.p, np.zeros(m)]),
        C=C,
        d=np.concatenate([p.d, p.b]),
        lb=np.concatenate([p.lb, np.zeros(m)]),
        ub=np.concatenate([p.ub, free]),
    )
    assert C.shape == (p.d.size + m, n + m)
    slack = p.A @ x.z - p.b
    point = QPPoint(
        z=np.concatenate([x.z, slack]),
        lam=np.zeros(0),
        mu=np.concatenate([x.mu, x.lam]),
        nu=np.concatenate([x.nu, x.lam]),
    )
    return "slacks", problem, point


def _units(p: Any, x: QPPoint, rng: np.random.Generator) -> Written:
    """Measure unknowns and rows in other units, powers of two from 2⁻⁸ to 2⁸, so that no number is rounded."""
    S, R, E = (2.0 ** rng.integers(-8, 9, size) for size in (p.p.size, p.b.size, p.d.size))
    D = sp.diags_array(S)
    problem = QP.build(
        sp.csr_array(D @ sp.csr_array(p.Q) @ D),
        S * p.p,
        sp.csr_array(sp.diags_array(R) @ sp.csr_array(p.A) @ D),
        R * p.b,
        sp.csr_array(sp.diags_array(E) @ sp.csr_array(p.C) @ D),
        E * p.d,
        p.lb / S,
        p.ub / S,
    )
    return "units by powers of two", problem, QPPoint(z=x.z / S, lam=x.lam / R, mu=x.mu / E, nu=x.nu * S)


def _linear_term_as_unknown(p: Any, x: QPPoint) -> Written:
    """Minimize ½zᵀQz + t with t − pᵀz = 0, whose multiplier is 1."""
    n, m, k = p.p.size, p.b.size, p.d.size
    C = sp.csr_array(
        sp.block_array(
            [[sp.csr_array(p.C), sp.csr_array((k, 1))], [sp.csr_array(-p.p[None, :]), sp.csr_array([[1.0]])]]
        )
    )
    problem = QP.build(
        sp.csr_array(sp.block_diag([sp.csr_array(p.Q), sp.csr_array((1, 1))])),
        np.concatenate([np.zeros(n), [1.0]]),
        sp.csr_array(sp.hstack([sp.csr_array(p.A), sp.csr_array((m, 1))])),
        p.b,
        C,
        np.concatenate([p.d, [0.0]]),
        np.concatenate([p.lb, [-np.inf]]),
        np.concatenate([p.ub, [np.inf]]),
    )
    point = QPPoint(
        z=np.concatenate([x.z, [p.p @ x.z]]),
        lam=x.lam,
        mu=np.concatenate([x.mu, [1.0]]),
        nu=np.concatenate([x.nu, [0.0]]),
    )
    return "pᵀz as an unknown", problem, point


def rewritten(rng: np.random.Generator, p: Any, x: QPPoint) -> Iterator[Written]:
    """Yield (how, problem, answer) of each other way to write a QP and an answer to it."""
    yield _bounds_as_rows(p, x)
    if p.d.size:
        yield _equalities_as_pairs(p, x)
    if p.b.size:
        yield _slacks(p, x)
    yield _units(p, x, rng)
    yield _linear_term_as_unknown(p, x)


@dataclass(frozen=True)
class Compared:
    """One answer in two ways of writing: the errors, and whether it is solved in each."""

    file: str
    label: str
    how: str
    first: float
    second: float
    solved: tuple[bool, bool]

    @property
    def ratio(self) -> float:
        low, high = sorted((max(self.first, ROUNDING), max(self.second, ROUNDING)))
        return high / low

    @property
    def apart(self) -> bool:
        return self.solved[0] != self.solved[1]


def compared(file: str, problem: Any, answers: list[tuple[str, Any]], epsilon: float) -> Iterator[Compared]:
    """Yield each answer in each way of writing beside the way of the file."""
    for label, point in answers:
        rng = np.random.default_rng(zlib.crc32(f"{file} {label}".encode()))
        own = judge(problem, point, epsilon)
        for how, other, there in rewritten(rng, problem, point):
            verdict = judge(other, there, epsilon)
            yield Compared(file, label, how, own.error, verdict.error, (own.solved, verdict.solved))
