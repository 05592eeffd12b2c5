"""Lorentz cones L = {x : x_N ≥ ‖x_T‖}, one for each row of an array, as interior-point methods need them.

Jordan's product is a ∘ b = (aᵀb, a_N b_T + b_N a_T), its unit e, det x = x_N² − ‖x_T‖², and the quadratic
representation P(x) = 2xxᵀ − det(x) J with J = diag(1, −1, …).
"""

from __future__ import annotations

import numpy as np

from cpbench.matrices import Dense, Vector

SMALLEST = 1e-30
"""Of a determinant of a point inside the cone."""


class RowScaling:
    """Nesterov and Todd's: P(p)w = y. theta : P(p)⁻¹, shape (nc, d, d)."""

    def __init__(self, y: Dense, w: Dense) -> None:
        d = y.shape[1]
        det_y, det_w = np.maximum(_det(y), SMALLEST), np.maximum(_det(w), SMALLEST)
        even_y, even_w = y / np.sqrt(det_y)[:, None], w / np.sqrt(det_w)[:, None]
        gamma = np.sqrt(0.5 * (1.0 + np.einsum("ci,ci->c", even_y, even_w)))
        flipped = (even_w + _flip(even_y)) / (2.0 * gamma)[:, None]  # p⁻¹ of determinant 1
        J = np.diag(np.r_[1.0, -np.ones(d - 1)])
        ratio = np.sqrt(det_w / det_y)
        self.theta = ratio[:, None, None] * (2.0 * flipped[:, :, None] * flipped[:, None, :] - J)
        root = flipped.copy()
        root[:, 0] += 1.0
        root /= np.sqrt(2.0 * root[:, 0])[:, None]
        self._root = np.sqrt(ratio)[:, None, None] * (2.0 * root[:, :, None] * root[:, None, :] - J)
        root[:, 1:] *= -1.0
        self._root_inverse = 2.0 * root[:, :, None] * root[:, None, :] - J
        self._root_inverse /= np.sqrt(ratio)[:, None, None]
        self._middle = np.einsum("cij,cj->ci", self._root, y)

    def right_hand_side(self, predicted: tuple[Dense, Dense] | None, target: float) -> Dense:
        """Return c of dw = c − Θdy, the equation of a step towards y ∘ w = target·e; Θ is the Nesterov–Todd scaling.

        `predicted` : (dy, dw) of Mehrotra's predictor, whose second-order term is subtracted; None: no such term.
        """
        if predicted is None:
            wanted = np.zeros_like(self._middle)
        else:
            dy, dw = predicted
            scaled_dy = np.einsum("cij,cj->ci", self._root, dy)
            scaled_dw = np.einsum("cij,cj->ci", self._root_inverse, dw)
            wanted = -_times(scaled_dy, scaled_dw)
        wanted[:, 0] += target
        middle = self._middle
        # λ \ (wanted − λ∘λ) = λ \ wanted − λ
        return np.einsum("cij,cj->ci", self._root, _divided(wanted, middle) - middle)


def _det(x: Dense) -> Vector:
    t = np.sqrt(np.einsum("ci,ci->c", x[:, 1:], x[:, 1:]))
    return (x[:, 0] - t) * (x[:, 0] + t)


def _flip(x: Dense) -> Dense:
    return np.column_stack([x[:, 0], -x[:, 1:]])


def _times(a: Dense, b: Dense) -> Dense:
    """Return Jordan product."""
    return np.column_stack([np.einsum("ci,ci->c", a, b), a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:]])


def _divided(b: Dense, a: Dense) -> Dense:
    """Return x of a ∘ x = b."""
    normal = (a[:, 0] * b[:, 0] - np.einsum("ci,ci->c", a[:, 1:], b[:, 1:])) / np.maximum(_det(a), SMALLEST)
    return np.column_stack([normal, (b[:, 1:] - normal[:, None] * a[:, 1:]) / a[:, :1]])


def longest(x: Dense, dx: Dense) -> float:
    """Return the largest t for which x + t dx stays in L, ∞ where there is none."""
    a, c = dx[:, 0] ** 2 - np.einsum("ci,ci->c", dx[:, 1:], dx[:, 1:]), np.maximum(_det(x), SMALLEST)
    b = x[:, 0] * dx[:, 0] - np.einsum("ci,ci->c", x[:, 1:], dx[:, 1:])
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    # the smallest positive root of a t² + 2bt + c, without cancellation
    denominator = np.where(b > 0, -b - root, root - b)
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = c / denominator, denominator / a
    candidates = np.stack([one, other])
    candidates = np.where((candidates > 0) & (b * b >= a * c), candidates, np.inf)
    falls = np.where(dx[:, 0] < 0, x[:, 0] / np.where(dx[:, 0] < 0, -dx[:, 0], 1.0), np.inf)
    return float(min(candidates.min(), falls.min()))
