"""The verdict, written again from its definition in NumPy: for an LCP, a QP and a contact problem.

Nothing of `cpbench.verification` is used but the number that is compared. Each function takes one connected part; the
error of a problem is the largest of its parts. They leave out what a part without constants and rows that are bounds
need, and rounding, so they are right where the error is above rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cpbench.formulations import LCP, QP, FrictionContact
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.lcp import LCPPoint
from cpbench.formulations.qp import QPPoint
from cpbench.verification import judge

Array = NDArray[Any]
Case = tuple[Any, Any, float]
"""A problem, an answer, and its error by the functions here."""
AGREED = 0.01
"""Largest relative difference: the equilibration of the product ends where means of rows are off by 5e-4."""
LEAST = 1e-12
"""Errors from here on are compared; those below are rounding."""


def equilibrated(K: Array) -> tuple[Array, Array]:
    """Return D and C so that the entries D_i|K_ij|C_j ≠ 0 of each row and of each column are 1 on average."""
    A, some = np.abs(K), K != 0
    logs = np.log(A, out=np.zeros(K.shape), where=some)
    normal = np.block([[np.diag(some.sum(axis=1)), some], [some.T, np.diag(some.sum(axis=0))]])
    sides = -np.concatenate([logs.sum(axis=1), logs.sum(axis=0)])
    D, C = np.exp(np.split(np.linalg.lstsq(normal.astype(float), sides)[0], 2))
    for _ in range(1000):
        D = some.sum(axis=1) / (A @ C)
        C = some.sum(axis=0) / (D @ A)
    return D, C


def lcp_error(M: Array, q: Array, z: Array) -> float:
    """Return the error of z as an answer to z ≥ 0, w = Mz + q ≥ 0, zᵀw = 0."""
    w, size = M @ z + q, np.abs(M) @ np.abs(z)
    D = equilibrated(M)[0]
    # q_i counts unless w_i > 0 holds z_i at 0 and the other terms of the row are small beside it
    needed = (w <= 0) | (size > 0.1 * np.abs(q))
    s = (D * np.maximum(size, np.abs(q) * (needed if (needed & (q != 0)).any() else 1))).max()
    row = D / s
    column = (row[:, None] * np.abs(M)).max(axis=0)
    pairs = np.abs(np.minimum(z * column, w * row)).max()
    # in the gap an unknown counts for at most 1/column, the size at which it moves a row by s
    gap = np.abs(np.clip(z, -1 / column, 1 / column) * column * w * row).sum()
    terms = max(np.abs(q * z * row * column).sum(), abs((z * row * column) @ M @ z), gap, 1e-300)
    # growth: the same with the constants alone for a size
    row = D / (D * np.abs(q)).max()
    column = (row[:, None] * np.abs(M)).max(axis=0)
    growth = np.abs(np.minimum(z * column, w * row)).max()
    return max(pairs, min(gap / terms, terms), min(growth, 1.0) ** 2)


def qp_error(P: QP, x: QPPoint) -> float:
    """Return the error of an answer, of rows f = Ky + c beside y = (z, λ, μ) between `low` and `high`."""
    n, m, G = x.z.size, x.lam.size, np.vstack([P.A, P.C])
    K = np.block([[P.Q, -G.T], [G, np.zeros((len(G), len(G)))]])
    c, y, of_z = np.concatenate([P.p, -P.b, -P.d]), np.concatenate([x.z, x.lam, x.mu]), np.arange(n + len(G)) < n
    low = np.concatenate([P.lb, np.zeros(m), np.full(len(G) - m, -np.inf)])
    high = np.concatenate([P.ub, np.full(len(G), np.inf)])
    f, size = K @ y + c, np.maximum(np.abs(y), np.abs(np.clip(y, low, high)))
    D = np.sqrt(np.multiply(*equilibrated(np.abs(K) + np.abs(K).T)))
    row, needed = qp_rows(K, c, y, f, low, high, size, D, of_z)
    column = np.maximum((row[:, None] * np.abs(K)).max(axis=0), 1 / np.maximum(np.abs(low), np.abs(high)))
    push = np.maximum(np.where(np.isinf(low), f, 0.0), np.where(np.isinf(high), -f, 0.0))  # what no bound takes of f
    z, price = qp_scales(K, c, needed, D, of_z)
    missed = np.where(of_z, np.maximum(low - y, y - high), push)
    gradient = max((push * row)[of_z].max(), ((low - y) * column)[~of_z].max(initial=0.0))
    gradient = max(gradient, (np.abs(f[:n] - x.nu) * row[:n] / np.maximum(1.0, np.abs(f[:n]) * row[:n])).max())
    # a gradient without prices of which all terms are far below what sides make of it is 0
    share = np.inf if P.p.any() else (D / row)[of_z].max() / price
    # a constraint or a bound counts by a tenth of its own terms, too, unless these are far below others
    unit, side = np.where(of_z, column, row), np.where(y < low, np.abs(low), np.where(y > high, np.abs(high), 0.0))
    own = np.where(of_z, np.where(side > 0, side + np.abs(y), 0.0), np.abs(K) @ size + np.abs(c))
    unit = np.maximum(unit, np.divide(0.1, own, out=np.zeros(y.size), where=own * unit > 1e-5))
    error = max((missed * unit).max(), min(gradient, share))
    gap, terms = qp_gap(K, c, z * price, y, f, low, high, column, of_z)
    near = (np.abs(y - low) <= np.abs(low) / 2) | (np.abs(y - high) <= np.abs(high) / 2)
    fixed = of_z & ((near & np.isfinite(size)) | (y <= low) | (y >= high))
    data = (D * np.maximum(np.abs(c), np.abs(K) @ np.where(fixed, size, 0.0)))[~of_z].max()
    growth = np.where(of_z, push / column / terms, push * D / data)
    return max(error, gap, min(growth.max(), 1.0) ** 2)


def qp_rows(
    K: Array, c: Array, y: Array, f: Array, low: Array, high: Array, size: Array, D: Array, of_z: Array
) -> tuple[Array, Array]:
    """Return 1/size of the rows, and whether their constants count."""
    terms, below, above = np.abs(K) @ size, np.abs(y - low), np.abs(y - high)
    idle = (np.isfinite(low) & (below <= above) & (f > 0)) | (np.isfinite(high) & (above <= below) & (f < 0))
    needed = (c != 0) & ~(idle & (terms <= 0.1 * np.abs(c)))
    row, reach = np.zeros(y.size), (size / D)[of_z].max()
    for group, least in ((of_z, 0.0), (~of_z, reach)):  # a row beside a multiplier counts for what z makes of a row
        counted = np.abs(c) * (needed if needed[group].any() else 1)
        row[group] = D[group] / max((D * np.maximum(terms, counted))[group].max(), least)
    return row, needed


def qp_scales(K: Array, c: Array, needed: Array, D: Array, of_z: Array) -> tuple[float, float]:
    """Return the sizes of z and of the gradient that those of the sides and prices c that are `needed` make."""
    counts, curved = D * np.abs(c) * needed, K[np.ix_(of_z, of_z)].any()
    price, side = counts[of_z].max(), counts[~of_z].max()
    z = max(side, price) if curved else side
    return z, max(price, z) if curved else price


def qp_gap(
    K: Array, c: Array, given: float, y: Array, f: Array, low: Array, high: Array, column: Array, of_z: Array
) -> tuple[float, float]:
    """Return the gap over the terms of the objective, and these; `given` is what sides and prices make of it."""
    bound = np.where(f > 0, low, high)
    room = np.clip(np.where(np.isinf(bound), y, y - bound), -1 / column, 1 / column)
    gap = np.abs(room * f).sum()
    half, prices, sides = y @ K @ y / 2, (c * y)[of_z], (c * y)[~of_z]
    gap = gap if prices.any() else min(gap, abs(half))  # without prices no objective is below 0
    terms = max(abs(half + prices.sum()), abs(half), min(np.abs(prices).sum(), np.abs(sides).sum()), gap, 1e-300)
    of_zero = np.sqrt(min(1.0, terms / given))  # an objective far below `given` is 0
    return (gap / terms, terms) if gap / terms <= of_zero else (of_zero, given)


def contact_error(W: Array, q: Array, mu: Array, r: Array) -> float:
    """Return the error of reactions r as an answer to û = Wr + q + μ‖u_T‖e_N in K*, r in K, ûᵀr = 0."""
    nc = mu.size
    d = r.size // nc
    u = (W @ r + q).reshape(nc, d)
    r, moved = r.reshape(nc, d), u + (mu * np.linalg.norm(u[:, 1:], axis=1))[:, None] * np.eye(d)[0]
    T = np.linalg.norm(W.reshape(nc, d, nc, d), axis=(1, 3))  # a contact is one row
    c, terms = np.linalg.norm(q.reshape(nc, d), axis=1), T @ np.linalg.norm(r, axis=1)
    D = np.sqrt(np.multiply(*equilibrated(T + T.T)))
    needed = ~u.any(axis=1) | (terms > 0.1 * c)  # not the free velocity of what is open or slides, if far larger
    s = np.linalg.norm(D * np.maximum(terms, c * (needed if needed.any() else 1)))
    row = (D / s)[:, None]
    column = (row * T).max(axis=0)[:, None]
    law = np.linalg.norm(r * column - cone(r * column - moved * row, mu), axis=1)
    sticks = np.linalg.norm((r - cone(r, mu)) * column, axis=1) + np.linalg.norm(u * row, axis=1)
    error = np.linalg.norm(np.where(mu > 0, np.minimum(law, sticks), law))
    lacks = np.linalg.norm(cone(-moved, mu), axis=1)
    closes = np.where(mu > 1, np.maximum(lacks, -u[:, 0]), lacks)  # a steep cone hides how fast it closes
    return max(error, min((closes * D).max() / np.linalg.norm(D * c), 1.0) ** 2)


def cone(y: Array, mu: Array) -> Array:
    """Project every row on ‖y_T‖ ≤ μ y_N."""
    slide = np.linalg.norm(y[:, 1:], axis=1)
    normal = np.maximum((y[:, 0] + mu * slide) / (1 + mu**2), 0.0)
    inside = slide <= mu * y[:, 0]
    normal = np.where(inside, y[:, 0], normal)
    share = np.minimum(1.0, mu * normal / np.where(slide > 0, slide, 1.0))
    return np.column_stack([normal, y[:, 1:] * share[:, None]])


def of_lcp(rng: np.random.Generator, n: int, off: float) -> Case:
    """Draw an LCP with a planted solution in random units, and an answer that is off by about `off`."""
    rows, columns = units(rng, n), units(rng, n)
    M = rows[:, None] * (connected(rng, n) * rng.standard_normal((n, n))) * columns
    active = rng.permutation(n) < rng.integers(1, n + 1)
    z = rng.exponential(size=n) / columns * active
    w = rng.exponential(size=n) * rows * ~active
    answer = z * (1 + off * rng.standard_normal(n)) + off * rng.standard_normal(n) / columns * (rng.random(n) < 0.3)
    problem = LCP(M=M, q=w - M @ z)
    return problem, LCPPoint(z=answer), lcp_error(M, problem.q, answer)


def of_qp(rng: np.random.Generator, n: int, off: float) -> Case:
    """Draw a convex QP with a planted solution in random units, and an answer that is off by about `off`."""
    m, k = int(rng.integers(1, n + 1)), int(rng.integers(0, n // 2 + 1))
    own, sides, even = units(rng, n), units(rng, m), units(rng, k)
    B = rng.standard_normal((n, int(rng.integers(1, n + 1))))
    Q = (B @ B.T + np.diag(rng.random(n))) * own[:, None] * own
    A = sides[:, None] * rng.standard_normal((m, n)) * own
    C = even[:, None] * rng.standard_normal((k, n)) * own
    z, lam = rng.standard_normal(n) / own, rng.exponential(size=m) / sides * (rng.random(m) < 0.5)
    mu, at = rng.standard_normal(k) / even, rng.integers(0, 4, n)
    lb = np.where(at == 0, z, np.where(at == 2, z - rng.exponential(size=n) / own, -np.inf))
    ub = np.where(at == 1, z, np.where(at == 2, z + rng.exponential(size=n) / own, np.inf))
    nu = rng.exponential(size=n) * own * ((at == 0).astype(float) - (at == 1))
    b = A @ z - rng.exponential(size=m) * sides * (lam == 0)
    problem = QP(Q=(Q + Q.T) / 2, p=A.T @ lam + C.T @ mu + nu - Q @ z, A=A, b=b, C=C, d=C @ z, lb=lb, ub=ub)
    z, lam, mu, nu = (part * (1 + off * rng.standard_normal(part.size)) for part in (z, lam, mu, nu))
    answer = QPPoint(z=z, lam=lam, mu=mu, nu=nu)
    return problem, answer, qp_error(problem, answer)


def of_contact(rng: np.random.Generator, n: int, off: float) -> Case:
    """Draw a contact problem with a planted solution in random units, and an answer that is off by about `off`."""
    d, nc = int(rng.integers(2, 4)), max(1, n // 3)
    H = np.repeat(units(rng, nc), d)[:, None] * rng.standard_normal((nc * d, int(rng.integers(d, nc * d + 1))))
    W, mu = H @ H.T, rng.choice([0.0, 0.3, 0.8, 3.0], nc)
    size = 1 / np.sqrt(np.diag(W).reshape(nc, d)[:, 0])
    t = rng.standard_normal((nc, d - 1))
    t /= np.linalg.norm(t, axis=1)[:, None]
    state = rng.integers(0, 3, nc)  # open, stick, slip
    normal, speed = rng.exponential(size=(2, nc))
    r = np.column_stack([normal, (mu * normal * np.where(state == 1, 0.5, 1.0))[:, None] * t])
    r *= (size * (state > 0))[:, None]
    u = np.column_stack([np.where(state == 0, speed, 0.0), np.where(state == 1, 0.0, -speed)[:, None] * t])
    u /= size[:, None]
    problem = FrictionContact(W=W, q=u.ravel() - W @ r.ravel(), mu=mu, dimension=d)
    answer = r.ravel() * (1 + off * rng.standard_normal(r.size))
    return problem, FCPoint(r=answer), contact_error(W, problem.q, mu, answer)


def units(rng: np.random.Generator, count: int) -> Array:
    return 10.0 ** rng.uniform(-3, 3, count)


def connected(rng: np.random.Generator, n: int) -> Array:
    """Draw a pattern of one connected part, with its diagonal."""
    pattern = np.eye(n, dtype=bool)
    while connected_components(pattern, directed=False)[0] > 1:
        pattern |= rng.random((n, n)) < 0.2
    return pattern


def differences(draw: Callable[..., Case], count: int) -> list[float]:
    """Return the relative differences to the product over problems drawn by seeds, the smallest first."""
    found = []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        problem, answer, error = draw(rng, int(rng.integers(2, 31)), 10.0 ** rng.uniform(-8, -1))
        measured = judge(problem, answer, 1e-6).error
        if measured > LEAST:
            found.append(abs(error - measured) / measured)
    assert len(found) > 0.9 * count
    return sorted(found)


@pytest.mark.parametrize("count", [20, pytest.param(200, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("draw", [of_lcp, of_qp, of_contact])
def test_the_definition_gives_the_number_of_the_product(draw: Callable[..., Case], count: int) -> None:
    assert differences(draw, count)[-1] <= AGREED
