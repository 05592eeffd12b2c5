"""CasADi's expressions as maps, and maps as columns of CasADi's SX, which differentiate them.

What is read is the graph that CasADi holds, never a file of its own format, whose reading runs code.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from cpbench.errors import ProblemError
from cpbench.formulations.expressions.map import Builder, Map
from cpbench.formulations.expressions.operators import Operator

_SAME = {
    "ADD": "ADD", "SUB": "SUB", "MUL": "MUL", "DIV": "DIV", "NEG": "NEG", "EXP": "EXP", "LOG": "LOG", "POW": "POW",
    "CONSTPOW": "POW", "SQRT": "SQRT", "SIN": "SIN", "COS": "COS", "TAN": "TAN", "ASIN": "ASIN", "ACOS": "ACOS",
    "ATAN": "ATAN", "LT": "LT", "LE": "LE", "EQ": "EQ", "NOT": "NOT", "AND": "AND", "OR": "OR", "FLOOR": "FLOOR",
    "CEIL": "CEIL", "FABS": "ABS", "ERF": "ERF", "FMIN": "MIN", "FMAX": "MAX", "SINH": "SINH", "COSH": "COSH",
    "TANH": "TANH", "ASINH": "ASINH", "ACOSH": "ACOSH", "ATANH": "ATANH", "ATAN2": "ATAN2", "LOG1P": "LOG1P",
    "EXPM1": "EXPM1", "IF_ELSE_ZERO": "CHOOSE",
}  # fmt: skip
"""CasADi's name of an operator -> ours."""


@cache
def _operators() -> dict[int, Operator]:
    import casadi as ca

    return {getattr(ca, f"OP_{theirs}"): Operator[ours] for theirs, ours in _SAME.items()}


def read(variables: Any, outputs: Any, parameters: Mapping[str, float]) -> Map:
    """Return the map from the column `variables` (symbols) to the column `outputs`, or a list of its rows, in which the
    other symbols are those named in `parameters`; raises ProblemError.
    """
    import casadi as ca

    try:
        rows = ca.densify(ca.vertcat(*outputs) if isinstance(outputs, list | tuple) else outputs)
        rows = ca.SX(rows) if isinstance(rows, ca.DM) else rows
        own = {symbol.__hash__() for symbol in ca.symvar(variables)}
        others = [symbol for symbol in ca.symvar(rows) if symbol.__hash__() not in own]
        unknown = [symbol.name() for symbol in others if symbol.name() not in parameters]
        if unknown:
            raise ProblemError("map", f"has the symbol {unknown[0]}, which is not a variable: give it in parameters")
        function = ca.Function("F", [variables, *others], [rows])
    except (RuntimeError, NotImplementedError) as cause:
        raise ProblemError("map", f"is not a function of the given variables ({_last_line(cause)})") from None
    if not function.is_a("SXFunction"):
        try:
            function = function.expand()
        except RuntimeError as cause:
            raise ProblemError("map", f"has a CasADi node with no elementary form ({_last_line(cause)})") from None
    return _Reader(function, [(symbol.name(), parameters[symbol.name()]) for symbol in others]).map()


def _last_line(cause: BaseException) -> str:
    lines = [line.strip() for line in str(cause).splitlines() if line.strip()]
    return lines[-1] if lines else type(cause).__name__


class _Reader:
    """CasADi's list of instructions, whose places of work are used again and again, as values that are not."""

    def __init__(self, function: Any, parameters: list[tuple[str, float]]) -> None:
        self._function = function
        self._builder = Builder(int(function.nnz_in(0)))
        self._parameters = [self._builder.parameter(name, value) for name, value in parameters]

    def map(self) -> Map:
        import casadi as ca

        f, build = self._function, self._builder
        work: dict[int, int] = {}
        ends: list[int] = [-1] * int(f.nnz_out())
        for k in range(f.n_instructions()):
            code = f.instruction_id(k)
            inputs, outputs = f.instruction_input(k), f.instruction_output(k)
            if code == ca.OP_INPUT:
                work[outputs[0]] = self._parameters[inputs[0] - 1] if inputs[0] else inputs[1]
            elif code == ca.OP_CONST:
                work[outputs[0]] = build.constant(f.instruction_constant(k))
            elif code == ca.OP_OUTPUT:
                ends[outputs[1]] = work[inputs[0]]
            else:
                work[outputs[0]] = self._operation(code, [work[i] for i in inputs])
        return build.finish(ends)

    def _operation(self, code: int, arguments: list[int]) -> int:
        import casadi as ca

        apply, constant = self._builder.apply, self._builder.constant
        if code in _operators():
            return apply(_operators()[code], *arguments)
        a = arguments[0]
        b = arguments[-1]
        if code == ca.OP_SQ:
            return apply(Operator.MUL, a, a)
        if code == ca.OP_TWICE:
            return apply(Operator.MUL, constant(2.0), a)
        if code == ca.OP_INV:
            return apply(Operator.DIV, constant(1.0), a)
        if code == ca.OP_NE:
            return apply(Operator.NOT, apply(Operator.EQ, a, b))
        if code == ca.OP_HYPOT:
            squares = apply(Operator.MUL, a, a), apply(Operator.MUL, b, b)
            return apply(Operator.SQRT, apply(Operator.ADD, *squares))
        if code == ca.OP_SIGN:
            zero, one = constant(0.0), constant(1.0)
            up = apply(Operator.CHOOSE, apply(Operator.LT, zero, a), one)
            return apply(Operator.SUB, up, apply(Operator.CHOOSE, apply(Operator.LT, a, zero), one))
        if code == ca.OP_ASSIGN:
            return a
        name = next((n for n in dir(ca) if n.startswith("OP_") and getattr(ca, n) == code), f"operator {code}")
        raise ProblemError("map", f"has CasADi's {name}, which cannot be written as MathOptFormat")


def express(F: Map, z: Any) -> Any:
    """Evaluate F(z) as an SX column; z an SX column of n rows."""
    import casadi as ca

    theirs = {operator: code for code, operator in reversed(_operators().items())}  # POW, not CONSTPOW
    values: list[Any] = [*(ca.vertsplit(z) if F.inputs else ()), *(ca.SX(c) for c in F.constants.tolist())]
    for head, a, b in zip(F.heads.tolist(), F.left.tolist(), F.right.tolist(), strict=True):
        code = theirs[Operator(head)]
        values.append(ca.SX.binary(code, values[a], values[b]) if b >= 0 else ca.SX.unary(code, values[a]))
    return ca.vertcat(*(values[k] for k in F.outputs.tolist())) if F.rows else ca.SX(0, 1)
