"""Reading MathOptFormat: models that are linear complementarity problems or quadratic programs.

A model with Complements constraints is a complementarity problem: every variable stands beside one function, and
there are no other rows. Its description says which (`cpbench lcp: ...`); without that its bounds do: all in [0, ∞)
lcp; free or in [0, ∞) mlcp, the free ones first; all finite relay; else avi. Any other model is a qp: its variables z,
rows in the order of the file, Ax ≥ b and, with the signs turned, Ax ≤ b. A maximum is the minimum of the opposite.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp

from cpbench import matrices
from cpbench.errors import FormatError
from cpbench.formulations.avi import AVI
from cpbench.formulations.base import Info, Problem
from cpbench.formulations.lcp import LCP
from cpbench.formulations.mlcp import MLCP
from cpbench.formulations.qp import QP
from cpbench.formulations.relay import Relay
from cpbench.matrices import Sparse, Vector
from cpbench.storage.base import build, read_head

MARK = "cpbench "
"""What the description of a written file begins with, the formulation after it."""
OFFSET = "objective_offset"
"""The property that keeps the constant of an objective, which changes no solution."""
_SETS = "GreaterThan, LessThan, EqualTo, Interval, Nonnegatives, Nonpositives, Zeros or Complements"
_FUNCTIONS = "Variable, VectorOfVariables, ScalarAffineFunction or VectorAffineFunction"

Row: TypeAlias = tuple[list[int], list[float], float]
"""Σ coefficientᵢ x[columnᵢ] + constant."""


def read(path: Path) -> Problem:
    """The problem in a file; raises FormatError."""
    return _Reader(path, load_json(path)).problem()


def load_json(path: Path) -> dict[str, Any]:
    """The JSON object in a file; raises FormatError."""
    read_head(path)
    try:
        found: Any = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as cause:
        raise FormatError(path, "", f"is not readable JSON ({cause})") from None
    if not isinstance(found, dict):
        raise FormatError(path, "", f"holds a JSON {type(found).__name__}, expected an object")
    return found  # pyright: ignore


def as_float(value: float) -> float:
    """A number of a JSON file, whose whole numbers have no end."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def offset(info: Info) -> float:
    """The constant of the objective."""
    value = info.properties.get(OFFSET, 0.0)
    return float(value) if isinstance(value, int | float) and math.isfinite(as_float(value)) else 0.0


class _Reader:
    """One file: its variables with their bounds, its rows by kind."""

    def __init__(self, path: Path, model: Mapping[str, Any]) -> None:
        self._path, self._model = path, model
        version = self._get(model, "version", dict, "")
        if version.get("major") != 1:
            raise FormatError(path, "version", f"is {version.get('major')}, cpbench reads MathOptFormat 1")
        names = [self._get(v, "name", str, f"variables/{k}") for k, v in self._items(model, "variables")]
        self._column = {name: k for k, name in enumerate(names)}
        if len(self._column) != len(names):
            raise FormatError(path, "variables", "has two of one name")
        self._lb, self._ub = np.full(len(names), -np.inf), np.full(len(names), np.inf)
        self._above: list[Row] = []  # with the least value in place of the constant
        self._equal: list[Row] = []  # with the value
        self._pairs: dict[int, Row] = {}
        self._complementary = False
        for k, constraint in self._items(model, "constraints"):
            self._constrain(constraint, f"constraints/{k}")

    def problem(self) -> Problem:
        name = str(self._model.get("name", "")) or self._path.name.removesuffix(".json").removesuffix(".mof")
        told = str(self._model.get("description", ""))
        node = told.removeprefix(MARK).partition(":")[0] if told.startswith(MARK) else ""
        sense, linear, Q = self._objective()
        described = node in ("lcp", "mlcp", "relay", "avi")
        if not self._complementary and not (described and not self._column):
            info = Info(properties={OFFSET: linear[2]} if linear[2] else {})
            return self._qp(name, info, sense, linear, Q)
        if sense != "feasibility":
            raise FormatError(self._path, "objective", f"is {sense} beside Complements, expected feasibility")
        return self._complementarity(name, node)

    # ------------------------------------------------------------------------------------------- nodes

    def _qp(self, name: str, info: Info, sense: str, linear: Row, Q: Sparse) -> Problem:
        sign = -1.0 if sense == "max" else 1.0
        A, b = self._matrix(self._above)
        C, d = self._matrix(self._equal)
        p = np.zeros(self._lb.size)
        _add(p, linear)
        parts = {"Q": sign * Q, "p": sign * p, "A": A, "b": b, "C": C, "d": d, "lb": self._lb, "ub": self._ub}
        return build(self._path, QP, "", name=name, info=info, **parts)

    def _complementarity(self, name: str, node: str) -> Problem:
        if self._above or self._equal:
            raise FormatError(
                self._path, "constraints", f"has {len(self._above) + len(self._equal)} rows beside Complements"
            )
        alone = [variable for variable, k in self._column.items() if k not in self._pairs]
        if alone:
            raise FormatError(
                self._path, "constraints", f"has no function beside {alone[0]} (and {len(alone) - 1} more)"
            )
        M, q = self._matrix([self._pairs[k] for k in range(len(self._column))])
        lb, ub = self._lb, self._ub
        free = np.isinf(lb) & np.isinf(ub)
        half = (lb == 0) & np.isinf(ub)
        fits = {
            "lcp": half.all(),
            "mlcp": (free | half).all() and (np.diff(free.astype(int)) <= 0).all(),
            "relay": np.isfinite(lb).all() and np.isfinite(ub).all(),
            "avi": True,
        }
        if not fits.get(node, False):
            node = "mlcp" if (free | half).all() else "avi"
            node = next((kind for kind in ("lcp", "relay") if fits[kind]), node)
        if node == "mlcp":
            first, rest = np.flatnonzero(free), np.flatnonzero(~free)
            blocks = {"A": (first, first), "C": (first, rest), "D": (rest, first), "B": (rest, rest)}
            parts: dict[str, Any] = {part: M[rows][:, columns] for part, (rows, columns) in blocks.items()}
            return build(self._path, MLCP, "", name=name, a=q[first], b=q[rest], **parts)
        if node == "lcp":
            return build(self._path, LCP, "", name=name, M=M, q=q)
        return build(self._path, Relay if node == "relay" else AVI, "", name=name, M=M, q=q, lb=lb, ub=ub)

    def _matrix(self, rows: list[Row]) -> tuple[Sparse, Vector]:
        """The rows as matrix, and the numbers beside them."""
        lengths = [len(columns) for columns, _, _ in rows]
        columns = [column for row in rows for column in row[0]]
        values = [value for row in rows for value in row[1]]
        where: Any = (np.array(values, float), (np.repeat(np.arange(len(rows)), lengths), np.array(columns, int)))
        return sp.csr_array(where, shape=(len(rows), len(self._column))), np.array([row[2] for row in rows], float)

    # --------------------------------------------------------------------------------------- what is read

    def _objective(self) -> tuple[str, Row, Sparse]:
        """Sense, affine part, Hessian."""
        n = len(self._column)
        objective = self._get(self._model, "objective", dict, "")
        sense = self._get(objective, "sense", str, "objective")
        if sense not in ("min", "max", "feasibility"):
            raise FormatError(self._path, "objective/sense", f"is '{sense}', expected min, max or feasibility")
        if sense == "feasibility":
            return sense, ([], [], 0.0), sp.csr_array((n, n))
        function = self._get(objective, "function", dict, "objective")
        if function.get("type") != "ScalarQuadraticFunction":
            rows = self._rows(function, "objective/function")
            if len(rows) != 1:
                raise FormatError(self._path, "objective/function", f"has {len(rows)} values, expected one")
            return sense, rows[0], sp.csr_array((n, n))
        where = "objective/function"
        affine = self._affine(function, "affine_terms", where)
        terms: dict[tuple[int, int], float] = {}
        for k, term in self._items(function, "quadratic_terms", where):
            here = f"{where}/quadratic_terms/{k}"
            pair = self._variable(term, "variable_1", here), self._variable(term, "variable_2", here)
            terms[pair] = terms.get(pair, 0.0) + self._number(term, "coefficient", here)
        return sense, affine, _hessian(terms, n)

    def _constrain(self, constraint: Any, where: str) -> None:
        function, set_ = (self._get(constraint, key, dict, where) for key in ("function", "set"))
        rows, kind = self._rows(function, f"{where}/function"), set_.get("type")
        if kind == "Complements":
            self._complement(rows, where)
            return
        sides: dict[Any, tuple[str | float, str | float]] = {
            "GreaterThan": ("lower", math.inf),
            "LessThan": (-math.inf, "upper"),
            "EqualTo": ("value", "value"),
            "Interval": ("lower", "upper"),
            "Nonnegatives": (0.0, math.inf),
            "Nonpositives": (-math.inf, 0.0),
            "Zeros": (0.0, 0.0),
        }
        if kind not in sides:
            raise FormatError(self._path, f"{where}/set", f"is {kind}, cpbench reads {_SETS}")
        low, high = (self._number(set_, s, f"{where}/set") if isinstance(s, str) else s for s in sides[kind])
        bare = function.get("type") in ("Variable", "VectorOfVariables")
        for row in rows:
            self._bound(row[0][0], low, high) if bare else self._row(row, low, high)

    def _bound(self, column: int, low: float, high: float) -> None:
        if low > self._lb[column]:
            self._lb[column] = low
        if high < self._ub[column]:
            self._ub[column] = high

    def _row(self, row: Row, low: float, high: float) -> None:
        columns, values, constant = row
        if low == high:
            self._equal.append((columns, values, low - constant))
            return
        if low > -math.inf:
            self._above.append((columns, values, low - constant))
        if high < math.inf:
            self._above.append((columns, [-value for value in values], constant - high))

    def _complement(self, rows: list[Row], where: str) -> None:
        """Functions, then as many variables."""
        self._complementary = True
        if len(rows) % 2:
            raise FormatError(self._path, where, f"has {len(rows)} values in Complements, expected an even number")
        half = len(rows) // 2
        for row, (columns, values, constant) in zip(rows[:half], rows[half:], strict=True):
            if len(columns) != 1 or values[0] != 1.0 or constant != 0.0:
                raise FormatError(self._path, where, "has no bare variable in the second half of Complements")
            if columns[0] in self._pairs:
                raise FormatError(self._path, where, f"has variable {columns[0] + 1} beside two functions")
            self._pairs[columns[0]] = row

    def _rows(self, function: Mapping[str, Any], where: str) -> list[Row]:
        """The values of an affine function."""
        kind = function.get("type")
        if kind == "Variable":
            return [([self._variable(function, "name", where)], [1.0], 0.0)]
        if kind == "VectorOfVariables":
            named = self._get(function, "variables", list, where)
            return [([self._variable({"name": name}, "name", where)], [1.0], 0.0) for name in named]
        if kind == "ScalarAffineFunction":
            return [self._affine(function, "terms", where)]
        if kind != "VectorAffineFunction":
            raise FormatError(self._path, where, f"is a {kind}, cpbench reads {_FUNCTIONS}")
        constants = self._get(function, "constants", list, where)
        rows: list[Row] = [([], [], self._number({"constant": c}, "constant", where)) for c in constants]
        for k, term in self._items(function, "terms", where):
            here = f"{where}/terms/{k}"
            index, inner = self._get(term, "output_index", int, here), self._get(term, "scalar_term", dict, here)
            if not 1 <= index <= len(rows):
                raise FormatError(self._path, here, f"has output_index {index}, expected 1 to {len(rows)}")
            rows[index - 1][0].append(self._variable(inner, "variable", here))
            rows[index - 1][1].append(self._number(inner, "coefficient", here))
        return rows

    def _affine(self, function: Mapping[str, Any], key: str, where: str) -> Row:
        columns: list[int] = []
        values: list[float] = []
        for k, term in self._items(function, key, where):
            columns.append(self._variable(term, "variable", f"{where}/{key}/{k}"))
            values.append(self._number(term, "coefficient", f"{where}/{key}/{k}"))
        return columns, values, self._number(function, "constant", where)

    # ----------------------------------------------------------------------------------------- JSON

    def _items(self, parent: Any, key: str, where: str = "") -> Iterator[tuple[int, Any]]:
        return enumerate(self._get(parent, key, list, where))

    def _get(self, parent: Any, key: str, kind: type[Any], where: str) -> Any:
        """An entry of a JSON object, of the right kind."""
        value = parent.get(key) if isinstance(parent, dict) else None
        if not isinstance(value, kind) or isinstance(value, bool):
            said = "is missing" if value is None else f"is a {type(value).__name__}"
            raise FormatError(self._path, f"{where}/{key}".lstrip("/"), f"{said}, expected a {kind.__name__}")
        return value

    def _variable(self, parent: Any, key: str, where: str) -> int:
        name = self._get(parent, key, str, where)
        if name not in self._column:
            raise FormatError(self._path, where, f"names the variable '{name}', which is none of variables")
        return self._column[name]

    def _number(self, parent: Any, key: str, where: str) -> float:
        value = parent.get(key) if isinstance(parent, dict) else None
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(as_float(value)):
            said = "is missing" if value is None else f"is {str(value)[:40]!r}"
            raise FormatError(self._path, f"{where}/{key}", f"{said}, expected a finite number")
        return float(value)


def _hessian(terms: Mapping[tuple[int, int], float], n: int) -> Sparse:
    """Q of the coefficients of zᵢzⱼ, and of zᵢ²/2. Of a pair that is there both ways round each has its half, unless
    that is far from symmetric."""
    entries = {
        pair: 2.0 * value if pair[0] != pair[1] and pair[::-1] in terms else value for pair, value in terms.items()
    }
    entries |= {pair[::-1]: value for pair, value in terms.items() if pair[::-1] not in terms}
    i, j = [pair[0] for pair in entries], [pair[1] for pair in entries]
    where: Any = (np.array(list(entries.values()), float), (np.array(i, int), np.array(j, int)))
    Q = sp.csr_array(where, shape=(n, n))
    return Q if matrices.is_symmetric(Q, 1e-9) else sp.csr_array(0.5 * Q + 0.5 * Q.T)


def _add(p: Vector, linear: Row) -> None:
    """The terms of a row into a vector; the first one as it is, with the sign of its zero."""
    seen: set[int] = set()
    for column, value in zip(linear[0], linear[1], strict=True):
        p[column] = p[column] + value if column in seen else value
        seen.add(column)
