"""Ropes over drums: the force that holds the load falls by e^(μθ) around the angle θ (Euler 1769, Eytelwein 1808).

The rope is a chain of n points of mass m on a drum of radius 1, at angles δ from each other, joined by rigid links.
Point i touches the drum with (N, T); the links pull with the tensions S_i. One end is held with the force S_0, the
other is pulled so that all points slide with the speed v (in a step, from rest; forces are impulses):

    N_i = (S_{i−1} + S_i) sin(δ/2),   m v = (S_i − S_{i−1}) cos(δ/2) − μ N_i

so that S_i = (S_{i−1}(c + μs) + m v)/(c − μs). Without mass S_n/S_0 = ((c + μs)/(c − μs))ⁿ, which tends to e^(μθ). It
is exact in rational arithmetic where c and s are: c = (1 − t²)/(1 + t²), s = 2t/(1 + t²), t a power of two.
"""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.global_contact import GFCPoint, GlobalFrictionContact
from cpbench.generators.base import Instance, collection
from cpbench_problems.generators.contact_joints import condensed

CITATION = (
    "Euler 1769, Mém. Acad. Sci. Berlin 18:265; Eytelwein 1808, Handbuch der Statik fester Körper; masses by Newton's "
    "second law"
)
MASS, SPEED, HELD = 2.0**-6, 2.0**-4, 1.0
"""Mass of a point, its speed after the step, and the impulse that holds the rope."""


@collection("belts", "gfc", "ropes that slide over drums, global form", CITATION)
def build_global() -> list[Instance]:
    return [rope(n, bits, mu) for n, bits, mu in ((6, 3, 0.5), (12, 4, 0.25), (24, 5, 0.5), (48, 5, 0.75))]


@collection("belts-local", "fcm", "ropes that slide over drums, local mixed form", CITATION)
def build_local() -> list[Instance]:
    sizes = ((11, 3, 0.25), (12, 4, 0.5), (14, 4, 0.75), (16, 4, 0.25), (18, 4, 0.5), (20, 4, 0.75), (24, 5, 0.25))
    return [condensed(rope(n, bits, mu)) for n, bits, mu in sizes]


@collection("belts-large", "gfc", "ropes of up to 2000 points over drums", CITATION, tier="standard")
def build_large() -> list[Instance]:
    return [rope(n, bits, mu) for n, bits, mu in ((400, 8, 0.5), (2000, 10, 0.5))]


@collection("belts-local-large", "fcm", "ropes of up to 2500 points over drums, local mixed form", CITATION,
            tier="standard")  # fmt: skip
def build_local_large() -> list[Instance]:
    dense = [condensed(rope(n, bits, mu)) for n, bits, mu in ((100, 7, 0.25), (250, 8, 0.5), (500, 8, 0.25))]
    sparse = ((600, 9, 0.75), (1000, 9, 0.25), (1500, 10, 0.5), (2000, 10, 0.25), (2500, 10, 0.5))
    return [*dense, *(condensed(rope(n, bits, mu), sparse=True) for n, bits, mu in sparse)]


def tensions(n: int, bits: int, mu: float) -> list[Fraction]:
    """Return S_0, ..., S_n as impulses, for tan(δ/4) = 2^−bits."""
    c, s = _half_angle(bits)
    tension, friction = [Fraction(HELD)], Fraction(mu)
    for _ in range(n):
        tension.append((tension[-1] * (c + friction * s) + Fraction(MASS * SPEED)) / (c - friction * s))
    return tension


def _half_angle(bits: int) -> tuple[Fraction, Fraction]:
    """Return cos(δ/2) and sin(δ/2) for tan(δ/4) = 2^−bits."""
    t = Fraction(1, 2**bits)
    return (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)


def rope(n: int, bits: int, mu: float) -> Instance:
    """Build n points at angles δ with tan(δ/4) = 2^−bits; unknowns of a point are its velocities outwards and along the
    drum, which are those of its contact."""
    S = tensions(n, bits, mu)
    c, s = (float(value) for value in _half_angle(bits))
    link = np.arange(n - 1)  # both its ends are pulled inwards, and towards each other
    rows = np.concatenate([2 * link, 2 * link + 1, 2 * link + 2, 2 * link + 3])
    values = np.repeat([-s, c, -s, -c], n - 1)
    G = sp.csr_array((values, (rows, np.tile(link, 4))), shape=(2 * n, n - 1))
    H = sp.csr_array(sp.eye_array(2 * n))
    f = np.zeros(2 * n)
    f[:2] += np.array([-s, -c]) * float(S[0])
    f[-2:] += np.array([-s, c]) * float(S[-1])
    normal = np.array([float((a + b) * _half_angle(bits)[1]) for a, b in itertools.pairwise(S)])
    r = np.column_stack([normal, -mu * normal]).ravel()
    v = np.tile([0.0, SPEED], n)
    problem = GlobalFrictionContact(
        M=sp.csr_array(MASS * H), H=H, G=G, f=f, w=np.zeros(2 * n), mu=np.full(n, mu), dimension=2,
        name=f"rope-{n}-{mu:g}",
    )  # fmt: skip
    point = GFCPoint(v=v, r=r, lam=np.array([float(value) for value in S[1:-1]]))
    angle = 4.0 * n * np.arctan(2.0**-bits)
    facts = {"contacts": n, "joints": n - 1, "angle": float(np.round(angle, 6)), "ratio": float(S[-1])}
    return Instance(problem, point, "planted to rounding", properties=facts)


def limit_ratio(n: int, bits: int, mu: float) -> Fraction:
    """Return S_n/S_0 of a rope without mass."""
    c, s = _half_angle(bits)
    return ((c + Fraction(mu) * s) / (c - Fraction(mu) * s)) ** n
