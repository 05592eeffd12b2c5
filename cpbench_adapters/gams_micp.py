"""PATH on nonlinear complementarity problems: a process of GAMS a solve, which reads the model.

The time is that of the process: compiling the model, generating it, and the solver. GAMS' own count of seconds (resUsd)
has the launch of the solver in it, so that it is not handed on as what the solver reports.
Tolerance: a tenth of ours, on PATH's absolute residual: the size of F at a start says nothing about a solution,
and beside a pole it may be anything. An answer is claimed solved where the error of its rows agrees, each in its own
unit.
"""

from __future__ import annotations

import dataclasses
import math
import subprocess
import tempfile
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from cpbench.errors import Unavailable
from cpbench.formulations.nonlinear import MiCP, MiCPPoint
from cpbench.solvers.base import (
    Availability,
    Budget,
    Claim,
    Record,
    Solver,
    SolverOutput,
    SolverSpec,
    package_version,
    register,
)
from cpbench.solvers.shared.row_error import row_error
from cpbench.solvers.stopping import Stopping
from cpbench_adapters import gams_model, gams_workspace
from cpbench_adapters.gams_mcp import gams_availability, path_settings, path_spec, path_stopping

NORMAL, ITERATIONS, RESOURCES, LICENCE = 1, 2, 3, 7
"""Solver statuses of GAMS."""
CLOSE = 100.0
"""Factor of the tolerance up to which what PATH calls solved is claimed `inaccurate`, beyond it `failed`."""
GRACE = 10.0
"""Seconds beyond the budget after which the process is ended."""
SHARE, LEAST = 0.1, 1e-14
"""Share of our tolerance that PATH is asked for, and the least of all."""
UNSEEN = "absolute: it may pass too early where F is below 1, whose size is not known before it is solved"


@register
class PathMiCP(Solver):
    """Newton's method on the normal map, each linear problem solved by Lemke's pivoting."""

    spec: ClassVar[SolverSpec] = path_spec("gams-path-micp", "micp")

    def stopping(self, tolerance: float, problem: MiCP | None = None) -> Stopping:
        criterion = path_stopping(max(SHARE * tolerance, LEAST))
        return dataclasses.replace(criterion, differs=UNSEEN, factor=math.inf)

    def availability(self) -> Availability:
        without_gams = super().availability()
        return gams_availability() if without_gams.ok else without_gams

    def obstacle(self, problem: MiCP) -> str | None:
        n, F = problem.start.size, problem.F
        if n == 0:
            return "has no unknown (n = 0): GAMS refuses an empty model"
        lacking = gams_model.without_operator(F)
        if lacking:
            return f"F has {', '.join(lacking)}, for which GAMS has no smooth function"
        most = gams_workspace.most_rows()
        if most is not None and n > most:
            return f"n = {n} makes a model of {n} rows: the demo licence of GAMS ends at {most}"
        rows, columns = gams_model.idle(F)
        if rows or columns:
            return (
                f"{rows} rows of F have no unknown and {columns} unknowns of {n} occur nowhere: GAMS refuses to match "
                "an empty equation"
            )
        size = gams_model.lengths(F)
        if size > gams_model.LONGEST:
            return f"F written out has {size:.0e} characters, more than {gams_model.LONGEST:.0e}"
        return None

    def solve(
        self, prepared: MiCP, budget: Budget, options: Any, start: Any | None = None, record: Record | None = None
    ) -> SolverOutput:
        first = prepared.project(prepared.start if start is None else start.z)
        limits: dict[str, float] = {"iterLim": budget.iterations or 1_000_000}
        if math.isfinite(budget.seconds):
            limits["resLim"] = budget.seconds
        with tempfile.TemporaryDirectory(prefix="gams-") as name:
            folder = Path(name)
            (folder / "model.gms").write_text(gams_model.model(prepared, first, limits))
            settings = path_settings(self.stopping(budget.tolerance), budget).items()
            (folder / "path.opt").write_text("".join(f"{key} {value}\n" for key, value in settings))
            values = _run(folder, budget)
        if isinstance(values, str):
            return SolverOutput(claim=Claim.FAILED, message=values)
        ended, model_status, iterations, z = int(values[0]), int(values[1]), values[2], values[3:]
        if ended == LICENCE:
            raise Unavailable("licence", f"path has no licence; {gams_workspace.ADVICE}")
        point = MiCPPoint(prepared.project(z)) if np.isfinite(z).all() else None
        error = _error(prepared, point)
        if error <= budget.tolerance:
            claim = Claim.SOLVED
        elif ended in (ITERATIONS, RESOURCES):
            claim = Claim.MAX_ITER
        else:
            claim = Claim.INACCURATE if ended == NORMAL and error <= CLOSE * budget.tolerance else Claim.FAILED
        return SolverOutput(
            claim=claim,
            point=point,
            counters={"iterations": int(iterations)} if 0 <= iterations < 1e9 else {},
            message=f"solver status {ended}, model status {model_status}, error {error:.1e}",
        )

    def version(self) -> str:
        """Return the version of GAMS, whose solvers have no other."""
        return package_version("gamspy_base")


def _error(problem: MiCP, point: MiCPPoint | None) -> float:
    """Return the largest error of a row, in the row's own unit; ∞ without a point."""
    if point is None:
        return math.inf
    with np.errstate(all="ignore"):
        return row_error(point.z, problem.F(point.z), problem.F.jacobian(point.z), problem.lb, problem.ub)


def _run(folder: Path, budget: Budget) -> Any:
    """Return the numbers that the model wrote, or what went wrong in a line."""
    command = [str(gams_workspace.system_directory() / "gams"), "model.gms", "logOption=0", "threads=1"]
    command.append(f"license={gams_workspace.licence_file()}")
    seconds = budget.seconds + GRACE if math.isfinite(budget.seconds) else None
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        return "out of time: the process of GAMS was ended"
    if done.returncode == gams_workspace.LICENSING:
        raise Unavailable("licence", f"path; {gams_workspace.ADVICE}")
    written = folder / "answer.txt"
    if not written.exists():
        listing = folder / "model.lst"
        text = listing.read_text(errors="replace") if listing.exists() else ""
        complaints = [line.strip("* ") for line in text.splitlines() if line.startswith("****")]
        return f"GAMS ended with return code {done.returncode}: {'; '.join(complaints[:2]) or 'no message'}"
    return np.array([_read(word) for word in written.read_text().split()])


def _read(word: str) -> float:
    """Return a number of GAMS: it may be UNDF, NA, EPS or an infinity."""
    named = {"UNDF": math.nan, "NA": math.nan, "EPS": 0.0, "+INF": math.inf, "-INF": -math.inf}
    return named[word] if word in named else float(word)
