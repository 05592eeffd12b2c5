from typing import Any

import overhead_qps
from benchopt import BaseSolver
from qpsolvers import Problem, solve_problem


class Solver(BaseSolver):
    name = "backend"
    parameters = {"backend": list(overhead_qps.BACKENDS)}
    sampling_strategy = "run_once"

    def set_objective(self, problem: Problem) -> None:
        self.problem = problem
        self.settings = overhead_qps.SETTINGS[self.backend]

    def run(self, _: Any) -> None:
        self.solution = solve_problem(self.problem, self.backend, **self.settings)

    def get_result(self) -> dict[str, Any]:
        return {"solution": self.solution}
