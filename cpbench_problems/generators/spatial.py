"""Spatial price equilibria: what is shipped between regions costs as much as the price differs, or nothing is shipped.

Region i supplies s_i at the price a_i + b_i s_i, region j takes D_j at the price c_j − d_j D_j; x_ij is shipped at the
cost t_ij: 0 ≤ x_ij ⟂ a_i + b_i s_i + t_ij − (c_j − d_j D_j) ≥ 0, s_i = Σ_j x_ij, D_j = Σ_i x_ij. Prices and
shipments are drawn first, then a, c and t, so that all is exact. Supplies, demands and prices are unique, shipments
need not be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.linear import LCP, MLCP, LCPPoint, MLCPPoint
from cpbench.foundation.matrices import Dense, Vector
from cpbench.generators.base import Instance, collection, dyadic, generator

CITATION = (
    "Samuelson 1952, Am. Econ. Rev. 42:283; Takayama and Judge 1971, Spatial and Temporal Price and Allocation "
    "Models; planted by cpbench"
)


@collection("spatial-prices", "lcp", "spatial price equilibria by shipments alone", CITATION)
def build() -> list[Instance]:
    return [by_shipments(*sizes) for sizes in ((3, 4), (6, 7), (10, 14))]


@collection("spatial-prices-mixed", "mlcp", "spatial price equilibria by supplies, demands and shipments", CITATION)
def build_mixed() -> list[Instance]:
    return [mixed(*sizes) for sizes in ((5, 6), (10, 12), (25, 30))]


@collection("spatial-prices-large", "mlcp", "spatial price equilibria of up to 300 regions", CITATION, tier="standard")
def build_large() -> list[Instance]:
    return [mixed(*sizes) for sizes in ((40, 60), (80, 90), (300, 330))]


@dataclass(frozen=True)
class _Market:
    """Slopes b (m,) and d (n,), intercepts a and c, costs t (m, n), shipments x (m, n) at the equilibrium."""

    b: Vector
    d: Vector
    a: Vector
    c: Vector
    t: Dense
    x: Dense


def _market(m: int, n: int) -> _Market:
    rng = generator(1100 + m * n)
    b, d = 2.0 ** rng.integers(-3, 1, m), 2.0 ** rng.integers(-3, 1, n)
    at, to = rng.integers(8, 17, m) / 1.0, rng.integers(24, 41, n) / 1.0
    used = rng.integers(0, 3, (m, n)) == 0
    x = np.where(used, dyadic(rng, (m, n), 0, 4) + 0.125, 0.0)
    t = to[None, :] - at[:, None] + np.where(used, 0.0, rng.integers(1, 33, (m, n)) / 8.0)
    return _Market(b, d, at - b * x.sum(axis=1), to + d * x.sum(axis=0), t, x)


def by_shipments(m: int, n: int) -> Instance:
    """Build the LCP of mn shipments: M = B ⊗ E + E ⊗ D, symmetric, of rank m + n − 1 at most."""
    market = _market(m, n)
    M = np.kron(np.diag(market.b), np.ones((n, n))) + np.kron(np.ones((m, m)), np.diag(market.d))
    q = (market.a[:, None] + market.t - market.c[None, :]).ravel()
    problem = LCP(M=sp.csr_array(M), q=q, name=f"spatial-{m}x{n}")
    facts = {"class": "PSD singular", "symmetric": True, "regions": m + n}
    return Instance(problem, LCPPoint(z=market.x.ravel()), "planted", properties=facts)


def mixed(m: int, n: int) -> Instance:
    """Build the mixed LCP with u = (s, D) free and v = x, sparse: equations b(s − Σ_j x) = 0 and d(D − Σ_i x) = 0."""
    market = _market(m, n)
    slopes = sp.diags_array(np.concatenate([market.b, market.d]))
    sums = sp.vstack([sp.kron(sp.eye_array(m), np.ones((1, n))), sp.kron(np.ones((1, m)), sp.eye_array(n))])
    C = sp.csr_array(-(slopes @ sums))
    b = (market.a[:, None] + market.t - market.c[None, :]).ravel()
    problem = MLCP(
        A=sp.csr_array(slopes), B=sp.csr_array((m * n, m * n)), C=C, D=sp.csr_array(-C.T), a=np.zeros(m + n), b=b,
        name=f"spatial-mixed-{m}x{n}",
    )  # fmt: skip
    u = np.concatenate([market.x.sum(axis=1), market.x.sum(axis=0)])
    facts = {"class": "PSD", "regions": m + n}
    return Instance(problem, MLCPPoint(u=u, v=market.x.ravel()), "planted", properties=facts)
