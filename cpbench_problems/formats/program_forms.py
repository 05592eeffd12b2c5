"""Quadratic programs in the names of other packages: a line of mathematics each, which is the declaration.

A line has an objective and its conditions, which bound unknowns last. Beside it stands what an answer of the package
has: x, and by matrix ("x" for bounds) its multipliers v, with the sign with which v times the row is added to the
gradient of the objective; `z_u − z_l` are two arrays, of the upper and of the lower sides.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass

Symbols = tuple[str, ...]
Duals = tuple[tuple[float, str], ...]


@dataclass(frozen=True)
class Rows:
    """Rows lower ≤ Ax ≤ upper, sides that are one array or absent (""); x itself where `matrix` is "".

    transposed : whether A is kept by columns. cone : whether upper − Ax is in cones. at : the array that names the
    unknowns of bounds, "" where all have some.
    """

    matrix: str
    lower: str
    upper: str
    transposed: bool = False
    cone: bool = False
    at: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arrays, each once."""
        return tuple(dict.fromkeys(filter(None, (self.matrix, self.lower, self.upper, self.at))))


@dataclass(frozen=True)
class Program:
    """Meaning of the arrays of a form.

    Attributes
    ----------
    text : the line as it is shown. hessian, linear, constant : of the objective, "" where there is none. sign : of the
    linear term. squares : C and d of an objective ½‖Cx − d‖². rows : conditions. x : the name of x in an answer.
    duals : (sign, name) of the multipliers by matrix, "x" of bounds.
    """

    text: str
    hessian: str
    linear: str
    sign: float
    constant: str
    squares: Symbols
    rows: tuple[Rows, ...]
    x: str
    duals: Mapping[str, Duals]

    @property
    def has_bounds(self) -> bool:
        """Whether bounds have arrays of their own."""
        return any(not rows.matrix for rows in self.rows)

    def arrays(self) -> dict[str, Symbols]:
        """Return the arrays with their dimensions: n unknowns, r0, r1, ... rows."""
        result: dict[str, Symbols] = {}
        if self.squares:
            result |= {self.squares[0]: ("m", "n"), self.squares[1]: ("m",)}
        result |= {self.hessian: ("n", "n"), self.linear: ("n",), self.constant: ()}
        for k, rows in enumerate(self.rows):
            size = f"r{k}" if rows.matrix or rows.at else "n"
            result[rows.matrix] = ("n", size) if rows.transposed else (size, "n")
            result |= dict.fromkeys((rows.lower, rows.upper, rows.at), (size,))
        result.pop("", None)
        return result

    def reading(self, names: Collection[str]) -> frozenset[object]:
        """Return what arrays of these names mean, to be compared with the reading of another form."""
        objective = [*self.squares, self.hessian, self.linear, self.constant]
        rows = [r for r in self.rows if not set(names).isdisjoint(r.names)]
        return frozenset([(self.sign, *(name for name in objective if name in names)), *rows])


_NAME = r"([A-Za-z][A-Za-z0-9_]*)"
_HESSIAN, _SQUARES = re.compile(rf"½ xᵀ {_NAME} x"), re.compile(rf"½ ‖{_NAME} x − {_NAME}‖²")
_LINEAR, _CONSTANT = re.compile(rf"(−?) ?{_NAME}ᵀ x"), re.compile(rf"\+ {_NAME}$")
_TWO_SIDED = re.compile(rf"{_NAME} ≤ (?:{_NAME}(ᵀ?) )?x(?:\[{_NAME}\])? ≤ {_NAME}")
_ONE_SIDED, _CONE = re.compile(rf"{_NAME}(ᵀ?) x (≤|=|≥) {_NAME}"), re.compile(rf"{_NAME} − {_NAME} x in cones")


def program(objective: str, conditions: str, answer: str = "x") -> Program:
    """Return the meaning of a line such as `½ xᵀ P x + qᵀ x`, `G x ≤ h, lb ≤ x ≤ ub`, with the arrays of an answer as
    `x, G: z, x: z_u − z_l`.

    >>> program("½ xᵀ P x + qᵀ x", "G x ≤ h, lb ≤ x ≤ ub").arrays()
    {'P': ('n', 'n'), 'q': ('n',), 'G': ('r0', 'n'), 'h': ('r0',), 'lb': ('n',), 'ub': ('n',)}
    """
    hessian, squares = _HESSIAN.match(objective), _SQUARES.match(objective)
    linear = _LINEAR.search(objective[hessian.end() if hessian else 0 :])
    constant = _CONSTANT.search(objective)
    x, *duals = answer.split(", ")
    return Program(
        text=f"min {objective}, {conditions}",
        hessian=hessian[1] if hessian else "",
        linear=linear[2] if linear else "",
        sign=-1.0 if linear and linear[1] else 1.0,
        constant=constant[1] if constant and not squares else "",
        squares=squares.groups() if squares else (),
        rows=tuple(map(_rows, conditions.split(", "))),
        x=x,
        duals=dict(map(_duals, duals)),
    )


def _rows(condition: str) -> Rows:
    if match := _CONE.fullmatch(condition):
        return Rows(match[2], "", match[1], cone=True)
    if match := _ONE_SIDED.fullmatch(condition):
        matrix, transposed, relation, side = match.groups()
        return Rows(matrix, side * (relation != "≤"), side * (relation != "≥"), bool(transposed))
    match = _TWO_SIDED.fullmatch(condition)
    if match is None:
        raise ValueError(f"{condition}: is no condition")
    lower, matrix, transposed, at, upper = match.groups()
    return Rows(matrix or "", lower, upper, bool(transposed), at=at or "")


def _duals(text: str) -> tuple[str, Duals]:
    matrix, _, names = text.partition(": ")
    parts = names.replace("− ", "−").split()
    return matrix, tuple((-1.0 if name.startswith("−") else 1.0, name.removeprefix("−")) for name in parts)
