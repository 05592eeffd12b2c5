"""A quadratic program over a product of cones in the form of the conic solvers, scaled, and the way back.

K becomes Lorentz cones as `lorentz_rows` says. The program is scaled first: every factor by its largest entry in A,
x by `x_unit`, the objective by the size of the forces, so that tolerances mean the same in grams and in tonnes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.solvers.shared.lorentz_rows import lorentz_rows


@dataclass(frozen=True)
class ConeProgram:
    """min ½x̂ᵀPx̂ + qᵀx̂, Ax̂ + ŝ = b, ŝ in the cones; back x = x_unit x̂, y = back·Tᵀŷ."""

    problem: ConeQP
    P: Any
    q: Any
    A: Any
    b: Any
    cones: list[tuple[str, int]]
    T: Any
    x_unit: float
    back: Any

    def point(self, x: Any, y: Any) -> ConeQPPoint:
        """Return our point from x̂ and ŷ."""
        return ConeQPPoint(x=self.x_unit * x[: self.problem.p.size], y=self.back * (self.T.T @ y))


def cone_program(problem: ConeQP) -> ConeProgram:
    """Return `problem` scaled, over {0}, ℝ₊ and Lorentz cones."""
    K = problem.K
    forces = max(matrices.max_abs(problem.p), matrices.max_abs(problem.Q) * problem.x_unit) or 1.0
    unit, sizes = problem.x_unit or 1.0, problem.block_sizes
    first = np.cumsum(K.size).astype(int) - K.size.astype(int)
    radius = [K.mu[i] / (sizes[first[i]] * unit) if K.kind[i] == Cone.CYLINDER else K.mu[i] for i in range(K.kind.size)]
    cones, T, U, c = lorentz_rows(ProductCone(K.kind, K.size, np.array(radius), K.mu_r))
    scaled = sp.diags_array(1.0 / sizes) @ sp.csr_array(problem.A)
    extra = U.shape[1]
    return ConeProgram(
        problem=problem,
        P=sp.block_diag([sp.csr_array(problem.Q) * (unit / forces), sp.csr_array((extra, extra))], format="csc"),
        q=np.concatenate([problem.p / forces, np.zeros(extra)]),
        A=-sp.hstack([T @ scaled, U], format="csc"),
        b=T @ (problem.b / (sizes * unit)) + c,
        cones=cones,
        T=T,
        x_unit=unit,
        back=forces / sizes,
    )
