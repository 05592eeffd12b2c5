"""Discretized free-boundary problems: obstacle, journal bearing, American put as LCPs; torsion as a bounded QP."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.linear import LCP
from cpbench.formulations.programs import QP
from cpbench.foundation.matrices import Sparse, Vector
from cpbench.generators.base import Instance, collection, snapped

MAJAVA = "Majava and Tai 2004, Int. J. Numer. Anal. Model. 1:73"
CRYER = "Cryer 1971, Math. Comp. 25:435; Moré and Toraldo 1991, SIAM J. Optim. 1:93"
BRENNAN = "Brennan and Schwartz 1977, J. Finance 32:449; Wilmott, Dewynne, Howison 1993"
MORE = "Moré and Toraldo 1991, SIAM J. Optim. 1:93"

RADIUS = 0.6979651482233737
"""Contact radius of the radial obstacle: the root of r²(1 − log(r/2)) = 1 (Majava and Tai 2004)."""


@collection("obstacle-radial", "lcp", "a membrane over a spherical obstacle, five-point Laplacian", MAJAVA)
def radial_obstacles() -> list[Instance]:
    return [radial_obstacle(n) for n in (15, 25)]


@collection("journal-bearing", "lcp", "pressure in a lubricated bearing, cavitation where it is zero", CRYER)
def journal_bearings() -> list[Instance]:
    return [journal_bearing(20, 10, 0.8), journal_bearing(30, 15, 0.1)]


@collection("american-put", "lcp", "one implicit step of an American put option in log price", BRENNAN)
def american_puts() -> list[Instance]:
    return [american_put(n) for n in (100, 400)]


@collection("torsion", "qp", "elastic-plastic torsion of a square bar: |u| at most the distance to the boundary", MORE)
def torsions() -> list[Instance]:
    return [torsion(n, c) for n, c in ((12, 5.0), (20, 10.0))]


@collection(
    "obstacle-radial-large", "lcp", "a membrane over a spherical obstacle, to 10⁵ points", MAJAVA, tier="standard"
)
def radial_obstacles_large() -> list[Instance]:
    return [radial_obstacle(n) for n in (45, 90, 316)]


@collection("journal-bearing-large", "lcp", "pressure in a lubricated bearing, to 10⁵ points", CRYER, tier="standard")
def journal_bearings_large() -> list[Instance]:
    return [journal_bearing(m, n, e) for m, n, e in ((60, 30, 0.1), (120, 60, 0.9), (450, 225, 0.8))]


@collection(
    "american-put-large", "lcp", "one implicit step of an American put option, to 10⁵ prices", BRENNAN, tier="standard"
)
def american_puts_large() -> list[Instance]:
    return [american_put(n) for n in (1000, 10_000, 100_000)]


@collection("torsion-large", "qp", "elastic-plastic torsion of a square bar, to 10⁵ points", MORE, tier="standard")
def torsions_large() -> list[Instance]:
    return [torsion(n, c) for n, c in ((45, 5.0), (90, 10.0), (316, 20.0))]


@collection(
    "free-boundaries-huge",
    "lcp",
    "obstacle, bearing and option with up to 10⁶ unknowns",
    "Majava and Tai 2004; Cryer 1971; Moré and Toraldo 1991; Brennan and Schwartz 1977",
    tier="large",
)
def huge() -> list[Instance]:
    return [radial_obstacle(1000), journal_bearing(1000, 1000, 0.8), american_put(1_000_000)]


@collection("torsion-huge", "qp", "elastic-plastic torsion of a square bar, 10⁶ points", MORE, tier="large")
def torsion_huge() -> list[Instance]:
    return [torsion(1000, 10.0)]


def _laplacian(m: int, n: int, a: float = 1.0, b: float = 1.0) -> Sparse:
    """Return a·(−∂²/∂x²) + b·(−∂²/∂y²) on m×n interior points, unscaled by the mesh size."""
    one = [sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(k, k)) for k in (m, n)]
    return sp.csr_array(a * sp.kron(one[0], sp.eye_array(n)) + b * sp.kron(sp.eye_array(m), one[1]))


def radial_obstacle(n: int) -> Instance:
    """Build −Δu ≥ 0, u ≥ ψ = √(1 − r²) on (−2, 2)², boundary values of the exact u; z = u − ψ on n×n interior points.

    u = ψ inside RADIUS and −RADIUS² log(r/2)/√(1 − RADIUS²) outside, up to the mesh error.
    """
    h = 4.0 / (n + 1)
    axis = -2.0 + h * np.arange(n + 2)
    X, Y = np.meshgrid(axis, axis, indexing="ij")
    r = np.hypot(X, Y)
    psi = np.where(r < 1.0, np.sqrt(np.maximum(1.0 - r * r, 0.0)), -1.0)
    outside = -(RADIUS**2) * np.log(np.maximum(r, 1e-9) / 2.0) / np.sqrt(1.0 - RADIUS**2)
    edge = np.where(r <= RADIUS, psi, outside)
    edge[1:-1, 1:-1] = 0.0
    load = np.zeros((n, n))  # what the boundary adds to −Δu, times h²
    load[0, :] -= edge[0, 1:-1]
    load[-1, :] -= edge[-1, 1:-1]
    load[:, 0] -= edge[1:-1, 0]
    load[:, -1] -= edge[1:-1, -1]
    M = _laplacian(n, n)
    q = snapped(M @ snapped(psi[1:-1, 1:-1].ravel()) + load.ravel())
    problem = LCP(M=M, q=q, name=f"radial-obstacle-{n}")
    return Instance(problem, properties={"class": "SPD M-matrix", "symmetric": True, "mesh": h})


def journal_bearing(m: int, n: int, eccentricity: float) -> Instance:
    """Build −∇·((1 + ε cos x)³ ∇u) = −ε sin x, u ≥ 0 on (0, 2π)×(0, 20), central differences."""
    hx, hy = 2.0 * np.pi / (m + 1), 20.0 / (n + 1)
    x = hx * np.arange(1, m + 1)

    def film(at: Vector) -> Vector:
        return snapped((1.0 + eccentricity * np.cos(at)) ** 3)

    left, right, here = film(x - hx / 2), film(x + hx / 2), film(x)
    across = sp.diags_array([-left[1:], left + right, -right[:-1]], offsets=[-1, 0, 1], shape=(m, m))
    along = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n))
    ratio = float(snapped((hx / hy) ** 2))
    M = sp.csr_array(sp.kron(across, sp.eye_array(n)) + ratio * sp.kron(sp.diags_array(here), along))
    q = np.repeat(snapped(eccentricity * hx**2 * np.sin(x)), n)
    problem = LCP(M=M, q=q, name=f"journal-bearing-{m}x{n}-{eccentricity:g}")
    return Instance(problem, properties={"class": "SPD M-matrix", "symmetric": True, "eccentricity": eccentricity})


def american_put(n: int) -> Instance:
    """Build an American put with strike 1, r = 0.05, σ = 0.3, Δt = 0.02, log prices in (−1.5, 1.5): z = V − payoff
    after one implicit step."""
    rate, sigma, dt = 0.05, 0.3, 0.02
    h = 3.0 / (n + 1)
    x = -1.5 + h * np.arange(n + 2)
    payoff = snapped(np.maximum(1.0 - np.exp(x), 0.0))
    diffusion, drift = 0.5 * sigma**2 / h**2, (rate - 0.5 * sigma**2) / (2.0 * h)
    lower, upper = float(snapped(-dt * (diffusion - drift))), float(snapped(-dt * (diffusion + drift)))
    middle = float(snapped(1.0 + dt * (2.0 * diffusion + rate)))
    M = sp.csr_array(sp.diags_array([lower, middle, upper], offsets=[-1, 0, 1], shape=(n, n)))
    step = lower * payoff[:-2] + middle * payoff[1:-1] + upper * payoff[2:]
    q = snapped(step - payoff[1:-1])
    problem = LCP(M=M, q=q, name=f"american-put-{n}")
    return Instance(problem, properties={"class": "M-matrix", "symmetric": False})


def torsion(n: int, load: float) -> Instance:
    """Build min ½∫|∇u|² − c∫u, |u| ≤ distance to the boundary of the unit square, n×n interior points."""
    h = 1.0 / (n + 1)
    axis = np.minimum(np.arange(1, n + 1), np.arange(n, 0, -1)) * h
    distance = np.minimum.outer(axis, axis).ravel()
    p = np.full(n * n, -load * h * h)
    problem = QP.build(_laplacian(n, n), p, lb=-distance, ub=distance, name=f"torsion-{n}x{n}-{load:g}")
    return Instance(problem, properties={"class": "SPD", "bounds": True})
