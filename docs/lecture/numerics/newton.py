"""Newton's methods of the lecture, step by step: linearise the map (Josephy), or the equation Φ = 0 (31)-(33)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench import MLCP, CpbenchError
from cpbench.foundation.matrices import Dense, Vector
from lecture.numerics import ncp_functions as ncp
from lecture.numerics.examples.nonlinear import NonlinearExample
from lecture.numerics.round_trips import answer

ENOUGH = 1e-13


@dataclass(frozen=True, eq=False)
class Iterate:
    """A point of a method: its natural residual, the merit ½‖Φ‖² (39) and the step length that led there."""

    x: Vector
    residual: float
    merit: float = 0.0
    length: float = 1.0


def josephy_newton(example: NonlinearExample, start: Vector, most: int = 12) -> list[Iterate]:
    """Each step solves the mixed LCP (14) of F linearised at the iterate, by the conversions of the library.

    It ends early where that problem is not solved; the residual of the last iterate tells.

    >>> from lecture.numerics.examples.nonlinear import hock_schittkowski_14
    >>> example = hock_schittkowski_14()
    >>> josephy_newton(example, example.start)[-1].residual < 1e-12
    True
    """
    x, n = start, example.free
    path = [Iterate(x, example.residual(x))]
    while path[-1].residual > ENOUGH and len(path) <= most:
        J = example.jacobian(x)
        offset = example.value(x) - J @ x
        step = MLCP(A=J[:n, :n], C=J[:n, n:], D=J[n:, :n], B=J[n:, n:], a=offset[:n], b=offset[n:])
        try:
            found = answer(step).point
        except CpbenchError:
            break
        x = np.concatenate([found.u, found.v])
        path.append(Iterate(x, example.residual(x)))
    return path


def generalized_newton(
    example: NonlinearExample, function: ncp.NCPFunction, start: Vector, most: int = 40
) -> list[Iterate]:
    """(33) on Φ = (F_F, ψ(F_C, z_C)), damped by halving until the merit (39) falls as Armijo asks.

    A singular element of ∂Φ is met by the least-squares step.

    >>> from lecture.numerics.examples.nonlinear import kojima_shindo
    >>> example = kojima_shindo()
    >>> generalized_newton(example, ncp.functions()[1], example.start)[-1].residual < 1e-12
    True
    """
    x = start
    phi = equation(example, function, x)
    path = [Iterate(x, example.residual(x), merit(phi))]
    while path[-1].residual > ENOUGH and len(path) <= most:
        step = -np.linalg.lstsq(subdifferential(example, function, x), phi, rcond=None)[0]
        length, before = 1.0, merit(phi)
        while True:
            phi = equation(example, function, x + length * step)
            if merit(phi) <= (1.0 - 1e-4 * length) * before or length < 1e-8:
                break
            length *= 0.5
        x = x + length * step
        path.append(Iterate(x, example.residual(x), merit(phi), length))
    return path


def equation(example: NonlinearExample, function: ncp.NCPFunction, x: Vector) -> Vector:
    """Φ(x)."""
    F, n = example.value(x), example.free
    return np.concatenate([F[:n], function.psi(F[n:], x[n:])])


def subdifferential(example: NonlinearExample, function: ncp.NCPFunction, x: Vector) -> Dense:
    """An element H of ∂Φ(x): ∂_wψ F′ + ∂_zψ I in the complementary rows."""
    F, J, n = example.value(x), example.jacobian(x), example.free
    _, by_w, by_z = function.values(F[n:], x[n:])
    H = np.array(J, dtype=float)
    H[n:] *= by_w[:, None]
    H[n:, n:] += np.diag(by_z)
    return H


def merit(phi: Vector) -> float:
    """½ΦᵀΦ, equation (39)."""
    return float(0.5 * phi @ phi)


def merit_slice(example: NonlinearExample, function: ncp.NCPFunction, x: Vector, way: Vector, steps: Vector) -> Vector:
    """The merit along a line through x."""
    return np.array([merit(equation(example, function, x + t * way)) for t in steps])


def least_singular_value(example: NonlinearExample, function: ncp.NCPFunction, x: Vector) -> float:
    """Of the element of ∂Φ(x): 0 where Newton's step is not defined."""
    return float(np.linalg.svd(subdifferential(example, function, x), compute_uv=False)[-1])
