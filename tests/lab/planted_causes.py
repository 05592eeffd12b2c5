"""Failures whose cause is planted.

A plant is a pair of problems, or of trials, that differ in one thing: its cause. It counts only where the solver fails
with the cause and solves the twin without it; which pairs do is measured here, before anything is explained. A decoy is
a property that a plant has beside its cause, which has to be suspected and not confirmed. The generators are written
from the definitions of the causes and share no code with their detectors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import cpbench as cp
from cpbench.formulations.conic import ConeQP
from cpbench.foundation.cones import Cone, ProductCone
from cpbench_lab.diagnosis.attempts import SolverTrial, attempt
from cpbench_lab.diagnosis.diagnosis import Diagnosis, complaint_of
from cpbench_problems.generators.symbols import mapped, unknowns

Random = np.random.Generator


@dataclass(frozen=True)
class Plant:
    """A trial with a cause, and its twin without. `decoy` : another property of both. `complaint` : what is wrong."""

    kind: str
    bad: SolverTrial
    twin: SolverTrial
    decoy: str = ""
    complaint: str = "error"


def definite(rng: Random, n: int, condition: float = 10.0, skew: float = 0.0) -> Any:
    """Return a positive definite matrix of a condition number, with a skew part where asked."""
    basis = np.linalg.qr(rng.standard_normal((n, n)))[0]
    K = rng.standard_normal((n, n))
    return basis @ np.diag(np.geomspace(1.0, condition, n)) @ basis.T + skew * (K - K.T)


def planted_lcp(rng: Random, M: Any, *, degenerate: int = 0) -> cp.LCP:
    """Return an LCP with a solution, in which so many pairs are both zero."""
    n = len(M)
    z = np.where(rng.random(n) < 0.5, rng.uniform(0.5, 2.0, n), 0.0)
    w = np.where(z == 0.0, rng.uniform(0.5, 2.0, n), 0.0)
    z[:degenerate] = w[:degenerate] = 0.0
    return cp.LCP(M=M, q=w - M @ z)


def each(
    kind: str, bad: cp.LCP | Any, twin: Any, solvers: list[str], *, decoy: str = "", **both: Any
) -> Iterator[Plant]:
    """Yield a plant a solver."""
    for solver in solvers:
        trial = SolverTrial(problem=bad, solver=solver, seconds=5.0, **both)
        yield Plant(kind, trial, replace(trial, problem=twin), decoy)


def infeasible(rng: Random) -> Iterator[Plant]:
    """A nonnegative combination of the rows of the LCP is negative; two rows of the program contradict each other."""
    n = int(rng.integers(4, 12))
    M = definite(rng, n, skew=0.3)
    y = np.zeros(n)
    y[:2] = rng.uniform(0.5, 2.0, 2)
    twin = planted_lcp(rng, M)
    N = M.copy()
    N[0] = -(y[1] * N[1] + rng.uniform(0.0, 1.0, n)) / y[0]
    q = twin.q.copy()
    q[0] = -(y[1] * q[1] + 1.0) / y[0]
    yield from each("infeasible", cp.LCP(M=N, q=q), twin, ["newton-min", "pgs", "lemke", "interior-point-lcp"])
    A = rng.standard_normal((3, n))
    A[1] = -2.0 * A[0]
    Q, p = definite(rng, n), rng.standard_normal(n)
    good = cp.QP.build(Q, p, A=A, b=np.array([1.0, -4.0, 0.0]))
    bad = cp.QP.build(Q, p, A=A, b=np.array([1.0, -1.0, 0.0]))
    yield from each("infeasible", bad, good, ["osqp", "interior-point-qp", "piqp"])


def unbounded(rng: Random) -> Iterator[Plant]:
    """The objective falls for ever along a direction without curvature."""
    n = int(rng.integers(4, 12))
    d = rng.integers(1, 3, n).astype(float)
    B = rng.integers(-2, 3, (n, n)).astype(float)
    B -= np.outer(B @ d, d) / (d @ d)
    B = np.rint(B * (d @ d))
    Q = B.T @ B
    p = -d
    A = np.vstack([d, np.abs(rng.integers(1, 3, (1, n)))])
    good = cp.QP.build(Q + np.eye(n), p, A=A, b=np.zeros(2))
    yield from each("unbounded", cp.QP.build(Q, p, A=A, b=np.zeros(2)), good, ["osqp", "clarabel", "interior-point-qp"])


def rounding(rng: Random) -> Iterator[Plant]:
    """A tolerance that no sum of doubles meets."""
    n = int(rng.integers(20, 40))
    lcp = planted_lcp(rng, definite(rng, n))
    for solver in ("lemke", "newton-min", "pgs", "interior-point-lcp"):
        bad = SolverTrial(problem=lcp, solver=solver, tolerance=float(10.0 ** -rng.uniform(17, 19)))
        yield Plant("rounding", bad, replace(bad, tolerance=1e-8))


def iterations(rng: Random) -> Iterator[Plant]:
    """A limit that is too small."""
    n = int(rng.integers(10, 30))
    lcp = planted_lcp(rng, definite(rng, n, 50.0))
    limit = int(rng.integers(2, 6))
    for solver in ("pgs", "psor", "mprgp", "interior-point-lcp"):
        trial = SolverTrial(problem=lcp, solver=f"{solver}[max_iterations={limit}]")
        yield Plant("iterations", trial, replace(trial, solver=solver))
    fc = contacts(rng, 4)
    for solver in ("nsgs", "admm-fc"):
        trial = SolverTrial(problem=fc, solver=f"{solver}[max_iterations={limit}]", tolerance=1e-8)
        yield Plant("iterations", trial, replace(trial, solver=solver))


def contacts(rng: Random, nc: int, *, mu: float = 0.5, condition: float = 10.0, shared: int = 0) -> Any:
    """Return contacts in space whose reactions push back; the last `shared` ones repeat the first."""
    rank = 3 * nc
    G = (
        rng.standard_normal((rank, 3 * (nc - shared) or 3))
        if shared
        else np.linalg.qr(rng.standard_normal((rank, rank)))[0]
    )
    W = G @ G.T if shared else G @ np.diag(np.geomspace(1.0, condition, rank)) @ G.T
    r = np.zeros((nc, 3))
    r[:, 0] = rng.uniform(0.5, 2.0, nc)
    return cp.FrictionContact(
        W=W, q=-W @ r.ravel() + 0.1 * rng.standard_normal(rank) * (not shared), mu=np.full(nc, mu), dimension=3
    )


def cycling(rng: Random) -> Iterator[Plant]:
    """Sweeps whose matrix of iteration turns by π: M = [[1, a], [−1/a, 1]], as LCP, relay and MLCP."""
    a, pairs = float(rng.uniform(0.6, 1.6)), int(rng.integers(1, 4))
    n = 2 * pairs
    z = rng.uniform(5.0, 9.0, n)
    K, L = (np.kron(np.eye(pairs), np.array([[1.0, a], [-share / a, 1.0]])) for share in (1.0, 0.25))
    solvers = ["pgs", "psor[omega=1.0]"]
    yield from each("cycling", cp.LCP(M=K, q=-K @ z), cp.LCP(M=L, q=-L @ z), solvers)
    box = {"lb": np.full(n, -1e3), "ub": np.full(n, 1e3)}
    yield from each("cycling", cp.Relay(M=K, q=-K @ z, **box), cp.Relay(M=L, q=-L @ z, **box), ["pgs-relay"])
    B, none = definite(rng, 2), np.zeros((n, 2))
    rest = {"B": B, "C": none, "D": none.T, "b": -np.ones(2)}
    yield from each("cycling", cp.MLCP(A=K, a=-K @ z, **rest), cp.MLCP(A=L, a=-L @ z, **rest), ["pgs-mlcp"])


def diverging(rng: Random) -> Iterator[Plant]:
    """Sweeps whose matrix of iteration has a radius above 1, of a positive definite matrix, on free unknowns."""
    a, radius, pairs = float(rng.uniform(1.2, 1.8)), float(rng.uniform(1.3, 3.0)), int(rng.integers(1, 4))
    n = 2 * pairs
    z = rng.uniform(5.0, 9.0, n)
    K, L = (np.kron(np.eye(pairs), np.array([[1.0, a], [-r / a, 1.0]])) for r in (radius, 0.3))
    B, none = definite(rng, 2), np.zeros((n, 2))
    rest = {"B": B, "C": none, "D": none.T, "b": -np.ones(2)}
    solvers = ["pgs-mlcp"]
    yield from each("diverging", cp.MLCP(A=K, a=-K @ z, **rest), cp.MLCP(A=L, a=-L @ z, **rest), solvers)


def scale(rng: Random) -> Iterator[Plant]:
    """Units that lie many decades apart."""
    n = int(rng.integers(8, 20))
    lcp = planted_lcp(rng, definite(rng, n))
    s = np.exp(rng.uniform(-1, 1, n) * np.log(10.0) * 5)
    bad = cp.LCP(M=s[:, None] * lcp.M * s[None, :], q=s * lcp.q)
    yield from each("scale", bad, lcp, SCALED_LCP)
    Q, A = definite(rng, n), rng.standard_normal((4, n))
    z = rng.standard_normal(n)
    p, b = rng.standard_normal(n), A @ z - 0.1
    good = cp.QP.build(Q, p, A=A, b=b)
    worse = cp.QP.build(s[:, None] * Q * s[None, :], s * p, A=A * s[None, :], b=b)
    yield from each("scale", worse, good, SCALED_QP)


SCALED_LCP = [
    "projection-vi", "extragradient-vi", "newton-fb-micp",
    "casadi-ipopt", "drake-moby",
]  # fmt: skip
SCALED_QP = ["osqp", "scs-coneqp", "daqp", "highs"]


def magnitude(rng: Random) -> Iterator[Plant]:
    """Objective and unknowns far from one, all of them by the same factors, as of nanometres or of pascals."""
    n = int(rng.integers(6, 14))
    far = float(10.0 ** rng.uniform(7.0, 11.0))
    Q, z = definite(rng, n), np.where(rng.random(n) < 0.5, rng.uniform(0.5, 2.0, n), 0.0)
    p = np.where(z == 0.0, rng.uniform(0.5, 2.0, n), 0.0) - Q @ z
    good = cp.QP.build(Q, p, lb=np.zeros(n))
    small = cp.QP.build(Q / far**3, p / far**2, lb=np.zeros(n))
    yield from each("magnitude", small, good, ["clarabel", "osqp", "piqp", "highs", "scs", "daqp", "proxqp"])
    lcp = planted_lcp(rng, definite(rng, n))
    large = cp.LCP(M=lcp.M / far**2, q=lcp.q / far)
    yield from each("magnitude", large, lcp, ["drake-moby", "casadi-ipopt"])


def large_nonmonotone(rng: Random) -> Iterator[Plant]:
    """Negative eigenvalues, which harm; and a magnitude, which does not."""
    for plant in nonmonotone(rng):
        ours = plant.bad.solver in ("pgs", "mprgp")
        if ours and not attempt(plant.bad).solved:  # it fails at size one as well
            far = float(10.0 ** rng.uniform(5.0, 7.0))
            bad, twin = (
                replace(one, problem=cp.LCP(M=one.problem.M, q=far * one.problem.q))  # pyright: ignore[reportAttributeAccessIssue]
                for one in (plant.bad, plant.twin)
            )
            yield Plant("nonmonotone", bad, twin, decoy="magnitude")


def tower(weights: Any, feet: int, mu: float, push: float) -> cp.GlobalFrictionContact:
    """Return bodies in the plane (x, y, angle; height 1, radius of gyration 0.4), each on the one below, on so many
    feet between −0.5 and 0.5; they fall, and the top one is pushed aside."""
    n, x = len(weights), np.linspace(-0.5, 0.5, feet) if feet > 1 else np.zeros(1)
    H = np.zeros((3 * n, 2 * n * feet))
    for k in range(n):
        for j, arm in enumerate(x):
            c = 2 * (k * feet + j)
            H[3 * k : 3 * k + 3, c : c + 2] = [[0, 1], [1, 0], [arm, 0.5]]
            if k:
                H[3 * k - 3 : 3 * k, c : c + 2] = -np.array([[0, 1], [1, 0], [arm, -0.5]])
    inertia = np.repeat(np.asarray(weights, dtype=float), 3) * np.tile([1.0, 1.0, 0.16], n)
    free = np.zeros(3 * n)
    free[1::3], free[-3] = -0.05, push
    nc = n * feet
    return cp.GlobalFrictionContact(
        M=np.diag(inertia), H=H, f=inertia * free, w=np.zeros(2 * nc), mu=np.full(nc, mu), dimension=2
    )


def local(scene: cp.GlobalFrictionContact) -> cp.FrictionContact:
    """Return W = HᵀM⁻¹H and q, by the definition."""
    M, H = np.asarray(scene.M), np.asarray(scene.H)
    R = H / np.diag(M)[:, None]
    return cp.FrictionContact(W=H.T @ R, q=R.T @ scene.f, mu=scene.mu, dimension=2)


def masses(rng: Random) -> Iterator[Plant]:
    """The top body of a tower weighs far more than the others."""
    n, heavy = int(rng.integers(3, 6)), float(10.0 ** rng.uniform(6.5, 8.0))
    weights = rng.uniform(0.8, 1.2, n)
    uneven = weights.copy()
    uneven[-1] *= heavy
    bad, twin = (tower(w, 1, 0.5, 0.01) for w in (uneven, weights))
    solvers = ["nsgs", "siconos-fc2d-nsgs", "pinocchio-pgs"]
    yield from each("masses far apart", local(bad), local(twin), solvers, tolerance=1e-6)
    yield from each("masses far apart", bad, twin, solvers, tolerance=1e-6)


def heavy_hyperstatic(rng: Random) -> Iterator[Plant]:
    """More reactions than the bodies determine, which harms; and a heavy top, which does not."""
    n = int(rng.integers(2, 4))
    weights = rng.uniform(0.8, 1.2, n)
    weights[-1] *= float(10.0 ** rng.uniform(4.0, 5.0))
    bad = local(tower(weights, 4, 0.0, 0.0))
    twin = replace(bad, W=np.asarray(bad.W) + np.eye(bad.q.size))
    solvers = ["quadprog", "dual-active-set"]
    yield from each("hyperstatic", bad, twin, solvers, decoy="masses far apart", tolerance=1e-8)


def hyperstatic(rng: Random) -> Iterator[Plant]:
    """More reactions than the bodies have freedoms."""
    nc = int(rng.integers(4, 8))
    bad = contacts(rng, nc, shared=nc - 2, mu=0.0)
    twin = replace(bad, W=bad.W + 0.5 * np.eye(3 * nc))
    yield from each("hyperstatic", bad, twin, ["quadprog", "dual-active-set"], tolerance=1e-8)


def free_blocks(rng: Random) -> tuple[Callable[[float], cp.MLCP], np.ndarray, np.ndarray]:
    """Return a planted MLCP by the least eigenvalue of its free block, the block's eigenvectors and its unknowns."""
    n, m = int(rng.integers(4, 8)), int(rng.integers(3, 6))
    C = rng.standard_normal((n, m))
    u, v = rng.standard_normal(n), np.where(rng.random(m) < 0.5, 1.0, 0.0)
    basis = np.linalg.qr(rng.standard_normal((n, n)))[0]
    B, w = definite(rng, m), np.where(v == 0.0, 1.0, 0.0)

    def mlcp(least: float) -> cp.MLCP:
        A = basis @ np.diag([*np.linspace(1.0, 3.0, n - 1), least]) @ basis.T
        return cp.MLCP(A=A, B=B, C=C, D=-C.T, a=-A @ u - C @ v, b=w + C.T @ u - B @ v)

    return mlcp, basis, u


def singular(rng: Random) -> Iterator[Plant]:
    """A block without full rank."""
    mlcp, basis, u = free_blocks(rng)
    yield from each(
        "singular", mlcp(0.0), mlcp(1.0), ["lemke", "newton-min", "pgs", "interior-point-lcp"], via=("mlcp-lcp-schur",)
    )
    n = u.size
    R = rng.standard_normal((3, n))
    z = rng.standard_normal(n)

    def qp(least: float) -> cp.QP:
        Q = basis @ np.diag([*np.linspace(1.0, 3.0, n - 1), least]) @ basis.T
        return cp.QP.build(Q, -Q @ z, A=R, b=R @ z - 1.0)

    yield from each("singular", qp(0.0), qp(1.0), ["quadprog", "dual-active-set"])
    mixed = basis @ np.diag([*np.linspace(1.0, 3.0, n - 1), 0.0]) @ basis.T

    def equation(least: float) -> cp.Equation:
        x = unknowns(n)
        A = mixed + least * np.outer(basis[:, -1], basis[:, -1])
        return cp.Equation(
            F=mapped(
                x,
                [
                    sum((float(A[i, j]) * x[j] for j in range(n)), 0.0)
                    + x[i] * x[i] * 0.0
                    - float(A[i] @ u)
                    - (least == 0.0) * 0.1
                    for i in range(n)
                ],
            )
        )

    yield from each("singular", equation(0.0), equation(1.0), ["newton-equation", "scipy-root-lm"])


def nonmonotone(rng: Random) -> Iterator[Plant]:
    """A matrix with a negative eigenvalue, and a solution."""
    n = int(rng.integers(6, 12))
    basis = np.linalg.qr(rng.standard_normal((n, n)))[0]
    values = np.linspace(1.0, 3.0, n)
    bad_values = values.copy()
    bad_values[: n // 2] *= -1.0
    state = rng.integers(2**31)
    bad = planted_lcp(np.random.default_rng(state), basis @ np.diag(bad_values) @ basis.T)
    twin = planted_lcp(np.random.default_rng(state), basis @ np.diag(values) @ basis.T)
    yield from each("nonmonotone", bad, twin, NONMONOTONE)


NONMONOTONE = [
    "interior-point-lcp", "pgs", "mprgp", "casadi-ipopt", "projection-vi",
]  # fmt: skip


def degenerate(rng: Random) -> Iterator[Plant]:
    """Pairs that are both zero at the solution, which is all that a singular active set needs."""
    n = int(rng.integers(8, 16))
    B = rng.standard_normal((n, n // 2))
    state = rng.integers(2**31)
    M = B @ B.T
    bad = planted_lcp(np.random.default_rng(state), M, degenerate=n // 2)
    twin = planted_lcp(np.random.default_rng(state), M)
    yield from each("degenerate", bad, twin, DEGENERATE, tolerance=1e-10)
    M = definite(rng, n)
    bad = planted_lcp(np.random.default_rng(state), M, degenerate=n // 2)
    twin = planted_lcp(np.random.default_rng(state), M)
    yield from each("degenerate", bad, twin, DEGENERATE, tolerance=1e-10)


DEGENERATE = [
    "interior-point-lcp",
    "newton-fb",
    "newton-min",
    "casadi-ipopt",
    "newton-fb-micp",
    "clarabel",
    "osqp",
    "pgs",
    "bpp",
    "cvxopt",
]


def no_interior(rng: Random) -> Iterator[Plant]:
    """s = (x, x, y) in the second-order cone leaves y = 0 and no room, and the dual has no solution that is attained;
    with (x + 1, x, y) there is room."""
    k = int(rng.integers(1, 6))
    n = 2 * k
    Q, p = definite(rng, n), rng.standard_normal(n)
    A = np.zeros((3 * k, n))
    i = np.arange(k)
    A[3 * i, 2 * i] = A[3 * i + 1, 2 * i] = A[3 * i + 2, 2 * i + 1] = 1.0
    K = ProductCone.of((Cone.SECOND_ORDER, k, 3, 1.0))
    room = np.tile([1.0, 0.0, 0.0], k)
    bad, twin = (ConeQP.over(Q, p, K, A, b) for b in (0.0 * room, room))
    solvers = ["interior-point-coneqp", "scs-coneqp", "clarabel-coneqp"]
    yield from each("no interior", bad, twin, solvers, tolerance=1e-8)


def lost(rng: Random) -> Iterator[Plant]:
    """A free block that is nearly singular is eliminated."""
    mlcp, _, _ = free_blocks(rng)
    least = float(10.0 ** -rng.uniform(9.0, 11.0))
    solvers = ["lemke", "newton-min", "interior-point-lcp", "bpp"]
    yield from each("lost", mlcp(least), mlcp(1.0), solvers, via=("mlcp-lcp-schur",))


def out_of_time(rng: Random) -> Iterator[Plant]:
    """A limit of time that is too small."""
    n = int(rng.integers(150, 250))
    lcp = planted_lcp(rng, definite(rng, n, 1e3))
    for solver in ("projection-vi", "newton-avi", "interior-point-lcp"):
        trial = SolverTrial(problem=lcp, solver=solver, seconds=0.002)
        yield Plant("time", trial, replace(trial, seconds=10.0))


def start(rng: Random) -> Iterator[Plant]:
    """A map that has no value where the solver begins: z·log z + …"""
    n = int(rng.integers(2, 6))

    def problem(shift: float) -> cp.NCP:
        z = unknowns(n)
        return cp.NCP(F=mapped(z, [(z[i] + shift).log() + 0.1 * z[i - 1] * z[i] for i in range(n)]))

    yield from each("start", problem(0.0), problem(0.5), START)


START = ["projection-vi", "extragradient-vi"]


def cone(rng: Random) -> Iterator[Plant]:
    """A law that is not the one that was asked: the convex relaxation where contacts slide, facets where they do."""
    nc = int(rng.integers(2, 5))
    W = definite(rng, 3 * nc)
    q = rng.standard_normal((nc, 3))
    q[:, 0], q[:, 1:] = -1.0, 3.0 * q[:, 1:] / np.linalg.norm(q[:, 1:], axis=1)[:, None]
    bad = cp.FrictionContact(W=W, q=q.ravel(), mu=np.full(nc, 0.7), dimension=3)
    still = q.copy()
    still[:, 1:] *= 0.01
    twin = replace(bad, W=np.eye(3 * nc), q=still.ravel())
    yield from each("wrong cone", bad, twin, ["clarabel-relaxation"])
    yield from each("wrong cone", bad, twin, ["lemke"], via=("inner",))


def claims(rng: Random) -> Iterator[Plant]:
    """A limit of iterations that a right answer needs no more of, but the solver's own test."""
    n = int(rng.integers(10, 30))
    lcp = planted_lcp(rng, definite(rng, n, 50.0))
    for solver in ("pgs", "psor", "mprgp", "interior-point-lcp"):
        for limit in range(2, 300):
            trial = SolverTrial(problem=lcp, solver=f"{solver}[max_iterations={limit}]")
            if attempt(trial).solved:
                yield Plant("iterations", trial, replace(trial, solver=solver), complaint="claim")
                break


GENERATORS: tuple[Callable[[Random], Iterator[Plant]], ...] = (
    infeasible, unbounded, rounding, iterations, out_of_time, cycling, diverging, scale, hyperstatic, singular,
    nonmonotone, degenerate, no_interior, start, cone, lost, magnitude, large_nonmonotone, masses, heavy_hyperstatic,
    claims,
)  # fmt: skip


def failing(plant: Plant) -> bool:
    """Whether the solver fails with the cause, and not without."""
    found = complaint_of(attempt(plant.bad), math.inf)
    if found is None or found.kind != plant.complaint:
        return False
    twin = attempt(plant.twin)
    return twin.solved if plant.complaint == "error" else complaint_of(twin, math.inf) is None


def named(plant: Plant, found: Diagnosis) -> bool:
    """Whether the planted cause is the one that was found, and the decoy is suspected."""
    suspected = [one.cause.kind for one in found.suspected]
    first = found.cause.kind if found.cause is not None else (suspected or [""])[0]
    return first == plant.kind and (not plant.decoy or plant.decoy in suspected)


def planted(make: Callable[[Random], Iterator[Plant]], each: int, seed: int, draws: int = 40) -> Iterator[Plant]:
    """Yield so many plants of one kind that fail for their cause, from one draw after the other."""
    count = 0
    for draw in range(draws):
        for plant in make(np.random.default_rng([seed, draw])):
            if failing(plant):
                yield plant
                count += 1
                if count == each:
                    return
