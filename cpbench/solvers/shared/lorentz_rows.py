"""Products of cones as rows of {0}, ℝ₊ and Lorentz cones {‖t‖ ≤ t₀}, what conic solvers know.

s ∈ K is written ŝ = Ts + Ue + c with ŝ in {0}, ℝ₊ and Lorentz cones L and one auxiliary e for every sum of two cones:

    second order    (μ s_N, s_T) ∈ L; μ = 0 is s_N ≥ 0, s_T = 0; μ = ∞ is s_N ≥ 0
    rolling         (μ s_N, s_T) ∈ L and (μ_r s_N, s_M) ∈ L, an intersection
    rolling dual    (s_N − e, μ s_T) ∈ L and (e, μ_r s_M) ∈ L, a sum
    ℝ₊ × disk       s_N ≥ 0 and (μ, s_T) ∈ L

The multiplier of s is y = Tᵀŷ: those of an intersection add up, and that of the constant μ drops out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.cones import Cone, ProductCone


class _Rows:
    """Collector of the rows of T, U and c, cone after cone."""

    def __init__(self) -> None:
        self._sizes: list[int] = []
        self._kinds: list[str] = []
        self.extra = 0
        self._T: list[tuple[int, int, float]] = []
        self._U: list[tuple[int, int, float]] = []
        self._c: list[tuple[int, float]] = []
        self._at = 0

    def add(self, kind: str, *rows: tuple[float, int | None]) -> int:
        """Add one cone with rows weight·s_i, or the constant `weight` for no i; returns the number of its first row."""
        first = self._at
        for weight, i in rows:
            if i is None:
                self._c.append((self._at, weight))
            else:
                self._T.append((self._at, i, weight))
            self._at += 1
        self._kinds.append(kind)
        self._sizes.append(len(rows))
        return first

    def auxiliary(self, *entries: tuple[int, float]) -> None:
        """Add an auxiliary unknown that enters rows with weights; `entries` : (row, weight)."""
        self._U += [(row, self.extra, weight) for row, weight in entries]
        self.extra += 1

    def arrays(self, m: int) -> tuple[list[tuple[str, int]], Any, Any, Any]:
        """Return the cones and T, U, c of their rows: one {0}, one ℝ₊, then every Lorentz cone."""
        start = np.concatenate([[0], np.cumsum(self._sizes)]).astype(int)
        cones, order = [], [np.zeros(0, int)]
        for kind in ("zero", "nonnegative", "lorentz"):
            members = [k for k, one in enumerate(self._kinds) if one == kind]
            order += [np.arange(start[k], start[k + 1]) for k in members]
            sizes = [self._sizes[k] for k in members]
            cones += [(kind, size) for size in (sizes if kind == "lorentz" else [sum(sizes)]) if size]
        rows = np.concatenate(order)
        c = np.zeros(self._at)
        for row, weight in self._c:
            c[row] = weight
        return cones, _sparse(self._T, self._at, m)[rows], _sparse(self._U, self._at, self.extra)[rows], c[rows]


def _sparse(entries: list[tuple[int, int, float]], rows: int, columns: int) -> Any:
    row, column, value = zip(*entries, strict=True) if entries else ((), (), ())
    return sp.csr_array((np.array(value, float), (np.array(row, int), np.array(column, int))), shape=(rows, columns))


def _second_order(rows: _Rows, n: int, t: list[int], mu: float) -> None:
    """Add the rows of ‖s_t‖ ≤ μ s_n."""
    if mu > 0 and math.isfinite(mu) and t:
        rows.add("lorentz", (mu, n), *((1.0, i) for i in t))
        return
    rows.add("nonnegative", (1.0, n))
    if mu == 0 and t:
        rows.add("zero", *((1.0, i) for i in t))


def _rolling(rows: _Rows, n: int, t: list[int], m: list[int], mu: float, mu_r: float) -> None:
    _second_order(rows, n, t, mu)
    _second_order(rows, n, m, mu_r)


def _rolling_dual(rows: _Rows, n: int, t: list[int], m: list[int], mu: float, mu_r: float) -> None:
    first = rows.add("lorentz", (1.0, n), *((mu, i) for i in t))
    second = rows.add("lorentz", (0.0, n), *((mu_r, i) for i in m))
    rows.auxiliary((first, -1.0), (second, 1.0))


def _cylinder(rows: _Rows, n: int, t: list[int], radius: float) -> None:
    rows.add("nonnegative", (1.0, n))
    if radius == 0 and t:
        rows.add("zero", *((1.0, i) for i in t))
    elif math.isfinite(radius) and t:
        rows.add("lorentz", (radius, None), *((1.0, i) for i in t))


def lorentz_rows(K: ProductCone) -> tuple[list[tuple[str, int]], Any, Any, Any]:
    """Return K as {0}, ℝ₊ and Lorentz cones: their kinds ("zero", "nonnegative", "lorentz") with sizes; T, U and c."""
    rows = _Rows()
    write: dict[Cone, Callable[..., None]] = {Cone.SECOND_ORDER: _second_order, Cone.CYLINDER: _cylinder}
    rolls: dict[Cone, Callable[..., None]] = {Cone.ROLLING: _rolling, Cone.ROLLING_DUAL: _rolling_dual}
    plain = {Cone.ZERO: "zero", Cone.NONNEGATIVE: "nonnegative"}
    at = 0
    for number, size, mu, mu_r in zip(K.kind, K.size.astype(int), K.mu, K.mu_r, strict=True):
        kind, numbers = Cone(int(number)), list(range(at, at + int(size)))
        at += int(size)
        if kind in write:
            write[kind](rows, numbers[0], numbers[1:], float(mu))
        elif kind in rolls:
            k = (len(numbers) - 1) // 2
            rolls[kind](rows, numbers[0], numbers[1 : 1 + k], numbers[1 + k :], float(mu), float(mu_r))
        elif kind in plain and numbers:
            rows.add(plain[kind], *((1.0, i) for i in numbers))
    return rows.arrays(K.rows)
