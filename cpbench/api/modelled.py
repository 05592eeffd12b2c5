"""Problems that people have under another name, and as objects of other packages, with the way back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from cpbench.api import cvxpy_program
from cpbench.api.problems import point_of
from cpbench.api.solution import Solution
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.primal import Primal, primal_of


@dataclass(frozen=True, eq=False, repr=False)
class Modelled:
    """A problem that was made of a model, and the way back to the unknowns of the model.

    Attributes
    ----------
    problem : the problem, for all functions that take one. back : makes the unknowns of the model of a point.
    """

    problem: Problem
    back: Callable[[Any], Any]

    def lift(self, answer: Solution | Point | Sequence[float]) -> Any:
        """Return the unknowns of the model from an answer to `problem`, as the function that made it says.

        Parameters
        ----------
        answer : a solution, a point, or a vector of the unknowns with or without multipliers.

        Raises PointError where it is not an answer to `problem`.
        """
        given = answer if isinstance(answer, Solution | Point) else primal_of(self.problem, answer)
        if isinstance(given, Primal):
            zero = self.problem.zero_point().arrays()
            return self.back(self.problem.point_type(**{**zero, given.name: given.values}))
        return self.back(point_of(self.problem, answer))

    def __repr__(self) -> str:
        return f"Modelled as {self.problem}"


def from_cvxpy(problem: Any, *, name: str = "") -> Modelled:
    """Return a `cvxpy.Problem` as a QP, or as a coneqp where it has second-order cones, by CVXPY's own conversion.

    `lift` returns the value of each variable of the problem, by variable, and does not change the variables.

    Raises ProblemError where it has integers, exponential, power or semidefinite cones, is not convex by CVXPY's rules
    or has a parameter without a value; Unavailable without CVXPY.

    >>> import cpbench, cvxpy
    >>> x = cvxpy.Variable(2)
    >>> model = cpbench.from_cvxpy(cvxpy.Problem(cvxpy.Minimize(cvxpy.sum(x)), [cvxpy.norm(x) <= 5, x[0] == 3]))
    >>> model.problem.node, model.lift(cpbench.solve(model.problem))[x].round(5).tolist()
    ('coneqp', [3.0, -4.0])
    """
    made, back = cvxpy_program.converted(problem, name)
    return Modelled(made, back)
