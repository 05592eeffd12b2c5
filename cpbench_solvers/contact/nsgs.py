"""Nonsmooth Gauss–Seidel on frictional contact: one contact after the other is solved exactly, until all agree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.foundation.kernel_cache import compiled, load_all
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput, SolverSpec, register
from cpbench_solvers.contact.by_parts import contact_spec
from cpbench_solvers.contact.relaxation import AT_FIRST, Advance, Local, Relaxation, Shape, general
from cpbench_solvers.contact.run import MethodOptions
from cpbench_solvers.contact.sweeps import (
    LOGGED,
    ROUNDED,
    AcceleratedSweeps,
    BlockRows,
    SweepState,
    conclude,
    kernel,
    work,
)


@dataclass(frozen=True)
class NSGSOptions(MethodOptions):
    """Options of nsgs. `omega` : relaxation of every contact's change. `local` : how a contact is solved. `shuffle`
    : a new random order for every sweep. `symmetric` : every other sweep goes backwards. `max_iterations` : sweeps.
    `stall_window` : sweeps without gain after which it gives up."""

    omega: float = 1.0
    local: Local = Local.EXACT
    shuffle: bool = False
    symmetric: bool = False
    stall_window: int = 10_000


@register
class NSGS(Relaxation):
    """Block Gauss–Seidel with exact one-contact solves; W may be nonsymmetric, its diagonal blocks singular.

    Converges in practice for most W ⪰ 0, linearly and slowly where contacts are hyperstatic. A contact whose
    W_NN is not positive takes a step of the natural map instead, and so does one that another local solver fails on.
    """

    spec: ClassVar[SolverSpec] = contact_spec(
        name="nsgs",
        summary="nonsmooth Gauss-Seidel, exact one-contact solves",
        method="splitting",
        citation="Jean and Moreau 1987; Jourdan, Alart and Jean 1998, CMAME 155:31",
        quick=True,
        options=NSGSOptions,
    )

    def warmup(self) -> None:
        load_all("cpbench_solvers.kernels", ("block_layout", "anderson", "contact_relaxation"))
        super().warmup()

    def solve_part(
        self, prepared: BlockRows, budget: Budget, options: NSGSOptions, start: Any, record: Record | None
    ) -> SolverOutput:
        if start is not None or record is not None or not _plain(options):
            return super().solve_part(prepared, budget, options, start, record)
        sweeps = AcceleratedSweeps(prepared, way=prepared.plain)
        limit = budget.iterations or options.max_iterations
        sweeps.sweep(min(AT_FIRST, limit), budget.tolerance)
        # most small problems are done here, in less time than it takes to prepare for more
        if sweeps.error <= budget.tolerance:
            spent = work(prepared.problem, sweeps.done, sweeps.seen)
            return conclude(prepared.problem, sweeps.best, sweeps.error, budget, Claim.INACCURATE, ROUNDED, spent)
        at = sweeps.iterate()
        at.state[LOGGED] = 0
        return self.swept(prepared, budget, options, at, np.inf, None)

    def advance(self, prepared: BlockRows, options: NSGSOptions, at: SweepState) -> Advance:
        if _fast(options):
            return _exact(prepared, options, at)
        shape = Shape(options.local, options.omega, shuffle=options.shuffle, symmetric=options.symmetric)
        return general(prepared, shape, at)


def _fast(options: NSGSOptions) -> bool:
    """Return whether there is a kernel for nothing but this."""
    return options.local is Local.EXACT and not options.symmetric


def _plain(options: NSGSOptions) -> bool:
    """Return whether the sweeps are those of `AcceleratedSweeps` without acceleration."""
    return _fast(options) and options.omega == 1.0 and not options.shuffle


def _exact(prepared: BlockRows, options: NSGSOptions, at: SweepState) -> Advance:
    """Return the fast sweeps."""
    problem, gauss_seidel = prepared.problem, kernel("gauss_seidel")
    sweeps = compiled(gauss_seidel.sweeps_3d if problem.dimension == 3 else gauss_seidel.sweeps_2d)
    order = prepared.order.copy() if options.shuffle else prepared.order
    iterate = (at.r, at.lam, order)
    relaxed = (options.omega, options.shuffle)
    return lambda tolerance, until, *progress: sweeps(*prepared.law, *iterate, *relaxed, tolerance, until, *progress)
