"""The numbers of a problem made simple: zeros, small whole numbers, few digits, one coefficient of friction for all."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp

from cpbench.errors import NotApplicable
from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench_lab.reduction.parts import bare, square

P = TypeVar("P", bound=Problem)

DIGITS = (1, 2, 3)
"""Digits that numbers are rounded to, the fewest first."""
SMALL = 9.5
"""A number below this is near a whole number of one digit."""
FRICTION = ("mu", "mu_r", "cone_mu", "cone_mu_r")
"""Vectors of coefficients of friction."""
OPERATORS = ("M", "W", "Q")
"""Matrices whose definiteness is what kind of problem it is."""
ROUNDING = 1e-13
"""Eigenvalues below so much of the largest are 0."""
NOISE = 1e-9
"""Share of the largest slack up to which one is taken for 0."""
FIXED = ("cone_kind", "cone_size")
"""Vectors that say what a problem is: they are not numbers to be rounded."""


@dataclass(frozen=True)
class NumberPlaces:
    """Places of the data that have one number: an entry of a matrix, with its mirror image where that is equal."""

    field: str
    places: tuple[tuple[int, ...], ...]
    value: float


def rounded(values: Any, digits: int) -> Any:
    """Round numbers to so many digits each; what is not finite stays.

    >>> rounded(np.array([1234.5, -0.067, np.inf]), 2).tolist()
    [1200.0, -0.067, inf]
    """
    array = np.asarray(values, dtype=float)
    flat = [float(f"{x:.{digits - 1}e}") if math.isfinite(x) else x for x in array.ravel().tolist()]
    return np.array(flat).reshape(array.shape)


def digits(problem: Problem) -> int:
    """Return the most digits that a number of the data has.

    >>> import cpbench
    >>> digits(cpbench.LCP(M=[[2.0, 0.25], [0.25, 1e-9]], q=[-1.0, 100.0]))
    2
    """
    return max((_length(x) for _, array in _arrays(problem) for x in np.unique(array).tolist()), default=1)


def _length(x: float) -> int:
    """Return the digits of a number: as many as give it back."""
    if not math.isfinite(x) or x == 0:
        return 1
    return next(count for count in range(1, 18) if float(f"{x:.{count - 1}e}") == x)


def _arrays(problem: Problem) -> Iterator[tuple[str, Any]]:
    """Yield the numbers of the data by field: all of a vector, those stored of a sparse matrix; and constants of
    maps."""
    for name, value in problem.data().items():
        if name not in FIXED:
            yield name, value.data if sp.issparse(value) else np.asarray(value)
    for name, F in problem.maps().items():
        yield name, F.constants


def _with(problem: P, name: str, array: Any) -> P:
    """Return the problem with other numbers in one field, of the same shape as `_arrays` has."""
    value: Any = problem.maps().get(name)
    if value is not None:
        return bare(problem, {name: dataclasses.replace(value, constants=array)})
    stored: Any = problem.data()[name]
    if sp.issparse(stored):
        csr: Any = sp.csr_array(stored, copy=True)
        csr.data = np.array(array)
        csr.eliminate_zeros()
        return bare(problem, {name: csr})
    return bare(problem, {name: array})


def wholesale(problem: Problem) -> Iterator[Callable[[Any], Any]]:
    """Yield what may be done with all numbers of a problem, or with those of a field, the simplest first: rounding,
    one coefficient of friction for all contacts, units (by powers of ten, which add no digits)."""
    arrays = dict(_arrays(problem))
    for count in DIGITS:
        yield partial(_rounded, names=tuple(arrays), count=count)
    for name, array in arrays.items():
        if name in FRICTION and array.size:
            yield from (partial(_filled, name=name, value=value) for value in _common(array))
        if name not in problem.maps():
            yield partial(_in_units, name=name)
        for count in DIGITS:
            yield partial(_rounded, names=(name,), count=count)
        if name in OPERATORS:
            yield from (partial(_of_factor, name=name, count=count) for count in DIGITS[:2])


def _of_factor(problem: P, name: str, count: int) -> P:
    """Return the problem with LLᵀ for a semidefinite matrix, L rounded: it has its rank still, unlike a rounded one."""
    M = matrices.dense(problem.data()[name])
    if not matrices.is_symmetric(M):
        return problem
    values, vectors = np.linalg.eigh(M)
    there = values > ROUNDING * values.max(initial=0.0)
    L = rounded(np.linalg.qr((vectors[:, there] * np.sqrt(values[there])).T)[1].T, count)
    return bare(problem, {name: rounded(L @ L.T, 15)})


def replanted(problem: P, solution: Any, count: int) -> P:
    """Return w = Mz + q with a rounded M that has a rounded solution: q = w − Mz, z and w of so many digits each.

    What is degenerate stays so, where rounding q itself would move the pairs that are both 0. Raises NotApplicable.
    """
    names = square(problem)
    if names is None:
        raise NotApplicable("replanted", f"{problem.node} is not w = Mz + q alone")
    z = next(iter(solution.arrays().values()))
    slack = next(iter(problem.slacks(solution).values()))
    top = max(matrices.max_abs(slack), matrices.max_abs(np.asarray(problem.data()[names[1]])))
    w = np.where(np.abs(slack) > NOISE * top, rounded(slack, count), 0.0)
    M = rounded(matrices.dense(problem.data()[names[0]]), count)
    return bare(problem, {names[0]: M, names[1]: rounded(w - M @ rounded(z, count), 15)})


def _common(array: Any) -> list[float]:
    """Return coefficients that all contacts may have: 1, a half, and those that occur."""
    finite = array[np.isfinite(array)]
    return [1.0, 0.5, *(float(f"{x:.0e}") for x in (np.median(finite), finite.max()))] if finite.size else []


def _filled(problem: P, name: str, value: float) -> P:
    return _with(problem, name, np.full(dict(_arrays(problem))[name].shape, value))


def _in_units(problem: P, name: str) -> P:
    array = dict(_arrays(problem))[name]
    top = np.abs(array[np.isfinite(array)]).max(initial=0.0)
    return _with(problem, name, rounded(array * 10.0 ** -math.floor(math.log10(top)), 15)) if top > 0 else problem


def _rounded(problem: P, names: tuple[str, ...], count: int) -> P:
    arrays = dict(_arrays(problem))
    for name in names:
        problem = _with(problem, name, rounded(arrays[name], count))
    return problem


# ------------------------------------------------------------------------------------------- one by one


def entries(problem: Problem) -> list[NumberPlaces]:
    """Return the numbers of the data that are not 0, one by one."""
    result: list[NumberPlaces] = []
    for name, value in problem.data().items():
        if name in FIXED:
            continue
        array = matrices.dense(value) if value.ndim == 2 else np.asarray(value)
        mirrored = array.ndim == 2 and array.shape[0] == array.shape[1]
        for place in map(tuple, np.argwhere((array != 0) & np.isfinite(array)).tolist()):
            x, other = float(array[place]), place[::-1]
            if mirrored and place > other and array[other] == x:
                continue
            both = mirrored and place < other and array[other] == x
            result.append(NumberPlaces(name, (place, other) if both else (place,), x))
    for name, F in problem.maps().items():
        result += [NumberPlaces(name, ((k,),), x) for k, x in enumerate(F.constants.tolist()) if x != 0]
    return result


def simpler(x: float) -> Iterator[float]:
    """Yield numbers that may stand for another one, the simplest first: one, the nearest whole number, and the number
    with few digits, nearest, larger and smaller (a larger diagonal stays definite where a rounded one would not).

    >>> list(simpler(3.14)), list(simpler(7.0)), list(simpler(-0.5))
    ([1.0, 3.0, 4.0, 3.1, 3.2], [1.0], [-1.0])
    """
    if not math.isfinite(x):
        return
    tried = {x, 0.0}
    for y in (math.copysign(1.0, x), *([float(round(x))] if abs(x) < SMALL else []), *_near(x)):
        if y not in tried and (_length(y), abs(y) > SMALL) <= (_length(x), abs(x) > SMALL):
            tried.add(y)
            yield y


def _near(x: float) -> Iterator[float]:
    """Yield a number with few digits: rounded, away from 0 and towards 0."""
    for count in DIGITS[: _length(x) - 1]:
        nearest = float(f"{x:.{count - 1}e}")
        unit = math.copysign(10.0 ** (math.floor(math.log10(abs(x))) - count + 1), x)
        other = nearest + unit if abs(nearest) < abs(x) else nearest - unit
        yield nearest
        yield float(f"{other:.{count - 1}e}")


def changed(problem: P, changes: Mapping[NumberPlaces, float]) -> P:
    """Return the problem with other values of some entries."""
    arrays: dict[str, Any] = {}
    maps: dict[str, Any] = {}
    data = problem.data()
    for entry, value in changes.items():
        if entry.field in data:
            if entry.field not in arrays:
                given = data[entry.field]
                arrays[entry.field] = np.array(matrices.dense(given) if given.ndim == 2 else given, dtype=float)
            for place in entry.places:
                arrays[entry.field][place] = value
        else:
            constants = maps.setdefault(entry.field, problem.maps()[entry.field].constants.copy())
            constants[entry.places[0][0]] = value
    stored = {name: _like(data[name], array) for name, array in arrays.items()}
    for name, constants in maps.items():
        problem = _with(problem, name, constants)
    return bare(problem, stored)


def _like(given: Any, array: Any) -> Any:
    return sp.csr_array(array) if sp.issparse(given) else array
