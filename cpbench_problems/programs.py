"""Problems that people have under another name, or as objects of other packages, with the way back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.api.problems import Modelled
from cpbench.errors import ProblemError
from cpbench_problems import cvxpy_program
from cpbench_problems.applications import (
    boxed_problem,
    columns_of,
    game_problem,
    least_squares_problem,
    rows_of,
    strategies,
)
from cpbench_problems.formats.array_forms import QPSOLVERS
from cpbench_problems.formats.array_problems import build_problem, choose
from cpbench_problems.formats.named_arrays import shapes_of


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
    program, back = cvxpy_program.converted(problem, name)
    return Modelled(program, back)


def from_qpsolvers(problem: Any, *, name: str = "") -> Modelled:
    """Return a `qpsolvers.Problem` as a QP; `lift` returns x, shape (n,).

    Raises FormatError where its parts do not fit each other, or P is stored as one triangle.

    >>> import cpbench, numpy, qpsolvers
    >>> given = qpsolvers.Problem(numpy.eye(2), numpy.array([-1.0, 2.0]), lb=numpy.zeros(2), ub=numpy.ones(2))
    >>> model = cpbench.from_qpsolvers(given)
    >>> model.lift(cpbench.solve(model.problem)).round(6).tolist()
    [1.0, 0.0]
    """
    form = QPSOLVERS
    given: dict[str, Any] = {part: getattr(problem, part, None) for part in form.arrays}
    if given["P"] is None or given["q"] is None:
        raise ProblemError("qpsolvers", f"is a {type(problem).__name__}, expected a qpsolvers.Problem")
    values: dict[str, Any] = {}
    for part, value in given.items():
        if value is not None:
            values[part] = sp.csr_array(value) if sp.issparse(value) else np.asarray(value)
    path = Path("qpsolvers.Problem")
    program = build_problem(path, values, *choose(path, shapes_of(values), form), name)
    return Modelled(program, lambda point: point.z)


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
    [0.75, 0.25] [0.25, 0.75]
    [0.0, 1.0] [0.0, 1.0]
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
