"""The NCP functions of Acary's lecture with its names and signs, (35)-(38): ψ(w, z) = 0 exactly where 0 ≤ w ⟂ z ≥ 0."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cpbench.formulations import ncp_functions as ncp
from cpbench.foundation.matrices import Dense

Values = tuple[Dense, Dense, Dense]
"""ψ(w, z) and an element of its subdifferential, by w and by z."""


def least(w: Dense, z: Dense) -> Values:
    """Evaluate min(w, z), equation (35)."""
    psi, by_z, by_w = ncp.minimum(z, w)
    return psi, by_w, by_z


def fischer_burmeister(w: Dense, z: Dense) -> Values:
    """Evaluate √(z² + w²) − z − w, equation (36).

    >>> float(fischer_burmeister(np.array(3.0), np.array(4.0))[0])
    -2.0
    """
    return _negated(ncp.fischer_burmeister(w, z))


def penalized(w: Dense, z: Dense, weight: float = 0.5) -> Values:
    """Evaluate λψ_FB − (1 − λ)max(0, z)max(0, w) with λ = `weight` in ]0, 1[, equation (37)."""
    return _negated(ncp.penalized(w, z, weight))


def smooth(w: Dense, z: Dense) -> Dense:
    """Evaluate wz − ½min²(0, z + w), Evtushenko and Purtov's function: equation (38) with its sign mended."""
    return ncp.evtushenko_purtov(w, z)[0]


def smooth_as_printed(w: Dense, z: Dense) -> Dense:
    """Evaluate wz + ½min²(0, z + w), equation (38) as the lecture prints it: no NCP function.

    >>> abs(float(smooth_as_printed(np.array(-1.0), np.array(2.0 - 3.0**0.5)))) < 1e-15
    True
    """
    return w * z + 0.5 * np.minimum(z + w, 0.0) ** 2


def _negated(values: Values) -> Values:
    psi, by_w, by_z = values
    return -psi, -by_w, -by_z


@dataclass(frozen=True)
class NCPFunction:
    """NCP function, with its number in the lecture and its name."""

    equation: str
    name: str
    values: Callable[[Dense, Dense], Values]

    def psi(self, w: Dense, z: Dense) -> Dense:
        """Evaluate ψ(w, z)."""
        return self.values(w, z)[0]


def functions(weight: float = 0.5) -> tuple[NCPFunction, ...]:
    """Return the functions (35)-(38), the third with λ = `weight`."""
    return (
        NCPFunction("(35)", "minimum", least),
        NCPFunction("(36)", "Fischer–Burmeister", fischer_burmeister),
        NCPFunction("(37)", f"penalized, λ = {weight:g}", lambda w, z: penalized(w, z, weight)),
        NCPFunction("(38)", "smooth", ncp.evtushenko_purtov),
    )
