"""Nonsmooth Gauss–Seidel on contacts with rolling friction: one after the other is solved exactly, until all agree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import RollingFrictionContact
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput, SolverSpec, register
from cpbench.solvers.shared.progress import Progress
from cpbench_solvers.contact.by_parts import SolverByParts
from cpbench_solvers.contact.rolling_blocks import RollingBlocks, rolling_blocks
from cpbench_solvers.contact.run import MethodOptions
from cpbench_solvers.contact.sweeps import conclude
from cpbench_solvers.kernels import rolling_gauss_seidel
from cpbench_solvers.traits import ITERATIVE

BLOCKS_A_CALL = 400_000
"""Blocks, and contacts, between two looks at the clock."""


@dataclass(frozen=True)
class NSGSRollingOptions(MethodOptions):
    """Options of nsgs-rfc. `omega` : relaxation of every contact's change. `shuffle` : a new random order in every
    sweep. `max_iterations` : sweeps. `stall_window` : sweeps without gain after which it gives up."""

    omega: float = 1.0
    shuffle: bool = False
    stall_window: int = 10_000


@register
class NSGSRolling(SolverByParts):
    """Block Gauss–Seidel with exact one-contact solves; W may be nonsymmetric, its diagonal blocks singular.

    Converges in practice for most W ⪰ 0, linearly and slowly where contacts are hyperstatic.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="nsgs-rfc",
        node="rfc",
        summary="nonsmooth Gauss-Seidel, exact one-contact solves with rolling friction",
        method="splitting",
        citation="Jean and Moreau 1987; Acary and Bourrier 2021, Eur. J. Mech. A/Solids 85:104046",
        traits=ITERATIVE,
        options=NSGSRollingOptions,
    )

    def prepare(self, problem: RollingFrictionContact, budget: Budget, options: NSGSRollingOptions) -> RollingBlocks:
        return rolling_blocks(problem)

    def solve_part(
        self, prepared: RollingBlocks, budget: Budget, options: NSGSRollingOptions, start: Any, record: Record | None
    ) -> SolverOutput:
        problem, lengths = prepared.problem, prepared.lengths
        r = np.zeros(problem.q.size) if start is None else start.r / lengths
        rolling = rolling_gauss_seidel
        sweeps, data = rolling.sweeps, (*prepared.matrix, *prepared.law, *prepared.local)
        limit = budget.iterations or options.max_iterations
        best, state, measured = r.copy(), np.array([0, 0, 0, budget.seed, 0]), np.full(2, np.inf)
        iterate = (r, best, np.zeros((problem.nc, 2)), np.arange(problem.nc), options.omega, options.shuffle)
        progress, done, error = Progress(options.stall_window, budget.seconds, "sweeps"), 0, np.inf
        piece = max(50, BLOCKS_A_CALL // (prepared.matrix[1].size + 10 * problem.nc))
        claim, message = Claim.MAX_ITER, f"{limit} sweeps"
        while True:
            until, state[rolling.RISKED] = min(limit, done + piece), 0
            going = True
            while going:  # an observer sees every evaluation, and changes nothing
                sweeps(*data, *iterate, budget.tolerance, until, state, measured, record is not None)
                done, error = int(state[rolling.ITERATION]), float(measured[rolling.ERROR])
                ended = error <= budget.tolerance or not np.isfinite(error)
                going = not ended and done < until and state[rolling.RISKED] < rolling.HARD_A_CALL
                if record is not None:
                    record(done, error, lambda: FCPoint(lengths * r))
            if measured[rolling.LEAST] <= budget.tolerance or done >= limit:
                break
            why = progress.trouble(done, error)
            if why is not None:
                claim, message = Claim.FAILED, why
                break
        counters = {"iterations": done, "projections": done * problem.nc, "hard_contacts": int(state[rolling.HARD])}
        least = float(measured[rolling.LEAST])
        return conclude(problem, lengths * best, least, budget, claim, message, counters)
