"""Base of the nodes with a nonlinear map F: a first start, and the size of F that their residuals are scaled by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from cpbench.formulations.base import Problem, Residuals, scaled
from cpbench.formulations.expressions import Map
from cpbench.foundation.matrices import Vector, norm


class _HasMap:
    """Declared by the nodes, in the order of their data."""

    F: Map
    start: Vector


@dataclass(frozen=True, eq=False, kw_only=True)
class NonlinearProblem(_HasMap, Problem):
    """A problem in terms of F(z). `start` (n,), 0 unless given, is where a solver begins by default.

    `scale` is ‖F(P(0))‖, P the projection on the set of the problem, or ‖F(start)‖ where F is not defined there.
    """

    @classmethod
    def from_casadi(cls, z: Any, F: Any, parameters: Mapping[str, float] | None = None, **others: Any) -> Self:
        """Read CasADi expressions: a column of symbols z and a column F, or a list of its rows, in which other symbols
        are named in `parameters`, with their values. Raises ProblemError."""
        return cls(F=Map.from_casadi(z, F, parameters), **others)

    @classmethod
    def from_sympy(
        cls, z: Sequence[Any], F: Sequence[Any], parameters: Mapping[str, float] | None = None, **others: Any
    ) -> Self:
        """Read SymPy expressions in the symbols z, and in those named in `parameters`. Raises ProblemError."""
        return cls(F=Map.from_sympy(z, F, parameters), **others)

    def project(self, z: Vector) -> Vector:
        """Return P(z), on the part of the set that has a projection in closed form."""
        return z

    @cached_property
    def scale(self) -> float:
        """Size by which errors are divided, of the problem and never of an answer; 0: errors are absolute."""
        with np.errstate(all="ignore"):
            for z in (self.project(np.zeros(self.start.size)), self.start):
                size = norm(self.F(z))
                if np.isfinite(size):
                    return size
        return 0.0

    def natural(self, defect: Vector, finite: bool, **parts: float) -> Residuals:
        """Return ‖defect‖/scale as the one measured number; ∞ where the answer is not `finite`, which a bound would
        clip."""
        absolute = norm(defect) if finite else np.inf
        return Residuals(
            measured={"natural": scaled(absolute, self.scale)},
            parts={"natural_absolute": absolute, **parts},
            flags=() if self.scale > 0 else ("absolute",),
        )
