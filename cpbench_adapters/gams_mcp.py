"""PATH, the standard solver of mixed complementarity problems, through gamspy: one process of GAMS a worker.

GAMS runs in a separate process, which is started in the warm-up and has one model, whose data are replaced; the numbers
reach it in `hand_over`, untimed, as those of a solver in this process are in its memory. What is timed is the solve
statement: GAMS generates the model, runs the solver in yet another process and reads its answer. GAMS' own count of
seconds (resUsd) has the launch of that process in it, so that it is not handed on as what the solver reports.
"""

from __future__ import annotations

import os
from functools import cache
from typing import Any, ClassVar

import numpy as np

from cpbench.errors import Unavailable
from cpbench.formulations import LCP, MLCP
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
    register,
)
from cpbench.solvers.stopping import Stopping, no_looser
from cpbench_adapters import gams_workspace
from cpbench_adapters.gams_workspace import explained, workspace
from cpbench_adapters.scaled_mcp import ScaledMCP, scaled_mcp, share, small_problem

CLAIMS = {
    ("NormalCompletion", "OptimalGlobal"): Claim.SOLVED,
    ("NormalCompletion", "OptimalLocal"): Claim.SOLVED,
    ("NormalCompletion", "InfeasibleGlobal"): Claim.INFEASIBLE,
    "IterationInterrupt": Claim.MAX_ITER,
    "ResourceInterrupt": Claim.MAX_ITER,
}
"""Solver status, or solver and model status -> our claim; every other end is FAILED."""


TOLERANCES = {"convergence_tolerance": 1e-6}
"""PATH's own tolerance, by its name in the option file."""


def path_stopping(tolerance: float) -> Stopping:
    """Return PATH's test, which is asked for `tolerance` in its own measure."""
    settings = no_looser(dict.fromkeys(TOLERANCES, tolerance), TOLERANCES)
    return Stopping(test="residual of its normal map, absolute", settings=settings, defaults=TOLERANCES)


def path_settings(stopping: Stopping, budget: Budget) -> dict[str, Any]:
    """Return PATH's option file; its limit of pivots is raised to GAMS', which the budget bounds."""
    return {**stopping.settings, "cumulative_iteration_limit": budget.iterations or 1_000_000}


class GamsPath(Solver):
    """Newton's method on the normal map, each linear problem solved by Lemke's pivoting. Tolerance: on the residual of
    the scaled problem (`scaled_mcp`)."""

    def stopping(self, tolerance: float, problem: LCP | MLCP | None = None) -> Stopping:
        return path_stopping(share(tolerance) if problem is None else scaled_mcp(problem).share(tolerance))

    def availability(self) -> Availability:
        without_gams = super().availability()
        return gams_availability() if without_gams.ok else without_gams

    def obstacle(self, problem: LCP | MLCP) -> str | None:
        n = sum(problem.point_sizes.values())
        if n == 0:
            return "has no unknown (n = 0): GAMS refuses an empty model"
        most = gams_workspace.most_rows()
        if most is not None and n > most:
            return f"n = {n} makes a model of {n} rows: the demo licence of GAMS ends at {most}"
        rows, columns = _empty(problem)
        if rows or columns:
            return (
                f"{rows} rows and {columns} columns of {n} have no entry: GAMS refuses to match an empty equation, "
                "and an unknown that occurs nowhere"
            )
        return None

    def hand_over(self, problem: LCP | MLCP) -> ScaledMCP:
        mcp = scaled_mcp(problem)
        with explained(self.spec.name):
            workspace().load(mcp)
        return mcp

    def solve(
        self, prepared: ScaledMCP, budget: Budget, options: Any, start: Any | None = None, record: Record | None = None
    ) -> SolverOutput:
        with explained(self.spec.name):
            gams = workspace()
            gams.load(prepared)
            settings = path_settings(path_stopping(prepared.share(budget.tolerance)), budget)
            gams.solve(settings, budget, prepared.start(start))
            model, x = gams.model, gams.x.toDense()
            ended, model_status = model.solve_status.name, model.status.name
            if "LicenseError" in (ended, model_status):
                raise Unavailable("licence", f"path: {ended}, {model_status}; {gams_workspace.ADVICE}")
        claim = CLAIMS.get((ended, model_status)) or CLAIMS.get(ended, Claim.FAILED)
        return SolverOutput(
            claim=claim,
            point=prepared.point(x) if np.isfinite(x).all() else None,
            counters={"iterations": int(model.num_iterations)} if _known(model.num_iterations) else {},
            message=f"{ended}, {model_status}",
        )

    def warmup(self) -> None:
        """Start GAMS, which stays: its threads and its process are no solve's."""
        self.run(small_problem(self.spec.node))

    def version(self) -> str:
        """Return the version of GAMS, whose solvers have no other."""
        return package_version("gamspy_base")


def path_spec(name: str, node: str) -> SolverSpec:
    """Return the spec of PATH on the problems of a node."""
    return SolverSpec(
        name=name,
        node=node,
        summary="PATH through GAMS: Newton on the normal map, Lemke pivoting inside",
        method="Newton with pivoting",
        citation="Dirkse and Ferris, Optim. Methods Softw. 5 (1995); Ferris and Munson, ibid. 12 (1999)",
        requires=("gamspy",),
        install="pip install gamspy",
        licence="proprietary",
        publishing=gams_workspace.PUBLISHING,
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC, Trait.LAUNCHES, Trait.WARM_START}),
    )


@register
class PathLCP(GamsPath):
    """The method for the LCP."""

    spec: ClassVar[SolverSpec] = path_spec("gams-path", "lcp")


@register
class PathMLCP(GamsPath):
    """The method for the MLCP, its equations as they are."""

    spec: ClassVar[SolverSpec] = path_spec("gams-path-mlcp", "mlcp")


@cache
def gams_availability() -> Availability:
    """Return whether GAMS starts with its licence and has PATH; costs one start of GAMS a process, 20 ms."""
    from gamspy.utils import getInstalledSolvers

    try:
        if "PATH" not in getInstalledSolvers(os.fspath(gams_workspace.system_directory())):
            return Availability("missing", "gamspy install solver path")
        code, message = gams_workspace.refusal()
    except Exception as error:
        return Availability("broken", f"{type(error).__name__}: {error}")
    if code == gams_workspace.LICENSING:
        return Availability("licence", f"{message}; {gams_workspace.ADVICE}")
    return Availability("broken", message) if code else Availability("ok")


def _empty(problem: LCP | MLCP) -> tuple[int, int]:
    """Return how many rows and columns of the problem's matrix have no entry."""
    if isinstance(problem, LCP):
        return _idle(problem.M, axis=1), _idle(problem.M, axis=0)
    A, B, C, D = problem.A, problem.B, problem.C, problem.D
    rows = _idle(A, C, axis=1) + _idle(D, B, axis=1)
    return rows, _idle(A, D, axis=0) + _idle(C, B, axis=0)


def _idle(*matrices: Matrix, axis: int) -> int:
    """Return rows (axis 1) or columns (axis 0) in which none of the matrices has an entry that is not 0."""
    return int((sum(np.asarray((M != 0).sum(axis=axis)).ravel() for M in matrices) == 0).sum())


def _known(value: Any) -> bool:
    """Return whether GAMS knows the value: it has numbers beyond 1e299 for what it does not."""
    return value is not None and 0.0 <= value < 1e299
