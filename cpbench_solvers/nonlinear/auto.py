"""Automatic choices of the nonlinear nodes: Newton's methods first, those that only need F after them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from cpbench.formulations.linear import AVI, AVIPoint
from cpbench.formulations.nonlinear import MiCP, MiCPPoint
from cpbench.formulations.variational import VI, VIPoint
from cpbench.foundation import matrices
from cpbench.solvers.base import SolverSpec, register
from cpbench_solvers.automatic import NEARER, AutomaticChoice, Neighbour, SolverPhase, automatic_spec


@register
class AutoMiCP(AutomaticChoice):
    """Newton's method on the active set, the Fischer–Burmeister equation, a path search, the normal map, and
    Josephy–Newton: where one stops at a point that is no solution, the next one's merit function or path leads
    elsewhere.
    """

    spec: ClassVar[SolverSpec] = automatic_spec(
        "micp", "auto-micp", "Newton's methods on boxes, the next where one has stopped"
    )
    worth: ClassVar[float] = NEARER
    members: ClassVar[tuple[str, ...]] = (
        "newton-min-micp",
        "newton-fb-micp",
        "path-search",
        "newton-normal-map",
        "josephy-newton",
    )

    def phases(self, problem: MiCP) -> Sequence[SolverPhase]:
        affine = [SolverPhase("auto-avi", via=_box)] if problem.F.compiled.affine else []
        return [*affine, *super().phases(problem)]


@register
class AutoVI(AutomaticChoice):
    """Newton's method; then extragradients, which need monotonicity and no derivative."""

    spec: ClassVar[SolverSpec] = automatic_spec("vi", "auto-vi", "Newton's method, then projections")
    members: ClassVar[tuple[str, ...]] = ("newton-vi", "extragradient-vi")

    def phases(self, problem: VI) -> Sequence[SolverPhase]:
        flat = problem.F.compiled.affine and problem.g.compiled.affine and problem.only_box
        box = problem.only_box and not (problem.b.size or problem.d.size or problem.g.rows)
        neighbours = [SolverPhase("auto-avi", via=_polyhedron)] * flat or [SolverPhase("auto-micp", via=_bounds)] * box
        return [*neighbours, *super().phases(problem)]


@register
class AutoQVI(AutomaticChoice):
    """Newton's method, then projections on the moving set."""

    spec: ClassVar[SolverSpec] = automatic_spec("qvi", "auto-qvi", "Newton's method, then projections")
    members: ClassVar[tuple[str, ...]] = ("newton-qvi", "projection-qvi")


def _box(problem: MiCP) -> Neighbour:
    """Return a problem with F(z) = Mz + q as the affine one that it is."""
    F = problem.F.compiled
    whole = AVI(M=F.M, q=F.q, lb=problem.lb, ub=problem.ub)
    return Neighbour(whole, lambda p: MiCPPoint(p.z), lambda p: AVIPoint(p.z, np.zeros(0), np.zeros(0)))


def _bounds(problem: VI) -> Neighbour:
    """Return a problem over a box alone as mixed complementarity."""
    lb, ub = problem.box
    none, whole = np.zeros(0), MiCP(F=problem.F, lb=lb, ub=ub, start=problem.start)
    return Neighbour(whole, lambda p: VIPoint(p.z, none, none, none), lambda p: MiCPPoint(p.z))


def _polyhedron(problem: VI) -> Neighbour:
    """Return a problem with affine F and g as one over a polyhedron; λ are the multipliers of Az ≥ b, then of g ≥ 0."""
    F, g, m = problem.F.compiled, problem.g.compiled, problem.b.size
    lb, ub = problem.box
    A, b = matrices.block([[problem.A], [g.M]]), np.concatenate([problem.b, -g.q])
    whole = AVI(M=F.M, q=F.q, A=A, b=b, C=problem.C, d=problem.d, lb=lb, ub=ub)

    def lift(point: AVIPoint) -> VIPoint:
        return VIPoint(z=point.z, lam=point.lam[:m], mu=point.mu, nu=point.lam[m:])

    return Neighbour(whole, lift, lambda p: AVIPoint(p.z, np.concatenate([p.lam, p.nu]), p.mu))
