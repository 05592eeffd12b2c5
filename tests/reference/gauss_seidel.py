"""reference-gauss-seidel: nonsmooth Gauss-Seidel by projections, of a local contact problem."""

from __future__ import annotations

import time
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.local_contact import FCPoint, FrictionContact
from cpbench.foundation.cones import de_saxce, project_friction_cone
from cpbench.foundation.matrices import dense
from cpbench.solvers import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register


@register
class ReferenceGaussSeidel(Solver):
    """Steps r_i <- P(r_i - û_i/|W_ii|) contact after contact, û = u + μ|u_T| n, P the projection on the cone."""

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="reference-gauss-seidel",
        node="fc",
        summary="Gauss-Seidel by projections on the cones, short rather than fast",
        method="Gauss-Seidel",
        citation="Jourdan, Alart and Jean 1998, CMAME 155:31",
        traits=frozenset({Trait.DETERMINISTIC, Trait.WARM_START, Trait.HISTORY}),
    )

    def solve(
        self,
        prepared: FrictionContact,
        budget: Budget,
        options: Any,
        start: FCPoint | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        W, q, mu = dense(prepared.W), prepared.q, prepared.mu
        d, end = q.size // max(mu.size, 1), time.monotonic() + budget.seconds
        places = [slice(d * i, d * i + d) for i in range(mu.size)]
        sizes = [float(np.linalg.norm(W[place, place])) or 1.0 for place in places]
        r = np.zeros(q.size) if start is None else start.r.copy()
        most, sweep = budget.iterations or 10_000, 0
        while True:
            point = FCPoint(r=r.copy())
            error = prepared.residuals(point, budget.tolerance).error
            if record is not None:
                record(sweep, error, lambda: point)  # noqa: B023 - called at once or never
            if error <= budget.tolerance or sweep >= most or time.monotonic() > end:
                break
            sweep += 1
            for i, place in enumerate(places):
                u = (W[place] @ r + q[place])[None]
                step = r[place][None] - de_saxce(u, mu[i : i + 1]) / sizes[i]
                r[place] = project_friction_cone(step, mu[i : i + 1])[0]
        claim = Claim.SOLVED if error <= budget.tolerance else Claim.MAX_ITER
        return SolverOutput(claim=claim, point=point, counters={"iterations": sweep})
