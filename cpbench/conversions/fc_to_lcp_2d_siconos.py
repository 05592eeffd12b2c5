"""Frictional contact → LCP in two dimensions, three rows a contact (the form of Siconos' fc2d_to_lcp).

Source  u = Wr + q, contact law with r = (r_N, r_T).
Target  z = (r_N, r_T + μ r_N, u_T⁻) a contact, where u_T = u_T⁺ − u_T⁻:
        M_c = [[W_NN − μW_NT, W_NT, 0], [W_TN − μW_TT, W_TT, 1], [2μ, −1, 0]],  q = (q_N, q_T, 0).
Lift    r = (z₁, z₂ − μz₁).        Push  z = (r_N, r_T + μ r_N, max(−u_T, 0)).
Kind    equivalent. Another LCP than (47)-(48), which are fc-lcp-2d: smaller, but not copositive where that one is, so
        that Lemke's method may end on a ray.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from cpbench.conversions.base import Conversion, conversions
from cpbench.conversions.congruence import repeat
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix

_SELECT = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_SHEAR = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
_OWN = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
_FRICTION = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])


@conversions.register("fc-lcp-2d-siconos")
@dataclass(frozen=True)
class FCtoLCP2DSiconos(Conversion):
    """Plane contact in three complementarities. Trace: `W`, `q`, `mu`."""

    name = "fc-lcp-2d-siconos"
    source = "fc"
    target = "lcp"
    equation = "Siconos fc2d_to_lcp"
    kind = Kind.EQUIVALENT
    cost = 3.0

    def obstacle(self, problem: FrictionContact) -> str | None:
        if problem.dimension == 2:
            return None
        return f"the problem is {problem.dimension}-dimensional; use fc-lcp-inner or fc-lcp-outer, which approximate it"

    def apply(self, problem: FrictionContact) -> tuple[LCP, Trace]:
        self.require(problem)
        W, q, mu = problem.W, problem.q, problem.mu
        rows = repeat(_SELECT, np.ones(mu.size))
        columns = sp.csr_array(rows + repeat(_SHEAR, -mu))  # r = columns @ z
        own = sp.csr_array(repeat(_OWN, np.ones(mu.size)) + repeat(_FRICTION, 2.0 * mu))
        if matrices.is_sparse(W):
            M: Matrix = sp.csr_array(rows.T @ W @ columns + own)
        else:
            M = rows.T @ (columns.T @ matrices.dense(W).T).T + matrices.dense(own)
        return LCP(M=M, q=rows.T @ q), {"W": W, "q": q, "mu": mu}

    def lift(self, point: LCPPoint, trace: Trace) -> FCPoint:
        z = point.z.reshape(-1, 3)
        return FCPoint(r=np.column_stack([z[:, 0], z[:, 1] - trace["mu"] * z[:, 0]]).ravel())

    def push(self, point: FCPoint, trace: Trace) -> LCPPoint:
        u = (trace["W"] @ point.r + trace["q"]).reshape(-1, 2)
        r = point.r.reshape(-1, 2)
        z = np.column_stack([r[:, 0], r[:, 1] + trace["mu"] * r[:, 0], np.maximum(-u[:, 1], 0.0)])
        return LCPPoint(z=z.ravel())
