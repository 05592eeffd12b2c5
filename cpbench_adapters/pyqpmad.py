"""qpmad, called directly: qpsolvers drops what its exceptions say, and of one unknown hands it our own Q to overwrite.

qpmad returns the multipliers of the inequalities that are active. Those of the equalities, and of variables with
lb = ub, are what is left of the gradient: first Cᵀμ = Qz + p − Aᵀλ − ν on the other variables, in the sense of least
squares, then ν of the fixed ones.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from cpbench.solvers.base import Claim, SolverSpec, Trait, register
from cpbench_adapters.qp_backend import BackendAnswer, QPBackend
from cpbench_adapters.qp_standard_form import StandardForm
from cpbench_adapters.qp_tolerances import Settings

_INFEASIBLE = "infeasible"


@register
class Pyqpmad(QPBackend):
    spec = SolverSpec(
        name="pyqpmad",
        node="qp",
        summary="qpmad: dual active set of Goldfarb and Idnani with bounds of their own, dense, Q positive definite",
        method="dual active set",
        citation="Goldfarb and Idnani, Math. Programming 27 (1983); Sherikov, qpmad",
        requires=("pyqpmad",),
        install="pip install cpbench[qp]",
        licence="BSD-3-Clause",
        traits=frozenset({Trait.DETERMINISTIC}),
    )
    sparse = False
    definite = True
    claims = {
        "OK": Claim.SOLVED,
        _INFEASIBLE: Claim.INFEASIBLE,
        "MAXIMAL_NUMBER_OF_ITERATIONS": Claim.MAX_ITER,
    }

    def call(self, form: StandardForm, settings: Settings) -> BackendAnswer:
        import pyqpmad

        parameters = pyqpmad.SolverParameters()
        for name, value in settings.items():
            setattr(parameters, name, value)
        rows = [M for M in (form.A, form.G) if M is not None]
        k = 0 if form.b is None else form.b.size
        b, h = (np.zeros(0) if v is None else v for v in (form.b, form.h))
        matrix = np.array(np.vstack(rows), order="F") if rows else None
        lower, upper = np.concatenate([b, np.full(h.size, -np.inf)]), np.concatenate([b, h])
        x, solver = np.zeros(form.q.size), pyqpmad.Solver()
        try:
            status = solver.solve(
                x,
                np.array(form.P, order="F"),  # a copy: it becomes the Cholesky factor
                form.q,
                form.lb,
                form.ub,
                matrix,
                lower if rows else None,
                upper if rows else None,
                parameters,
            )
        except RuntimeError as cause:
            if "Infeasible" in str(cause):
                return BackendAnswer(status=_INFEASIBLE, remarks=(str(cause),))
            raise
        active = solver.get_inequality_dual()
        bounds = 0 if form.lb is None else form.q.size
        every = np.zeros(bounds + k + h.size)
        # rows of G have no lower side; a lower bound counts negative (qpsolvers' z_box)
        every[active.indices] = np.where(active.is_lower, -active.dual, active.dual)
        z_box, z = every[:bounds], every[bounds + k :]
        gradient = form.P @ x + form.q
        if bounds:
            gradient += z_box
        if form.G is not None:
            gradient += form.G.T @ z
        fixed = form.lb == form.ub if bounds else np.zeros(x.size, dtype=bool)
        y = np.zeros(k)
        if form.A is not None and not fixed.all():
            y = sla.lstsq(form.A[:, ~fixed].T, -gradient[~fixed], check_finite=False)[0]
        if fixed.any():
            z_box[fixed] = -(gradient + (0.0 if form.A is None else form.A.T @ y))[fixed]
        return BackendAnswer(
            status=status.name,
            x=x,
            z=z,
            y=y,
            z_box=z_box,
            counters={"iterations": int(solver.get_num_iterations())},
        )
