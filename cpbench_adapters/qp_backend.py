"""Base of all QP backends: refusals, and the way from an end to a claim and from an answer to a point."""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import importlib
import os
import sys
import warnings
from abc import abstractmethod
from collections.abc import Generator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from cpbench.errors import CpbenchError
from cpbench.formulations.programs import QP
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix
from cpbench.solvers.base import (
    Availability,
    Budget,
    Claim,
    Record,
    Solver,
    SolverOutput,
    SolverSpec,
    Trait,
    package_version,
)
from cpbench.solvers.stopping import Stopping
from cpbench_adapters.qp_standard_form import StandardForm, standard_form
from cpbench_adapters.qp_tolerances import TABLE, Settings, stopping, translate

DENSE_LIMIT = 4000
"""Most unknowns that a backend with dense storage is given."""
DENSE_BYTES = 0.5e9
"""Most memory that its matrices may take."""
HEAVY = "jax"
"""What backends of qpsolvers import, for more than a second, of which none is a solver here."""
EIGENVALUE_LIMIT = 1000
"""Most unknowns for which a refusal also computes the least eigenvalue (O(n³), about 0.1 s at 1000)."""


@dataclass(frozen=True)
class BackendAnswer:
    """Result of a backend: its own word for how it ended, x and the multipliers, counters."""

    status: str
    x: Any | None = None
    z: Any | None = None
    y: Any | None = None
    z_box: Any | None = None
    counters: Mapping[str, int] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


class QPBackend(Solver):
    """One QP backend.

    Attributes
    ----------
    sparse : True for csc matrices always, False for dense always, None for what the problem has.
    bounds_as_rows : the backend knows no bounds (or qpsolvers stacks them, infinite ones included).
    definite : it needs Q positive definite.
    needs_inequality : without one the backend is not called, or does not iterate (each says why).
    claims : its own words -> our claims; every other word is FAILED. prints : a banner, always.
    """

    sparse: ClassVar[bool | None] = True
    bounds_as_rows: ClassVar[bool] = False
    definite: ClassVar[bool] = False
    needs_inequality: ClassVar[bool] = False
    claims: ClassVar[Mapping[str, Claim]] = {}
    prints: ClassVar[bool] = False

    @abstractmethod
    def call(self, form: StandardForm, settings: Settings) -> BackendAnswer:
        """Run the backend; its exceptions pass through."""

    def obstacle(self, problem: QP) -> str | None:
        n = problem.p.size
        if n == 0:
            return "has no unknown (n = 0): there is nothing to minimise"
        if self.sparse is False:
            bounds = int(np.isfinite(problem.lb).sum() + np.isfinite(problem.ub).sum()) if self.bounds_as_rows else 0
            size = 8 * n * (n + problem.b.size + problem.d.size + bounds)
            if n > DENSE_LIMIT or size > DENSE_BYTES:
                return (
                    f"keeps dense matrices: n = {n} with {problem.b.size + problem.d.size} constraints takes "
                    f"{size / 1e9:.1f} GB (at most {DENSE_LIMIT} unknowns and {DENSE_BYTES / 1e9:.1f} GB); "
                    "use a sparse backend (clarabel, osqp, piqp)"
                )
        if not problem.convex:
            return f"not convex: Q has a negative eigenvalue{_least_eigenvalue(problem.Q)}"
        if self.definite and not matrices.is_definite(problem.Q):
            return (
                f"needs Q positive definite, Q is singular{_least_eigenvalue(problem.Q)}; "
                "use clarabel, piqp or proxqp, which take a semidefinite Q"
            )
        return None

    def setup(self, problem: QP, budget: Budget, options: Any) -> StandardForm:
        sparse = self.sparse
        if sparse is None:
            sparse = any(matrices.is_sparse(M) for M in (problem.Q, problem.A, problem.C))
        return standard_form(
            problem,
            sparse=sparse,
            bounds_as_rows=self.bounds_as_rows,
            needs_inequality=self.needs_inequality,
        )

    def solve(
        self,
        prepared: StandardForm,
        budget: Budget,
        options: Any,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        settings = self.settings(budget)
        with _stdout_to_stderr() if self.prints else contextlib.nullcontext():
            answer = self.call(prepared, settings)
        return self.output(prepared, answer)

    def settings(self, budget: Budget) -> Settings:
        """Return what the backend is asked for, as `call` takes it; raises CpbenchError where that is said nowhere."""
        if self.spec.name not in TABLE:
            tables = "TABLE and TESTS of qp_tolerances"
            raise CpbenchError(f"{self.spec.name}: is not in {tables}; define `settings` and `stopping` in its class")
        return translate(self.spec.name, budget)

    def stopping(self, tolerance: float, problem: QP | None = None) -> Stopping | None:
        return stopping(self.spec.name, tolerance, problem)

    def output(self, form: StandardForm, answer: BackendAnswer) -> SolverOutput:
        """Return the claim and the point that the backend's answer means."""
        claim = self.claims.get(answer.status, Claim.FAILED)
        point = None
        # with these claims x is a ray or the last iterate of a proof, not an answer
        if answer.x is not None and claim not in (Claim.INFEASIBLE, Claim.UNBOUNDED):
            point = form.point(answer.x, answer.z, answer.y, answer.z_box)
        message = "; ".join((answer.status, *answer.remarks))
        return SolverOutput(claim=claim, point=point, counters=dict(answer.counters), message=message)

    def warmup(self) -> None:
        one = np.ones((1, 1))
        self.run(QP.build(Q=one, p=-np.ones(1), A=one, b=np.zeros(1), C=None, lb=np.zeros(1), ub=2 * np.ones(1)))

    def version(self) -> str:
        return package_version(self.spec.requires[-1])


@contextlib.contextmanager
def _stdout_to_stderr() -> Generator[None]:
    """Send what C code prints on stdout to stderr: a banner there would end up in the output of a command."""
    flush = ctypes.CDLL(None).fflush  # of all streams of C, which keep what is not written to a terminal
    flush(None)
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
        flush(None)
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def table_spec(row: Mapping[str, Any], **given: Any) -> SolverSpec:
    """Return the spec of a solver that stands in a table; `given` : what its row does not say, or says otherwise."""
    values = {name: row[name] for name in {field.name for field in dataclasses.fields(SolverSpec)} & row.keys()}
    values |= {"requires": tuple(row["requires"]), "traits": frozenset(map(Trait, row["traits"]))}
    return SolverSpec(**(values | given))


class QPSolversBackend(QPBackend):
    """A backend called through the function that qpsolvers has for it."""

    def guest_function(self) -> Any:
        """Return qpsolvers' `<backend>_solve_problem`; importing it imports every backend that is installed."""
        name = self.spec.name
        return getattr(importlib.import_module(f"qpsolvers.solvers.{name}_"), f"{name}_solve_problem")

    @abstractmethod
    def status(self, solution: Any, settings: Settings) -> str:
        """Return the backend's own word for how it ended."""

    def counters(self, solution: Any) -> Mapping[str, int]:
        return {}

    def availability(self) -> Availability:
        _import_qpsolvers()
        return super().availability()

    def setup(self, problem: QP, budget: Budget, options: Any) -> StandardForm:
        form = super().setup(problem, budget, options)
        assert form.guest is not None  # made here, so that it is not timed as part of the solve
        return form

    def call(self, form: StandardForm, settings: Settings) -> BackendAnswer:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            solution = self.guest_function()(form.guest, **settings)
        status = self.status(solution, settings)
        return BackendAnswer(
            status=status,
            x=solution.x,
            z=solution.z,
            y=solution.y,
            z_box=solution.z_box,
            counters=self.counters(solution),
            # qpsolvers warns of every end that is not a solution; what only repeats the status is left out
            remarks=tuple(
                text
                for w in caught
                if issubclass(w.category, UserWarning) and status.lower() not in (text := str(w.message)).lower()
            ),
        )


def _import_qpsolvers() -> None:
    """Import qpsolvers for the first time without what its backends warn of: they are all imported with it,
    and a deprecated one would break every other backend where warnings are errors."""
    if "qpsolvers" in sys.modules:
        return
    hidden = HEAVY not in sys.modules
    if hidden:
        sys.modules[HEAVY] = None  # type: ignore[assignment]  (an import of it fails, as if it were not installed)
    # ImportError: `probe` says what is missing
    with warnings.catch_warnings(), contextlib.suppress(ImportError):
        warnings.simplefilter("ignore")
        importlib.import_module("qpsolvers")
    if hidden:
        del sys.modules[HEAVY]


def _least_eigenvalue(Q: Matrix) -> str:
    if Q.shape[0] > EIGENVALUE_LIMIT:
        return ""
    return f" (least eigenvalue at unit diagonal {matrices.least_eigenvalue(Q):.1e})"
