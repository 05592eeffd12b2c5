"""Problems made around a chosen solution, and a solver of tiny problems that tries every active set."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench import graph
from cpbench.conversions.base import Conversion
from cpbench.formulations import (
    LCP,
    MLCP,
    QP,
    FCPoint,
    FrictionContact,
    LCPPoint,
    MLCPPoint,
    QPPoint,
)
from cpbench.foundation import matrices

SQUARE = ("positive definite", "singular semidefinite", "monotone", "symmetric indefinite", "any")
"""Classes of square matrices that `square` makes; the first three have a semidefinite symmetric part."""


def square(rng: np.random.Generator, n: int, kind: str) -> np.ndarray:
    G = rng.standard_normal((n, n))
    skew = G - G.T
    if kind == "positive definite":
        return G @ G.T + 0.1 * np.eye(n)
    low = rng.standard_normal((n, max(1, n // 2)))  # one number is never singular: with M = 0 all z may be solutions
    if kind == "singular semidefinite":
        return low @ low.T
    if kind == "monotone":
        return low @ low.T + skew
    return (G + G.T) / 2 if kind == "symmetric indefinite" else G


def stored(M: np.ndarray, sparse: bool) -> Any:
    return sp.csr_array(M) if sparse else M


def complementary(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return z, w ≥ 0 with zᵀw = 0; one pair in six is (0, 0)."""
    state = rng.integers(0, 6, n)
    size = rng.uniform(0.5, 2.0, n)
    return np.where(state < 3, size, 0.0), np.where((state >= 3) & (state < 5), size, 0.0)


def lcp(rng: np.random.Generator, n: int, kind: str = "any", *, sparse: bool = False) -> tuple[LCP, LCPPoint]:
    M = square(rng, n, kind)
    z, w = complementary(rng, n)
    return LCP(M=stored(M, sparse), q=w - M @ z), LCPPoint(z=z)


def mlcp(
    rng: np.random.Generator, n: int, m: int, kind: str = "any", *, sparse: bool = False
) -> tuple[MLCP, MLCPPoint]:
    """Return [[A, C], [D, B]] of a kind of `square`; "singular" has a zero row and column in A."""
    whole = square(rng, n + m, "any" if kind == "singular" else kind)
    if kind == "singular" and n:
        whole[0, :n] = whole[:n, 0] = 0.0
    A, C, D, B = whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]
    u = rng.standard_normal(n)
    v, w = complementary(rng, m)
    problem = MLCP(
        A=stored(A, sparse),
        B=stored(B, sparse),
        C=stored(C, sparse),
        D=stored(D, sparse),
        a=-A @ u - C @ v,
        b=w - D @ u - B @ v,
    )
    return problem, MLCPPoint(u=u, v=v)


def qp(
    rng: np.random.Generator, n: int, m: int, k: int, kind: str = "positive definite", *, sparse: bool = False
) -> tuple[QP, QPPoint]:
    """Plant bounds on every side: none, lower, upper, both, equal."""
    Q = square(rng, n, kind)
    A, C = rng.standard_normal((m, n)), rng.standard_normal((k, n))
    z, mu = rng.standard_normal(n), rng.standard_normal(k)
    lam, slack = complementary(rng, m)
    at_lower, room = complementary(rng, n)
    at_upper, above = complementary(rng, n)
    side = rng.integers(0, 5, n)
    has_lower, has_upper, fixed = np.isin(side, (1, 3)), np.isin(side, (2, 3)), side == 4
    room[at_lower > 0] = 0.0
    above[has_lower & (at_lower > 0)] = 1.0  # not at both bounds at once
    at_upper[has_lower & (at_lower > 0)] = 0.0
    lb = np.where(has_lower, z - room, np.where(fixed, z, -np.inf))
    ub = np.where(has_upper, z + above, np.where(fixed, z, np.inf))
    lb = np.where(has_lower & has_upper & (lb == ub), lb - 1.0, lb)
    nu = np.where(has_lower & (lb == z), at_lower, 0.0) - np.where(has_upper, at_upper, 0.0)
    nu = np.where(fixed, rng.standard_normal(n), nu)
    p = A.T @ lam + C.T @ mu + nu - Q @ z
    problem = QP(
        Q=stored(Q, sparse),
        p=p,
        A=stored(A, sparse),
        b=A @ z - slack,
        C=stored(C, sparse),
        d=C @ z,
        lb=lb,
        ub=ub,
    )
    return problem, QPPoint(z=z, lam=lam, mu=mu, nu=nu)


def contact_state(
    rng: np.random.Generator, nc: int, d: int, mu: np.ndarray, *, directions: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return r, u of contacts that separate, graze, stick and slide; they slide against one of `directions` if given.

    Sticking reactions stay within 0.7 μ r_N, so within every polygon of four sides or more.
    """
    r, u = np.zeros((nc, d)), np.zeros((nc, d))
    for c in range(nc):
        way = rng.standard_normal(d - 1)
        if directions is not None:
            way = directions[:, rng.integers(directions.shape[1])]
        way = way / np.linalg.norm(way)
        match rng.choice(["separate", "graze", "stick", "slide"], p=[0.2, 0.1, 0.3, 0.4]):
            case "separate":
                u[c] = np.concatenate([[rng.uniform(0.1, 2.0)], rng.standard_normal(d - 1)])
            case "graze":
                u[c, 1:] = rng.standard_normal(d - 1)
            case "stick":
                r[c, 0] = rng.uniform(0.1, 2.0)
                r[c, 1:] = mu[c] * r[c, 0] * rng.uniform(0.0, 0.7) * way
            case _:
                r[c, 0] = rng.uniform(0.1, 2.0)
                r[c, 1:] = mu[c] * r[c, 0] * way
                u[c, 1:] = -rng.uniform(0.1, 2.0) * way
    return r.ravel(), u.ravel()


def fc(
    rng: np.random.Generator,
    nc: int,
    d: int,
    kind: str = "any",
    *,
    sparse: bool = False,
    directions: np.ndarray | None = None,
) -> tuple[FrictionContact, FCPoint]:
    W = square(rng, nc * d, kind)
    mu = friction(rng, nc)
    r, u = contact_state(rng, nc, d, mu, directions=directions)
    return FrictionContact(W=stored(W, sparse), q=u - W @ r, mu=mu, dimension=d), FCPoint(r=r)


def friction(rng: np.random.Generator, nc: int) -> np.ndarray:
    """Draw coefficients, one in five 0."""
    return np.where(rng.random(nc) < 0.2, 0.0, rng.uniform(0.1, 1.0, nc))


def bodies_and_contacts(
    rng: np.random.Generator, bodies: int, nc: int, d: int, symmetric: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Build the mass matrix of rigid bodies of six unknowns each, and H of contacts that touch one or two of them."""
    n = 6 * bodies
    M = np.zeros((n, n))
    for b in range(bodies):
        at = slice(6 * b, 6 * b + 6)
        M[at, at] = square(rng, 6, "positive definite") + np.eye(6)
        if not symmetric:
            M[at, at] += 0.5 * square(rng, 6, "any")
    H = np.zeros((n, nc * d))
    for c in range(nc):
        for b in rng.choice(bodies, size=min(bodies, 2), replace=False):
            H[6 * b : 6 * b + 6, d * c : d * c + d] = rng.standard_normal((6, d))
    return M, H


def enumerate_mlcp(problem: MLCP, tolerance: float = 1e-10) -> MLCPPoint | None:
    """Return the first solution found by trying every set of positive v (2^m least-squares problems); None if none
    is."""
    n, m = problem.a.size, problem.b.size
    whole = matrices.dense(matrices.block([[problem.A, problem.C], [problem.D, problem.B]]))
    right = -np.concatenate([problem.a, problem.b])
    for active in itertools.product((False, True), repeat=m):
        basis = np.concatenate([np.full(n, True), active])
        x = np.zeros(n + m)
        if basis.any():
            x[basis] = np.linalg.lstsq(whole[np.ix_(basis, basis)], right[basis], rcond=None)[0]
        x[n:] = np.maximum(x[n:], 0.0)
        point = MLCPPoint(u=x[:n], v=x[n:])
        if problem.residuals(point).error <= tolerance:
            return point
    return None


def both_ways(edge: Conversion, problem: Any, point: Any) -> tuple[Any, Any]:
    """The converted problem and its answer, after checking that the planted one goes there and comes back."""
    assert problem.residuals(point).error <= 1e-9
    target = edge.step(problem)
    there = graph.push(target, point)
    assert target.residuals(there).error <= 1e-9
    assert problem.residuals(graph.lift(target, there)).error <= 1e-9
    return target, there
