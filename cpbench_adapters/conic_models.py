"""Clarabel and SCS on min ½xᵀPx + qᵀx, Ax + s = b, s in {0}, ℝ₊ and Lorentz cones: a model that is solved for one q
after another.

Both keep what depends on P and A alone: Clarabel its ordering and its scaling, SCS its factorization. SCS starts from
its last solution, Clarabel, an interior method, from its own start. What is asked of them is for data of size 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, Claim
from cpbench.solvers.stopping import Stopping, no_looser
from cpbench_adapters.qp_tolerances import TESTS

FINEST, FINEST_GAP = 1e-13, 1e-15
"""The least residual and gap that are asked for, relative to data of size 1."""
INFEASIBILITY = 1e-7
"""Largest tolerance on a proof of infeasibility or unboundedness, whatever ε."""


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


def _of_scaled(test: Stopping, settings: Mapping[str, float]) -> Stopping:
    """Return a test of data that the adapter has brought to size 1, so that absolute and relative are the same."""
    words = f"{test.test}, of scaled data"
    return Stopping(test=words, settings=no_looser(settings, test.defaults), defaults=test.defaults)


class ConicModel(Protocol):
    """A model whose q may change. `cones`: as `lorentz_rows` names them; P : all of it, symmetric."""

    def __init__(self, P: Any, q: Vector, A: Any, b: Vector, cones: list[tuple[str, int]], budget: Budget) -> None: ...

    @classmethod
    def stopping(cls, tolerance: float) -> Stopping:
        """Return the test by which it ends, and what it is asked for."""
        ...

    def solve(self, q: Vector | None = None) -> ConicEnd:
        """Solve for this q, or for the one that the model was made with."""
        ...


class ClarabelModel:
    """Residuals get ε/10; a gap δ leaves s and y up to √δ from the conditions on the boundary of a cone, so the gap
    gets ε²/10, but neither gets less than double precision allows."""

    _CLAIMS: ClassVar[dict[str, Claim]] = {
        "Solved": Claim.SOLVED,
        "AlmostSolved": Claim.INACCURATE,
        "InsufficientProgress": Claim.INACCURATE,
        "NumericalError": Claim.FAILED,
        "PrimalInfeasible": Claim.INFEASIBLE,
        "DualInfeasible": Claim.UNBOUNDED,
        "MaxIterations": Claim.MAX_ITER,
        "MaxTime": Claim.MAX_ITER,
    }

    @classmethod
    def stopping(cls, tolerance: float) -> Stopping:
        """Return Clarabel's test, and what it is asked for."""
        test = TESTS["clarabel"]
        feasible, gap = max(0.1 * tolerance, FINEST), max(0.1 * tolerance**2, FINEST_GAP)
        settings = {"tol_feas": feasible, "tol_gap_abs": gap, "tol_gap_rel": gap}
        settings |= dict.fromkeys(("tol_infeas_abs", "tol_infeas_rel"), min(0.1 * tolerance, INFEASIBILITY))
        return _of_scaled(test, settings)

    def __init__(self, P: Any, q: Vector, A: Any, b: Vector, cones: list[tuple[str, int]], budget: Budget) -> None:
        import clarabel

        known = {
            "zero": clarabel.ZeroConeT,
            "nonnegative": clarabel.NonnegativeConeT,
            "lorentz": clarabel.SecondOrderConeT,
        }
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.presolve_enable = False  # it would forbid another q
        for name, value in self.stopping(budget.tolerance).settings.items():
            setattr(settings, name, value)
        settings.max_iter = 200 if budget.iterations is None else budget.iterations
        if math.isfinite(budget.seconds):
            settings.time_limit = budget.seconds
        self._solver = clarabel.DefaultSolver(
            sp.csc_array(sp.triu(P)), q, sp.csc_array(A), b, [known[kind](size) for kind, size in cones], settings
        )

    def solve(self, q: Vector | None = None) -> ConicEnd:
        if q is not None:
            self._solver.update(q=q)
        solution = self._solver.solve()
        status = str(solution.status)
        return ConicEnd(
            status=status,
            claim=self._CLAIMS.get(status, Claim.FAILED),
            x=np.asarray(solution.x),
            y=np.asarray(solution.z),
            iterations=int(solution.iterations),
        )


class ScsModel:
    """error ≤ eps_abs + eps_rel·scale in the ∞-norm, gap included, where K ∋ s ⟂ y ∈ K* to rounding: both get ε/10."""

    _WORDS: ClassVar[dict[int, tuple[str, Claim]]] = {
        1: ("solved", Claim.SOLVED),
        2: ("solved_inaccurate", Claim.INACCURATE),
        -1: ("unbounded", Claim.UNBOUNDED),
        -2: ("infeasible", Claim.INFEASIBLE),
        -6: ("unbounded_inaccurate", Claim.UNBOUNDED),
        -7: ("infeasible_inaccurate", Claim.INFEASIBLE),
    }
    MAX_ITERATIONS = 100_000

    @classmethod
    def stopping(cls, tolerance: float) -> Stopping:
        """Return the test of SCS, and what it is asked for."""
        test, e = TESTS["scs"], max(0.1 * tolerance, FINEST)
        settings = {"eps_abs": e, "eps_rel": e, "eps_infeas": min(e, INFEASIBILITY)}
        return _of_scaled(test, settings)

    def __init__(self, P: Any, q: Vector, A: Any, b: Vector, cones: list[tuple[str, int]], budget: Budget) -> None:
        import scs

        named: dict[str, Any] = {"q": [size for kind, size in cones if kind == "lorentz"]}
        named |= {{"zero": "z", "nonnegative": "l"}[kind]: size for kind, size in cones if kind != "lorentz"}
        self._rows = b.size
        if not b.size:  # SCS wants a cone
            A, b, named = sp.csc_array((1, q.size)), np.ones(1), {"l": 1}
        limit: dict[str, Any] = {"time_limit_secs": budget.seconds} if math.isfinite(budget.seconds) else {}
        self._solver = scs.SCS(
            {"P": sp.csc_matrix(sp.triu(P)), "A": sp.csc_matrix(A), "b": b, "c": q},
            named,
            **self.stopping(budget.tolerance).settings,
            max_iters=self.MAX_ITERATIONS if budget.iterations is None else budget.iterations,
            verbose=False,
            **limit,
        )
        self._warm = False

    def solve(self, q: Vector | None = None) -> ConicEnd:
        if q is not None:
            self._solver.update(c=q)
        solution = self._solver.solve(warm_start=self._warm)
        value = int(solution["info"]["status_val"])
        status, claim = self._WORDS.get(value, (f"status {value}", Claim.FAILED))
        end = ConicEnd(
            status=status,
            claim=claim,
            x=solution["x"],
            y=solution["y"][: self._rows],
            iterations=int(solution["info"]["iter"]),
        )
        self._warm = end.usable  # a ray is not a start
        return end
