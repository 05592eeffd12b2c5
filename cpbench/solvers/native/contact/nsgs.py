"""Nonsmooth Gauss–Seidel on frictional contact: one contact after the other is solved exactly, until all agree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cpbench.formulations.fc import FrictionContact
from cpbench.kernel_cache import compiled
from cpbench.matrices import Vector
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench.solvers.native.contact.contact_relaxation import TRAITS, Advance, Local, Relaxation, Shape, general
from cpbench.solvers.native.contact.contact_sweeps import BlockRows, kernel
from cpbench.solvers.options import fixed, searched


@dataclass(frozen=True)
class NSGSOptions:
    """`omega` : relaxation of every contact's change. `local` : how a contact is solved. `shuffle` : a new random order
    for every sweep. `symmetric` : every other sweep goes backwards. `max_iterations` : sweeps. `stall_window` : sweeps
    without gain after which it gives up."""

    omega: float = searched(1.0, low=0.5, high=1.9)
    local: Local = Local.EXACT
    shuffle: bool = False
    symmetric: bool = False
    max_iterations: int = fixed(100_000)
    stall_window: int = fixed(10_000)


@register
class NSGS(Relaxation):
    """Block Gauss–Seidel with exact one-contact solves; W may be nonsymmetric, its diagonal blocks singular.

    Converges in practice for most W ⪰ 0, linearly and slowly where contacts are hyperstatic. A contact whose
    W_NN is not positive takes a step of the natural map instead, and so does one that another local solver fails on.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="nsgs",
        node="fc",
        summary="nonsmooth Gauss-Seidel, exact one-contact solves",
        method="splitting",
        citation="Jean and Moreau 1987; Jourdan, Alart and Jean 1998, CMAME 155:31",
        traits=TRAITS,
        options=NSGSOptions,
    )

    def setup(self, problem: FrictionContact, budget: Budget, options: NSGSOptions) -> BlockRows:
        if not _fast(options):
            kernel("contact_relaxation")  # so that it is not loaded, nor compiled the first time, while solving
        return super().setup(problem, budget, options)

    def advance(self, prepared: BlockRows, budget: Budget, options: NSGSOptions, r: Vector) -> Advance:
        if _fast(options):
            return _exact(prepared, options, r)
        shape = Shape(options.local, options.omega, shuffle=options.shuffle, symmetric=options.symmetric)
        return general(prepared, shape, r)


def _fast(options: NSGSOptions) -> bool:
    """Whether there is a kernel for nothing but this."""
    return options.local is Local.EXACT and not options.symmetric


def _exact(prepared: BlockRows, options: NSGSOptions, r: Vector) -> Advance:
    """The fast sweeps."""
    problem, gauss_seidel = prepared.problem, kernel("gauss_seidel")
    sweeps = compiled(gauss_seidel.sweeps_3d if problem.dimension == 3 else gauss_seidel.sweeps_2d)
    order = prepared.order.copy() if options.shuffle else prepared.order
    iterate = (r, np.zeros(problem.mu.size), order)
    relaxed = (options.omega, options.shuffle)
    return lambda tolerance, until, *progress: sweeps(*prepared.law, *iterate, *relaxed, tolerance, until, *progress)
