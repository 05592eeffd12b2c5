"""Murty's least-index method on an LCP: the first negative component changes places with its complement."""

from __future__ import annotations

from typing import ClassVar

from cpbench.solvers.base import SolverSpec, register
from cpbench_solvers.lcp.principal_pivoting import PrincipalPivoting, pivoting_spec


@register
class Murty(PrincipalPivoting):
    """Any complementary basis will do, feasible or not, so every start is a warm one.

    Finite for P-matrices, though 2ⁿ pivots are possible (Murty 1978). For others it meets a diagonal entry that is
    not positive, or comes back to a basis it has seen and runs into the limit of pivots.
    """

    spec: ClassVar[SolverSpec] = pivoting_spec(
        name="murty",
        summary="Murty's least-index principal pivoting, for P-matrices",
        citation="Murty 1974, Linear Algebra Appl. 9:65; Cottle, Pang and Stone 2009, section 4.2",
        by_default=False,
    )
    loop = "murty"
    promise = "a P-matrix"
