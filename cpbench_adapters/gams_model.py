"""A nonlinear complementarity problem as a model in GAMS' language: one scalar variable and one equation a row.

F's operations are written out as expressions; what occurs twice is written twice, up to a limit. GAMS wants smooth
functions in such models, so that maximum, absolute value, comparisons and the like have no operator there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from cpbench.formulations.expressions import Map, Operator
from cpbench.formulations.nonlinear import MiCP
from cpbench.foundation.matrices import Vector

LONGEST = 4_000_000
"""Characters of all expressions."""
ROOT = math.sqrt(2.0)

UNARY: Mapping[Operator, str] = {
    Operator.NEG: "(-{})",
    Operator.SQRT: "sqrt({})",
    Operator.EXP: "exp({})",
    Operator.LOG: "log({})",
    Operator.EXPM1: "(exp({})-1)",
    Operator.LOG1P: "log(1+{})",
    Operator.SIN: "sin({})",
    Operator.COS: "cos({})",
    Operator.TAN: "tan({})",
    Operator.ASIN: "arcsin({})",
    Operator.ACOS: "arccos({})",
    Operator.ATAN: "arctan({})",
    Operator.SINH: "sinh({})",
    Operator.COSH: "cosh({})",
    Operator.TANH: "tanh({})",
    Operator.ERF: f"(2*errorf({ROOT!r}*{{}})-1)",  # GAMS' errorf is the normal distribution
}
BINARY: Mapping[Operator, str] = {
    Operator.ADD: "({}\n+{})",
    Operator.SUB: "({}\n-{})",
    Operator.MUL: "({}*{})",
    Operator.DIV: "({}/{})",
}


def without_operator(F: Map) -> list[str]:
    """Return names of operators of F that GAMS has not, in a model of this kind."""
    known = {*UNARY, *BINARY, Operator.POW}
    return sorted(Operator(int(head)).name for head in np.unique(F.heads) if Operator(int(head)) not in known)


def idle(F: Map) -> tuple[int, int]:
    """Return how many rows have no unknown, and how many unknowns no row."""
    pattern = F.jacobian(np.zeros(F.inputs))
    return int((np.diff(pattern.indptr) == 0).sum()), F.inputs - np.unique(pattern.indices).size


def lengths(F: Map) -> float:
    """Return about how many characters the expressions of F have, written out."""
    size = [8.0] * F.inputs + [24.0] * F.constants.size
    for a, b in zip(F.left.tolist(), F.right.tolist(), strict=True):
        size.append(8.0 + size[a] + (size[b] if b >= 0 else 0.0))
    return sum(size[end] for end in F.outputs.tolist())


def expressions(F: Map) -> list[str]:
    """Return one expression for every row."""
    first = F.inputs + F.constants.size
    texts = [f"x{i}" for i in range(F.inputs)] + [_number(c) for c in F.constants.tolist()]
    for head, a, b in zip(F.heads.tolist(), F.left.tolist(), F.right.tolist(), strict=True):
        operator = Operator(head)
        if operator is Operator.POW:
            constant = F.constants[b - F.inputs] if F.inputs <= b < first else math.nan
            whole = constant == round(constant) if math.isfinite(constant) else False
            # ** is exp(b log a) there, for a > 0
            texts.append(f"power({texts[a]},{int(constant)})" if whole else f"({texts[a]}**{texts[b]})")
        elif operator.binary:
            texts.append(BINARY[operator].format(texts[a], texts[b]))
        else:
            texts.append(UNARY[operator].format(texts[a]))
    return [texts[end] for end in F.outputs.tolist()]


def model(problem: MiCP, start: Vector, limits: Mapping[str, float]) -> str:
    """Return the whole file: it writes the statuses, iterations and levels to answer.txt."""
    n = problem.start.size
    lines = ["$offDigit", "$offListing", "option limRow=0, limCol=0, solPrint=off;"]
    lines += [f"Variable x{i}; Equation e{i};" for i in range(n)]
    lines += [f"e{i}..\n{text}\n=n= 0;" for i, text in enumerate(expressions(problem.F))]
    for i, (lb, ub, level) in enumerate(zip(problem.lb, problem.ub, start, strict=True)):
        bounds = [f"x{i}.lo={_number(lb)};"] * bool(np.isfinite(lb)) + [f"x{i}.up={_number(ub)};"] * bool(
            np.isfinite(ub)
        )
        lines.append(" ".join([*bounds, f"x{i}.l={_number(level)};"]))
    lines.append("Model m /" + ",\n".join(f"e{i}.x{i}" for i in range(n)) + "/;")
    lines.append("option mcp=path; m.optFile=1;")
    lines += [f"m.{name}={_number(value)};" for name, value in limits.items()]
    lines.append("solve m using mcp;")
    lines.append("file answer /answer.txt/; answer.nr=2; answer.nd=15; answer.nw=25; put answer;")
    printed = ["m.solveStat", "m.modelStat", "m.iterUsd", *(f"x{i}.l" for i in range(n))]
    lines += [f"put {value} /;" for value in printed]
    return "\n".join([*lines, "putclose;"])


def _number(value: float) -> str:
    return f"({float(value)!r})" if value < 0 else repr(float(value))
