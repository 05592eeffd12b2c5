"""Answers in the names and rows of the package whose arrays a quadratic program was read from.

Rows of a file that have no side are no rows of the problem, two sides are two, and one unknown alone is a bound;
multipliers are numbered by the rows of the file all the same.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from cpbench.errors import PointError
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.formulations.programs import QP, QPPoint
from cpbench.foundation.matrices import Vector
from cpbench_problems import applications
from cpbench_problems.formats.program_forms import Program


@dataclass(frozen=True, eq=False)
class PackageRows(ABC):
    """Names of the numbers of an answer; rows of a file are counted through all its matrices.

    Attributes
    ----------
    meaning : of the form. sizes : the number of rows of each matrix, "x" for bounds.
    """

    meaning: Program
    sizes: Mapping[str, int]

    @abstractmethod
    def shown(self, point: Any) -> dict[str, Vector]:
        """Return x and the multipliers as the package has them."""

    @abstractmethod
    def point(self, problem: Any, arrays: Mapping[str, Vector]) -> Point | None:
        """Return the answer that arrays of the package are, None where they are not x and all multipliers of rows.

        Multipliers of bounds that are left out follow from the others. Raises PointError on arrays that are none of the
        package's, and on sizes.
        """

    def named(self, x: Vector, v: Vector, bounds: Vector | None = None) -> dict[str, Vector]:
        """Return x, the multipliers v of all rows and those of bounds by their names in the package."""
        result, start = {self.meaning.x: x}, 0
        for name, size in self.sizes.items():
            part = bounds if name == "x" and bounds is not None else v[start : start + size]
            start += 0 if name == "x" else size
            duals = self.meaning.duals.get(name, ())
            result |= {dual: sign * part if len(duals) == 1 else np.maximum(sign * part, 0.0) for sign, dual in duals}
        return {name: part + 0.0 for name, part in result.items()}  # no -0

    def multipliers(self, n: int, arrays: Mapping[str, Vector]) -> tuple[Vector, Vector | None] | None:
        """Return the multipliers v of all rows, and those of bounds where these are there, as `point` does."""
        duals = self.meaning.duals
        names = {self.meaning.x, *(dual for some in duals.values() for _, dual in some)}
        if self.meaning.x not in arrays:
            return None
        if unknown := sorted(arrays.keys() - names):
            raise PointError(f"{', '.join(unknown)}: expected {', '.join(sorted(names))}")
        values: dict[str, Vector] = {}
        for name, size in self.sizes.items():
            duals_of_name = [(sign, dual) for sign, dual in duals.get(name, ()) if dual in arrays]
            for _, dual in duals_of_name:
                if arrays[dual].size != size:
                    raise PointError(f"{dual} has {arrays[dual].size} numbers, expected {size}")
            if duals_of_name:
                values[name] = np.sum([sign * arrays[dual] for sign, dual in duals_of_name], axis=0)
            elif name != "x" and size:
                if len(arrays) == 1:
                    return None
                raise PointError(f"{' or '.join(dual for _, dual in duals[name])} is missing, of the rows of {name}")
        x = arrays[self.meaning.x]
        if x.size != n:
            raise PointError(f"{self.meaning.x} has {x.size} numbers, expected {n}")
        v = np.concatenate([np.zeros(0), *(values.get(name, []) for name in self.sizes if name != "x")])
        return v, values.get("x")


@dataclass(frozen=True, eq=False)
class ConicRows(PackageRows):
    """Rows upper − Ax in cones; row (m,) : the row of the file of each row of the problem. sign (m,) : -1 at equations,
    which are Ax − upper, else 1."""

    row: Any
    sign: Vector

    def shown(self, point: ConeQPPoint) -> dict[str, Vector]:
        v = np.zeros(sum(self.sizes.values()))
        v[self.row] = self.sign * point.y
        return self.named(point.x, v)

    def point(self, problem: ConeQP, arrays: Mapping[str, Vector]) -> ConeQPPoint | None:
        given = self.multipliers(problem.p.size, arrays)
        return None if given is None else ConeQPPoint(arrays[self.meaning.x], self.sign * given[0][self.row])


@dataclass(frozen=True, eq=False)
class FileRows(PackageRows):
    """Places of the rows of a file in its quadratic program.

    Attributes
    ----------
    below, above : rows of which the lower, then those of which the upper sides are the rows of A. equal : the rows of
    C. single, unknown, factor : rows that are bounds, the unknown of each and its coefficient. lower_row, upper_row :
    (n,) the row that makes the bound of each unknown, -1 where none does.
    """

    below: Any
    above: Any
    equal: Any
    single: Any
    unknown: Any
    factor: Vector
    lower_row: Any
    upper_row: Any

    def shown(self, point: QPPoint) -> dict[str, Vector]:
        v, m = np.zeros(sum(self.sizes.values()) - self.sizes.get("x", 0)), self.below.size
        np.subtract.at(v, self.below, point.lam[:m])
        np.add.at(v, self.above, point.lam[m:])
        v[self.equal] = -point.mu
        row, bounds = np.where(point.nu > 0, self.lower_row, self.upper_row), -point.nu
        nonzero = np.flatnonzero((row >= 0) & (point.nu != 0))
        factor = np.ones(v.size)
        factor[self.single] = self.factor
        v[row[nonzero]], bounds[nonzero] = bounds[nonzero] / factor[row[nonzero]], 0.0
        return self.named(point.z, v, bounds)

    def point(self, problem: QP, arrays: Mapping[str, Vector]) -> QPPoint | None:
        given = self.multipliers(problem.p.size, arrays)
        if given is None:
            return None
        x, (v, bounds) = arrays[self.meaning.x], given
        lower, upper = -v, v.copy()
        both = np.intersect1d(self.below, self.above)  # the sign of their multiplier tells the side
        lower[both], upper[both] = np.maximum(lower[both], 0.0), np.maximum(upper[both], 0.0)
        lam, mu = np.concatenate([lower[self.below], upper[self.above]]), -v[self.equal]
        nu = np.zeros(x.size)
        np.subtract.at(nu, self.unknown, self.factor * v[self.single])
        if bounds is not None:
            nu -= bounds
        elif "x" in self.sizes:
            nu = problem.Q @ x + problem.p - problem.A.T @ lam - problem.C.T @ mu
        return QPPoint(z=x, lam=lam, mu=mu, nu=nu)


_ROWS: WeakKeyDictionary[Problem, PackageRows] = WeakKeyDictionary()


def remember(problem: Problem, rows: PackageRows) -> None:
    """Keep where the rows of the file of a problem are, as long as the problem."""
    _ROWS[problem] = rows


def file_rows(problem: Problem) -> PackageRows | None:
    """Return where the rows of its file are, of a problem that was read from arrays of a package."""
    return _ROWS.get(problem)


def own_unknowns(problem: Problem, point: Point) -> dict[str, Vector] | None:
    """Return x and the multipliers of a program as its package has them, the unknowns of a game, of least squares or of
    a boxed LCP; None of any other problem."""
    rows = file_rows(problem)
    if rows is not None and isinstance(point, QPPoint | ConeQPPoint):
        return rows.shown(point)
    return applications.own_unknowns(problem, point)


def answer_of_package(problem: Problem, arrays: Mapping[str, Vector]) -> Point | None:
    """Return the answer that arrays are in the names of the package of the problem, None where they are none."""
    rows = file_rows(problem)
    return None if rows is None else rows.point(problem, arrays)
