"""A map as formulas for people: `z1*z2 + exp(z1) - 3`."""

from __future__ import annotations

from collections.abc import Sequence

from cpbench.formulations.expressions.map import Map
from cpbench.formulations.expressions.operators import Operator

_SIGNS = {
    Operator.OR: ("or", 1), Operator.AND: ("and", 2), Operator.LT: ("<", 4), Operator.LE: ("≤", 4),
    Operator.EQ: ("=", 4), Operator.ADD: ("+", 5), Operator.SUB: ("-", 5), Operator.MUL: ("*", 6),
    Operator.DIV: ("/", 6), Operator.POW: ("^", 8),
}  # fmt: skip
"""Sign of an operator, and how tight it binds."""
_NOT, _MINUS, _WHOLE = 3, 7, 9
_ONE_SIDED = frozenset({Operator.ADD, Operator.MUL, Operator.AND, Operator.OR})
"""Those with which a·(b·c) needs no bracket for a reader, though the list has another order of rounding."""


def formulas(F: Map, names: Sequence[str], longest: int) -> list[str]:
    """Return the formulas of all rows, in the names of the unknowns and of parameters; what is longer than `longest`
    characters is `…`.

    >>> import casadi as ca
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> formulas(Map.from_casadi(ca.vertcat(x, y), (x - 2) * ca.exp(-y)), ["x", "y"], 80)
    ['(x - 2)*exp(-y)']
    """
    texts = [*names, *(f"{c:.6g}" for c in F.constants.tolist())]
    bound = [_WHOLE] * len(names) + [_WHOLE if c >= 0 else _MINUS for c in F.constants.tolist()]
    for name, index in F.named.items():
        texts[F.inputs + index], bound[F.inputs + index] = name, _WHOLE
    for head, a, b in zip(F.heads.tolist(), F.left.tolist(), F.right.tolist(), strict=True):
        text, tight = _written(Operator(head), (texts[a], bound[a]), (texts[b], bound[b]))
        texts.append(text if len(text) <= longest else "…")
        bound.append(tight if len(text) <= longest else _WHOLE)
    return [texts[k] for k in F.outputs.tolist()]


def _written(head: Operator, a: tuple[str, int], b: tuple[str, int]) -> tuple[str, int]:
    if head in _SIGNS:
        sign, tight = _SIGNS[head]
        between = sign if sign in "*/^" else f" {sign} "
        left = _bracketed(a, tight + (head is Operator.POW))
        return f"{left}{between}{_bracketed(b, tight if head in _ONE_SIDED else tight + 1)}", tight
    if head is Operator.NEG:
        return f"-{_bracketed(a, _MINUS)}", _MINUS
    if head is Operator.NOT:
        return f"not {_bracketed(a, _NOT)}", _NOT
    if head is Operator.CHOOSE:
        return f"({b[0]} if {a[0]} else 0)", _WHOLE
    return f"{head.name.lower()}({a[0]}{f', {b[0]}' if head.binary else ''})", _WHOLE


def _bracketed(part: tuple[str, int], tight: int) -> str:
    return part[0] if part[1] >= tight else f"({part[0]})"
