"""Contract of the generators, and the exact arithmetic they plant solutions with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cpbench.formulations.base import Info, Point, Problem
from cpbench.foundation.matrices import Dense, Vector
from cpbench.generators.descriptions import describe
from cpbench.registry import Registry

LICENCE = "CC0-1.0"
"""Licence of the problems, as numbers in files; the code that makes them is under that of cpbench."""
SMALL, STANDARD, LARGE = TIERS = ("small", "standard", "large")
"""Tiers of the collection: shipped in files; made in minutes; made on request."""


@dataclass(frozen=True, eq=False)
class Instance:
    """A problem and what is known of it.

    Attributes
    ----------
    solution : a solution, None where none is known in closed form.
    known : how it is known: `planted` (the data were made for it; `planted to rounding` where the sums are not
        exact), `published`, `closed form`, `infeasible` or `unbounded` (then `certificate` proves it: multipliers, or a
        ray), or `nothing`.
    starts : starting points that were published with it, the first of them the problem's own; the file's guesses.
    """

    problem: Problem
    solution: Point | None = None
    known: str = "nothing"
    certificate: Vector | None = None
    properties: Mapping[str, Any] = field(default_factory=dict)
    starts: tuple[Point, ...] = ()

    @property
    def name(self) -> str:
        return self.problem.name


@dataclass(frozen=True)
class Collection:
    """One family: a registered generator. `build` is deterministic and takes no argument.

    `tier` : the tier that it belongs to, '' for none. Problems of tiers come out bit for bit alike on every machine.
    """

    name: str
    node: str
    summary: str
    citation: str
    build: Callable[[], list[Instance]]
    tier: str = SMALL

    @property
    def builtin(self) -> bool:
        """Return whether its files are shipped."""
        return self.tier == SMALL

    def instances(self) -> list[Instance]:
        """Build the instances, with description, family, source, licence and citation in their info."""
        return [self._signed(instance) for instance in self.build()]

    def _signed(self, instance: Instance) -> Instance:
        facts = {"known": instance.known, **instance.properties}
        description = describe(self.name, instance.name, {**instance.problem.sizes(), **facts})
        if description.solutions:
            facts = {"solutions": description.solutions, **facts}
        info = Info(
            title=instance.problem.info.title or self.summary,
            description=description.sentences,
            source=f"cpbench generate, collection {self.name}",
            licence=LICENCE,
            family=self.name,
            citation=self.citation,
            properties=facts,
        )
        return replace(instance, problem=replace(instance.problem, info=info))


generators: Registry[Collection] = Registry("generator")


def collection(
    name: str, node: str, summary: str, citation: str, *, builtin: bool = True, tier: str = ""
) -> Callable[[Callable[[], list[Instance]]], Any]:
    """Register a function that builds instances as a collection (a decorator).

    builtin : it is of the small tier, whose files are shipped. tier : another one.
    """

    def register(build: Callable[[], list[Instance]]) -> Callable[[], list[Instance]]:
        generators.add(name, Collection(name, node, summary, citation, build, tier or (SMALL if builtin else "")))
        return build

    return register


def generator(seed: int) -> np.random.Generator:
    """Create the generator every family draws from: PCG64, whose integers are the same everywhere."""
    return np.random.Generator(np.random.PCG64(seed))


def dyadic(rng: np.random.Generator, shape: int | tuple[int, ...], low: int, high: int, denominator: int = 8) -> Dense:
    """Draw multiples of 1/denominator (a power of two) in [low, high]."""
    return rng.integers(low * denominator, high * denominator + 1, shape) / denominator


def snapped(x: Any) -> Any:
    """Round `x` to multiples of 2⁻⁴⁰: the last bits of sin, exp and log differ between C libraries."""
    return np.round(np.asarray(x) * 2.0**40) / 2.0**40
