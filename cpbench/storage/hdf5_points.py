"""Points in HDF5: `/solution` and `/guesses`, under FCLIB's names: v, r and l of a contact problem (our λ is its l).

solution                                       parts of the point, slacks as they follow from it (u), attributes
guesses/{number_of_guesses, 1, 2, ...}         each like a solution, without slacks
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from cpbench import __version__
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.global_contact import GFCPoint
from cpbench.formulations.local_contact import FCMPoint
from cpbench.storage.hdf5_tree import Tree, put_array, put_attribute, put_integer

_FCLIB = {"lam": "l"}
"""Parts of contact points that FCLIB calls otherwise; it has none of these where they are empty."""


def put_solution(parent: h5py.Group, problem: Problem, point: Point, attributes: Mapping[str, Any]) -> None:
    """Write `/solution`: the point, the slacks as they follow from it (FCLIB's u), and attributes."""
    put_point(
        parent, point, {**attributes, "node": problem.node, "fingerprint": problem.fingerprint}, _slacks(problem, point)
    )


def put_point(
    parent: h5py.Group, point: Point, attributes: Mapping[str, Any], slacks: Mapping[str, NDArray[Any]] | None = None
) -> None:
    """Write `/solution` from its parts."""
    group: h5py.Group = parent.create_group("solution")
    _put_parts(group, point, slacks or {})
    for name, value in {**attributes, "cpbench_version": __version__}.items():
        put_attribute(group, name, value if isinstance(value, int | float | bool) else str(value))


def put_guesses(parent: h5py.Group, problem: Problem, points: Sequence[Point]) -> None:
    """Write `/guesses`, with slacks, for FCLIB's reader insists on u; nothing when there are none."""
    if not points:
        return
    group = parent.create_group("guesses")
    put_integer(group, "number_of_guesses", len(points))
    for k, point in enumerate(points, 1):
        _put_parts(group.create_group(str(k)), point, _slacks(problem, point))


def read_point(tree: Tree, kind: type[Point]) -> Any:
    """Read the point of a group; parts that are empty by default may be missing. Raises FormatError."""
    parts: dict[str, Any] = {}
    for name, f in kind.__dataclass_fields__.items():
        fclib = _names(kind).get(name, name)
        stored = fclib if fclib in tree else name
        if stored in tree or (fclib == name and f.default_factory is MISSING):
            parts[name] = tree.array(stored)
        else:
            parts[name] = np.zeros(0)
    return kind(**parts)


def _slacks(problem: Problem, point: Point) -> dict[str, NDArray[Any]]:
    """Return the values stored beside a point, without those of nonlinear maps, whose last bits differ between
    machines.
    """
    if problem.maps() and not isinstance(problem, ContactProblem):
        return {}
    return {name: value for name, value in problem.slacks(point).items() if np.isfinite(value).all()}


def _put_parts(group: h5py.Group, point: Point, slacks: Mapping[str, NDArray[Any]]) -> None:
    names = _names(type(point))
    stored = {names.get(name, name): value for name, value in point.arrays().items() if value.size or name not in names}
    for name, value in {**slacks, **stored}.items():
        put_array(group, name, value, compress=True)


def _names(kind: type[Point]) -> Mapping[str, str]:
    return _FCLIB if issubclass(kind, FCMPoint | GFCPoint) else {}
