"""A benchopt benchmark of the QPs of overhead_qps.py."""

from typing import Any

from benchopt import BaseObjective
from qpsolvers import Problem, Solution


class Objective(BaseObjective):
    name = "QP"
    min_benchopt_version = "1.6"
    sampling_strategy = "run_once"

    def set_data(self, problem: Problem) -> None:
        self.problem = problem

    def get_objective(self) -> dict[str, Any]:
        return {"problem": self.problem}

    def evaluate_result(self, solution: Solution) -> dict[str, float]:
        """The numbers that qpbenchmark notes, too."""
        return {
            "value": float(bool(solution.found)),
            "primal_residual": solution.primal_residual(),
            "dual_residual": solution.dual_residual(),
            "duality_gap": solution.duality_gap(),
        }

    def get_one_result(self) -> dict[str, Any]:
        return {"solution": Solution(self.problem)}
