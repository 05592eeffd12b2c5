"""Complementarity solvers of GAMS, through gamspy: one process of GAMS a worker, one model, data replaced.

The model is F(i) .. Σⱼ K(i,j) x(j) + k(i) =N= 0, matched to x(i), whose bounds say the rest: free for the equations
of an MLCP, x ≥ 0 where 0 ≤ x ⟂ F ≥ 0. GAMS runs in a process of its own, which is started in the warm-up; the numbers
reach it in `hand_over`, untimed, as those of a solver in this process are in its memory. What is timed is the solve
statement: GAMS generates the model, runs the solver in yet another process and reads its answer.
"""

from __future__ import annotations

import contextlib
import logging
import math
import os
import signal
import threading
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.errors import Ended, Unavailable
from cpbench.formulations import LCP, MLCP
from cpbench.matrices import Matrix
from cpbench.solvers.adapters import gams_licence
from cpbench.solvers.adapters.scaled_mcp import ScaledMCP, scaled_mcp
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

CLAIMS = {
    ("NormalCompletion", "OptimalGlobal"): Claim.SOLVED,
    ("NormalCompletion", "OptimalLocal"): Claim.SOLVED,
    ("NormalCompletion", "InfeasibleGlobal"): Claim.INFEASIBLE,
    "IterationInterrupt": Claim.MAX_ITER,
    "ResourceInterrupt": Claim.MAX_ITER,
}
"""Solver status, or solver and model status -> our claim; every other end is FAILED."""


class GamsMCP(Solver):
    """One solver of GAMS for LCP and MLCP. Tolerance: on the residual of the scaled problem (`scaled_mcp`)."""

    guest: ClassVar[str]
    """Its name in GAMS."""

    @abstractmethod
    def settings(self, tolerance: float, budget: Budget) -> Mapping[str, Any]:
        """Its option file."""

    def rows(self, problem: LCP | MLCP) -> int:
        """Rows of the model that is solved in the end."""
        return sum(problem.point_sizes.values())

    def availability(self) -> Availability:
        found = super().availability()
        return _availability(self.guest) if found.ok else found

    def obstacle(self, problem: LCP | MLCP) -> str | None:
        n = sum(problem.point_sizes.values())
        if n == 0:
            return "has no unknown (n = 0): GAMS refuses an empty model"
        most = gams_licence.most_rows()
        if most is not None and self.rows(problem) > most:
            return f"n = {n} makes a model of {self.rows(problem)} rows: the demo licence of GAMS ends at {most}"
        rows, columns = _empty(problem)
        if rows or columns:
            return (
                f"{rows} rows and {columns} columns of {n} have no entry: GAMS refuses to match an empty equation, "
                "and an unknown that occurs nowhere"
            )
        return None

    def hand_over(self, problem: LCP | MLCP) -> ScaledMCP:
        mcp = scaled_mcp(problem)
        with _explained(self.spec.name):
            _workspace(os.getpid()).load(mcp)
        return mcp

    def solve(
        self, prepared: ScaledMCP, budget: Budget, options: Any, start: Any | None = None, record: Record | None = None
    ) -> SolverOutput:
        with _explained(self.spec.name):
            workspace = _workspace(os.getpid())
            workspace.load(prepared)
            workspace.solve(self.guest, self.settings(prepared.tolerance(budget), budget), budget)
            model, x = workspace.model, workspace.x.toDense()
            ended, found = model.solve_status.name, model.status.name
            if "LicenseError" in (ended, found):
                raise Unavailable("licence", f"{self.guest}: {ended}, {found}; {gams_licence.ADVICE}")
        claim = CLAIMS.get((ended, found)) or CLAIMS.get(ended, Claim.FAILED)
        return SolverOutput(
            claim=claim,
            point=prepared.point(x) if np.isfinite(x).all() else None,
            counters={"iterations": int(model.num_iterations)} if _told(model.num_iterations) else {},
            message=f"{ended}, {found}",
            reported=float(model.total_solver_time) if _told(model.total_solver_time) else None,
        )

    def warmup(self) -> None:
        """Starts GAMS, which stays: its threads and its process are no solve's."""
        one = np.eye(1)
        problems = {
            "lcp": LCP(M=np.eye(2), q=np.array([-1.0, -2.0])),
            "mlcp": MLCP(A=one, B=one, C=one, D=-one, a=np.ones(1), b=-np.ones(1)),
        }
        self.run(problems[self.spec.node])

    def version(self) -> str:
        """Of GAMS, whose solvers have no other."""
        return package_version("gamspy_base")


def gams_spec(name: str, node: str, *, summary: str, method: str, citation: str, install: str, **more: Any) -> Any:
    """What the specs of all of them share."""
    return SolverSpec(
        name=name,
        node=node,
        summary=summary,
        method=method,
        citation=citation,
        requires=("gamspy",),
        install=install,
        licence="proprietary",
        publishing=gams_licence.PUBLISHING,
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
        **more,
    )


class Workspace:
    """A process of GAMS with the model, and the problem whose numbers it has."""

    def __init__(self) -> None:
        import gamspy as gp

        logging.getLogger("MODEL").setLevel(logging.ERROR)  # it prints every end that is not a solution
        with _own_interrupt():
            self.container = gp.Container()
        i = self.i = gp.Set(self.container, "i")
        j = gp.Alias(self.container, "j", i)
        self.K = gp.Parameter(self.container, "K", domain=[i, j])
        self.k = gp.Parameter(self.container, "c", domain=i)
        self.x = gp.Variable(self.container, "x", domain=i)
        F = gp.Equation(self.container, "F", type="nonbinding", domain=i)
        F[i] = gp.Sum(j, self.K[i, j] * self.x[j]) + self.k[i] == gp.Number(0)
        self.model = gp.Model(self.container, "complementarity", problem="MCP", matches={F: self.x})
        self._loaded: ScaledMCP | None = None

    def load(self, mcp: ScaledMCP) -> None:
        """Give GAMS the numbers of a problem, unless it has them."""
        import pandas as pd

        if self._loaded is mcp:
            return
        self._loaded = None
        labels = [str(row) for row in range(mcp.k.size)]
        kind = pd.CategoricalDtype(labels, ordered=True)
        entries = sp.coo_array(mcp.K)
        rows, columns = (pd.Categorical.from_codes(codes, dtype=kind) for codes in entries.coords)
        self.i.setRecords(labels)
        self.K.setRecords(pd.DataFrame({"i": rows, "j": columns, "value": entries.data}))
        self.k.setRecords(np.array(mcp.k))
        self._loaded = mcp

    def solve(self, guest: str, settings: Mapping[str, Any], budget: Budget) -> None:
        """Run a solver on what is loaded, from x = 0: the answer before is still there, and would be the start."""
        import gamspy as gp

        assert self._loaded is not None
        n, free = self._loaded.k.size, self._loaded.free
        lower = np.where(np.arange(n) < free, -np.inf, 0.0)
        self.x.setRecords({"level": np.zeros(n), "lower": lower, "upper": np.full(n, np.inf)})
        limits: dict[str, Any] = {"threads": 1}
        if math.isfinite(budget.seconds):
            limits["time_limit"] = budget.seconds
        if budget.iterations is not None:
            limits["iteration_limit"] = budget.iterations
        # no `output`: gamspy stops reading at the end of an inner job (NLPEC has one), and the pipe fills until it blocks
        self.model.solve(solver=guest, options=gp.Options(**limits), solver_options=dict(settings))

    def ended(self) -> int | None:
        """Exit code of the process of GAMS, None while it runs."""
        return self.container._execution_engine._process.poll()


@cache
def _workspace(pid: int) -> Workspace:
    """The workspace of this process (a forked one cannot share it)."""
    return Workspace()


@contextlib.contextmanager
def _own_interrupt() -> Iterator[None]:
    """gamspy takes SIGINT for itself; it stays ours."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handler = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


@contextlib.contextmanager
def _explained(who: str) -> Iterator[None]:
    """What gamspy raises, as what it is: a refused licence, a dead process, or its own summary of errors."""
    try:
        yield
    except Unavailable:
        raise
    except Exception as error:
        made = _workspace.cache_info().currsize
        code = _workspace(os.getpid()).ended() if made else None
        _workspace.cache_clear()  # nobody knows what is left of it
        refused, said = _refusal()
        if refused == gams_licence.LICENSING:
            raise Unavailable("licence", f"{said}; {gams_licence.ADVICE}") from None
        if getattr(error, "return_code", None) == gams_licence.LICENSING:
            raise Unavailable("licence", f"{_summary(error)}; {gams_licence.ADVICE}") from None
        if code is not None and code != 0:
            raise Ended(who, code) from None
        raise RuntimeError(f"{type(error).__name__}: {_summary(error)}") from error


def _refusal() -> tuple[int, str]:
    """What GAMS says of its licence; nothing where it cannot even be asked."""
    try:
        return gams_licence.refusal()
    except Exception:
        return 0, ""


def _summary(error: Exception) -> str:
    """The lines that GAMS marks with stars, else the first line."""
    lines = str(error).splitlines() or [""]
    return "; ".join(line.strip("* ") for line in lines if line.startswith("****")) or lines[0]


@cache
def _availability(guest: str) -> Availability:
    """Whether GAMS starts with its licence and has the solver; costs one start of GAMS a process, 20 ms."""
    try:
        return _installed(guest) or _licensed()
    except Exception as error:
        return Availability("broken", f"{type(error).__name__}: {error}")


def _installed(guest: str) -> Availability | None:
    """`missing` for a solver that GAMS does not know yet, else None."""
    from gamspy.utils import getInstalledSolvers

    if guest.upper() in getInstalledSolvers(os.fspath(gams_licence.system_directory())):
        return None
    return Availability("missing", f"gamspy install solver {guest}")


@cache
def _licensed() -> Availability:
    code, said = gams_licence.refusal()
    if code == 0:
        return Availability("ok")
    licence = code == gams_licence.LICENSING
    return Availability("licence", f"{said}; {gams_licence.ADVICE}") if licence else Availability("broken", said)


def _empty(problem: LCP | MLCP) -> tuple[int, int]:
    """How many rows and columns of the problem's matrix have no entry."""
    if isinstance(problem, LCP):
        return _idle(problem.M, axis=1), _idle(problem.M, axis=0)
    A, B, C, D = problem.A, problem.B, problem.C, problem.D
    rows = _idle(A, C, axis=1) + _idle(D, B, axis=1)
    return rows, _idle(A, D, axis=0) + _idle(C, B, axis=0)


def _idle(*matrices: Matrix, axis: int) -> int:
    """Rows (axis 1) or columns (axis 0) in which none of the matrices has an entry that is not 0."""
    return int((sum(np.asarray((M != 0).sum(axis=axis)).ravel() for M in matrices) == 0).sum())


def _told(value: Any) -> bool:
    """GAMS has numbers beyond 1e299 for what it does not know."""
    return value is not None and 0.0 <= value < 1e299
