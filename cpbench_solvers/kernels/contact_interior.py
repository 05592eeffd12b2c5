"""What a step of interior points on frictional contact does besides its linear solves: scaling, directions, lengths.

Every row of y and w lies in a Lorentz cone L = {x : x_N ≥ ‖x_T‖}. Jordan's product is a ∘ b = (aᵀb, a_N b_T + b_N a_T),
det x = x_N² − ‖x_T‖². The scaling of Nesterov and Todd, Θy = w, is kept as vectors: with det v = 1 and a number s,
s(2vvᵀ − J), J = diag(1, −1, …), takes a row in a few operations. A row of `scaling` is (f, v, s): Θ = s(2ffᵀ − J), and
its square root √s(2vvᵀ − J).

Reference in plain NumPy: `tests/solvers/references/interior_point_fc.py`.
"""

import numpy as np

from cpbench.foundation.kernels import DATA, DATA_2D, FAST, VECTOR, float64, helper, kernel, void

SMALLEST = 1e-30
"""Of a determinant of a point inside the cone."""
ROWS = float64[:, ::1]
BLOCKS = float64[:, :, ::1]


@helper(inline=True)
def _det(x, d):
    square = 0.0
    for k in range(1, d):
        square += x[k] * x[k]
    t = np.sqrt(square)
    return max((x[0] - t) * (x[0] + t), SMALLEST)  # the product keeps the digits that the difference of squares loses


@helper(inline=True)
def _reflect(v, x, factor, sign, out, d):
    """Set out ← factor·(2uuᵀ − J)x with u = (v_N, sign·v_T); `out` may be x."""
    along = v[0] * x[0]
    for k in range(1, d):
        along += sign * v[k] * x[k]
    out[0] = factor * (2.0 * v[0] * along - x[0])
    for k in range(1, d):
        out[k] = factor * (2.0 * sign * v[k] * along + x[k])


@helper(inline=True)
def _longest(x, dx, step, d):
    """Return the least of `step` and the largest t for which x + t dx stays in the cone."""
    a, b = dx[0] * dx[0], x[0] * dx[0]
    for k in range(1, d):
        a -= dx[k] * dx[k]
        b -= x[k] * dx[k]
    c = _det(x, d)
    inside = b * b - a * c
    if inside >= 0.0:
        # the smallest positive root of a t² + 2bt + c, without cancellation
        root = np.sqrt(inside)
        below = -b - root if b > 0.0 else root - b
        if below > 0.0 and c < step * below:
            step = c / below
        if below * a > 0.0 and abs(below) < step * abs(a):
            step = below / a
    if dx[0] < 0.0 and x[0] < -step * dx[0]:
        step = -x[0] / dx[0]
    return step


@kernel(void(ROWS, ROWS, DATA_2D, DATA, float64, ROWS, ROWS, VECTOR, BLOCKS), fast=FAST)
def prepare(y, w, q, Wy, epsilon, scaling, slope, residual, blocks):
    """Write the scaling of (y, w), the slope of φ(w) = √(‖w_T‖² + ε²), the residual Wy + q + φ e_N − w and the blocks
    (I − e_N φ′)Θ."""
    nc, d = y.shape
    for i in range(nc):
        own = scaling[i]
        det_y, det_w = _det(y[i], d), _det(w[i], d)
        root_y, root_w = np.sqrt(det_y), np.sqrt(det_w)
        gamma = 0.0
        for k in range(d):
            # of both on det = 1: near the boundary y and w differ by many powers of ten
            gamma += (y[i, k] / root_y) * (w[i, k] / root_w)
        gamma = 2.0 * np.sqrt(0.5 * (1.0 + gamma))
        for k in range(d):
            even_y = y[i, k] / root_y
            own[k] = (w[i, k] / root_w + (even_y if k == 0 else -even_y)) / gamma
            own[d + k] = own[k]
        own[d] += 1.0
        norm = np.sqrt(2.0 * own[d])
        for k in range(d):
            own[d + k] /= norm
        own[2 * d] = root_w / root_y  # Θ maps det y to det w: s² = det w/det y
        phi = 0.0
        for k in range(1, d):
            phi += w[i, k] * w[i, k]
        phi = np.sqrt(phi + epsilon * epsilon)
        slope[i, 0] = 0.0
        for k in range(1, d):
            slope[i, k] = w[i, k] / phi
        for k in range(d):
            residual[i * d + k] = Wy[i * d + k] + q[i, k] - w[i, k]
        residual[i * d] += phi
        for j in range(d):
            for k in range(d):
                sign = 0.0 if k != j else (-1.0 if k == 0 else 1.0)  # −J, J = diag(1, −1, …)
                blocks[i, k, j] = own[2 * d] * (2.0 * own[k] * own[j] + sign)
            for k in range(1, d):
                # (I − e_N φ′)Θ, so that the linear system keeps the pattern of W
                blocks[i, 0, j] -= slope[i, k] * blocks[i, k, j]


@helper(inline=True)
def _reduce(c, slope, residual, right):
    """Set right ← (I − e_N φ′)c − residual."""
    nc, d = c.shape
    for i in range(nc):
        along = 0.0
        for k in range(1, d):
            along += slope[i, k] * c[i, k]
        for k in range(d):
            right[i * d + k] = c[i, k] - residual[i * d + k]
        right[i * d] -= along


@kernel(void(ROWS, ROWS, DATA, ROWS, VECTOR), fast=FAST)
def predict(w, slope, residual, c, right):
    """Write c = −w of the predictor, dw = c − Θdy, and the right-hand side of its linear system."""
    nc, d = w.shape
    for i in range(nc):
        for k in range(d):
            c[i, k] = -w[i, k]
    _reduce(c, slope, residual, right)


@kernel(void(ROWS, ROWS, ROWS, ROWS, DATA, DATA, float64, ROWS, VECTOR), fast=FAST)
def correct(y, w, scaling, slope, residual, predicted, gap, c, right):
    """Write c of Mehrotra's corrector from the predictor dy and its c, and its right-hand side; gap : yᵀw/nc."""
    nc, d = y.shape
    length, dw = 1.0, np.empty((nc, d))
    for i in range(nc):
        own, dy = scaling[i], predicted[i * d : i * d + d]
        _reflect(own[:d], dy, -own[2 * d], 1.0, dw[i], d)
        for k in range(d):
            dw[i, k] += c[i, k]
        length = _longest(y[i], dy, length, d)
        length = _longest(w[i], dw[i], length, d)
    ahead = 0.0
    for i in range(nc):
        for k in range(d):
            ahead += (y[i, k] + length * predicted[i * d + k]) * (w[i, k] + length * dw[i, k])
    sigma = min(max(ahead / (nc * gap), 0.0), 1.0) ** 3  # Mehrotra: what the predictor would leave
    a, b, wanted, middle = np.empty(d), np.empty(d), np.empty(d), np.empty(d)
    for i in range(nc):
        own, dy = scaling[i], predicted[i * d : i * d + d]
        v, root = own[d : 2 * d], np.sqrt(own[2 * d])
        _reflect(v, dy, root, 1.0, a, d)
        _reflect(v, dw[i], 1.0 / root, -1.0, b, d)
        _reflect(v, y[i], root, 1.0, middle, d)
        wanted[0] = sigma * gap
        for k in range(d):
            wanted[0] -= a[k] * b[k]
        for k in range(1, d):
            wanted[k] = -(a[0] * b[k] + b[0] * a[k])
        # λ \ (wanted − λ∘λ) = λ \ wanted − λ
        normal = middle[0] * wanted[0]
        for k in range(1, d):
            normal -= middle[k] * wanted[k]
        normal /= _det(middle, d)
        for k in range(1, d):
            wanted[k] = (wanted[k] - normal * middle[k]) / middle[0] - middle[k]
        wanted[0] = normal - middle[0]
        _reflect(v, wanted, root, 1.0, c[i], d)
    _reduce(c, slope, residual, right)


@kernel(float64(ROWS, ROWS, ROWS, ROWS, DATA, float64, float64), fast=FAST)
def move(y, w, scaling, c, step, boundary, shortest):
    """Go the share `boundary` of the way to the boundary along (dy, c − Θdy), a full step at most; y and w are changed.

    Returns the length, or, without a move, one below `shortest`, NaN where the step is not finite.
    """
    nc, d = y.shape
    length, dw = np.inf, np.empty((nc, d))
    total = 0.0
    for i in range(nc):
        own, dy = scaling[i], step[i * d : i * d + d]
        _reflect(own[:d], dy, -own[2 * d], 1.0, dw[i], d)
        for k in range(d):
            dw[i, k] += c[i, k]
            total += abs(dy[k]) + abs(dw[i, k])
        length = _longest(y[i], dy, length, d)
        length = _longest(w[i], dw[i], length, d)
    if not total < np.inf:  # also NaN: nothing has been moved yet
        return np.nan
    length = min(boundary * length, 1.0)
    if length >= shortest:
        for i in range(nc):
            for k in range(d):
                y[i, k] += length * step[i * d + k]
                w[i, k] += length * dw[i, k]
    return length
