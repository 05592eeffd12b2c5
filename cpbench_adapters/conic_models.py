"""Conic solvers on min ½xᵀPx + qᵀx, Ax + s = b, s in {0}, ℝ₊ and Lorentz cones: a model that is solved for one q after
another.

Most keep what depends on P and A alone: Clarabel its ordering and its scaling, SCS its factorization. SCS starts from
its last solution, the interior methods from their own start.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, Claim
from cpbench.solvers.stopping import Stopping, no_looser
from cpbench_adapters.qp_tolerances import INFEASIBILITY, TESTS, Settings, translate

FINEST, FINEST_GAP = 1e-13, 1e-15
"""The least residual and gap that are asked for, relative to data of size 1."""


@dataclass(frozen=True)
class ConicProgram:
    """min ½xᵀPx + qᵀx, Ax + s = b, s in `cones`, as `lorentz_rows` names them, {0} and ℝ₊ first; P : all of it."""

    P: Any
    q: Vector
    A: Any
    b: Vector
    cones: list[tuple[str, int]]

    def sizes(self) -> tuple[int, int, list[int]]:
        """Return rows in {0}, rows in ℝ₊, and the sizes of the Lorentz cones."""
        of = {kind: [size for name, size in self.cones if name == kind] for kind in ("zero", "nonnegative", "lorentz")}
        return sum(of["zero"]), sum(of["nonnegative"]), of["lorentz"]


@dataclass(frozen=True)
class ConicEnd:
    """Result of a conic solve: the guest's word, our claim, x, the multipliers y ∈ K* of s, and its iterations."""

    status: str
    claim: Claim
    x: Vector
    y: Vector
    iterations: int

    @property
    def usable(self) -> bool:
        """Return whether x and y are finite, and a point and not the ray of a certificate."""
        return self.claim not in (Claim.INFEASIBLE, Claim.UNBOUNDED) and bool(
            np.isfinite(self.x).all() and np.isfinite(self.y).all()
        )


class ConicModel(ABC):
    """A model of a program, whose q may change; settings : by the package's own names."""

    backend: ClassVar[str]
    """Its name in `qp_tolerances`."""
    claims: ClassVar[Mapping[str, Claim]]
    """The guest's words -> our claims; every other word is FAILED."""

    @abstractmethod
    def __init__(self, program: ConicProgram, settings: Settings) -> None: ...

    @abstractmethod
    def run(self, q: Vector | None) -> tuple[str, Any, Any, int]:
        """Return the guest's word, x, y and its iterations, for this q or for the one that the model was made with."""

    @classmethod
    @abstractmethod
    def tolerances(cls, tolerance: float) -> dict[str, float]:
        """Return what is asked for on data that the adapter has brought to size 1."""

    @classmethod
    def stopping(cls, tolerance: float) -> Stopping:
        """Return the test by which it ends on scaled data, where absolute and relative are the same."""
        test = TESTS[cls.backend]
        asked = no_looser(cls.tolerances(tolerance), test.defaults)
        return Stopping(test=f"{test.test}, of scaled data", settings=asked, defaults=test.defaults)

    @classmethod
    def settings(cls, budget: Budget) -> Settings:
        """Return the settings for scaled data."""
        return {**translate(cls.backend, budget), **cls.stopping(budget.tolerance).settings}

    def solve(self, q: Vector | None = None) -> ConicEnd:
        """Solve for this q, or for the one that the model was made with."""
        status, x, y, iterations = self.run(q)
        claim = self.claims.get(status, Claim.FAILED)
        return ConicEnd(status=status, claim=claim, x=np.asarray(x), y=np.asarray(y), iterations=int(iterations))


class ClarabelModel(ConicModel):
    """Residuals get ε/10; a gap δ leaves s and y up to √δ from the conditions on the boundary of a cone, so the gap
    gets ε²/10, but neither gets less than double precision allows."""

    backend = "clarabel"
    claims = {
        "Solved": Claim.SOLVED,
        "AlmostSolved": Claim.INACCURATE,
        "InsufficientProgress": Claim.INACCURATE,
        "PrimalInfeasible": Claim.INFEASIBLE,
        "DualInfeasible": Claim.UNBOUNDED,
        "MaxIterations": Claim.MAX_ITER,
        "MaxTime": Claim.MAX_ITER,
    }

    @classmethod
    def tolerances(cls, tolerance: float) -> dict[str, float]:
        gap, proof = max(0.1 * tolerance**2, FINEST_GAP), min(0.1 * tolerance, INFEASIBILITY)
        settings = {"tol_feas": max(0.1 * tolerance, FINEST), "tol_gap_abs": gap, "tol_gap_rel": gap}
        return settings | {"tol_infeas_abs": proof, "tol_infeas_rel": proof}

    def __init__(self, program: ConicProgram, settings: Settings) -> None:
        import clarabel

        known = {
            "zero": clarabel.ZeroConeT,
            "nonnegative": clarabel.NonnegativeConeT,
            "lorentz": clarabel.SecondOrderConeT,
        }
        given = clarabel.DefaultSettings()
        # presolve would forbid another q
        for name, value in {**settings, "verbose": False, "presolve_enable": False}.items():
            setattr(given, name, value)
        P, A = sp.csc_array(sp.triu(program.P)), sp.csc_array(program.A)
        cones = [known[kind](size) for kind, size in program.cones]
        self._solver = clarabel.DefaultSolver(P, program.q, A, program.b, cones, given)

    def run(self, q: Vector | None) -> tuple[str, Any, Any, int]:
        if q is not None:
            self._solver.update(q=q)
        solution = self._solver.solve()
        return str(solution.status), solution.x, solution.z, solution.iterations


class ScsModel(ConicModel):
    """error ≤ eps_abs + eps_rel·scale in the ∞-norm, gap included, where K ∋ s ⟂ y ∈ K* to rounding: both get ε/10."""

    backend = "scs"
    claims = {
        "solved": Claim.SOLVED,
        "solved_inaccurate": Claim.INACCURATE,
        "unbounded": Claim.UNBOUNDED,
        "infeasible": Claim.INFEASIBLE,
        "unbounded_inaccurate": Claim.UNBOUNDED,
        "infeasible_inaccurate": Claim.INFEASIBLE,
    }
    _WORDS: ClassVar[Mapping[int, str]] = dict(zip((1, 2, -1, -2, -6, -7), claims, strict=True))

    @classmethod
    def tolerances(cls, tolerance: float) -> dict[str, float]:
        e = max(0.1 * tolerance, FINEST)
        return {"eps_abs": e, "eps_rel": e, "eps_infeas": min(e, INFEASIBILITY)}

    def __init__(self, program: ConicProgram, settings: Settings) -> None:
        import scs

        A, b, named = program.A, program.b, dict(zip("zlq", program.sizes(), strict=True))
        self._rows = b.size
        if not b.size:  # SCS wants a cone
            A, b, named = sp.csc_array((1, program.q.size)), np.ones(1), {"l": 1}
        data = {"P": sp.csc_matrix(sp.triu(program.P)), "A": sp.csc_matrix(A), "b": b, "c": program.q}
        self._solver = scs.SCS(data, named, **settings, verbose=False)
        self._warm = False

    def run(self, q: Vector | None) -> tuple[str, Any, Any, int]:
        if q is not None:
            self._solver.update(c=q)
        solution = self._solver.solve(warm_start=self._warm)
        value, x, y = solution["info"]["status_val"], solution["x"], solution["y"]
        # a ray is not a start
        self._warm = value not in (-1, -2, -6, -7) and bool(np.isfinite(x).all() and np.isfinite(y).all())
        return self._WORDS.get(value, f"status {value}"), x, y[: self._rows], solution["info"]["iter"]


STALLS = 1e-9
"""About where QOCO takes no more steps: 7 of 25 cone programs ended as inaccurate when it was asked for 1e-13."""


class QocoModel(ConicModel):
    """QOCO. Its one tolerance, for residuals and gap, is that of the gap of Clarabel, down to `STALLS`."""

    backend = "qoco"
    claims = {
        "QOCO_SOLVED": Claim.SOLVED,
        "QOCO_SOLVED_INACCURATE": Claim.INACCURATE,
        "QOCO_MAX_ITER": Claim.MAX_ITER,
    }

    @classmethod
    def tolerances(cls, tolerance: float) -> dict[str, float]:
        return dict.fromkeys(("abstol", "reltol"), max(0.1 * min(tolerance, max(tolerance**2, STALLS)), FINEST))

    def __init__(self, program: ConicProgram, settings: Settings) -> None:
        import qoco

        (k, m, lorentz), A, b = program.sizes(), sp.csr_matrix(program.A), program.b
        parts = [(M.tocsc(), c) if c.size else (None, None) for M, c in ((A[:k], b[:k]), (A[k:], b[k:]))]
        data = (sp.csc_matrix(program.P), program.q, *parts[0], *parts[1], m, len(lorentz), lorentz or None)
        self._solver = qoco.QOCO()
        self._solver.setup(program.q.size, b.size - k, k, *data, **settings)

    def run(self, q: Vector | None) -> tuple[str, Any, Any, int]:
        if q is not None:
            self._solver.update_vector_data(c=q)
        end = self._solver.solve()
        return end.status, end.x, np.concatenate([end.y, end.z]), end.iters


class MoreauModel(ClarabelModel):
    """Moreau's interior method, which is Clarabel's; or, by its settings, its active set, which is DAQP's."""

    backend = "moreau-ipm"

    def __init__(self, program: ConicProgram, settings: Settings) -> None:
        import moreau

        k, m, lorentz = program.sizes()
        named = {"ipm_settings": moreau.IPMSettings, "active_set_settings": moreau.ActiveSetSettings}
        kinds = {name: kind(**_of(kind, settings)) for name, kind in named.items()}
        given = moreau.Settings(device="cpu", **kinds, **_of(moreau.Settings, settings))
        cones = moreau.Cones(num_zero_cones=k, num_nonneg_cones=m, so_cone_dims=lorentz)
        P = sp.csr_matrix(program.P + program.P.T) / 2  # it takes only one that is symmetric
        self._made = lambda q: moreau.Solver(P, q, sp.csr_matrix(program.A), program.b, cones, given)
        self._q = program.q

    def run(self, q: Vector | None) -> tuple[str, Any, Any, int]:
        solver: Any = self._made(self._q if q is None else q)
        end = solver.solve()
        return str(solver.info.status), end.x, end.z, solver.info.iterations


def _of(kind: Any, settings: Settings) -> Settings:
    return {name: value for name, value in settings.items() if name in kind.model_fields}


_ALL: tuple[type[ConicModel], ...] = (ClarabelModel, MoreauModel, QocoModel, ScsModel)
MODELS: Mapping[str, type[ConicModel]] = {model.backend: model for model in _ALL}
