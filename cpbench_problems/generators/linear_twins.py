"""Linear problems without a solution, without a lower bound, and with many solutions, each with what proves it."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.linear import LCP, MLCP, LCPPoint, MLCPPoint
from cpbench.formulations.programs import QP, QPPoint
from cpbench.foundation.matrices import Dense
from cpbench.generators.base import Instance, collection, dyadic, generator

CITATION = (
    "Farkas 1902, J. reine angew. Math. 124:1 (certificates); Cottle, Pang, Stone 1992, The Linear Complementarity "
    "Problem, ch. 3; made by cpbench"
)


@collection("lcp-twins", "lcp", "LCPs without a solution and with many", CITATION)
def build_lcp() -> list[Instance]:
    return [*(lcp_infeasible(n) for n in (5, 40)), *(lcp_many(n) for n in (4, 10, 40))]


@collection("mlcp-twins", "mlcp", "mixed LCPs without a solution and with many", CITATION)
def build_mlcp() -> list[Instance]:
    return [*(mlcp_infeasible(n, m) for n, m in ((3, 4), (20, 30))), *(mlcp_many(n, m) for n, m in ((3, 4), (20, 20)))]


@collection("qp-twins", "qp", "programs without a feasible point, without a bound, and with many solutions", CITATION)
def build_qp() -> list[Instance]:
    return [
        *(qp_infeasible(n) for n in (6, 40)),
        *(qp_unbounded(n) for n in (6, 40)),
        *(linear_unbounded(n) for n in (6, 40)),
        *(linear_many(n) for n in (6, 40)),
    ]


def _singular(rng: np.random.Generator, n: int) -> Dense:
    """Return GGᵀ, the rows of G with sum 0, so that (1, ..., 1) is in the null space."""
    G = dyadic(rng, (n, n), -1, 1)
    G[-1] = -G[:-1].sum(axis=0)
    return G @ G.T


def lcp_infeasible(n: int) -> Instance:
    """Build a positive semidefinite M with eᵀM = 0 and eᵀq = −1: eᵀ(Mz + q) = −1 for every z."""
    rng = generator(1400 + n)
    M, q = _singular(rng, n), dyadic(rng, n, -2, 2)
    q[-1] += -1.0 - q.sum()
    problem = LCP(M=M, q=q, name=f"lcp-infeasible-{n}")
    return Instance(problem, None, "infeasible", np.ones(n), {"class": "PSD singular", "solutions": "0"})


def lcp_many(n: int) -> Instance:
    """Build M = −I, q = e: each z_i is 0 or 1, so that there are 2ⁿ solutions; 0 is the one that is given."""
    problem = LCP(M=-np.eye(n), q=np.ones(n), name=f"many-solutions-{n}")
    return Instance(problem, LCPPoint(z=np.zeros(n)), "closed form", properties={"class": "N", "solutions": str(2**n)})


def mlcp_infeasible(n: int, m: int) -> Instance:
    """Build the mixed form of `lcp_infeasible`: the sum of all rows is 0 on the left and −1 on the right."""
    rng = generator(1500 + n + m)
    whole, q = _singular(rng, n + m), dyadic(rng, n + m, -2, 2)
    q[-1] += -1.0 - q.sum()
    blocks = {"A": whole[:n, :n], "B": whole[n:, n:], "C": whole[:n, n:], "D": whole[n:, :n]}
    problem = MLCP(**blocks, a=q[:n], b=q[n:], name=f"mlcp-infeasible-{n}-{m}")
    return Instance(problem, None, "infeasible", np.ones(n + m), {"class": "PSD singular", "solutions": "0"})


def mlcp_many(n: int, m: int) -> Instance:
    """Build −v + 1 ≥ 0 ⟂ v ≥ 0 beside u = Cv: 2ᵐ solutions; v = 0 is the one that is given."""
    C = dyadic(generator(1600 + n + m), (n, m), -1, 1)
    problem = MLCP(
        A=np.eye(n), B=-np.eye(m), C=-C, D=np.zeros((m, n)), a=np.zeros(n), b=np.ones(m), name=f"many-solutions-{n}-{m}"
    )
    point = MLCPPoint(u=np.zeros(n), v=np.zeros(m))
    return Instance(problem, point, "closed form", properties={"class": "indefinite", "solutions": str(2**m)})


def qp_infeasible(n: int) -> Instance:
    """Build a strictly convex program with the rows gᵀz ≥ 1 and −gᵀz ≥ 0 among others: their sum is 0 ≥ 1."""
    rng = generator(1700 + n)
    G, A = dyadic(rng, (n, n), -1, 1), dyadic(rng, (n // 2, n), -1, 1)
    A[-1], b = -A[0], dyadic(rng, n // 2, -2, 0)
    b[0], b[-1] = 1.0, 0.0
    problem = QP.build(G @ G.T + np.eye(n), dyadic(rng, n, -1, 1), A=A, b=b, name=f"qp-infeasible-{n}")
    certificate = np.zeros(n // 2)
    certificate[[0, -1]] = 1.0
    return Instance(problem, None, "infeasible", certificate, {"class": "SPD", "solutions": "0"})


def qp_unbounded(n: int) -> Instance:
    """Build P with Pe = 0 and pᵀe = −1 over rows Az ≥ b, b ≤ 0, with Ae ≥ 0: from 0 the objective falls along e."""
    rng = generator(1800 + n)
    P, p, A = _singular(rng, n), dyadic(rng, n, -1, 1), dyadic(rng, (n // 2, n), -1, 1)
    p[-1] += -1.0 - p.sum()
    A[:, -1] += np.maximum(-A.sum(axis=1), 0.0)
    problem = QP.build(P, p, A=A, b=-dyadic(rng, n // 2, 0, 2), name=f"qp-unbounded-{n}")
    return Instance(problem, None, "unbounded", np.ones(n), {"class": "PSD singular", "solutions": "0"})


def linear_unbounded(n: int) -> Instance:
    """Build the linear program min −z_1 over z ≥ 0 and differences z_i − z_{i+1} ≥ −1: it falls along e."""
    A = np.eye(n - 1, n) - np.eye(n - 1, n, k=1)
    p = np.zeros(n)
    p[0] = -1.0
    problem = QP.build(np.zeros((n, n)), p, A=A, b=-np.ones(n - 1), lb=np.zeros(n), name=f"linear-unbounded-{n}")
    return Instance(problem, None, "unbounded", np.ones(n), {"class": "LP", "solutions": "0"})


def linear_many(n: int) -> Instance:
    """Build min Σz over z ≥ 0, Σz ≥ 1: the whole simplex solves it; the first corner is the one that is given."""
    problem = QP.build(
        np.zeros((n, n)), np.ones(n), A=np.ones((1, n)), b=[1.0], lb=np.zeros(n), name=f"linear-face-{n}"
    )
    point = QPPoint(z=np.eye(n)[0], lam=np.ones(1), mu=np.zeros(0), nu=np.zeros(n))
    return Instance(problem, point, "closed form", properties={"class": "LP", "solutions": "infinite"})
