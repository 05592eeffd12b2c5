"""Automatic choice with rolling friction."""

from __future__ import annotations

from typing import ClassVar

from cpbench.solvers.base import SolverSpec, register
from cpbench.solvers.native.automatic import InOrder, automatic_spec


@register
class AutoRolling(InOrder):
    """Sweeps from contact to contact; ADMM, which goes on where they stall."""

    spec: ClassVar[SolverSpec] = automatic_spec("rfc", "auto-rfc", "Gauss-Seidel, then ADMM")
    members: ClassVar[tuple[str, ...]] = ("nsgs-rfc", "admm-rfc")
