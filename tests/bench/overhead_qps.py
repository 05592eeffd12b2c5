"""The quadratic programs that all three harnesses solve: min ½xᵀPx + qᵀx subject to Gx ≤ h, one file each."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from cpbench import storage
from cpbench.formulations import QP
from cpbench.solvers.base import Budget
from cpbench_adapters.qp_tolerances import translate

BACKENDS = ("daqp", "piqp", "proxqp")
"""Dense backends that come with cpbench, each called through qpsolvers by every harness."""
TOLERANCE = 1e-6
SETTINGS = {name: translate(name, Budget(tolerance=TOLERANCE, seconds=10.0)) for name in BACKENDS}
"""What cpbench gives each backend, so that all harnesses ask for the same solves."""
FOLDER = "CPBENCH_OVERHEAD_FOLDER"
"""Environment variable with the folder of the problems, for the harnesses that take none on their command line."""


def write(folder: Path, count: int, n: int = 20, m: int = 30) -> None:
    """Strictly convex QPs of n unknowns and m constraints; a random point satisfies them."""
    folder.mkdir()
    for seed in range(count):
        rng = np.random.default_rng(seed)
        F, A = rng.standard_normal((n, n)), rng.standard_normal((m, n))
        b = A @ rng.standard_normal(n) - rng.random(m)
        problem = QP.build(Q=F @ F.T + np.eye(n), p=rng.standard_normal(n), A=A, b=b, name=f"random{seed}")
        storage.save(problem, folder / f"random{seed}.h5")


def paths() -> list[str]:
    return sorted(map(str, Path(os.environ[FOLDER]).glob("*.h5")))


def read(path: str) -> dict[str, Any]:
    """P, q, G, h of a file, by h5py alone."""
    with h5py.File(path) as file:
        data = file["cpbench"]
        vectors = data["vectors"]
        return {"P": data["Q"][()], "q": vectors["p"][()], "G": -data["A"][()], "h": -vectors["b"][()]}
