"""The plane of an LCP with n = 2: its four complementary cones, its solutions, and the path of Lemke's method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench import LCP
from cpbench.errors import ProblemError
from cpbench.foundation.matrices import Dense, Vector, dense, max_abs, norm
from cpbench.solvers.base import Budget, Claim, solvers


@dataclass(frozen=True, eq=False)
class ComplementaryCone:
    """pos(g₁, g₂), g_i = −M_i where z_i may be positive, else e_i (Cottle, Pang and Stone 1992, section 1.3).

    Attributes
    ----------
    active : the indices whose z may be positive, from 0.
    generators : (2, 2), columns g_i. degenerate : they are parallel.
    z : the solution when q is in this cone, else None.
    """

    active: tuple[int, ...]
    generators: Dense
    degenerate: bool
    z: Vector | None


@dataclass(frozen=True, eq=False)
class LemkePath:
    """Path of Lemke's method, a point after every pivot: w − Mz = q + z₀e, the complementary pairs but one
    complementary.

    Attributes
    ----------
    z : (k, 2). cover : (k,) z₀, 0 at the end when it found a solution. ray : it ended in a ray instead.
    """

    z: Dense
    cover: Vector
    ray: bool


def complementary_cones(problem: LCP, tolerance: float = 1e-9) -> list[ComplementaryCone]:
    """Return the cones of z = 0, z₁, z₂ and both; q lies in one when its distance is at most tolerance·‖q‖."""
    from scipy.optimize import nnls  # 80 ms that other figures need not wait for

    M, q = dense(problem.M), problem.q
    result: list[ComplementaryCone] = []
    for active in ((), (0,), (1,), (0, 1)):
        G = np.eye(2)
        G[:, list(active)] = -M[:, list(active)]
        size = np.linalg.norm(G, axis=0)
        degenerate = abs(float(np.linalg.det(G))) <= 1e-12 * float(size[0] * size[1])
        share, distance = nnls(G, q)
        z = np.where(np.isin([0, 1], active), share, 0.0) if distance <= tolerance * norm(q) else None
        result.append(ComplementaryCone(active, G, degenerate, z))
    return result


def solutions(cones: list[ComplementaryCone]) -> list[Vector]:
    """Return the different z of the cones that hold q (a q on a common face has one z in both).

    A degenerate cone gives one of its solutions.
    """
    different: list[Vector] = []
    for z in (cone.z for cone in cones if cone.z is not None):
        if all(norm(z - other) > 1e-9 * max(max_abs(z), max_abs(other)) for other in different):
            different.append(z)
    return different


def is_p_matrix(problem: LCP) -> bool:
    """Return whether all principal minors are positive: the cones then fill the plane without overlapping (n = 2)."""
    M = dense(problem.M)
    return bool(M[0, 0] > 0 and M[1, 1] > 0 and np.linalg.det(M) > 0)


def lemke_path(problem: LCP) -> LemkePath:
    """Return the pivots of cpbench's `lemke`, run with 1, 2, ... pivots allowed.

    The solver gives z; z₀ is the least that makes q + Mz + z₀e nonnegative, which it is at every pivot. Empty when
    q ≥ 0. Raises ProblemError when the solver breaks down.
    """
    M, q = dense(problem.M), problem.q
    lemke, z, cover = solvers.get("lemke"), list[Vector](), list[float]()
    while q.min() < 0:
        pivots = len(z) + 1
        done = lemke.run(problem, Budget(iterations=pivots))
        if done.counters["pivots"] < pivots:
            if "ray" not in done.message:
                raise ProblemError("lcp.M", f"lemke: {done.message or done.claim}; scale M and q to comparable sizes")
            return LemkePath(np.array(z).reshape(-1, 2), np.array(cover), ray=True)
        assert done.point is not None, "a pivot limit comes with the point it was reached at"
        solved = done.claim is Claim.SOLVED
        z.append(np.asarray(done.point.z))
        cover.append(0.0 if solved else max(0.0, float(-(M @ z[-1] + q).min())))
        if solved:
            break
    return LemkePath(np.array(z).reshape(-1, 2), np.array(cover), ray=False)
