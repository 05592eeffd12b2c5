"""Claims of QP solvers are the verdict's where idle prices and sides are large, and where there are no prices."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench.formulations import QP, QPPoint
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.qp.claims import ErrorMeasure


def fit(seed: int, sparse: bool = False) -> QP:
    """min ½‖Az − b‖² over z ≥ 0: about half of the unknowns are 0, some with prices far above the others."""
    rng = np.random.default_rng(seed)
    A = np.abs(rng.standard_normal((16, 8)))
    p = A.T @ rng.standard_normal(16)
    p[rng.random(8) < 0.2] += 30.0
    Q = A.T @ A
    return QP.build(sp.csr_array(Q) if sparse else Q, p, lb=np.zeros(8))


def kernel_machine(seed: int) -> QP:
    """The dual of a support vector machine: one equality, whose side is 0."""
    rng = np.random.default_rng(seed)
    points, sign = rng.standard_normal((6, 2)), np.array([1.0, -1.0] * 3)
    squares = ((points[:, None] - points) ** 2).sum(2)
    Q = sign[:, None] * np.exp(-squares) * sign
    return QP.build(Q, -np.ones(6), C=sign[None], d=np.zeros(1), lb=np.zeros(6), ub=np.full(6, 20.0))


@pytest.mark.parametrize("name", ["augmented-lagrangian", "mprgp-qp"])
def test_iterations_end_where_the_verdict_agrees(name: str) -> None:
    """Nearly always. Norms that idle rows enlarge miss by up to four times, up to every other answer here."""
    beyond = []
    for seed in range(20):
        for problem in (fit(seed, sparse=seed % 2 == 0), kernel_machine(seed)):
            if solvers.get(name).obstacle(problem) is not None:
                continue
            for tolerance in (1e-4, 1e-8):
                output = solvers.get(name).run(problem, Budget(tolerance=tolerance))
                if output.claim is Claim.SOLVED:
                    beyond.append(judge(problem, output.point, tolerance).error / tolerance)
    assert len(beyond) >= 30
    assert max(beyond) <= 1.2
    assert sum(share > 1.0 for share in beyond) <= 0.05 * len(beyond)


def gap_over_objective(P: QP, z: Any, y: Any, terms: Any, reach: float) -> float:
    """|Σ z_i f_i + Σ y_j g_j| over max(|f|, ½|zᵀQz|, min(Σ|p_i z_i|, Σ|h_j y_j|)), without idle constants."""
    G, h = np.vstack([P.A, P.C]), np.append(P.b, P.d)
    force, rows = P.Q @ z + P.p - G.T @ y, G @ z - h
    bounded = np.isfinite(P.lb) & (force > 0.0)
    products = force * np.clip(np.where(bounded, z - np.where(bounded, P.lb, 0.0), z), -reach, reach)
    idle = bounded & (terms <= 0.1 * abs(P.p))
    price = np.where(idle, 0.0, P.p * z)
    side = np.where((np.arange(h.size) < P.b.size) & (rows > 0) & (abs(G) @ abs(z) <= 0.1 * abs(h)), 0.0, h * y)
    gap = abs(products[bounded].sum() + y @ rows) + abs(products[~bounded]).sum()
    quadratic = z @ P.Q @ z
    objective = max(abs(quadratic / 2 + price.sum()), abs(quadratic) / 2, min(abs(price).sum(), abs(side).sum()))
    return gap / max(objective, gap)


def test_errors_of_rows_are_those_of_plain_numpy() -> None:
    """With a bound and a side that give z its size, so that prices do not; and Q and G of entries of size 1, D = 1."""
    rng = np.random.default_rng(3)
    for _ in range(40):
        signs = rng.choice([-1.0, 1.0], (5, 5))
        Q, A, C = np.triu(signs) + np.triu(signs, 1).T, rng.choice([-1.0, 1.0], (2, 5)), rng.choice([-1.0, 1.0], (1, 5))
        z, lam, mu, nu = rng.uniform(1, 2, 5), rng.uniform(-0.1, 1, 2), rng.uniform(-1, 1, 1), rng.uniform(-1, 1, 5)
        p, b, d = 10.0 ** rng.uniform(-1, 3) * rng.uniform(-1, 1, 5), rng.uniform(-9, 9, 2), rng.uniform(-9, 9, 1)
        lb, ub = np.where(np.arange(5) < 3, 1.1, -np.inf), np.full(5, np.inf)
        problem = QP.build(Q, p, A, b, C, d, lb, ub)
        z[0] = 1.1
        force = Q @ z + p - A.T @ lam - C.T @ mu
        below = (np.arange(5) < 3) & (force > 0.0)
        terms = abs(Q) @ abs(z) + abs(A).T @ abs(lam) + abs(C).T @ abs(mu)
        share = 1.0 / max(terms.max(), abs(p[~below]).max(initial=0.0), z.max())
        f = share * force
        g, feeds, sides = A @ z - b, np.full(3, z.sum()), abs(np.append(b, d))
        counts = np.append(A @ z <= b, True) | (feeds > 0.1 * sides)
        size = max(feeds.max(), sides[counts].max())
        effect = max(share, 1.0 / size)
        expected = max(
            (abs(force - nu) * share / np.maximum(1.0, abs(f))).max(),
            np.where(np.isfinite(lb), -f, abs(f)).max(),
            ((lb - z) * effect).max(),
            (-g / size).max(),
            (-lam * share).max(),
            abs(C @ z - d).max() / size,
            gap_over_objective(problem, z, np.append(lam, mu), terms, 1.0 / effect),
        )
        found = ErrorMeasure(problem, tolerance=1e9).error((z, lam, mu, nu))
        norms = ErrorMeasure(problem).error((z, lam, mu, nu))
        np.testing.assert_allclose(found, max(norms, expected), rtol=1e-12)


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("size", [2e-1, 2e-3, 2e-5])
@pytest.mark.parametrize("name", ["auto-qp", "proximal-active-set", "interior-point-qp", "augmented-lagrangian"])
def test_without_prices_the_size_is_that_of_terms_that_cancel(name: str, size: float, sparse: bool) -> None:
    """Where sides hold z away from 0, Qz = 0 has the size of its terms, not that of 1.

    The least objective is 0: methods that only approach it have no share of it right, and do not claim it.
    """
    Q, A = size * np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([[0.0, 0.4], [9.0, 0.0]])
    if sparse:
        Q, A = sp.csr_array(Q), sp.csr_array(A)
    problem = QP.build(Q, np.zeros(2), A, np.array([0.0, 1.0]))
    for tolerance in (1e-4, 1e-6, 1e-8):
        output = solvers.get(name).run(problem, Budget(tolerance=tolerance))
        assert isinstance(output.point, QPPoint)
        solved = judge(problem, output.point, tolerance).solved
        assert solved == (output.claim is Claim.SOLVED)
        assert solved or name == "interior-point-qp"
