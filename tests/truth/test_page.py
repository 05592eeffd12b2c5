"""The definition of the verdict, taken from its page, against the numbers of the package.

The functions are those that `docs/methods/verdict.md` shows; they share nothing with `cpbench.verification`, and are
right for one connected part with a constant that counts.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cpbench.formulations import LCP, QP, FrictionContact
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.linear import LCPPoint
from cpbench.formulations.programs import QPPoint
from cpbench.verification import judge

Array = NDArray[Any]
Case = tuple[Any, Any, float]
"""A problem, an answer, and its error by the functions of the page."""
AGREED = 1e-3
"""Largest relative difference: the equilibration of the package ends where means of rows are off by 1e-4."""
LEAST = 1e-12
"""Errors from here on are compared; those below are rounding."""
PAGE = Path(__file__).resolve().parents[2] / "docs" / "methods" / "verdict.md"


def shown() -> dict[str, Callable[..., Any]]:
    """Return the functions that the page defines."""
    space: dict[str, Any] = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL):
        if "def " in block:
            exec(compile(block, str(PAGE), "exec"), space)
    return space


SHOWN = shown()


def of_lcp(rng: np.random.Generator, n: int, off: float) -> Case:
    """Draw an LCP with a planted solution in random units, and an answer that is off by about `off`."""
    rows, columns = units(rng, n), units(rng, n)
    M = rows[:, None] * (connected(rng, n) * rng.standard_normal((n, n))) * columns
    active = rng.permutation(n) < rng.integers(1, n + 1)
    z = rng.exponential(size=n) / columns * active
    w = rng.exponential(size=n) * rows * ~active
    answer = z * (1 + off * rng.standard_normal(n)) + off * rng.standard_normal(n) / columns * (rng.random(n) < 0.3)
    problem = LCP(M=M, q=w - M @ z)
    z_all, inf = np.ones(n, dtype=bool), np.full(n, np.inf)
    error = SHOWN["linear_error"](M, problem.q, answer, np.zeros(n), inf, z_all, program=False)
    return problem, LCPPoint(z=answer), error


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
    G = np.vstack([A, C])
    K = np.block([[(Q + Q.T) / 2, -G.T], [G, np.zeros((m + k, m + k))]])
    low = np.concatenate([lb, np.zeros(m), np.full(k, -np.inf)])
    high, of_z = np.concatenate([ub, np.full(m + k, np.inf)]), np.arange(n + m + k) < n
    constants, x = np.concatenate([problem.p, -b, -problem.d]), np.concatenate([z, lam, mu])
    return problem, answer, SHOWN["linear_error"](K, constants, x, low, high, of_z, nu=nu)


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
    return problem, FCPoint(r=answer), SHOWN["contact_error"](W, problem.q, mu, answer)


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
