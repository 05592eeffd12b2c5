"""Every node as pairs (a, b) with a = P(a − b): numbers of an answer that share nothing with the judge.

An unknown with a force is such a pair, and so is an equation, where P is the identity.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pairs import Pairs, Project, box, cone, identity

from cpbench.foundation.cones import Cone

Factors = list[tuple[int, Project]]
"""AnswerSizes and projections of consecutive factors."""


def _cones(K: Any) -> Factors:
    found: Factors = []
    for kind, size, mu, mu_r in zip(K.kind, K.size, K.mu, K.mu_r, strict=True):
        which, n = Cone(int(kind)), int(size)
        alone = which in (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE)
        found += [(1, cone(which, 1, mu, mu_r))] * n if alone else [(n, cone(which, n, mu, mu_r))]
    return found


def _boxes(lb: np.ndarray, ub: np.ndarray) -> Factors:
    free = np.isinf(lb) & np.isinf(ub)
    return [(1, identity if f else box(lo, hi)) for lo, hi, f in zip(lb, ub, free, strict=True)]


def _simple_set(p: Any, lb: np.ndarray, ub: np.ndarray, K: Any) -> Factors:
    """The factors of K, with bounds on its free components."""
    found, at = [], 0
    for size, project in _cones(K):
        found += _boxes(lb[at : at + 1], ub[at : at + 1]) if project is identity else [(size, project)]
        at += size
    return found


def _nonnegative(n: int) -> Factors:
    return [(1, box(0.0, np.inf))] * n


def _equations(n: int) -> Factors:
    return [(1, identity)] * n


def _contact(p: Any) -> tuple[Factors, Callable[[np.ndarray], np.ndarray]]:
    """Projections of the contacts' reactions (in units where friction is isotropic) and û of u."""
    d, nc = p.dimension, p.nc
    isotropic = np.ones(nc) if p.node == "afc" else np.asarray(p.mu)
    rolling = np.asarray(getattr(p, "mu_r", np.zeros(nc)))
    half = (d - 1) // 2 if hasattr(p, "mu_r") else d - 1
    kind = Cone.ROLLING if hasattr(p, "mu_r") else Cone.SECOND_ORDER
    factors = [(d, cone(kind, d, isotropic[c], rolling[c])) for c in range(nc)]

    def hat(u: np.ndarray) -> np.ndarray:
        U = u.reshape(nc, d).copy()
        sliding, turning = np.linalg.norm(U[:, 1 : 1 + half], axis=1), np.linalg.norm(U[:, 1 + half :], axis=1)
        U[:, 0] += isotropic * sliding + rolling * turning
        return U.ravel()

    return factors, hat


def _dense(M: Any) -> np.ndarray:
    return np.asarray(M.toarray() if hasattr(M, "toarray") else M, dtype=float)


def _join(
    x: list[np.ndarray],
    J: list[list[np.ndarray]],
    values: list[np.ndarray],
    pairs: list[tuple[int, int, Factors]],
    multipliers: tuple[int, ...] = (),
) -> Pairs:
    """Pairs (part of x, block of rows, factors); a block of rows −1 − i is part i of x itself."""
    column = np.cumsum([0, *(part.size for part in x)])
    row = np.cumsum([0, *(part.size for part in values)])
    a, b, a_is, b_is, factors, at = [], [], [], [], [], 0
    for part, block, sets in pairs:
        a.append(x[part])
        b.append(values[block] if block >= 0 else x[-1 - block])
        a_is.append(column[part] + np.arange(a[-1].size))
        b_is.append((column[-1] + row[block] if block >= 0 else column[-1 - block]) + np.arange(a[-1].size))
        for size, project in sets:
            factors.append((np.arange(at, at + size), project))
            at += size
    whole = np.block(J) if sum(v.size for v in values) else np.zeros((0, sum(part.size for part in x)))
    joined = [np.concatenate(part) for part in (a, b, x, values, a_is, b_is)]
    multiplier = np.concatenate([np.full(part.size, i in multipliers) for i, part in enumerate(x)])
    return Pairs(joined[0], joined[1], factors, joined[2], whole, *joined[3:], multiplier)


def _zeros(*shape: int) -> np.ndarray:
    return np.zeros(shape)


def _box_node(x: np.ndarray, J: np.ndarray, value: np.ndarray, sets: Factors) -> Pairs:
    return _join([x], [[J]], [value], [(0, 0, sets)])


def _program(
    x: np.ndarray,
    nu: np.ndarray,
    lam: np.ndarray,
    mu: np.ndarray,
    H: np.ndarray,
    gradient: np.ndarray,
    rows: tuple[np.ndarray, np.ndarray],
    equalities: tuple[np.ndarray, np.ndarray],
    sets: Factors,
) -> Pairs:
    """Stationarity ∇ − Aᵀλ − Cᵀμ − ν = 0, 0 ≤ λ ⟂ rows ≥ 0, equalities = 0, x = P(x − ν)."""
    (A, g), (C, h) = rows, equalities
    n, m, k = x.size, g.size, h.size
    force = gradient - A.T @ lam - C.T @ mu - nu
    J = [
        [H, -A.T, -C.T, -np.eye(n)],
        [A, _zeros(m, m), _zeros(m, k), _zeros(m, n)],
        [C, _zeros(k, m), _zeros(k, k), _zeros(k, n)],
    ]
    return _join(
        [x, lam, mu, nu],
        J,
        [force, g, h],
        [(0, 0, _equations(n)), (1, 1, _nonnegative(m)), (2, 2, _equations(k)), (0, -4, sets)],
        (1, 2, 3),
    )


def _inequality(
    x: np.ndarray,
    lam: np.ndarray,
    mu: np.ndarray,
    H: np.ndarray,
    F: np.ndarray,
    rows: tuple[np.ndarray, np.ndarray],
    equalities: tuple[np.ndarray, np.ndarray],
    sets: Factors,
) -> Pairs:
    """x = P(x − F + Aᵀλ + Cᵀμ), 0 ≤ λ ⟂ rows ≥ 0, equalities = 0."""
    (A, g), (C, h) = rows, equalities
    m, k = g.size, h.size
    J = [[H, -A.T, -C.T], [A, _zeros(m, m), _zeros(m, k)], [C, _zeros(k, m), _zeros(k, k)]]
    force = F - A.T @ lam - C.T @ mu
    pairs = [(0, 0, sets), (1, 1, _nonnegative(m)), (2, 2, _equations(k))]
    return _join([x, lam, mu], J, [force, g, h], pairs, (1, 2))


def _map(F: Any, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Slopes and values at x."""
    return (_dense(F.jacobian(x)), F(x)) if F.rows else (_zeros(0, x.size), _zeros(0))


def _global(p: Any, point: Any, K: np.ndarray, force: np.ndarray) -> Pairs:
    """Dynamics, contacts and joints: Kv = Hr + Gλ + …"""
    H, G = _dense(p.H), _dense(getattr(p, "G", _zeros(p.H.shape[0], 0)))
    lam, b = (getattr(point, "lam", _zeros(0)), getattr(p, "b", _zeros(0)))
    m, k = point.r.size, lam.size
    factors, hat = _contact(p)
    J = [
        [K, -H, -G],
        [H.T, _zeros(m, m), _zeros(m, k)],
        [G.T, _zeros(k, m), _zeros(k, k)],
    ]
    u = H.T @ point.v + p.w
    values = [force - H @ point.r - G @ lam, u, G.T @ point.v + b]
    sets = [(0, 0, _equations(point.v.size)), (1, 1, factors), (2, 2, _equations(k))]
    pairs = _join([point.v, point.r, lam], J, values, sets, (2,))
    pairs.b[point.v.size : point.v.size + m] = hat(u)
    return pairs


def _local(p: Any, x: list[np.ndarray], J: list[list[np.ndarray]], values: list[np.ndarray]) -> Pairs:
    """ContactAnswer, and equations after them."""
    factors, hat = _contact(p)
    m = x[0].size
    if p.node == "afc":  # r = Sr′, u = S⁻¹u′ of isotropic contacts with μ = 1
        S = np.column_stack([np.ones(p.nc), _dense(p.mu)]).ravel()
        x, J, values = [x[0] / S], [[S[:, None] * J[0][0] * S]], [S * values[0]]
    pairs = _join(x, J, values, [(0, 0, factors), *((i, i, _equations(x[i].size)) for i in range(1, len(x)))])
    pairs.b[:m] = hat(values[0])
    return pairs


def pairs_of(p: Any, point: Any) -> Pairs:
    """The pairs of any node."""
    return _NODES[p.node](p, point)


def _linear(p: Any, x: np.ndarray, sets: Factors) -> Pairs:
    return _box_node(x, _dense(p.M), p.M @ x + p.q, sets)


def _mlcp(p: Any, x: Any) -> Pairs:
    values = [p.A @ x.u + p.C @ x.v + p.a, p.D @ x.u + p.B @ x.v + p.b]
    J = [[_dense(p.A), _dense(p.C)], [_dense(p.D), _dense(p.B)]]
    return _join([x.u, x.v], J, values, [(0, 0, _equations(x.u.size)), (1, 1, _nonnegative(x.v.size))])


def _qp(p: Any, x: Any) -> Pairs:
    rows, equalities = (_dense(p.A), p.A @ x.z - p.b), (_dense(p.C), p.C @ x.z - p.d)
    return _program(x.z, x.nu, x.lam, x.mu, _dense(p.Q), p.Q @ x.z + p.p, rows, equalities, _boxes(p.lb, p.ub))


def _nlp(p: Any, x: Any) -> Pairs:
    H = _dense(p.f.hessian(x.z, np.ones(1)))
    for F, multipliers in ((p.g, x.lam), (p.h, x.mu)):
        if F.rows:
            H = H - _dense(F.hessian(x.z, multipliers))
    gradient = _dense(p.f.jacobian(x.z)).ravel()
    sets = _boxes(p.lb, p.ub)
    return _program(x.z, x.nu, x.lam, x.mu, H, gradient, _map(p.g, x.z), _map(p.h, x.z), sets)


def _avi(p: Any, x: Any) -> Pairs:
    rows, equalities = (_dense(p.A), p.A @ x.z - p.b), (_dense(p.C), p.C @ x.z - p.d)
    return _inequality(x.z, x.lam, x.mu, _dense(p.M), p.M @ x.z + p.q, rows, equalities, _boxes(p.lb, p.ub))


def _vi(p: Any, x: Any) -> Pairs:
    H, F = _map(p.F, x.z)
    A, g = _map(p.g, x.z)
    if g.size:
        H = H - _dense(p.g.hessian(x.z, x.nu))
    rows = np.vstack([_dense(p.A), A]), np.concatenate([p.A @ x.z - p.b, g])
    lam, sets = np.concatenate([x.lam, x.nu]), _simple_set(p, p.lb, p.ub, p.K)
    return _inequality(x.z, lam, x.mu, H, F, rows, (_dense(p.C), p.C @ x.z - p.d), sets)


def _qvi(p: Any, x: Any) -> Pairs:
    n = x.z.size
    H, F = _map(p.F, x.z)
    A, g = _map(p.g, np.concatenate([x.z, x.z]))
    K, lb, ub = p.set_at(x.z)
    return _inequality(x.z, x.nu, _zeros(0), H, F, (A[:, :n], g), (_zeros(0, n), _zeros(0)), _simple_set(p, lb, ub, K))


def _cp(p: Any, x: Any) -> Pairs:
    H, F = _map(p.F, x.x)
    none = _zeros(0, x.x.size), _zeros(0)
    return _inequality(x.x, x.lam, _zeros(0), H, F, (_dense(p.A), p.A @ x.x), none, _cones(p.K))


def _coneqp(p: Any, x: Any) -> Pairs:
    Q, A = _dense(p.Q), _dense(p.A)
    s = A @ x.x + p.b
    n, m = x.x.size, s.size
    J = [[Q, -A.T], [A, _zeros(m, m)]]
    values = [Q @ x.x + p.p - A.T @ x.y, s]
    pairs = _join([x.x, x.y], J, values, [(0, 0, _equations(n)), (1, 1, _cones(p.K))], (1,))
    pairs.a[n:], pairs.b[n:] = s, x.y  # s = P(s − y)
    pairs.a_is[n:], pairs.b_is[n:] = pairs.b_is[n:].copy(), pairs.a_is[n:].copy()
    return pairs


def _nonlinear(p: Any, x: np.ndarray, sets: Factors) -> Pairs:
    return _box_node(x, *_map(p.F, x), sets)


_NODES: dict[str, Callable[[Any, Any], Pairs]] = {
    "lcp": lambda p, x: _linear(p, x.z, _nonnegative(x.z.size)),
    "relay": lambda p, x: _linear(p, x.z, _boxes(p.lb, p.ub)),
    "soclcp": lambda p, x: _linear(p, x.x, _cones(p.K)),
    "mlcp": _mlcp,
    "avi": _avi,
    "qp": _qp,
    "coneqp": _coneqp,
    **dict.fromkeys(("fc", "rfc", "afc"), lambda p, x: _local(p, [x.r], [[_dense(p.W)]], [p.W @ x.r + p.q])),
    "fcm": lambda p, x: _local(
        p,
        [x.r, x.lam],
        [[_dense(p.W), _dense(p.V)], [_dense(p.V).T, _dense(p.R)]],
        [p.W @ x.r + p.V @ x.lam + p.q, p.V.T @ x.r + p.R @ x.lam + p.s],
    ),
    **dict.fromkeys(("gfc", "grfc"), lambda p, x: _global(p, x, _dense(p.M), p.M @ x.v - p.f)),
    "nfc": lambda p, x: _global(p, x, *_map(p.F, x.v)),
    "ncp": lambda p, x: _nonlinear(p, x.z, _nonnegative(x.z.size)),
    "micp": lambda p, x: _nonlinear(p, x.z, _boxes(p.lb, p.ub)),
    "equation": lambda p, x: _nonlinear(p, x.z, _equations(x.z.size)),
    "ge": lambda p, x: _nonlinear(p, x.z, _simple_set(p, p.lb, p.ub, p.K)),
    "vi": _vi,
    "qvi": _qvi,
    "cp": _cp,
    "nlp": _nlp,
}
