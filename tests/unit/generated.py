"""Instances of generators, built once a process, and their names from the sheets: none is built while tests are
collected."""

from __future__ import annotations

from functools import cache

from cpbench.formulations import formulations
from cpbench.generators import Instance, generators
from cpbench.generators.base import SMALL
from cpbench.generators.collection import ListedProblem, catalogue


@cache
def instances(collection: str) -> tuple[Instance, ...]:
    """The instances of a collection."""
    return tuple(generators.get(collection).instances())


def instance(entry: ListedProblem) -> Instance:
    """The instance of an entry of the sheets."""
    (found,) = (one for one in instances(entry.family) if one.name == entry.name)
    return found


def shipped(*, maps: bool) -> list[ListedProblem]:
    """Entries of the small tier, of the formulations with maps or of those without."""
    with_maps = {kind.node for kind in formulations if kind.has_maps()}
    return [entry for entry in catalogue() if entry.tier == SMALL and (entry.node in with_maps) == maps]
