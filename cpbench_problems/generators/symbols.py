"""Formulas of the generators as maps: operation by operation, as they are written.

CasADi and SymPy simplify, each version in its own way; a map that ships must come out the same everywhere.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from cpbench.formulations.expressions import Builder, Map
from cpbench.formulations.expressions.recording import Symbol
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector


def unknowns(n: int) -> list[Symbol]:
    """Create z₁, …, z_n, the unknowns of a map."""
    build = Builder(n)
    return [Symbol(build, k) for k in range(n)]


def mapped(z: Sequence[Symbol], outputs: Sequence[Any]) -> Map:
    """Build the map from z, all that `unknowns` gave, to `outputs`, some of which may be numbers."""
    build = z[0].build
    return build.finish([o.number if isinstance(o, Symbol) else build.constant(o) for o in outputs])


def total(terms: Iterable[Any]) -> Any:
    """Sum from the first to the last; 0.0 of nothing."""
    result: Any = None
    for term in terms:
        result = term if result is None else result + term
    return 0.0 if result is None else result


def product(M: Matrix, z: Sequence[Symbol]) -> list[Any]:
    """Multiply Mz, a row the sum of what is stored in it."""
    S = matrices.sparse(M)
    columns, data, ends = S.indices.tolist(), S.data.tolist(), S.indptr.tolist()
    return [total(_times(data[k], z[columns[k]]) for k in range(a, b)) for a, b in itertools.pairwise(ends)]


def _times(factor: float, z: Symbol) -> Symbol:
    return z if factor == 1.0 else factor * z


def arctan(z: Vector) -> Vector:
    """Compute arctan to some units in the last place: four halvings of the angle, then the series up to t¹⁷.

    By +, −, ·, / and roots alone, which round alike on every machine; the functions of C and NumPy do not.
    """
    t = z
    for _ in range(4):
        t = t / (1.0 + np.sqrt(1.0 + t * t))
    series = np.zeros_like(t)
    for k in range(17, 0, -2):
        series = 1.0 / k - t * t * series
    return 16.0 * t * series


def sine(x: Vector) -> Vector:
    """Compute sin by the same, for a few turns: whole halves of a turn off, then the series up to r²³."""
    half_turns = np.round(x / np.pi)
    r = x - half_turns * np.pi
    series = np.ones_like(r)
    for k in range(22, 0, -2):
        series = 1.0 - r * r * series / (k * (k + 1))
    return np.where(half_turns % 2 == 0, r, -r) * series
