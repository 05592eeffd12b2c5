"""Quadratic programs as objects of other packages, with the way back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.api.modelled import Modelled
from cpbench.errors import ProblemError
from cpbench_problems.formats.array_forms import QPSOLVERS
from cpbench_problems.formats.array_problems import build_problem, choose
from cpbench_problems.formats.named_arrays import shapes_of


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
    made = build_problem(path, values, *choose(path, shapes_of(values), form), name)
    return Modelled(made, lambda point: point.z)
