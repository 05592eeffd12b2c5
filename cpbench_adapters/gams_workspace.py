"""GAMS at work beside a worker: its process, the one model in it, what its failures mean, and what its licence allows.

The model is F(i) .. Σⱼ K(i,j) x(j) + c(i) =N= 0, matched to x(i), whose bounds say the rest: free for the equations
of an MLCP, x ≥ 0 where 0 ≤ x ⟂ F ≥ 0.
"""

from __future__ import annotations

import contextlib
import logging
import math
import os
import signal
import subprocess
import tempfile
import threading
from collections.abc import Generator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import Ended, Unavailable
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget
from cpbench.solvers.external.folder import Folder
from cpbench_adapters.scaled_mcp import ScaledMCP

GENERATED = 2**30
"""Bytes of the largest files that gamspy writes, more or less: too much for a folder in memory."""


LICENSING = 7
"""Return code of GAMS for a licence that it refuses."""
DEMO_ROWS = 1000
"""Most rows and columns of a nonlinear or complementarity model under the demo licence."""
ADVICE = (
    "gamspy install license CODE, with one of your own: newer packages bring no newer demo licence; or run PATH by its "
    "own licence, as 'PATH without GAMS' in docs/guides/modeller.md says"
)
PUBLISHING = (
    "GAMS' licence: benchmarks may be published with the methodology documented, unless COPT, CPLEX, Gurobi, Knitro, "
    "LINDO or Xpress take part, which needs written consent"
)


class Workspace:
    """A process of GAMS with the model, and the problem whose numbers it has."""

    def __init__(self) -> None:
        import gamspy as gp

        logging.getLogger("MODEL").setLevel(logging.ERROR)  # it prints every end that is not a solution
        self._folder = Folder(GENERATED)
        with _own_interrupt():
            self.container = gp.Container(working_directory=str(self._folder.path))
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
        self._tidy()
        labels = [str(row) for row in range(mcp.k.size)]
        kind = pd.CategoricalDtype(labels, ordered=True)
        entries = sp.coo_array(mcp.K)
        rows, columns = (pd.Categorical.from_codes(codes, dtype=kind) for codes in entries.coords)
        self.i.setRecords(labels)
        self.K.setRecords(pd.DataFrame({"i": rows, "j": columns, "value": entries.data}))
        self.k.setRecords(np.array(mcp.k))
        self._loaded = mcp

    def solve(self, settings: Mapping[str, Any], budget: Budget, first: Vector) -> None:
        """Run PATH on what is loaded, from the levels `first`: else it would start at the answer before."""
        import gamspy as gp

        assert self._loaded is not None
        n, free = self._loaded.k.size, self._loaded.free
        lower = np.where(np.arange(n) < free, -np.inf, 0.0)
        self.x.setRecords({"level": np.maximum(first, lower), "lower": lower, "upper": np.full(n, np.inf)})
        limits: dict[str, Any] = {"threads": 1}
        if math.isfinite(budget.seconds):
            limits["time_limit"] = budget.seconds
        if budget.iterations is not None:
            limits["iteration_limit"] = budget.iterations
        self.model.solve(solver="path", options=gp.Options(**limits), solver_options=dict(settings))

    def _tidy(self) -> None:
        """Delete the files of jobs that are done: gamspy keeps the data of every problem."""
        for done in self._folder.path.glob("_*"):
            if done.is_file():
                done.unlink()

    def ended(self) -> int | None:
        """Return the exit code of GAMS, None while it runs."""
        return self.container._execution_engine._process.poll()


_workspaces: dict[int, Workspace] = {}
"""By process: one that is forked cannot share that of its parent."""


def workspace() -> Workspace:
    """Return the workspace of this process."""
    if os.getpid() not in _workspaces:
        _workspaces[os.getpid()] = Workspace()
    return _workspaces[os.getpid()]


@contextlib.contextmanager
def _own_interrupt() -> Generator[None]:
    """Return gamspy takes SIGINT for itself; it stays ours."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handler = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


@contextlib.contextmanager
def explained(solver: str) -> Generator[None]:
    """Return gamspy's exception as what it is: a refused licence, a dead process, or its own summary of errors."""
    try:
        yield
    except Unavailable:
        raise
    except Exception as error:
        lost = _workspaces.pop(os.getpid(), None)  # what is left of it is unknown
        code = lost.ended() if lost else None
        refused, message = _refusal()
        if refused == LICENSING:
            raise Unavailable("licence", f"{message}; {ADVICE}") from None
        if getattr(error, "return_code", None) == LICENSING:
            raise Unavailable("licence", f"{_summary(error)}; {ADVICE}") from None
        if code is not None and code != 0:
            raise Ended(solver, code) from None
        raise RuntimeError(f"{type(error).__name__}: {_summary(error)}") from error


def _refusal() -> tuple[int, str]:
    """Return what GAMS says of its licence; nothing where it cannot even be asked."""
    try:
        return refusal()
    except Exception:
        return 0, ""


def _summary(error: Exception) -> str:
    """Return the lines that GAMS marks with stars, else the first line."""
    lines = str(error).splitlines() or [""]
    return "; ".join(line.strip("* ") for line in lines if line.startswith("****")) or lines[0]


def refusal() -> tuple[int, str]:
    """Return GAMS' return code and complaints when it is started on an empty file (20 ms); (0, '') when all is well."""
    with tempfile.TemporaryDirectory(prefix="gams-") as folder:
        empty = Path(folder) / "empty.gms"
        empty.touch()
        command = [str(system_directory() / "gams"), str(empty), f"license={licence_file()}", "logOption=3"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace", timeout=60)
    if done.returncode == 0:
        return 0, ""
    complaints = [line.removeprefix("***").strip() for line in done.stdout.splitlines() if line.startswith("***")]
    return done.returncode, "; ".join(complaints[:2]) or f"GAMS ended with return code {done.returncode}"


def system_directory() -> Path:
    """Return where gamspy takes GAMS from."""
    import gamspy

    return Path(gamspy.get_option("GAMS_SYSDIR"))


def licence_file() -> Path:
    """Return the licence that gamspy uses: GAMSPY_LICENSE_PATH, an installed one, the demo licence in the package."""
    from gamspy.utils import _get_license_path

    return Path(_get_license_path(os.fspath(system_directory())))


@cache
def most_rows() -> int | None:
    """Return rows and columns that the licence allows, None for a licence without that limit."""
    try:
        text = licence_file().read_text(errors="replace")
    except (ImportError, OSError):
        return DEMO_ROWS  # the caller cannot solve anyway; without gamspy the demo licence is what comes with it
    return DEMO_ROWS if "GAMS_Demo" in text else None
