"""Networks of resistors, ideal diodes and closed switches, at rest: Kirchhoff's laws, and a diode conducts or blocks.

u are the voltages of the nodes of a grid, v ≥ 0 the currents through diodes from node p to node q with threshold e:
Gu + Cv = I with C the incidence of the diodes (+1 at p, −1 at q), and 0 ≤ v ⟂ e − (u_p − u_q) ≥ 0. Voltages and
currents are drawn first, then thresholds and sources, so that all is exact. G is positive definite, so that voltages
are unique.

A closed switch from p to q has no resistance: u_p = u_q, and its current j is one more unknown without bounds,
Gu + Sj + Cv = I with its incidence S. An open switch is no edge.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.linear import MLCP, MLCPPoint
from cpbench.foundation.matrices import Vector
from cpbench.generators.base import Instance, collection, dyadic, generator

CITATION = "Leenaerts and van Bokhoven 1998, Piecewise Linear Modeling and Analysis; planted by cpbench"
SWITCHED = (
    "Acary, Bonnefon and Brogliato 2011, Nonsmooth Modeling and Simulation for Switched Circuits; planted by cpbench"
)


@collection("diode-circuits", "mlcp", "grids of resistors and ideal diodes at rest", CITATION)
def build() -> list[Instance]:
    return [grid(side) for side in (3, 5, 9, 15)]


@collection("diode-circuits-large", "mlcp", "grids of up to 6·10⁴ nodes", CITATION, tier="standard")
def build_large() -> list[Instance]:
    return [grid(side) for side in (40, 70, 250)]


@collection("switched-circuits-large", "mlcp", "grids of up to 3,600 nodes with switches", SWITCHED, tier="standard")
def build_switched() -> list[Instance]:
    return [grid(side, switched=True) for side in (20, 30, 60)]


def grid(side: int, *, switched: bool = False) -> Instance:
    """Build side × side nodes with resistors between neighbours and to the ground, and a diode beside every second
    resistor, from the higher voltage to the lower; half of the diodes conduct.

    switched : there is a closed switch beside every eighth resistor along a row, none next to another.
    """
    rng = generator(1200 + side)
    number = np.arange(side * side).reshape(side, side)
    pairs = np.vstack([
        np.column_stack([number[:, :-1].ravel(), number[:, 1:].ravel()]),
        np.column_stack([number[:-1].ravel(), number[1:].ravel()]),
    ])  # fmt: skip
    edges, nodes = np.arange(len(pairs)), side * side
    ends = sp.csr_array(
        (np.repeat([1.0, -1.0], len(pairs)), (pairs.T.ravel(), np.tile(edges, 2))), shape=(nodes, len(pairs))
    )
    G = ends @ sp.diags_array(2.0 ** rng.integers(-2, 3, len(pairs))) @ ends.T + sp.eye_array(nodes) / 16.0
    closed = np.column_stack([number[:, :-1:8].ravel(), number[:, 1::8].ravel()]) if switched else pairs[:0]
    u = dyadic(rng, nodes, 0, 8)
    u[closed[:, 1]] = u[closed[:, 0]]
    drop = ends.T @ u
    beside = edges % 2 == 0
    C = sp.csr_array(ends[:, beside] @ sp.diags_array(np.where(drop[beside] < 0, -1.0, 1.0)))
    conducts = rng.integers(0, 2, C.shape[1]) == 1
    size = dyadic(rng, C.shape[1], 0, 2) + 0.125
    v, w = np.where(conducts, size, 0.0), np.where(conducts, 0.0, size)
    facts = {"class": "monotone", "diodes": int(v.size), "conducting": int(conducts.sum())}
    name = f"diode-grid-{side}x{side}"
    if switched:
        G, C, u = _with_switches(G, C, u, closed, dyadic(rng, len(closed), -2, 2))
        facts, name = {**facts, "switches": len(closed)}, f"switched-grid-{side}x{side}"
    problem = MLCP(
        A=sp.csr_array(G), B=sp.csr_array((v.size, v.size)), C=C, D=sp.csr_array(-C.T), a=-(G @ u) - C @ v,
        b=w + C.T @ u, name=name,
    )  # fmt: skip
    return Instance(problem, MLCPPoint(u=u, v=v), "planted", properties=facts)


def _with_switches(
    G: sp.csr_array, C: sp.csr_array, u: Vector, closed: np.ndarray, currents: Vector
) -> tuple[sp.csr_array, sp.csr_array, Vector]:
    """Border G by the incidence of closed switches, given by their two nodes, and extend C and u by their currents."""
    count = len(closed)
    S = sp.csr_array(
        (np.repeat([1.0, -1.0], count), (closed.T.ravel(), np.tile(np.arange(count), 2))), shape=(u.size, count)
    )
    bordered = sp.csr_array(sp.block_array([[G, S], [-S.T, None]]))
    return bordered, sp.csr_array(sp.vstack([C, sp.csr_array((count, C.shape[1]))])), np.concatenate([u, currents])
