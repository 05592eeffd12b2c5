"""Automatic choices over products of cones."""

from __future__ import annotations

from typing import ClassVar

from cpbench.solvers.base import SolverSpec, register
from cpbench_solvers.automatic import AutomaticChoice, automatic_spec


@register
class AutoConeQP(AutomaticChoice):
    """The interior point, which is done after a few factorizations; ADMM, which needs one, where it has stopped."""

    spec: ClassVar[SolverSpec] = automatic_spec("coneqp", "auto-coneqp", "interior point, then ADMM")
    members: ClassVar[tuple[str, ...]] = ("interior-point-coneqp", "admm-coneqp")


@register
class AutoSOCLCP(AutomaticChoice):
    """Newton's method on the natural map; the interior point, for monotone problems; ADMM."""

    spec: ClassVar[SolverSpec] = automatic_spec("soclcp", "auto-soclcp", "Newton, then interior point, then ADMM")
    members: ClassVar[tuple[str, ...]] = ("newton-soclcp", "interior-point-soclcp", "admm-soclcp")
