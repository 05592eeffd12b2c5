"""Functions by +, −, ·, / and roots alone, which round alike on every machine; those of C and NumPy do not."""

from __future__ import annotations

import numpy as np

from cpbench.foundation.matrices import Vector


def arctan(z: Vector) -> Vector:
    """Compute arctan to some units in the last place: four halvings of the angle, then the series up to t¹⁷."""
    t = z
    for _ in range(4):
        t = t / (1.0 + np.sqrt(1.0 + t * t))
    series = np.zeros_like(t)
    for k in range(17, 0, -2):
        series = 1.0 / k - t * t * series
    return 16.0 * t * series


def sine(x: Vector) -> Vector:
    """Compute sin to some units of 10⁻¹⁶ for a few turns: whole halves of a turn off, then the series up to r²³."""
    half_turns = np.round(x / np.pi)
    r = x - half_turns * np.pi
    series = np.ones_like(r)
    for k in range(22, 0, -2):
        series = 1.0 - r * r * series / (k * (k + 1))
    return np.where(half_turns % 2 == 0, r, -r) * series
