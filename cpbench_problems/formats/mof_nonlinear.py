"""Nonlinear programs and complementarity problems as models of MathOptFormat."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from cpbench.formulations.expressions import Map
from cpbench_problems.formats import to_mof
from cpbench_problems.formats.mof_write import FEASIBILITY, MODELS, Written, numbered

MINOR = to_mof.VERSION["minor"]
CONVEX = " convex"
"""Behind the formulation of an nlp that was said to be convex."""


@MODELS.of("nlp")
def nlp(problem: Any) -> Written:
    """Write every row as a separate function, as simple as it reads back; g, or h, as one vector where its rows share
    so much that this would be far longer.
    """
    names = numbered("z", problem.start.size)

    def objective() -> Iterator[str]:
        functions = to_mof.scalars(problem.f, names)
        assert functions is not None  # one row shares with no other
        yield f'{{"sense": "min", "function": {_text(functions[0])}}}'

    def rows() -> Iterator[str]:
        yield from _rows("g", problem.g, names, "GreaterThan", "lower", "Nonnegatives")
        yield from _rows("h", problem.h, names, "EqualTo", "value", "Zeros")

    return Written(
        names=names,
        lb=problem.lb,
        ub=problem.ub,
        start=problem.start,
        parameters=problem.parameters,
        objective=objective(),
        rows=rows(),
        entries=sum(F.operations for F in problem.maps().values()),
        minor=MINOR,
        remark=CONVEX if problem.convex else "",
    )


@MODELS.of("ncp")
def ncp(problem: Any) -> Written:
    n = problem.start.size
    return _complements(problem, np.zeros(n), np.full(n, np.inf))


@MODELS.of("micp")
def micp(problem: Any) -> Written:
    return _complements(problem, problem.lb, problem.ub)


def _complements(problem: Any, lb: Any, ub: Any) -> Written:
    """Write one constraint: (F(z), z) in Complements."""
    names = numbered("z", problem.start.size)

    def rows() -> Iterator[str]:
        if not names:
            return  # a set has a dimension of 2 at least
        function = to_mof.vector(problem.F, names)
        function["rows"] += [{"type": "+", "args": [name]} for name in names]
        yield _constraint("complementarity", function, {"type": "Complements", "dimension": 2 * len(names)})

    return Written(
        names=names,
        lb=lb,
        ub=ub,
        start=problem.start,
        parameters=problem.parameters,
        objective=[FEASIBILITY],
        rows=rows(),
        entries=problem.F.operations,
        minor=MINOR,
    )


def _rows(label: str, F: Map, names: list[str], kind: str, side: str, cone: str) -> Iterator[str]:
    functions = to_mof.scalars(F, names)
    if functions is None:
        yield _constraint(label, to_mof.vector(F, names), {"type": cone, "dimension": F.rows})
        return
    for k, function in enumerate(functions, 1):
        value = -function["constant"] if function.get("constant") else 0.0  # JuMP takes no constant in a row
        moved = function | {"constant": 0.0} if "constant" in function else function
        yield _constraint(f"{label}[{k}]", moved, {"type": kind, side: value})


def _constraint(name: str, function: dict[str, Any], set_: dict[str, Any]) -> str:
    return _text({"name": name, "function": function, "set": set_})


def _text(value: Any) -> str:
    return json.dumps(value, allow_nan=False)
