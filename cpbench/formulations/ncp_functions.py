"""NCP functions ψ(a, b) = 0 ⇔ 0 ≤ a ⟂ b ≥ 0, signed as min(a, b): both derivatives are ≥ 0 near a solution.

    minimum              min(a, b)                              (35) of Acary's lecture
    fischer_burmeister   a + b − √(a² + b²)                     (36), negated
    penalized            λ fb + (1 − λ) max(0, a) max(0, b)     (37), Chen, Chen and Kanzow, negated
    evtushenko_purtov    ab − ½ min(0, a + b)²                  (38), its sign mended

Solvers, conversions and what explains them take them from here; the judge has its own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from cpbench.formulations.expressions.recording import either, less, where
from cpbench.foundation.matrices import Vector

Values: TypeAlias = tuple[Vector, Vector, Vector]
"""ψ and its two (generalized) partial derivatives, each as long as a and b."""
NCPFunction: TypeAlias = Callable[[Vector, Vector], Values]

PENALTY_SHARE = 0.95
"""λ of the penalized function, as in Chen, Chen and Kanzow 2000."""


def minimum(a: Vector, b: Vector) -> Values:
    """Evaluate min(a, b); at a tie the derivative is that of b."""
    first = a < b
    return np.where(first, a, b), first.astype(float), (~first).astype(float)


def fischer_burmeister(a: Vector, b: Vector) -> Values:
    """Evaluate a + b − √(a² + b²); at (0, 0) the derivative is the limit from the direction (1, 1)."""
    root = np.hypot(a, b)
    at_zero = root == 0.0
    safe = np.where(at_zero, 1.0, root)
    kink = 1.0 - np.sqrt(0.5)
    both = (a > 0) & (b > 0)
    # without cancellation when both are positive
    phi = np.where(both, 2.0 * a * (b / np.where(both, a + b + root, 1.0)), a + b - root)
    return phi, np.where(at_zero, kink, 1.0 - a / safe), np.where(at_zero, kink, 1.0 - b / safe)


def penalized(a: Vector, b: Vector, share: float = PENALTY_SHARE) -> Values:
    """Evaluate the penalized Fischer–Burmeister function λ fb(a, b) + (1 − λ) a₊b₊, λ = `share` (Chen, Chen, Kanzow
    2000)."""
    phi, by_a, by_b = fischer_burmeister(a, b)
    rest, a_plus, b_plus = 1.0 - share, np.maximum(a, 0.0), np.maximum(b, 0.0)
    return (
        share * phi + rest * a_plus * b_plus,
        share * by_a + rest * b_plus * (a > 0),
        share * by_b + rest * a_plus * (b > 0),
    )


def evtushenko_purtov(a: Vector, b: Vector) -> Values:
    """Evaluate ab − ½ min(0, a + b)²: differentiable, with derivative 0 at (0, 0)."""
    low = np.minimum(0.0, a + b)
    return a * b - 0.5 * low * low, b - low, a - low


def symbolic_fischer_burmeister(a: Any, b: Any) -> Any:
    """Write a + b − √(a² + b²) of two columns, as 2ab/(a + b + √(a² + b²)) where a + b > 0: the difference would
    lose all digits of the smaller one. At (0, 0), where it has no derivative, that of a + b is taken."""
    squares = a * a + b * b
    positive, upper = less(0.0, squares), less(0.0, a + b)
    root = where(positive, np.sqrt(either(positive, squares, 1.0)))
    return either(upper, 2 * a * b / either(upper, a + b + root, 1.0), a + b - root)
