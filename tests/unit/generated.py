"""Built instances of generators, made once a process: several test files take their cases from them."""

from __future__ import annotations

from functools import cache

from cpbench.generators import Instance, generators


@cache
def instances(collection: str) -> tuple[Instance, ...]:
    """The instances of a collection."""
    return tuple(generators.get(collection).instances())
