"""Elastic cubes on a plane, with friction: contact problems whose W has full rank, for `published_ordering.py`.

    python tests/bench/flexible_blocks.py FOLDER [--cells 2,3,5,8] [--young 1e2,1e4]

Cubes of unit edge and mass density, ν = 0.3, in eight-node bricks, thrown obliquely and spinning onto a rigid plane:
one step of h = 0.01 of implicit Euler, every node of the bottom a contact with μ = 0.3. The matrix of the step is
M + h²K: nodes in contact are coupled by elasticity, the more the stiffer, and none is redundant. These are made to be
like the sets Cubes_H8 of Acary, Brémond and Huber, which are not among the data at hand; they are not those.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from cpbench import storage
from cpbench.formulations import FrictionContact
from cpbench.formulations.base import Info

POISSON, STEP, MU = 0.3, 0.01, 0.3
CORNERS = np.array([[i, j, k] for k in (0, 1) for j in (0, 1) for i in (0, 1)])


def element(a: float, young: float) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and mass (24, 24) of a brick of edge a, by two Gauss points each way."""
    shear = young / (2 * (1 + POISSON))
    lame = young * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    C = np.diag([2 * shear] * 3 + [shear] * 3)
    C[:3, :3] += lame
    K, M = np.zeros((2, 24, 24))
    points = (0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3))
    for x in np.array(np.meshgrid(points, points, points)).reshape(3, -1).T:
        factors = np.where(CORNERS == 1, x, 1 - x)
        N = factors.prod(axis=1)
        signs = np.where(CORNERS == 1, 1.0, -1.0)
        dN = np.stack([signs[:, d] * np.delete(factors, d, axis=1).prod(axis=1) for d in range(3)]) / a
        B = np.zeros((6, 24))
        for d in range(3):
            B[d, d::3] = dN[d]
        for row, (d, e) in enumerate(((0, 1), (1, 2), (2, 0)), start=3):
            B[row, d::3], B[row, e::3] = dN[e], dN[d]
        K += a**3 / 8 * B.T @ C @ B
        shape = np.kron(N, np.eye(3))
        M += a**3 / 8 * shape.T @ shape
    return K, M


def cube(cells: int, young: float) -> FrictionContact:
    """(cells + 1)² contacts; r (N, T₁, T₂) are impulses, u velocities at the end of the step."""
    side = cells + 1
    nodes = np.arange(side**3).reshape(side, side, side)  # by z, y, x
    K, M = element(1.0 / cells, young)
    places = np.array(
        [[nodes[z + k, y + j, x + i] for i, j, k in CORNERS] for z, y, x in np.ndindex(cells, cells, cells)]
    )
    dofs = (3 * places[:, :, None] + np.arange(3)).reshape(len(places), 24)
    rows, columns = np.repeat(dofs, 24, axis=1).ravel(), np.tile(dofs, 24).ravel()
    step = np.tile((M + STEP**2 * K).ravel(), len(places))
    n = 3 * side**3
    A = sp.csc_array(sp.coo_array((step, (rows, columns)), shape=(n, n)))
    position = np.stack(np.meshgrid(*[np.arange(side) / cells] * 3, indexing="ij")[::-1], axis=-1).reshape(-1, 3)
    free = np.array([0.6, 0.2, -1.0]) + np.cross([0.3, -0.8, 0.5], position - 0.5)
    bottom = nodes[0].ravel()
    contact = (3 * bottom[:, None] + [2, 0, 1]).ravel()
    W = spla.splu(A).solve(np.eye(n)[:, contact])[contact]
    return FrictionContact(
        W=0.5 * (W + W.T),
        q=free.ravel()[contact],
        mu=np.full(bottom.size, MU),
        dimension=3,
        name=f"cube-{cells}-{young:g}",
        info=Info(family="flexible"),
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cells", default="2,3,5,8", help="along an edge")
    parser.add_argument("--young", default="1e2,1e4", help="moduli of elasticity")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    for cells in map(int, arguments.cells.split(",")):
        for young in map(float, arguments.young.split(",")):
            storage.save(cube(cells, young), arguments.folder / f"cube-{cells}-{young:g}.h5", force=True)
