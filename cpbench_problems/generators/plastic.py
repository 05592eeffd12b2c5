"""Trusses whose bars yield: elastic, plastic with hardening, by the yield conditions of Maier.

Bars elongate by e = Bᵀu − λ⁺ + λ⁻ with plastic parts λ ≥ 0 and carry s = k e; Bs = f in every free joint. A bar yields
in tension at s = y + hλ⁺ and in compression at −s = y + hλ⁻: 0 ≤ λ⁺ ⟂ y − s + hλ⁺ ≥ 0, and the same for λ⁻. Elongations
are times the length of the bar, so that diagonals of cells of 3 by 4 have whole numbers. Displacements come first,
then yield stresses and loads, so that all is exact.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.linear import MLCP, MLCPPoint
from cpbench.generators.base import Instance, collection, dyadic, generator

CITATION = "Maier 1970, Meccanica 5:54; Cottle, Pang, Stone 1992, The Linear Complementarity Problem; by cpbench"


@collection("plastic-trusses", "mlcp", "elastic-plastic trusses, a third of whose bars yields", CITATION)
def build() -> list[Instance]:
    return [truss(*cells) for cells in ((1, 1), (3, 2), (6, 3))]


@collection("plastic-trusses-large", "mlcp", "trusses of up to 4·10⁴ bars", CITATION, tier="standard")
def build_large() -> list[Instance]:
    return [truss(*cells) for cells in ((25, 12), (40, 20), (100, 100))]


def bars_of(across: int, up: int) -> sp.csr_array:
    """Return B, (2 · free joints, bars): the bars of across × up cells with both diagonals, whose left side is held.

    Column of a bar from joint p to q: (q − p) at q and (p − q) at p.
    """
    number = np.arange((across + 1) * (up + 1)).reshape(across + 1, up + 1)
    position = np.column_stack(
        [np.repeat(np.arange(across + 1), up + 1) * 3.0, np.tile(np.arange(up + 1), across + 1) * 4.0]
    )
    ends = np.vstack([
        np.column_stack([number[:-1].ravel(), number[1:].ravel()]),
        np.column_stack([number[1:, :-1].ravel(), number[1:, 1:].ravel()]),
        np.column_stack([number[:-1, :-1].ravel(), number[1:, 1:].ravel()]),
        np.column_stack([number[:-1, 1:].ravel(), number[1:, :-1].ravel()]),
    ])  # fmt: skip
    along = position[ends[:, 1]] - position[ends[:, 0]]
    rows, columns, values = [], [], []
    for side, sign in ((0, -1.0), (1, 1.0)):
        for axis in (0, 1):
            rows.append(2 * ends[:, side] + axis)
            columns.append(np.arange(len(ends)))
            values.append(sign * along[:, axis])
    B = sp.csr_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(2 * number.size, len(ends))
    )
    B.eliminate_zeros()
    return sp.csr_array(B[2 * (up + 1) :])


def truss(across: int, up: int) -> Instance:
    """Build across × up cells; every third bar yields, as far as a quarter of its elongation, hardening k/4."""
    rng = generator(1300 + 50 * across + up)
    B = bars_of(across, up)
    count = B.shape[1]
    k = 2.0 ** rng.integers(-4, -1, count)
    u = dyadic(rng, B.shape[0], -2, 2)
    stretch = B.T @ u
    yields = np.arange(count) % 3 == 0
    part = np.where(yields, stretch / 4.0, 0.0)
    lam = np.concatenate([np.maximum(part, 0.0), np.maximum(-part, 0.0)])
    s, h = k * (stretch - part), k / 4.0
    yield_at = np.abs(s) - h * np.abs(part) + np.where(yields, 0.0, rng.integers(1, 9, count) / 8.0)
    stiff = sp.diags_array(k)
    both = sp.hstack([stiff, -stiff])
    C = sp.csr_array(-(B @ both))
    hardening = sp.diags_array(np.tile(h, 2))
    block = sp.vstack([both, -both]) + hardening
    w_part = np.tile(yield_at, 2)
    problem = MLCP(
        A=sp.csr_array(B @ stiff @ B.T), B=sp.csr_array(block), C=C, D=sp.csr_array(C.T), a=-(B @ s), b=w_part,
        name=f"truss-{across}x{up}",
    )  # fmt: skip
    facts = {"class": "SPD", "bars": int(count), "yielding": int((part != 0).sum())}
    return Instance(problem, MLCPPoint(u=u, v=lam), "planted", properties=facts)
