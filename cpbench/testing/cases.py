"""Planted cases of every node, with the corner shapes that break plugins, as files beside the checks.

`planted/NODE.h5` has problems with a solution that they were made for, and problems that have none;
`planted/README.md` says what their names mean and how one is added.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from cpbench.formulations import Problem
from cpbench.generators import generators
from cpbench.generators.base import LARGE, STANDARD
from cpbench.storage.hdf5_files import members_of, read_problem
from cpbench.storage.hdf5_points import read_point
from cpbench.storage.hdf5_tree import Tree, open_tree

FOLDER = Path(__file__).with_name("planted")


@dataclass(frozen=True, eq=False)
class Case:
    """A problem with a solution that the data were made for; None where it has none."""

    name: str
    problem: Any
    point: Any


@cache
def cases(node: str) -> list[Case]:
    """Return dense and sparse ones, n = 0 and 1, degenerate, frictionless, singular, nonsymmetric, zero rows, units of
    1e±8.

    Of a formulation that has no such cases, the problems of its generators whose solution is known.
    """
    shipped = [case for case in _read(node) if case.point is not None]
    if shipped:
        return shipped
    small = [one for one in generators if one.node == node and one.tier not in (STANDARD, LARGE)]
    return [
        Case(i.name, dataclasses.replace(i.problem, name=i.name), i.solution)
        for one in small
        for i in one.instances()
        if i.solution is not None
    ]


def infeasible(node: str) -> list[Case]:
    """Return problems of the node that have no solution (their point is None)."""
    return [case for case in _read(node) if case.point is None]


def is_shipped(node: str) -> bool:
    """Return whether a formulation has cases of its own, beside the problems of its generators."""
    return (FOLDER / f"{node}.h5").is_file()


@cache
def _read(node: str) -> list[Case]:
    if not is_shipped(node):
        return []
    with open_tree(FOLDER / f"{node}.h5") as root:
        return [_case(root.child(name), read_problem(root, name)) for name in members_of(root)]


def _case(stored: Tree, problem: Problem) -> Case:
    solved = "solution" in stored
    return Case(problem.name, problem, read_point(stored.child("solution"), problem.point_type) if solved else None)
