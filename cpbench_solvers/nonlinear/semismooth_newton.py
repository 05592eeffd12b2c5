"""Semismooth Newton on Φ(z) = 0, Φ made of one of four NCP functions, made global by the merit ½‖Φ‖².

Reference in plain NumPy: `tests/solvers/references/semismooth_newton.py`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from cpbench.formulations.ncp_functions import NCPFunction, fischer_burmeister, minimum, penalized
from cpbench.foundation.matrices import Matrix, Vector, norm
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_solvers.nonlinear.box_newton import BoxMethod, BoxNewton, CountedBox
from cpbench_solvers.nonlinear.merit_search import MeritPoint, StepwiseDescent, fall_back
from cpbench_solvers.traits import ITERATIVE

STEEP, POWER = 1e-8, 2.1
"""A Newton direction d must have ∇θᵀd ≤ −STEEP ‖d‖^POWER (De Luca, Facchinei and Kanzow 1996)."""


@dataclass(frozen=True)
class SemismoothOptions:
    """Options of the methods of this module. `max_iterations` : Newton steps. `memory` : merits that the line search
    compares with. `project` : whether trial points are put into the bounds. `restarts` : other starts that are tried
    in the end."""

    max_iterations: int = 1000
    memory: int = 5
    project: bool = True
    restarts: int = 20


class SemismoothNewton(BoxNewton):
    """Newton with V = diag(α) + diag(β) F′(z); Levenberg–Marquardt or gradient steps where that does not descend."""

    psi: ClassVar[NCPFunction]
    merit: ClassVar[NCPFunction]
    """Another function where ½‖Φ‖² of the first has kinks."""

    def method(self, box: CountedBox, options: SemismoothOptions, budget: Budget) -> BoxMethod:
        return SemismoothMethod(box, type(self).psi, type(self).merit, options)


class SemismoothMethod(StepwiseDescent):
    """Steps for one NCP function, else for that of the merit; where the first gains nothing it is left out, each time
    for twice as many steps, so that it costs few factorizations where it never does."""

    strategies = 2

    def __init__(self, box: CountedBox, psi: NCPFunction, merit: NCPFunction, options: SemismoothOptions) -> None:
        super().__init__(box, merit, options.memory, options.project)
        self._psi, self._same, self._project = psi, psi is merit, options.project

    def begin(self, z: Vector, F: Vector, strategy: int) -> None:
        """Begin; the other strategy leaves the bounds where `project` stays within them, and the other way round."""
        self.descent.project = self._project != bool(strategy)
        self._waiting, self._pause = 0, 1
        super().begin(z, F, strategy)

    def next(self, J: Matrix, gradient: Vector) -> MeritPoint | None:
        at, descent, result = self.at, self.descent, None
        if self._waiting > 0:
            self._waiting -= 1
        elif not self._same:
            equation = MeritPoint(at.z, at.F, *self.box.equation(self._psi, at.z, at.F), merit=np.nan)
            result = self._along(at, descent.newton(equation, J), gradient)
            if result is None:
                self._waiting, self._pause = self._pause, 2 * self._pause
        if result is None:  # the merit's own direction, cheaper than a regularized one
            result = self._along(at, descent.newton(at, J), gradient)
        if result is None:
            self.box.counters["regularized"] = self.box.counters.get("regularized", 0) + 1
            result = fall_back(descent, at, J, gradient)
        return result

    def _along(self, at: MeritPoint, d: Vector | None, gradient: Vector) -> MeritPoint | None:
        """Return a point along a Newton direction, None where there is none that lowers the merit."""
        if d is None:
            return None
        slope, size = float(gradient @ d), float(np.abs(d).max())
        # in logarithms, by d/size: powers of a long direction, and its squares, are no numbers
        length = math.log(norm(d / size)) + math.log(size) if 0.0 < size < np.inf else np.inf
        steep = slope < 0.0 and math.log(-slope) >= math.log(STEEP) + POWER * length
        return self.descent.search(at, d, slope if steep else 0.0)


_spec = partial(SolverSpec, node="micp", method="semismooth Newton", traits=ITERATIVE, options=SemismoothOptions)


@register
class SemismoothNewtonMin(SemismoothNewton):
    """Newton's method on the natural map: steps of an active set, the merit of Fischer and Burmeister."""

    psi = staticmethod(minimum)
    merit = staticmethod(fischer_burmeister)
    spec: ClassVar[SolverSpec] = _spec(
        name="newton-min-micp",
        summary="semismooth Newton on min(z, F), merit of Fischer-Burmeister, nonmonotone line search",
        citation="De Luca, Facchinei and Kanzow 2000, Comput. Optim. Appl. 16",
    )


@register
class SemismoothNewtonFB(SemismoothNewton):
    """Newton's method on the function of Fischer and Burmeister."""

    psi = merit = staticmethod(fischer_burmeister)
    spec: ClassVar[SolverSpec] = _spec(
        name="newton-fb-micp",
        summary="semismooth Newton on the Fischer-Burmeister equation, nonmonotone line search",
        citation="De Luca, Facchinei and Kanzow 1996, Math. Program. 75; Billups 1995",
        quick=True,
    )


@register
class SemismoothNewtonPFB(SemismoothNewton):
    """Newton's method on the penalized function, whose level sets are bounded for more problems."""

    psi = merit = staticmethod(penalized)
    spec: ClassVar[SolverSpec] = _spec(
        name="newton-pfb-micp",
        summary="semismooth Newton on the penalized Fischer-Burmeister equation, nonmonotone line search",
        citation="Chen, Chen and Kanzow 2000, Math. Program. 88",
    )
