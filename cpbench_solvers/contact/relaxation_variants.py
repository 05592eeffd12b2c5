"""Relaxations that do less for a contact, or all contacts at once: projected SOR and block Jacobi."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cpbench.solvers.base import SolverSpec, register
from cpbench_solvers.contact.by_parts import contact_spec
from cpbench_solvers.contact.relaxation import Advance, Local, Relaxation, Shape, general
from cpbench_solvers.contact.run import MethodOptions
from cpbench_solvers.contact.sweeps import BlockRows, SweepState


@dataclass(frozen=True)
class PSORContactOptions(MethodOptions):
    """Options of psor-fc. `omega` : times ρ_c = 1/‖W_cc‖, the length of a projection. `shuffle` : a new random order
    for every sweep. `symmetric` : every other sweep goes backwards. `max_iterations` : sweeps. `stall_window` :
    sweeps without gain after which it gives up."""

    omega: float = 1.5
    shuffle: bool = False
    symmetric: bool = False
    stall_window: int = 10_000


@register
class PSORContact(Relaxation):
    """r_c ← P_K(r_c − ωρ_c û_c), contact after contact with the newest velocities: no local problem is solved.

    A sweep costs little and does little where normal and tangents of a contact are coupled.
    """

    spec: ClassVar[SolverSpec] = contact_spec(
        name="psor-fc",
        summary="projected successive over-relaxation: one projection of every contact a sweep",
        method="splitting",
        citation="De Saxcé and Feng 1998, Math. Comput. Modelling 28:225; Cryer 1971, SIAM J. Control 9:385",
        options=PSORContactOptions,
        by_default=False,
    )

    def advance(self, prepared: BlockRows, options: PSORContactOptions, at: SweepState) -> Advance:
        shape = Shape(Local.PROJECTION, options.omega, shuffle=options.shuffle, symmetric=options.symmetric)
        return general(prepared, shape, at)


@dataclass(frozen=True)
class JacobiContactOptions(MethodOptions):
    """Options of jacobi-fc. `omega` : relaxation of every contact's change, halved whenever the error grows fourfold
    or gains nothing. `local` : how a contact is solved. `max_iterations` : sweeps. `stall_window` : sweeps without
    gain after which it gives up."""

    omega: float = 1.0
    local: Local = Local.EXACT
    stall_window: int = 10_000


@register
class JacobiContact(Relaxation):
    """All contacts are solved with the velocities of the last sweep; goes back to its best point where that diverges.

    What runs in parallel elsewhere. As ω falls, so does the speed: with many contacts a body it needs many sweeps.
    """

    spec: ClassVar[SolverSpec] = contact_spec(
        name="jacobi-fc",
        summary="block Jacobi with exact one-contact solves and a relaxation that adapts",
        method="splitting",
        citation="Acary and Brogliato 2008, Springer LNACM 35, chapter 13",
        options=JacobiContactOptions,
        by_default=False,
    )

    def advance(self, prepared: BlockRows, options: JacobiContactOptions, at: SweepState) -> Advance:
        return general(prepared, Shape(options.local, options.omega, simultaneous=True), at)
