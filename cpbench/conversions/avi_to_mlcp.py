"""AVI → MLCP by multipliers of the polyhedron.

Source  −(Mz + q) ∈ N_X(z),  X = {Az ≥ b, Cz = d, lb ≤ z ≤ ub}.
Target  with finite bounds among the rows E, e and F, g (as in qp-mlcp), u = (z, μ) free, v = λ:
        Mz + q − Fᵀμ − Eᵀλ = 0,  Fz − g = 0,  0 ≤ λ ⟂ Ez − e ≥ 0.
Lift    z, λ and μ of A and C.        Push  the same, with ν = Mz + q − Aᵀλ − Cᵀμ for the bounds that are
        pressed.
Kind    equivalent: X is a polyhedron, so the multipliers exist for every M.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import kkt
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.avi import AVI, AVIPoint
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.mlcp import MLCP, MLCPPoint


@conversions.register("avi-mlcp")
@dataclass(frozen=True)
class AVItoMLCP(Conversion):
    """Multipliers of a polyhedron.

    Trace: sizes and indices as qp-mlcp; `M`, `q` and the set for the multipliers of `push`.
    """

    name = "avi-mlcp"
    source = "avi"
    target = "mlcp"
    equation = "(22) → (14)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def apply(self, problem: AVI) -> tuple[MLCP, Trace]:
        constraints = kkt.rows(problem, problem.M)
        kept = {"M": problem.M, "q": problem.q, **kkt.polyhedron(problem)}
        return kkt.conditions(problem.M, problem.q, constraints), {**constraints.sizes, **kept}

    def lift(self, point: MLCPPoint, trace: Trace) -> AVIPoint:
        z, equality = np.split(point.u, [trace["n"]])
        lam, mu, _ = kkt.split(point.v, equality, trace)
        return AVIPoint(z=z, lam=lam, mu=mu)

    def push(self, point: AVIPoint, trace: Trace) -> MLCPPoint:
        z, lam, mu = point.z, point.lam, point.mu
        nu = kkt.pressing(trace, z, lam, mu)
        inequality, equality = kkt.join(lam, mu, nu, trace)
        return MLCPPoint(u=np.concatenate([z, equality]), v=inequality)
