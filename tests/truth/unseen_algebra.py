"""LCPs, MLCPs and QPs drawn at random from the applications they come from, degenerate ones among them.

Each function takes a random generator and a size, and returns one problem that has a solution by its construction or
by a theorem that its docstring names.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from cpbench.formulations import LCP, MLCP, QP

Rng = np.random.Generator
Array = np.ndarray


def facets(W: Array, q: Array, mu: Array, directions: int) -> LCP:
    """Return the LCP of Stewart and Trinkle (1996) of contact with `directions` tangents a contact, W of 3 rows each.

    z = (normal, tangential, sliding speeds); the matrix is copositive, a solution exists where q ∈ range of W.
    """
    nc = len(mu)
    angles = 2 * np.pi * np.arange(directions) / directions
    N = np.zeros((3 * nc, nc))
    D = np.zeros((3 * nc, nc * directions))
    E = np.zeros((nc * directions, nc))
    for c in range(nc):
        N[3 * c, c] = 1
        D[3 * c + 1, c * directions : (c + 1) * directions] = np.cos(angles)
        D[3 * c + 2, c * directions : (c + 1) * directions] = np.sin(angles)
        E[c * directions : (c + 1) * directions, c] = 1
    J = np.hstack([N, D])
    top = np.hstack([J.T @ W @ J, np.vstack([np.zeros((nc, nc)), E])])
    bottom = np.hstack([np.diag(mu), -E.T, np.zeros((nc, nc))])
    return LCP(M=np.vstack([top, bottom]), q=np.concatenate([J.T @ q, np.zeros(nc)]))


def bimatrix(rng: Rng, size: int) -> LCP:
    """Costs of two players, small whole numbers half the time, so that ties occur (Lemke & Howson 1964)."""
    m, n = max(1, size // 2), max(1, size - size // 2)
    draw = (lambda s: rng.integers(1, 6, s).astype(float)) if rng.random() < 0.5 else (lambda s: rng.uniform(1, 2, s))
    M = np.zeros((m + n, m + n))
    M[:m, m:], M[m:, :m] = draw((m, n)), draw((n, m))
    return LCP(M=M, q=-np.ones(m + n))


def ties(rng: Rng, size: int) -> LCP:
    """M = GGᵀ + B − Bᵀ of small whole numbers, positive semidefinite; q = w − Mz of few values, so that ratios tie."""
    B = np.triu(rng.integers(-1, 2, (size, size)), 1).astype(float)
    half = rng.integers(-1, 2, (size, max(1, size // 3))).astype(float)
    M = half @ half.T + (B - B.T)
    z = rng.integers(0, 2, size) * rng.integers(0, 2, size)
    w = (1 - z) * rng.integers(0, 2, size)
    return LCP(M=M, q=w - M @ z)


def p_matrix(rng: Rng, size: int) -> LCP:
    """Murty's triangular matrix, on which Lemke's method needs many pivots, mixed and scaled: a P-matrix."""
    M = np.tril(np.full((size, size), 2.0 * rng.uniform(0.2, 1)), -1) + np.eye(size)
    scale = 2.0 ** rng.integers(-6, 7, size)
    return LCP(M=scale[:, None] * M * (2.0 ** rng.integers(-6, 7, size)), q=-scale * rng.uniform(0.5, 1.5, size))


def obstacle(rng: Rng, size: int) -> LCP:
    """A membrane over a random obstacle: −Δ of a square grid, an M-matrix (sparse)."""
    side = max(2, int(np.sqrt(10 * size)))
    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(side, side))
    M = sp.csr_array(sp.kron(line, sp.eye_array(side)) + sp.kron(sp.eye_array(side), line))
    height = rng.normal(0, 1, (side, side)).cumsum(0).cumsum(1).ravel() / side
    return LCP(M=M, q=M @ height + rng.uniform(0, 0.1) * np.ones(side * side))


def ill_conditioned(rng: Rng, size: int) -> LCP:
    """Positive definite with eigenvalues over up to ten decades, or semidefinite with a solution."""
    U, _ = np.linalg.qr(rng.normal(size=(size, size)))
    values = 10.0 ** rng.uniform(-rng.uniform(0, 10), 0, size)
    values[: int(rng.integers(0, 1 + size // 3))] = 0.0
    M = (U * values) @ U.T
    z = np.maximum(rng.normal(size=size), 0)
    w = np.where(z > 0, 0, np.maximum(rng.normal(size=size), 0))
    return LCP(M=(M + M.T) / 2, q=w - M @ z)


def circuit(rng: Rng, size: int) -> MLCP:
    """One implicit Euler step of an RC network with ideal diodes (Acary, Bonnefon & Brogliato 2011).

    Node voltages and diode currents: (C/h + G)x − Nᵀi + s = 0, 0 ≤ i ⟂ −Nx ≥ 0, N the incidence of the diodes; an
    open switch is a resistance of 1e12 Ω, a closed one of 1e-3 Ω.
    """
    nodes, diodes = max(2, size), max(1, size // 2)
    edges = [(k, int(rng.integers(0, k))) for k in range(1, nodes)]
    edges += [tuple(int(i) for i in rng.choice(nodes, 2, replace=False)) for _ in range(nodes // 2)]
    ohms = rng.choice([1e3, 1e-3, 1e12, 50.0], len(edges), p=[0.6, 0.15, 0.1, 0.15])
    A = np.diag(10.0 ** rng.uniform(-9, -6, nodes) / 1e-5) + np.diag(1e-9 * np.ones(nodes))
    for (a, b), r in zip(edges, ohms, strict=True):
        A[a, a] += 1 / r
        A[b, b] += 1 / r
        A[a, b] -= 1 / r
        A[b, a] -= 1 / r
    N = np.zeros((diodes, nodes))
    for row in N:
        a, b = rng.choice(nodes, 2, replace=False)
        row[a], row[b] = 1.0, -1.0
    source = np.zeros(nodes)
    source[rng.integers(0, nodes, max(1, nodes // 4))] = rng.normal(0, 0.01, max(1, nodes // 4))
    return MLCP(A=A, C=N.T, D=-N, B=np.zeros((diodes, diodes)), a=-source, b=np.zeros(diodes))


def trade(rng: Rng, size: int) -> MLCP:
    """Spatial price equilibrium with affine supply and demand (Harker 1984): free prices, nonnegative shipments."""
    regions = max(2, int(np.sqrt(size)))
    arcs = [(i, j) for i in range(regions) for j in range(regions) if i != j]
    flow = np.zeros((regions, len(arcs)))
    for k, (i, j) in enumerate(arcs):
        flow[i, k], flow[j, k] = -1.0, 1.0
    slope = np.diag(rng.uniform(0.5, 5, regions))
    surplus = rng.normal(0, 10, regions)
    cost = np.round(rng.uniform(0.5, 3, len(arcs)), 1)
    zero = np.zeros((len(arcs), len(arcs)))
    return MLCP(A=slope, C=flow, D=-flow.T, B=zero, a=surplus, b=cost)


def mixed(rng: Rng, size: int) -> MLCP:
    """Positive semidefinite with a skew part and a planted solution; degenerate pairs among them."""
    n, m = max(1, size // 3), max(1, size - size // 3)
    G = rng.normal(size=(n + m, max(1, (n + m) // 2)))
    S = np.triu(rng.normal(size=(n + m, n + m)), 1)
    M = G @ G.T / (n + m) + (S - S.T)
    M[:n, :n] += np.eye(n)
    u, v = rng.normal(size=n), np.maximum(rng.normal(size=m), 0)
    w = np.where(v > 0, 0, rng.integers(0, 2, m) * rng.uniform(0, 1, m))
    A, C, D, B = M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:]
    return MLCP(A=A, C=C, D=D, B=B, a=-(A @ u + C @ v), b=w - D @ u - B @ v)


def _qp(Q: Array, p: Array, *, A=None, b=None, C=None, d=None, lb=-np.inf, ub=np.inf) -> QP:
    n = len(p)
    none, empty = np.zeros((0, n)), np.zeros(0)
    return QP(
        Q=Q,
        p=p,
        A=none if A is None else A,
        b=empty if b is None else b,
        C=none if C is None else C,
        d=empty if d is None else d,
        lb=np.full(n, lb),
        ub=np.full(n, ub),
    )


def predictive_control(rng: Rng, size: int) -> QP:
    """Linear model predictive control, states kept as unknowns: sparse, box on the inputs (Wang & Boyd 2010)."""
    states, inputs = int(rng.integers(2, 7)), int(rng.integers(1, 4))
    horizon = max(2, size // (states + inputs))
    F = rng.normal(size=(states, states))
    F *= rng.uniform(0.7, 1.1) / np.abs(np.linalg.eigvals(F)).max()
    B = rng.normal(size=(states, inputs))
    n = horizon * (states + inputs)
    C = sp.lil_array((horizon * states, n))
    d = np.zeros(horizon * states)
    d[:states] = F @ rng.normal(0, 3, states)
    for k in range(horizon):
        at, here = k * (states + inputs), slice(k * states, (k + 1) * states)
        C[here, at : at + inputs] = -B
        C[here, at + inputs : at + inputs + states] = np.eye(states)
        if k:
            C[here, at - states : at] = -F
    weights = np.tile(np.concatenate([np.full(inputs, 10.0 ** rng.uniform(-3, 0)), np.ones(states)]), horizon)
    problem = _qp(sp.csr_array(sp.diags_array(weights)), np.zeros(n), C=sp.csr_array(C), d=d)
    box = np.tile(np.concatenate([np.ones(inputs), np.full(states, np.inf)]), horizon)
    return QP(Q=problem.Q, p=problem.p, A=problem.A, b=problem.b, C=problem.C, d=problem.d, lb=-box, ub=box)


def support_vectors(rng: Rng, size: int) -> QP:
    """The dual of a support vector machine with a Gaussian kernel: dense, box, one equation."""
    features = rng.normal(size=(size, 3))
    label = np.sign(features[:, 0] + rng.normal(0, 0.3, size)) + (features[:, 0] == 0)
    gap = ((features[:, None] - features[None]) ** 2).sum(2)
    Q = np.outer(label, label) * np.exp(-gap / rng.uniform(0.5, 4))
    return _qp(Q, -np.ones(size), C=label[None], d=np.zeros(1), lb=0.0, ub=10.0 ** rng.uniform(-1, 3))


def portfolio(rng: Rng, size: int) -> QP:
    """Markowitz with a factor model, long only, fully invested."""
    F = rng.normal(size=(size, max(1, size // 10))) * 0.1
    Q = F @ F.T + np.diag(rng.uniform(0.001, 0.05, size))
    return _qp(Q, -rng.normal(0.05, 0.1, size) / rng.uniform(0.1, 10), C=np.ones((1, size)), d=np.ones(1), lb=0.0)


def nonnegative_fit(rng: Rng, size: int) -> QP:
    """Nonnegative least squares of a matrix whose columns are nearly dependent."""
    columns = rng.normal(size=(2 * size, size)).cumsum(1) / np.sqrt(size)
    target = columns @ np.maximum(rng.normal(size=size), 0) + rng.normal(0, 0.01, 2 * size)
    return _qp(columns.T @ columns, -columns.T @ target, lb=0.0)


def degenerate_vertex(rng: Rng, size: int) -> QP:
    """More constraints active at the solution than unknowns, with repeated rows; the solution is planted."""
    half = rng.normal(size=(size, max(1, size // 2)))
    Q, z = half @ half.T, rng.normal(size=size)
    A = rng.integers(-2, 3, (2 * size, size)).astype(float)
    A = np.vstack([A, A[: size // 2]])
    active = rng.random(len(A)) < 0.6
    multipliers = np.where(active, rng.integers(0, 2, len(A)) * rng.uniform(0, 1, len(A)), 0)
    slack = np.where(active, 0, rng.uniform(0, 2, len(A)))
    return _qp(Q, A.T @ multipliers - Q @ z, A=A, b=A @ z - slack)
