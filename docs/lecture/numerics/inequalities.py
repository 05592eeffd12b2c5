"""Variational inequalities, normal cones and cones in numbers: (18), (22)-(26), (28)-(30)."""

from __future__ import annotations

import numpy as np

from cpbench import AVI
from cpbench.foundation.cones import project_box
from cpbench.foundation.matrices import Dense, Vector, dense
from lecture.numerics.examples.nonlinear import NonlinearExample


def least_product(M: Dense, q: Vector, z: Vector, points: Dense) -> float:
    """min over the rows y of `points` of F(z)ᵀ(y − z), F(z) = Mz + q: not negative at a solution of (22).

    >>> least_product(np.eye(1), np.array([1.0]), np.zeros(1), np.array([[0.0], [2.0]]))
    0.0
    """
    return float(((points - z) @ (M @ z + q)).min())


def polygon(avi: AVI) -> Dense:
    """Vertices of X = {z : Az ≥ b} in the plane, counterclockwise; shape (k, 2)."""
    A, b = dense(avi.A), avi.b
    found: list[Vector] = []
    for i in range(len(b)):
        for j in range(i):
            pair = A[[i, j]]
            if abs(np.linalg.det(pair)) > 1e-12:
                vertex = np.linalg.solve(pair, b[[i, j]])
                if (A @ vertex - b > -1e-9).all():
                    found.append(vertex)
    vertices = np.array(found)
    around = vertices - vertices.mean(axis=0)
    return vertices[np.argsort(np.arctan2(around[:, 1], around[:, 0]))]


def normal_map(avi: AVI, y: Vector) -> Vector:
    """F(P_K y) + y − P_K y of an affine inequality over a box, equation (26).

    >>> normal_map(AVI(M=np.eye(1), q=np.ones(1), lb=np.zeros(1), ub=np.ones(1)), np.array([-1.0])).tolist()
    [0.0]
    """
    x = project_box(y, avi.lb, avi.ub)
    return avi.M @ x + avi.q + y - x


def interval(slope: float, offset: float) -> AVI:
    """slope·z + offset over [0, 1], the smallest box there is."""
    return AVI(M=np.array([[slope]]), q=np.array([offset]), lb=np.zeros(1), ub=np.ones(1))


def distance_to_normal_cone(example: NonlinearExample, x: Vector) -> float:
    """‖x − P_K(x − F(x))‖, K = ℝ^free × ℝ₊: 0 exactly where 0 ∈ F(x) + N_K(x), equations (28) and (29)."""
    lower = np.concatenate([np.full(example.free, -np.inf), np.zeros(x.size - example.free)])
    return float(np.linalg.norm(x - project_box(x - example.value(x), lower, np.full(x.size, np.inf))))


def cone_products(mu: float, dual_mu: float, count: int = 720) -> float:
    """The least vᵀd over `count` unit edges v of the cone of μ and d of the cone of `dual_mu`, in the plane: (18).

    >>> abs(cone_products(0.5, 2.0)) < 1e-15
    True
    """
    v = np.array([[1.0, mu], [1.0, -mu]]) / np.hypot(1.0, mu)
    share = np.linspace(-1.0, 1.0, count)
    d = np.column_stack([np.ones(count), share * dual_mu])
    return float((v @ (d / np.linalg.norm(d, axis=1)[:, None]).T).min())
