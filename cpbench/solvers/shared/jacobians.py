"""Generalized Jacobians of the projections on cones and boxes, for Newton methods on natural maps.

Every factor has a normal component N and up to two groups of others, T and M, with bounds μ and μ_r times r_N (a
second-order cone has no M). Where the groups a, b ∈ {0, 1} are clipped, r_N = gᵀx/D with g = (1, aμ t̂, bμ_r m̂) and
D = 1 + aμ² + bμ_r², and r_T = μ r_N t̂ for a clipped group, x_T for another. So the Jacobian is

    J = ggᵀ/D + diag(0, (1−a)I + a (μ r_N/‖x_T‖)(I − t̂t̂ᵀ), the same of M),

0 where x is in the polar cone. It is symmetric, 0 ⪯ J ⪯ I, and exact wherever the projection is differentiable; at a
kink it is the limit from one side, an element of Bouligand's subdifferential. That of a dual cone is I − J(−x), Moreau.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.cones import Cone, ProductCone, project_rolling_cone
from cpbench.foundation.matrices import Dense, Sparse, Vector


def projection_jacobian(K: ProductCone, x: Vector) -> Sparse:
    """Return an element of ∂P_K(x), block diagonal, shape (rows, rows), without its zeros."""
    row, column, value = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]
    for kind, rows, mu, mu_r in K.groups:
        blocks = _factor(kind, x[rows], mu, mu_r)
        row.append(np.repeat(rows, rows.shape[1], axis=1).ravel())
        column.append(np.tile(rows, (1, rows.shape[1])).ravel())
        value.append(blocks.ravel())
    values = np.concatenate(value)
    kept = values != 0.0
    indices = (np.concatenate(row)[kept], np.concatenate(column)[kept])
    return sp.csr_array((values[kept], indices), shape=(x.size, x.size))


def box_jacobian(x: Vector, lower: Vector, upper: Vector) -> Sparse:
    """Return an element of the generalized Jacobian of the projection on lower ≤ x ≤ upper."""
    return sp.diags_array(((x > lower) & (x < upper)).astype(float), format="csr")


def _factor(kind: Cone, x: Dense, mu: Vector, mu_r: Vector) -> Dense:
    """Return blocks of factors of one kind and size, shape (count, size, size)."""
    count, size = x.shape
    match kind:
        case Cone.ZERO:
            return np.zeros((count, size, size))
        case Cone.FREE:
            return _diagonal(np.ones_like(x))
        case Cone.NONNEGATIVE:
            return _diagonal((x > 0).astype(float))
        case Cone.SECOND_ORDER:
            half_space = np.isinf(mu)
            finite = np.where(half_space, 1.0, mu)
            blocks = _clipped(x, [(slice(1, size), finite)], _normal_second_order(x, finite))
            whole = np.ones_like(x)
            whole[:, 0] = x[:, 0] > 0
            blocks[half_space] = _diagonal(whole[half_space])
            return blocks
        case Cone.ROLLING:
            return _rolling(x, mu, mu_r)
        case Cone.ROLLING_DUAL:
            return _diagonal(np.ones_like(x)) - _rolling(-x, mu, mu_r)
        case Cone.CYLINDER:
            blocks = _diagonal(np.ones_like(x))
            blocks[:, 0, 0] = x[:, 0] > 0
            blocks[:, 1:, 1:] = _sphere(x[:, 1:], mu)
            return blocks
        case Cone.BALL:
            return _sphere(x, mu)


def _rolling(x: Dense, mu: Vector, mu_r: Vector) -> Dense:
    k = (x.shape[1] - 1) // 2
    groups = [(slice(1, 1 + k), mu), (slice(1 + k, x.shape[1]), mu_r)]
    return _clipped(x, groups, project_rolling_cone(x, mu, mu_r)[:, 0])


def _normal_second_order(x: Dense, mu: Vector) -> Vector:
    """Return r_N of the projection on {‖r_T‖ ≤ μ r_N}."""
    t = np.linalg.norm(x[:, 1:], axis=1)
    return np.maximum(np.where(t > mu * x[:, 0], (x[:, 0] + mu * t) / (1.0 + mu * mu), x[:, 0]), 0.0)


def _clipped(x: Dense, groups: list[tuple[slice, Vector]], normal: Vector) -> Dense:
    """Return J of the formula above; `groups` are the columns of T and M with their coefficients, `normal` is r_N."""
    count, size = x.shape
    blocks, g, D = np.zeros((count, size, size)), np.zeros((count, size)), np.ones(count)
    g[:, 0] = 1.0
    for columns, coefficient in groups:
        part = x[:, columns]
        length, bound = np.linalg.norm(part, axis=1), coefficient * normal
        clipped = length > bound
        g[:, columns] = np.where(clipped, coefficient / np.where(clipped, length, 1.0), 0.0)[:, None] * part
        D += np.where(clipped, coefficient**2, 0.0)
        blocks[:, columns, columns] = _sphere(part, bound)
    blocks += g[:, :, None] * (g / D[:, None])[:, None, :]
    blocks[normal <= 0.0] = 0.0
    return blocks


def _sphere(x: Dense, radius: Vector) -> Dense:
    """Return ∂ of the projection on a disk of that radius: I inside, (radius/‖x‖)(I − x̂x̂ᵀ) outside."""
    length = np.linalg.norm(x, axis=1)
    outside = length > radius
    safe = np.where(outside, length, 1.0)
    ratio = np.where(outside, np.where(outside, radius, 1.0) / safe, 1.0)
    unit = np.where(outside, 1.0 / safe, 0.0)[:, None] * x
    return ratio[:, None, None] * (np.eye(x.shape[1]) - unit[:, :, None] * unit[:, None, :])


def _diagonal(values: Dense) -> Dense:
    blocks: Any = np.zeros((*values.shape, values.shape[1]))
    i = np.arange(values.shape[1])
    blocks[:, i, i] = values
    return blocks
