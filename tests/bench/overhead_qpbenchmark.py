"""A qpbenchmark test set of the QPs of overhead_qps.py."""

from collections.abc import Iterator
from pathlib import Path

import overhead_qps
from qpbenchmark.problem import Problem
from qpbenchmark.solver_settings import SolverSettings
from qpbenchmark.test_set import TestSet
from qpbenchmark.tolerance import Tolerance


class OverheadQpbenchmark(TestSet):
    description = "Random dense QPs"
    title = "Overhead"
    sparse_only = False

    def __init__(self) -> None:
        super().__init__()
        self.solvers = set(overhead_qps.BACKENDS)

    def define_tolerances(self, runtime: float = 10.0) -> None:
        eps = overhead_qps.TOLERANCE
        self.tolerances = {"default": Tolerance(primal=eps, dual=eps, gap=eps, runtime=runtime)}

    def define_solver_settings(self) -> None:
        settings = SolverSettings()
        for backend, given in overhead_qps.SETTINGS.items():
            for name, value in given.items():
                settings.set_param(backend, name, value)
        self.solver_settings = {"default": settings}

    def __iter__(self) -> Iterator[Problem]:
        for path in overhead_qps.paths():
            yield Problem(**overhead_qps.read(path), A=None, b=None, lb=None, ub=None, name=Path(path).stem)
