"""LCPs that carry a name, with their published solutions."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation.matrices import Dense
from cpbench.generators.base import Instance, collection


@collection(
    "lcp-classics",
    "lcp",
    "LCPs that carry a name",
    "Murty 1978, Math. Prog. Study 7:61; Fathi 1979, Math. Prog. 17:335; Darvay et al. 2020 (Csizmadia); Cottle, Pang, "
    "Stone 1992; Munson (MCPLIB)",
)
def build() -> list[Instance]:
    """Build Murty, Fathi, Csizmadia, Pang's isolated solution and its perturbation, munson1, a ray of solutions."""
    return [
        *(murty(n) for n in (10, 100)),
        *(fathi(n) for n in (10, 40)),
        *(csizmadia(n) for n in (10, 30)),
        isolated(),
        isolated_perturbed(),
        munson1(),
        unbounded_ray(),
    ]


def _murty_matrix(n: int) -> Dense:
    return 2.0 * np.tril(np.ones((n, n))) - np.eye(n)


def murty(n: int) -> Instance:
    """Build M = 2 tril(E) − I, q = −e, z = e₁, with the P-matrix of Murty (1978, Math. Prog. Study 7:61).

    With this q Lemke's method takes two pivots and Murty's least-index rule one. On the same matrix, Lemke's method
    takes 2ⁿ with −q = (2ⁿ, 2ⁿ + 2ⁿ⁻¹, …), and the rule 2ⁿ − 1 with the unknowns in reverse order.
    """
    problem = LCP(M=_murty_matrix(n), q=-np.ones(n), name=f"murty-{n}")
    return Instance(problem, LCPPoint(z=np.eye(n)[0]), "published", properties={"class": "P", "symmetric": False})


def fathi(n: int) -> Instance:
    """Build M = LLᵀ with L Murty's matrix, q = −e, z = e₁; symmetric positive definite (Fathi 1979).

    Newton-min takes n iterations from z = 0 (Dussault, Frappier and Gilbert 2019); Lemke's method takes two pivots.
    """
    L = _murty_matrix(n)
    problem = LCP(M=L @ L.T, q=-np.ones(n), name=f"fathi-{n}")
    return Instance(problem, LCPPoint(z=np.eye(n)[0]), "published", properties={"class": "SPD", "symmetric": True})


def csizmadia(n: int) -> Instance:
    """Build M = 2I − tril(E), z = (1, 0, 1, 0, …), q = (e − z) − Mz. A P-matrix whose inverse grows as 2ⁿ."""
    M = 2.0 * np.eye(n) - np.tril(np.ones((n, n)))
    z = np.arange(1, n + 1) % 2.0
    problem = LCP(M=M, q=(1.0 - z) - M @ z, name=f"csizmadia-{n}")
    return Instance(problem, LCPPoint(z=z), "published", properties={"class": "P", "symmetric": False})


_ISOLATED = np.array([[0.0, -1, -1], [1, 0, 0], [-1, 0, 1]])


def isolated() -> Instance:
    """Build a problem whose isolated solution a small perturbation of q destroys (Cottle, Pang, Stone): z = (1, 0,
    0).
    """
    problem = LCP(M=_ISOLATED, q=[0.0, -1, 1], name="pang-isolated")
    return Instance(problem, LCPPoint(z=[1.0, 0, 0]), "published", properties={"class": "indefinite"})


def isolated_perturbed() -> Instance:
    """Build the same with q₁ = −10⁻⁴: w₁ = −z₂ − z₃ − 10⁻⁴ < 0 for every z ≥ 0. There is no solution."""
    problem = LCP(M=_ISOLATED, q=[-1e-4, -1, 1], name="pang-isolated-perturbed")
    return Instance(problem, None, "infeasible", np.array([1.0, 0, 0]), {"class": "infeasible"})


def munson1() -> Instance:
    """Build three variables of MCPLIB: z = (1, 0, 0)."""
    problem = LCP(M=np.array([[1.0, 2, 3], [0, 1, -1], [1, 1, 0]]), q=[-1.0, 1, 1], name="munson1")
    return Instance(problem, LCPPoint(z=[1.0, 0, 0]), "published", properties={"class": "nonsymmetric"})


def unbounded_ray() -> Instance:
    """Build M = [[1, −1], [−1, 1]], q = (1, −1): every (t, 1 + t), t ≥ 0, is a solution; (0, 1) is the least."""
    problem = LCP(M=np.array([[1.0, -1], [-1, 1]]), q=[1.0, -1.0], name="ray-of-solutions")
    return Instance(problem, LCPPoint(z=[0.0, 1.0]), "closed form", properties={"class": "PSD singular"})
