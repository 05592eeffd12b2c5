"""LCPs made for a solution: z and w first, complementary, then q = w − Mz, exactly."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation.matrices import Dense, Vector
from cpbench.generators.base import Instance, collection, dyadic, generator

CITATION = "Harker and Pang 1990, Lectures in Applied Math. 26:265 (monotone family)"


@collection("lcp-planted", "lcp", "random LCPs of known matrix class with a planted solution", CITATION)
def build() -> list[Instance]:
    """Build SPD, singular PSD, Harker–Pang (monotone, nonsymmetric), H₊, degenerate and badly scaled matrices."""
    return [
        *(_instance(f"spd-{n}", _spd(n), n, {"class": "SPD", "symmetric": True}) for n in (20, 100)),
        *(_instance(f"psd-{n}", _psd(n), n, {"class": "PSD singular", "symmetric": True}) for n in (20, 100)),
        *(_instance(f"harker-pang-{n}", _harker_pang(n), n, {"class": "PD nonsymmetric"}) for n in (20, 100)),
        _instance("h-plus-60", _h_plus(60), 60, {"class": "P", "symmetric": False}),
        _instance("degenerate-40", _spd(40), 40, {"class": "SPD", "degenerate": True}, degenerate=True),
        _scaled(40),
    ]


@collection(
    "lcp-planted-large", "lcp", "random LCPs with a planted solution, up to 2000 unknowns", CITATION, tier="standard"
)
def build_large() -> list[Instance]:
    return [
        *(_instance(f"spd-{n}", _spd(n), n, {"class": "SPD", "symmetric": True}) for n in (200, 1000)),
        *(_instance(f"harker-pang-{n}", _harker_pang(n), n, {"class": "PD nonsymmetric"}) for n in (200, 2000)),
    ]


def _spd(n: int) -> Dense:
    """Return AAᵀ + I, entries multiples of 1/64."""
    A = dyadic(generator(n), (n, n), -1, 1)
    return A @ A.T + np.eye(n)


def _psd(n: int) -> Dense:
    """Return AAᵀ with A of n/2 columns: rank n/2."""
    A = dyadic(generator(n + 1), (n, n // 2), -1, 1)
    return A @ A.T


def _harker_pang(n: int) -> Dense:
    """Return AAᵀ + B + D, B skew, D diagonal with entries in [0, 3/8]."""
    rng = generator(n + 2)
    A, B, D = dyadic(rng, (n, n), -5, 5), dyadic(rng, (n, n), -5, 5), dyadic(rng, n, 0, 3) / 8
    return A @ A.T + np.triu(B, 1) - np.triu(B, 1).T + np.diag(D)


def _h_plus(n: int) -> Dense:
    """Draw strictly diagonally dominant rows, positive diagonal, columns scaled by powers of two: a P-matrix, not
    PSD.
    """
    rng = generator(n + 3)
    M = dyadic(rng, (n, n), -1, 1)
    np.fill_diagonal(M, 0.0)
    M += np.diag(np.abs(M).sum(axis=1) + 1.0)
    return M * 2.0 ** rng.integers(-4, 5, n)


def _solution(n: int, *, degenerate: bool) -> tuple[Vector, Vector]:
    """Draw z, w ≥ 0 with zᵀw = 0; every fifth pair both zero when degenerate."""
    rng = generator(n + 4)
    value = dyadic(rng, n, 0, 4) + 1.0 / 8
    active = rng.integers(0, 2, n) == 1
    z, w = np.where(active, value, 0.0), np.where(active, 0.0, value)
    if degenerate:
        z[::5] = w[::5] = 0.0
    return z, w


def _instance(name: str, M: Dense, n: int, properties: dict[str, object], *, degenerate: bool = False) -> Instance:
    z, w = _solution(n, degenerate=degenerate)
    return Instance(LCP(M=M, q=w - M @ z, name=name), LCPPoint(z=z), "planted", properties=properties)


def _scaled(n: int) -> Instance:
    """Build an SPD matrix with rows and columns scaled by powers of two from 2⁻¹⁰ to 2¹⁰."""
    s = 2.0 ** generator(n + 5).integers(-10, 11, n)
    M = _spd(n) * s[:, None] * s[None, :]
    z, w = _solution(n, degenerate=False)
    z, w = z / s, w * s
    problem = LCP(M=M, q=w - M @ z, name=f"badly-scaled-{n}")
    return Instance(problem, LCPPoint(z=z), "planted", properties={"class": "SPD", "badly_scaled": True})
