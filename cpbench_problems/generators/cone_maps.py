"""Generalized equations and cone complementarity problems with cubic monotone maps, planted as those of `vi_sets`."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.conic import CP, CPPoint, cone_fields
from cpbench.formulations.variational import GE, GEPoint
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.generators.base import Instance, collection, dyadic, generator
from cpbench_problems.generators.vi_sets import on_cones, planted_map, sides, sized_name

CITATION = "planted by cpbench"


@collection("ge-planted", "ge", "cubic monotone generalized equations with normal cones of products", CITATION)
def build_generalized() -> list[Instance]:
    return [generalized(k) for k in (2, 10, 9, 12)]


@collection("cp-planted", "cp", "cubic monotone cone complementarity problems", CITATION)
def build_cones() -> list[Instance]:
    return [cone_complementarity(k) for k in (3, 12, 8, 10)]


@collection(
    "ge-planted-large", "ge", "cubic monotone generalized equations of up to 9004 unknowns", CITATION, tier="standard"
)
def build_generalized_large() -> list[Instance]:
    sparse = [generalized(k, sparse=True) for k in (500, 1000, 3000)]
    return [*map(generalized, (40, 100)), *sparse]


@collection(
    "cp-planted-large",
    "cp",
    "cubic monotone cone complementarity problems of up to 9006 unknowns",
    "planted by cpbench",
    tier="standard",
)
def build_cones_large() -> list[Instance]:
    sparse = [cone_complementarity(k, sparse=True) for k in (500, 1000, 3000)]
    return [*map(cone_complementarity, (40, 100)), *sparse]


def generalized(count: int, *, sparse: bool = False) -> Instance:
    """Build bounded free components and second-order cones."""
    rng = generator(600 + count)
    z, w = sides(rng, 4)
    x, y, mu = on_cones(rng, count)
    at, value = np.concatenate([z, x]), np.concatenate([w, y])
    K = ProductCone.of((Cone.FREE, 1, 4), (Cone.SECOND_ORDER, count, 3, mu))
    free = np.arange(at.size) < 4
    problem = GE(
        F=planted_map(at, value, rng, sparse=sparse),
        lb=np.where(free, -1.0, -np.inf),
        ub=np.where(free, 2.0, np.inf),
        **cone_fields(K),
        name=sized_name("generalized", count, sparse=sparse),
    )
    return Instance(problem, GEPoint(z=at), "planted", properties={"class": "strongly monotone"})


def cone_complementarity(count: int, *, sparse: bool = False) -> Instance:
    """Build orthant, equations and second-order cones, with two rows Ax ≥ 0, one of them active."""
    rng = generator(500 + count)
    positive, size = np.arange(4) % 2 == 0, dyadic(rng, 4, 1, 2)
    x, y, mu = on_cones(rng, count)
    at = np.concatenate([np.where(positive, size, 0.0), [1.0, -1.5], x])
    value = np.concatenate([np.where(positive, 0.0, size), np.zeros(2), y])
    A = dyadic(rng, (2, at.size), -1, 1, 2)
    A[:, 4] += np.array([0.0, 2.0]) - A @ at  # Ax = (0, 2)
    lam = np.array([0.75, 0.0])
    K = ProductCone.of((Cone.NONNEGATIVE, 1, 4), (Cone.FREE, 1, 2), (Cone.SECOND_ORDER, count, 3, mu))
    F = planted_map(at, value + A.T @ lam, rng, sparse=sparse)
    problem = CP(F=F, A=A, **cone_fields(K), name=sized_name("cone-complementarity", count, sparse=sparse))
    facts = {"class": "strongly monotone"}
    return Instance(problem, CPPoint(x=at, lam=lam), "planted", properties=facts)
