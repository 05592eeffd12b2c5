"""Nonmonotone line search on the merit ½‖Φ‖² (39); Levenberg–Marquardt or gradient steps where Newton's fail."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack

from cpbench.formulations.ncp_functions import NCPFunction
from cpbench.foundation.matrices import Matrix, Vector, dense, max_abs, norm
from cpbench_solvers.nonlinear.box_newton import BoxMethod, CountedBox
from cpbench_solvers.nonlinear.normal_path import shifted

ARMIJO = 1e-4
ACCEPT = 0.9
"""A full step that cuts the merit to this share is taken without further question."""
BACKTRACKS = 40


@dataclass(frozen=True, eq=False)
class MeritPoint:
    """A point with Φ there. z, F, phi, alpha, beta : (n,). merit : ½‖Φ‖², ∞ where Φ is not a number."""

    z: Vector
    F: Vector
    phi: Vector
    alpha: Vector
    beta: Vector
    merit: float


class Descent:
    """Nonmonotone line search on ½‖Φ‖² for one NCP function (Grippo, Lampariello and Lucidi 1986): a step must lower
    the largest of the last `memory` merits. Where `project` trial points are put into the bounds."""

    def __init__(self, box: CountedBox, psi: NCPFunction, memory: int, project: bool) -> None:
        self.box, self._psi, self.project = box, psi, project
        self._merits: deque[float] = deque(maxlen=memory)

    def begin(self, at: MeritPoint) -> None:
        self._merits.clear()
        self._merits.append(at.merit)

    @property
    def reference(self) -> float:
        """The merit that a step must lower."""
        return max(self._merits)

    def accept(self, at: MeritPoint) -> None:
        """Note the merit of a point that the method went to."""
        self._merits.append(at.merit)

    def at(self, z: Vector, F: Vector | None = None) -> MeritPoint:
        F = self.box.F(z) if F is None else F
        phi, alpha, beta = self.box.equation(self._psi, z, F)
        with np.errstate(all="ignore"):
            merit = 0.5 * float(phi @ phi)
        return MeritPoint(z, F, phi, alpha, beta, merit if math.isfinite(merit) else math.inf)

    def gradient(self, at: MeritPoint, J: Matrix) -> Vector:
        """Return the gradient of the merit, VᵀΦ for any V of the generalized derivative, where it is smooth."""
        return at.alpha * at.phi + J.T @ (at.beta * at.phi)

    def newton(self, at: MeritPoint, J: Matrix) -> Vector | None:
        """Return −V⁻¹Φ, None where V is singular. Rows without F (bounds that are met) are solved first."""
        decided = (at.beta == 0.0) & (at.alpha != 0.0)
        if not decided.any():
            return self.box.solve(_generalized(at.alpha, at.beta, J), -at.phi)
        rest, known = np.flatnonzero(~decided), np.flatnonzero(decided)
        d = np.zeros(at.z.size)
        d[known] = -at.phi[known] / at.alpha[known]
        if rest.size:
            rows: Any = J[rest]
            right = -at.phi[rest] - at.beta[rest] * (rows @ d)
            part = self.box.solve(_generalized(at.alpha[rest], at.beta[rest], rows[:, rest]), right)
            if part is None:
                return None
            d[rest] = part
        return d

    def search(self, at: MeritPoint, d: Vector | None, slope: float) -> MeritPoint | None:
        """Return the first z + td, t = 1, ½, …, that lowers the reference merit enough; None when none does."""
        if d is None:
            return None
        reference = self.reference
        descends = slope < -1e-14 * at.merit
        t = 1.0
        for k in range(BACKTRACKS):
            z = at.z + t * d
            trial = self.at(self.box.project(z) if self.project else z)
            if (k == 0 and trial.merit <= ACCEPT * at.merit) or (
                descends and trial.merit <= reference + ARMIJO * t * slope
            ):
                if norm(trial.z - at.z) <= 1e-16 * norm(at.z):
                    return None
                return trial
            if not descends and k >= 2:
                return None
            t *= 0.5
        return None


class DescentMethod(BoxMethod):
    """Base of the methods whose iterates are those of a `Descent`."""

    def __init__(self, box: CountedBox, merit: NCPFunction, memory: int, project: bool) -> None:
        super().__init__(box)
        self.descent = Descent(box, merit, memory, project)

    def begin(self, z: Vector, F: Vector, strategy: int) -> None:
        self._stand(self.descent.at(z, F))
        self.descent.begin(self.at)

    def _stand(self, at: MeritPoint) -> None:
        self.at, self.z, self.F = at, at.z, at.F


class StepwiseDescent(DescentMethod):
    """Base of those that accept every point they go to."""

    def step(self) -> bool:
        J = self.box.jacobian(self.z)
        moved = None if J is None else self.next(J, self.descent.gradient(self.at, J))
        if moved is None:
            return False
        self.descent.accept(moved)
        self._stand(moved)
        return True

    @abstractmethod
    def next(self, J: Matrix, gradient: Vector) -> MeritPoint | None:
        """Return the next point, from F′ and the gradient of the merit at `at`; None where there is none."""


def damped(box: CountedBox, V: Matrix, phi: Vector, share: float) -> Vector | None:
    """Return argmin ‖Vd + Φ‖² + ν‖d‖², ν = share · max|V|² · min(1, ‖Φ‖): a direction of descent of ‖Φ‖ for ν > 0."""
    top = max_abs(V)
    root = math.sqrt(share * min(1.0, norm(phi))) * max(top, 1e-8)
    zero = np.zeros(phi.size)
    if not sp.issparse(V):
        with np.errstate(all="ignore"):
            stacked = np.vstack([V, root * np.eye(zero.size)])
            box.counters["factorizations"] += 1
            # its columns are independent, so that QR without pivots serves: singular values cost ten times as much
            _, d, info = lapack.dgels(stacked, np.concatenate([-phi, zero]), overwrite_a=True)
        return d[: zero.size] if info == 0 and np.isfinite(d).all() else None
    # the augmented system keeps V's sparsity and, unlike the normal equations, its condition number
    eye = sp.eye_array(zero.size)
    augmented = sp.csr_array(sp.block_array([[root * eye, V], [V.T, -root * eye]]))
    both = box.solve(augmented, np.concatenate([-phi, zero]))
    return None if both is None else both[zero.size :]


SHIFT = 1e-8
"""Times max|F′|, added to the diagonal of F′ where Newton's direction fails: enough where F is monotone."""
SHARES = (1e-8, 1e-4, 1e-1)
"""Levenberg–Marquardt's regularizations that are tried one after the other."""


def fall_back(descent: Descent, at: MeritPoint, J: Matrix, gradient: Vector) -> MeritPoint | None:
    """Return a step along a regularized direction or, in the end, along minus the gradient."""
    for d in _regularized(descent.box, at, J):
        result = None if d is None else descent.search(at, d, float(gradient @ d))
        if result is not None:
            return result
    return descent.search(at, -gradient, -float(gradient @ gradient))


def _regularized(box: CountedBox, at: MeritPoint, J: Matrix) -> Iterator[Vector | None]:
    """Return Newton's direction for F′ with a shifted diagonal, then Levenberg–Marquardt's, whose systems have twice
    as many unknowns."""
    yield box.solve(_generalized(at.alpha, at.beta, shifted(J, SHIFT)), -at.phi)
    V = _generalized(at.alpha, at.beta, J)
    for share in SHARES:
        yield damped(box, V, at.phi, share)


def fall_back_afresh(descent: Descent, z: Vector, F: Vector, J: Matrix) -> MeritPoint | None:
    """Return what `fall_back` does from z, of which F is F(z), whatever merits were there before."""
    at = descent.at(z, F)
    descent.begin(at)
    return fall_back(descent, at, J, descent.gradient(at, J))


def _generalized(alpha: Vector, beta: Vector, J: Matrix) -> Matrix:
    """Return diag(α) + diag(β) F′(z)."""
    if sp.issparse(J):
        return sp.csr_array(sp.diags_array(beta) @ J + sp.diags_array(alpha))
    V = beta[:, None] * dense(J)
    V[np.diag_indices(alpha.size)] += alpha
    return V
