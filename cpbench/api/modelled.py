"""Problems that people have under another name, and as objects of other packages, with the way back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from cpbench.api import cvxpy_program
from cpbench.api.problems import point_of
from cpbench.api.solution import Solution
from cpbench.formulations.applications import (
    boxed_problem,
    columns_of,
    game_problem,
    least_squares_problem,
    rows_of,
    strategies,
)
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


def from_game(A: Any, B: Any, *, name: str = "") -> Modelled:
    """Return a bimatrix game as an LCP, whose solutions are its equilibria (Cottle, Pang, Stone, §1.4).

    `lift` returns (x, y): the probabilities of the rows, shape (m,), and of the columns, shape (n,).

    Parameters
    ----------
    A, B : payoffs of the player who chooses the row and of the one who chooses the column, shape (m, n); both want
        them large. name : of the problem.

    Raises ProblemError where the shapes differ, a matrix is empty, or an entry is not finite.

    >>> import cpbench
    >>> game = cpbench.from_game(A=[[3, 0], [0, 1]], B=[[1, 0], [0, 3]])
    >>> for point in cpbench.every_solution(game.problem).points:
    ...     print(*(part.tolist() for part in game.lift(point)))
    [1.0, 0.0] [1.0, 0.0]
    [0.0, 1.0] [0.0, 1.0]
    [0.75, 0.25] [0.25, 0.75]
    """
    problem = game_problem(A, B, name)
    return Modelled(problem, lambda point: strategies(problem, point))


def from_least_squares(A: Any, b: Any, lb: Any = None, ub: Any = None, *, name: str = "") -> Modelled:
    """Return min ½‖Ax − b‖² with lb ≤ x ≤ ub as a QP in (x, r), r = Ax − b, which does not form AᵀA.

    `lift` returns x, shape (n,).

    Parameters
    ----------
    A : (m, n), dense or sparse. b : (m,). lb, ub : (n,), or one number for all; None: no bound. name : of the problem.

    Raises ProblemError where the shapes differ, an entry is not finite, or the bounds exclude each other.

    >>> import cpbench
    >>> model = cpbench.from_least_squares([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], [1.0, 0.0, -1.0], lb=0.0)
    >>> model.lift(cpbench.solve(model.problem)).round(6).tolist()
    [0.5, 0.0]
    """
    problem = least_squares_problem(A, b, lb, ub, name)
    return Modelled(problem, lambda point: point.z[: columns_of(problem)])


def from_boxed_lcp(A: Any, b: Any, lo: Any, hi: Any, findex: Any = None, *, name: str = "") -> Modelled:
    """Return the boxed LCP of a physics engine as an AVI: Ax = b + w, lo ≤ x ≤ hi, w ≥ 0 at lo, w ≤ 0 at hi, else 0.

    The sign of b is that of ODE, DART and Bullet; where yours is w = Ax + b, give −b. `lift` returns x, shape (n,).

    Parameters
    ----------
    A : (n, n), dense or sparse. b, lo, hi : (n,), lo and hi finite or infinite. findex : (n,) whole numbers; −1 where
        the bounds are constant, j ≥ 0 where the row is friction at row j: then hi is the coefficient of friction, lo is
        −hi, and |x_i| ≤ hi_i x_j. None: −1 everywhere. name : of the problem.

    Raises ProblemError where the shapes differ or a bound is not one that this law has.

    >>> import cpbench
    >>> model = cpbench.from_boxed_lcp([[1, 0], [0, 1]], [2, -3], [0, -0.5], [float("inf"), 0.5], findex=[-1, 0])
    >>> model.lift(cpbench.solve(model.problem)).round(6).tolist()
    [2.0, -1.0]
    """
    problem = boxed_problem(A, b, lo, hi, findex, name)
    return Modelled(problem, lambda point: point.z[: rows_of(problem)])


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
