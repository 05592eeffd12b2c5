"""An affine variational inequality as the mixed LCP that it is, of its own size where each unknown has one bound."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.linear import AVI, MLCP, AVIPoint, MLCPPoint
from cpbench.foundation import matrices
from cpbench_solvers.automatic import Neighbour
from cpbench_solvers.qp.apart import block


def as_mlcp(P: AVI) -> Neighbour:
    """Return the MLCP with u = (z without bounds, μ) and v = (z from its bound on, λ, t).

    An unknown with a bound is z = lb + y or, where only the upper one is finite, ub − y with y ≥ 0. Where both are,
    t ≥ 0 is the force of the upper one, 0 ≤ t ⟂ ub − lb − y ≥ 0 (Cottle, Pang and Stone 1992, section 1.5). Unknowns
    with equal bounds are constants. M changes by signs alone, so that what is monotone remains so.
    """
    n, m, k = P.q.size, P.b.size, P.d.size
    low, high = np.isfinite(P.lb), np.isfinite(P.ub)
    origin, sign = np.where(low, P.lb, np.where(high, P.ub, 0.0)), np.where(high & ~low, -1.0, 1.0)
    two, free = np.flatnonzero(low & high & P.moving), np.flatnonzero(~(low | high))
    E = matrices.identity(n, P.M)[:, two]
    rows = [row for row in (P.A, P.C, -matrices.transpose(E)) if row.shape[0]]
    none = [[matrices.zeros(row.shape[0], other.shape[0], P.M) for other in rows] for row in rows]
    below: list[list[matrices.Matrix | None]] = [[row, *zero] for row, zero in zip(rows, none, strict=True)]
    K = matrices.block([[P.M, *(-matrices.transpose(row) for row in rows)], *below])
    signs = np.concatenate([sign, np.ones(m + k + two.size)])
    K = matrices.scaled_both(K, signs)
    c = signs * np.concatenate([P.M @ origin + P.q, P.A @ origin - P.b, P.C @ origin - P.d, (P.ub - P.lb)[two]])
    u = np.concatenate([free, np.arange(n + m, n + m + k)])
    bounded = np.flatnonzero((low | high) & P.moving)
    v = np.concatenate([bounded, np.arange(n, n + m), np.arange(n + m + k, c.size)])
    parts = {"A": (u, u), "B": (v, v), "C": (u, v), "D": (v, u)}
    mixed = MLCP(**{name: block(K, *at) for name, at in parts.items()}, a=c[u], b=c[v])

    def lift(point: MLCPPoint) -> AVIPoint:
        x = np.zeros(c.size)
        x[u], x[v] = point.u, np.maximum(point.v, 0.0)
        z = np.clip(origin + sign * x[:n], P.lb, P.ub)
        return AVIPoint(z=z, lam=x[n : n + m], mu=x[n + m : n + m + k])

    def push(point: AVIPoint) -> MLCPPoint:
        force = P.slacks(point)["w"]
        x = np.concatenate([sign * (point.z - origin), point.lam, point.mu, np.maximum(-force, 0.0)[two]])
        return MLCPPoint(x[u], np.maximum(x[v], 0.0))

    return Neighbour(mixed, lift, push)
