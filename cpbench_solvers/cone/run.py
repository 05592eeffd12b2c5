"""The loop of the methods for cone programs and cone complementarity problems: what is measured, kept and said."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Protocol

from cpbench.formulations.conic import SOCLCP, ConeQP
from cpbench.foundation.matrices import Vector, least_eigenvalue
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput
from cpbench.solvers.shared.progress import SHARE, Progress
from cpbench_solvers.cone.scaled_form import ConicForm, conic_form
from cpbench_solvers.lcp.claims import CLOSE, concluded


class Iterates(Protocol):
    """x̂, ŝ and ŷ of a method, and its counters; `step` goes on, or says why it cannot."""

    counters: dict[str, int]

    @property
    def x(self) -> Vector: ...
    @property
    def s(self) -> Vector: ...
    @property
    def y(self) -> Vector: ...
    def step(self) -> str | None: ...


class ConicSolver(Solver):
    """A method on `ConicForm`, of either node."""

    window: int = 1000
    """Iterations without gain after which a run ends."""
    every: bool = False
    """Whether the error is measured after every iteration, not ever more seldom."""

    def obstacle(self, problem: ConeQP | SOCLCP) -> str | None:
        if isinstance(problem, SOCLCP):
            return None
        if not problem.convex:
            return f"not convex: Q has, at unit diagonal, the eigenvalue {least_eigenvalue(problem.Q):.1e}"
        return None

    def setup(self, problem: ConeQP | SOCLCP, budget: Budget, options: Any) -> ConicForm:
        return conic_form(problem, budget.tolerance)

    @abstractmethod
    def begin(self, form: ConicForm, start: tuple[Vector, Vector] | None, options: Any) -> Iterates:
        """Return the method at x̂ and ŷ, or at its own start."""

    def solve(
        self, prepared: ConicForm, budget: Budget, options: Any, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        form, tolerance = prepared, budget.tolerance
        progress = Progress(self.window, budget.seconds)
        limit = budget.iterations or options.max_iterations
        method = self.begin(form, None if start is None else form.start(start), options)
        best = form.answer(method.x, method.s, method.y) if start is None else start
        error, done, check = form.error(best), 0, 0
        if record is not None:
            record(0, error, lambda point=best: point)
        claim, message = Claim.MAX_ITER, f"{limit} iterations"
        while error > tolerance and done < limit:
            why = method.step()
            done += why is None
            method.counters["iterations"] = done
            if why is None and not self.every and done < check and done < limit:
                continue
            check = done + 1 + min(done // SHARE, 20)
            if why is None:
                point = form.answer(method.x, method.s, method.y)
                reached = form.error(point)
                if record is not None:
                    record(done, reached, lambda point=point: point)
                if reached < error:
                    best, error = point, reached
                why = None if error <= tolerance else progress.trouble(done, reached)
            if why is not None and error > tolerance:
                claim, message = Claim.FAILED, why
                break
        before = best
        best, error = self.finish(form, best, error, tolerance, method.counters)
        if record is not None and best is not before:
            record(done + 1, error, lambda point=best: point)
        if claim is Claim.FAILED and error <= CLOSE * tolerance:
            claim = Claim.INACCURATE
        return concluded(best, error, budget, dict(method.counters), claim, f"{message}, error {error:.1e}")

    def finish(
        self, form: ConicForm, best: Any, error: float, tolerance: float, counters: dict[str, int]
    ) -> tuple[Any, float]:
        """Finish with the best iterate."""
        return best, error
