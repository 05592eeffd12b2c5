"""Newton's method on Robinson's normal map, made global by a nonmonotone line search and by steps on another merit."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.ncp_functions import fischer_burmeister
from cpbench.foundation.matrices import Matrix, Vector, norm
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_solvers.nonlinear.box_newton import BoxMethod, BoxNewton, CountedBox
from cpbench_solvers.nonlinear.merit_search import ARMIJO, SHARES, Descent, damped, fall_back_afresh
from cpbench_solvers.nonlinear.normal_path import PERTURBATIONS, cell_matrix, normal_point, shifted
from cpbench_solvers.traits import ITERATIVE

BACKTRACKS = 12
CONSISTENT = 0.5
"""A direction from a singular matrix is used when it leaves no more of F₊ than this share."""


@dataclass(frozen=True)
class NormalMapOptions:
    """Options of newton-normal-map. `memory` : values of ‖F₊‖ that the line search compares with. `max_iterations` :
    steps. `max_extra` : factorizations beyond one a step, as singular matrices take, until it is stuck, 0 for no
    limit. `restarts` : other starts that are tried in the end."""

    memory: int = 5
    max_iterations: int = 1000
    max_extra: int = 0
    restarts: int = 20


@register
class NormalMapNewton(BoxNewton):
    """F₊(x) = F(P(x)) + x − P(x) = 0, z = P(x): F is asked for within the bounds only.

    The direction is that of the piece which x is in; its steps must lower ½‖F₊‖², nonmonotonely. F₊ has kinks, so
    that no direction may do: then z takes a step on the Fischer–Burmeister merit, and x is put above or below it anew.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="newton-normal-map",
        node="micp",
        summary="Newton on the normal map, nonmonotone line search",
        method="semismooth Newton",
        citation="Robinson 1992, Math. Oper. Res. 17:691; 1994, Set-Valued Anal. 2:291",
        traits=ITERATIVE,
        options=NormalMapOptions,
    )

    def method(self, box: CountedBox, options: NormalMapOptions, budget: Budget) -> BoxMethod:
        return _NormalMap(box, options)


class _NormalMap(BoxMethod):
    def __init__(self, box: CountedBox, options: NormalMapOptions) -> None:
        super().__init__(box)
        self._merits: deque[float] = deque(maxlen=options.memory)
        self._most = options.max_extra or math.inf
        self._descent = Descent(box, fischer_burmeister, 1, project=True)

    def begin(self, z: Vector, F: Vector, strategy: int) -> None:
        self._merits.clear()
        self._stand(normal_point(z, F, self.box.lb, self.box.ub), z, F)

    def _stand(self, x: Vector, z: Vector, F: Vector) -> None:
        self.x, self.z, self.F = x, z, F
        self._merits.append(_merit(F + x - z))

    def step(self) -> bool:
        counters = self.box.counters
        if counters["factorizations"] - counters["iterations"] >= self._most:
            return False
        J = self.box.jacobian(self.z)
        return J is not None and (self._newton(J) or self._merit_step(J))

    def _newton(self, J: Matrix) -> bool:
        box = self.box
        value = self.F + self.x - self.z
        between = (self.x > box.lb) & (self.x < box.ub)
        reference, merit = max(self._merits), _merit(value)
        for d in self._directions(J, value, between):
            t = 1.0
            for _ in range(BACKTRACKS):
                x = self.x + t * d
                z = box.project(x)
                F = box.F(z)
                if _merit(F + x - z) <= reference - 2.0 * ARMIJO * t * merit and norm(x - self.x) > 0.0:
                    self._stand(x, z, F)
                    return True
                t *= 0.5
        return False

    def _directions(self, J: Matrix, value: Vector, between: NDArray[np.bool_]) -> Iterator[Vector]:
        """Return Newton's; where the cell's matrix is singular, the shortest that solves nearly, if any does (a kernel,
        as prices have, adds nothing to it); those of regularized matrices."""
        box = self.box
        for share in PERTURBATIONS:
            C = cell_matrix(shifted(J, share), between)
            d = box.solve(C, -value)
            if d is None:
                d = damped(box, C, value, SHARES[0])
                if d is not None and norm(C @ d + value) > CONSISTENT * norm(value):
                    continue
            if d is not None:
                yield d

    def _merit_step(self, J: Matrix) -> bool:
        moved = fall_back_afresh(self._descent, self.z, self.F, J)
        if moved is None:
            return False
        # the two merits are not bounds of each other: what was reached by this one counts afresh in the other
        self._merits.clear()
        self._stand(normal_point(moved.z, moved.F, self.box.lb, self.box.ub), moved.z, moved.F)
        return True


def _merit(value: Vector) -> float:
    with np.errstate(all="ignore"):
        merit = 0.5 * float(value @ value)
    return merit if math.isfinite(merit) else math.inf
