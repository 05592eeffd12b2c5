"""Projected Gauss–Seidel of Pinocchio on frictional contact.

A contact's normal reaction takes a Gauss–Seidel step with 1/W_NN, then its tangential one with 1/min(W_T1T1, W_T2T2)
and is cut back to the disk of radius μr_N. That step is too long where the tangential block is far from a multiple of
I, and the iteration may then cycle.

Tolerance ε: Pinocchio stops when, for every contact just after its own step, dist(û_c, K*_μ) and |û_cᵀr_c| are at most
ε/100 in scaled data (`pinocchio_contacts`); what later contacts of the sweep do to u_c is not looked at, so that a
first sweep may pass with an answer that is none. The claim is Pinocchio's own word.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation import matrices
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.stopping import Stopping
from cpbench_adapters import pinocchio_contacts
from cpbench_adapters.pinocchio_contacts import PinocchioContacts

SHARE = 0.01
"""Part of our tolerance that its criteria get: after a sweep the error was up to 49 times what it had seen in it."""
PRODUCTS_A_CALL = 2e7
"""Entries of W that a call may look at, some 10 ms: Pinocchio has no clock, and a sweep depends on r alone."""
LARGEST = 16_384
"""Rows of W up to which three dense copies (2 GB each) are made."""
STACK, PAGE = 16 * 2**20, 4096
"""Bytes of stack for all but W; what its size is a multiple of."""
SHALLOW = 2**21
"""Bytes of W that any stack holds."""


@dataclass(frozen=True)
class PinocchioPGSOptions:
    """Options of pinocchio-pgs. `over_relaxation` : ω in ]0, 2[. `max_iterations` : sweeps."""

    over_relaxation: float = 1.0
    max_iterations: int = 100_000


@register
class PinocchioPGS(Solver):
    """Dense; sweeps are done some at a time, so that the time limit is kept."""

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="pinocchio-pgs",
        node="fc",
        summary="projected Gauss-Seidel on contacts, Pinocchio",
        method="splitting",
        citation="Carpentier et al., SII 2019; Carpentier, Le Lidec and Montaut, RSS 2024",
        requires=("pinocchio",),
        install="pip install pin",
        licence="BSD-3-Clause",
        traits=frozenset({Trait.WARM_START, Trait.DETERMINISTIC}),
        options=PinocchioPGSOptions,
        known_failures={
            "case-frictionless-3d": "claims solved after one sweep with error 6.5e-2: a contact that met its law when "
            "its turn came is not measured again after the others moved",
            "check_infeasibility_is_proved_or_not_claimed_solved": "squeezed: u_1N + u_2N = -2 for all r, and either "
            "contact has u_N = 0 right after its own step: claimed solved after one sweep",
        },
    )

    def obstacle(self, problem: FrictionContact) -> str | None:
        if problem.q.size > LARGEST:
            return f"needs W dense: {problem.q.size} rows > {LARGEST}; use pinocchio-admm or nsgs"
        return pinocchio_contacts.obstacle(problem)

    def stopping(self, tolerance: float, problem: FrictionContact | None = None) -> Stopping:
        test = "dist(û_c, K*_μ) and |û_cᵀr_c| of every contact just after its own step, of scaled data"
        differs = "what later contacts of the sweep do to a contact, so that one sweep may pass"
        return pinocchio_contacts.stopping(test, SHARE * tolerance, differs, math.inf)

    def setup(self, problem: FrictionContact, budget: Budget, options: PinocchioPGSOptions) -> Any:
        import pinocchio as pin

        model = pinocchio_contacts.contacts(problem)
        return model, pin.DelassusOperatorDense(np.asfortranarray(matrices.dense(model.G)))

    def solve(
        self,
        prepared: tuple[PinocchioContacts, Any],
        budget: Budget,
        options: PinocchioPGSOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        import pinocchio as pin

        model, delassus = prepared
        n = model.g.size
        if n == 0:
            return SolverOutput(claim=Claim.SOLVED, point=FCPoint(np.zeros(0)), counters={"iterations": 0})
        settings, result, solver = pin.PGSSolverSettings(), pin.PGSSolverResult(), pin.PGSConstraintSolver(n)
        pinocchio_contacts.set_tolerances(settings, self.stopping(budget.tolerance))
        settings.over_relaxation = options.over_relaxation
        limit = budget.iterations or options.max_iterations
        deadline = time.monotonic() + budget.seconds
        x = np.zeros(n) if start is None else model.guess(start.r)
        done, converged = 0, False
        while not converged and done < limit and time.monotonic() < deadline:
            sweeps = min(limit - done, max(1, int(PRODUCTS_A_CALL / n**2)))
            settings.max_iterations = sweeps - 1  # its loop has one more
            result.setConstraintImpulseGuess(x)
            converged = _deep(n, solver.solve, delassus, model.g, model.models, model.data, settings, result)
            x = np.array(result.retrieveConstraintImpulses())
            done += min(int(result.iterations) + 1, sweeps)
        counters = {"iterations": done, "projections": done * model.problem.nc}
        if not np.isfinite(x).all():
            return SolverOutput(claim=Claim.FAILED, counters=counters, message=f"not finite after {done} sweeps")
        return SolverOutput(
            claim=Claim.SOLVED if converged else Claim.MAX_ITER,
            point=FCPoint(model.reactions(x)),
            counters=counters,
            message=f"dual feasibility {result.dual_feasibility:.1e}, complementarity {result.complementarity:.1e}",
        )

    def warmup(self) -> None:
        self.run(FrictionContact(W=np.eye(3), q=np.array([-1.0, 0.0, 0.0]), mu=np.array([0.5])))


def _deep(n: int, solve: Callable[..., bool], *arguments: Any) -> bool:
    """Run `solve(*arguments)` where a copy of W fits on the stack.

    Pinocchio 4.1 makes one there: with the usual 8 MB, W of 1024 rows ends in a segmentation fault.
    """
    if 8 * n**2 <= SHALLOW:
        return solve(*arguments)
    before = threading.stack_size(8 * n**2 // PAGE * PAGE + STACK)
    try:
        with ThreadPoolExecutor(max_workers=1) as pool:
            return pool.submit(solve, *arguments).result()
    finally:
        threading.stack_size(before)
