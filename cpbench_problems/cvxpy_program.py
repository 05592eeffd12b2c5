"""Programs of CVXPY as a QP or a coneqp, by the conversion that CVXPY itself makes for Clarabel: min ½xᵀPx + cᵀx + d
with Ax + s = b, s in a product of {0}, orthant and second-order cones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import ProblemError, Unavailable
from cpbench.formulations.base import Info, Problem
from cpbench.formulations.conic import ConeQP
from cpbench.formulations.programs import QP
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.storage.base import OFFSET, SENSE

NO_CONES = {"exp": "exponential cones", "psd": "semidefinite cones", "p3d": "power cones", "pnd": "power cones"}
"""Cones of CVXPY that no formulation has."""


def converted(problem: Any, name: str = "") -> tuple[Problem, Callable[[Any], dict[Any, Any]]]:
    """Return a `cvxpy.Problem` as a QP or coneqp, and what makes the values of its variables of a point.

    Raises ProblemError where it has integers or other cones, is not convex by CVXPY's rules, or has a parameter without
    a value; Unavailable without CVXPY.
    """
    try:
        import cvxpy
        from cvxpy import error, settings
        from cvxpy.reductions.solution import Solution
    except ImportError:
        raise Unavailable("missing", "cvxpy is not installed: pip install cvxpy") from None
    if not isinstance(problem, cvxpy.Problem):
        raise ProblemError("cvxpy", f"is a {type(problem).__name__}, expected a cvxpy.Problem")
    if problem.is_mixed_integer():
        names = [v.name() for v in problem.variables() if v.attributes["integer"] or v.attributes["boolean"]]
        raise ProblemError("cvxpy", f"has integers ({', '.join(names)}), which no formulation has")
    data: Any
    chain: Any
    inverse: Any
    try:
        data, chain, inverse = problem.get_problem_data(cvxpy.CLARABEL, ignore_dpp=True)
    except (error.DCPError, error.ParameterError, error.SolverError, ValueError) as cause:
        raise ProblemError("cvxpy", " ".join(str(cause).split())) from None
    dims = data["dims"]
    for part, cones in NO_CONES.items():
        if solution := getattr(dims, part):
            count = solution if isinstance(solution, int) else len(solution)
            raise ProblemError("cvxpy", f"has {count} {cones}, which no formulation has")
    properties: dict[str, Any] = {SENSE: "max"} if isinstance(problem.objective, cvxpy.Maximize) else {}
    if offset := float(inverse[-1][settings.OFFSET]):
        properties[OFFSET] = offset
    program = _program(data, dims, name, Info(title="program of CVXPY", properties=properties))

    reductions = chain.reductions[:-1]

    def back(point: Any) -> dict[Any, Any]:
        x = next(iter(point.arrays().values()))
        solution = Solution(cvxpy.OPTIMAL, 0.0, {data[settings.PARAM_PROB].x.id: x}, {}, {})
        for reduction, known in reversed(list(zip(reductions, inverse[:-1], strict=True))):
            solution = reduction.invert(solution, known)
        return {variable: solution.primal_vars[variable.id] for variable in problem.variables()}

    return program, back


def _program(data: Any, dims: Any, name: str, info: Info) -> Problem:
    """Return Clarabel's data as a problem."""
    c, b = np.asarray(data["c"], float), np.asarray(data["b"], float)
    A = sp.csr_array(data["A"])
    Q = sp.csr_array(data["P"]) if data.get("P") is not None else sp.csr_array((c.size, c.size))
    equal, above = int(dims.zero), int(dims.zero) + int(dims.nonneg)
    if not dims.soc:
        program = QP.build(Q, c, -A[equal:above], -b[equal:above], A[:equal], b[:equal], name=name)
        return replace(program, info=info)
    factors = (
        (Cone.ZERO, 1, equal),
        (Cone.NONNEGATIVE, 1, above - equal),
        *((Cone.SECOND_ORDER, 1, int(size), 1.0) for size in dims.soc),
    )
    K = ProductCone.of(*(factor for factor in factors if factor[2]))
    return replace(ConeQP.over(Q, c, K, -A, b), name=name, info=info)
