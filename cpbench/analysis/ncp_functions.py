"""The NCP functions of Acary's lecture, (35)-(38): ψ(w, z) = 0 exactly where 0 ≤ w ⟂ z ≥ 0."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cpbench.matrices import Dense


def least(w: Dense, z: Dense) -> Dense:
    """min(w, z), equation (35)."""
    return np.minimum(w, z)


def fischer_burmeister(w: Dense, z: Dense) -> Dense:
    """√(z² + w²) − z − w, equation (36).

    >>> float(fischer_burmeister(np.array(3.0), np.array(4.0)))
    -2.0
    """
    return np.hypot(z, w) - z - w


def penalized(w: Dense, z: Dense, weight: float = 0.5) -> Dense:
    """λψ_FB − (1 − λ)max(0, z)max(0, w) with λ = `weight` in ]0, 1[, equation (37)."""
    return weight * fischer_burmeister(w, z) - (1.0 - weight) * np.maximum(z, 0.0) * np.maximum(w, 0.0)


def smooth(w: Dense, z: Dense) -> Dense:
    """wz − ½min²(0, z + w), Evtushenko and Purtov's function: equation (38) with its sign mended."""
    return w * z - 0.5 * np.minimum(z + w, 0.0) ** 2


def smooth_as_printed(w: Dense, z: Dense) -> Dense:
    """wz + ½min²(0, z + w), equation (38) as the lecture prints it: no NCP function.

    >>> abs(float(smooth_as_printed(np.array(-1.0), np.array(2.0 - 3.0**0.5)))) < 1e-15
    True
    """
    return w * z + 0.5 * np.minimum(z + w, 0.0) ** 2


@dataclass(frozen=True)
class NCPFunction:
    """One of them, with its number in the lecture and its name."""

    equation: str
    name: str
    psi: Callable[[Dense, Dense], Dense]


def functions(weight: float = 0.5) -> tuple[NCPFunction, ...]:
    """(35)-(38), the third with λ = `weight`."""
    return (
        NCPFunction("(35)", "minimum", least),
        NCPFunction("(36)", "Fischer–Burmeister", fischer_burmeister),
        NCPFunction("(37)", f"penalized, λ = {weight:g}", lambda w, z: penalized(w, z, weight)),
        NCPFunction("(38)", "smooth", smooth),
    )
