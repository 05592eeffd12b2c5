"""LCPs of formulas against which one method or another is slow, cycles, or fails; with their exact solutions."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.generators.base import Instance, collection, dyadic, generator
from cpbench_problems.generators.lcp_classics import csizmadia, fathi, murty

CITATION = (
    "Ben Gharbia and Gilbert 2012, Math. Prog. 134:349; Darvay, Illés, Povh, Rigó 2020, SIAM J. Optim. 30:2628 "
    "(Csizmadia's matrix); Harker and Pang 1990, Lectures in Applied Math. 26:265 (lcprand); Murty 1978; Fathi 1979"
)


@collection("lcp-hard", "lcp", "LCPs on which a method cycles, takes very many steps, or breaks down", CITATION)
def build() -> list[Instance]:
    """Build cycles of plain Newton-min, Csizmadia's matrix with another q, and degenerate random problems."""
    return [
        *(cycling(n) for n in (3, 4, 33, 64, 255)),
        *(csizmadia_degenerate(n) for n in (10,)),
        *(random_degenerate(n) for n in (30, 60)),
    ]


@collection("lcp-hard-large", "lcp", "the same with up to 10⁵ unknowns", CITATION, tier="standard")
def build_large() -> list[Instance]:
    return [
        *(cycling(n) for n in (8191, 100_000)),
        csizmadia_degenerate(1000),
        csizmadia(1000),
        murty(1000),
        fathi(1000),
        *(random_degenerate(n) for n in (400, 1000)),
    ]


def cycling(n: int) -> Instance:
    """Build Ben Gharbia and Gilbert's sparse P-matrix of n ≥ 3 rows, q = e, z = 0.

    n odd: M = I + 2C with C the cyclic shift (C_{i+1,i} = 1); n even: M = I + (4/3)C + ½C². From z = −e₁, plain
    Newton-min (z_i or (Mz + q)_i is set to 0, whichever is smaller) visits −αe₁, −αe₂, ... and never stops.
    """
    shift = sp.csr_array((np.ones(n), (np.roll(np.arange(n), -1), np.arange(n))), shape=(n, n))
    M = sp.eye_array(n) + (2.0 * shift if n % 2 else (4.0 / 3.0) * shift + 0.5 * (shift @ shift))
    problem = LCP(M=sp.csr_array(M), q=np.ones(n), name=f"newton-min-cycle-{n}")
    start = np.zeros(n)
    start[0] = -1.0
    facts = {"class": "P", "symmetric": False}
    return Instance(problem, LCPPoint(z=np.zeros(n)), "published", None, facts, (LCPPoint(z=start),))


def csizmadia_degenerate(n: int) -> Instance:
    """Build Csizmadia's matrix 2I − tril(E) with q = e − Me = (0, 1, ..., n − 1), z = 0, from z = e."""
    M = 2.0 * np.eye(n) - np.tril(np.ones((n, n)))
    problem = LCP(M=M, q=np.arange(n, dtype=float), name=f"csizmadia-degenerate-{n}")
    facts = {"class": "P", "symmetric": False, "degenerate": 1}
    return Instance(problem, LCPPoint(z=np.zeros(n)), "published", None, facts, (LCPPoint(z=np.ones(n)),))


def random_degenerate(n: int) -> Instance:
    """Build M = AᵀA + B + D, B skew, D ≥ 0 diagonal; a third of the pairs has z > 0, a third w > 0, a third neither."""
    rng = generator(700 + n)
    A, B = dyadic(rng, (n, n), -5, 5), dyadic(rng, (n, n), -2, 2)
    M = A.T @ A + np.triu(B, 1) - np.triu(B, 1).T + np.diag(rng.integers(1, 20, n) / 64.0)
    kind = np.arange(n) % 3
    z = np.where(kind == 0, dyadic(rng, n, 0, 1) + 0.125, 0.0)
    p = M @ z
    size = 2.0 ** np.ceil(np.log2(np.abs(p).max()))
    w = np.where(kind == 1, size * (dyadic(rng, n, 0, 1) + 0.125), 0.0)
    problem = LCP(M=M, q=w - p, name=f"random-degenerate-{n}")
    facts = {"class": "PD nonsymmetric", "degenerate": int((kind == 2).sum())}
    return Instance(problem, LCPPoint(z=z), "planted", properties=facts)
