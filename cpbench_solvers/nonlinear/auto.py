"""Automatic choices of the nonlinear nodes: Newton's methods first, those that only need F after them."""

from __future__ import annotations

from typing import ClassVar

from cpbench.solvers.base import SolverSpec, register
from cpbench_solvers.automatic import AutomaticChoice, automatic_spec


@register
class AutoMiCP(AutomaticChoice):
    """Josephy–Newton with a path search, the normal map, the Fischer–Burmeister equation.

    Where the first stops at a point that is none, the next one's merit function has its stationary points elsewhere.
    """

    spec: ClassVar[SolverSpec] = automatic_spec(
        "micp", "auto-micp", "Newton's methods on boxes, the next where one has stopped"
    )
    members: ClassVar[tuple[str, ...]] = (
        "path-search",
        "newton-normal-map",
        "newton-fb-micp",
        "josephy-newton",
    )


@register
class AutoVI(AutomaticChoice):
    """Newton's method; then extragradients, which need monotonicity and no derivative."""

    spec: ClassVar[SolverSpec] = automatic_spec("vi", "auto-vi", "Newton's method, then projections")
    members: ClassVar[tuple[str, ...]] = ("newton-vi", "extragradient-vi")


@register
class AutoQVI(AutomaticChoice):
    """Newton's method, then projections on the moving set."""

    spec: ClassVar[SolverSpec] = automatic_spec("qvi", "auto-qvi", "Newton's method, then projections")
    members: ClassVar[tuple[str, ...]] = ("newton-qvi", "projection-qvi")
