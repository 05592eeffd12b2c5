"""Planted cases of the nonlinear nodes, with their corners: n = 0 and 1, all ties, affine F, everything fixed."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from cpbench.formulations import (
    CP,
    GE,
    NCP,
    NLP,
    QVI,
    VI,
    Equation,
    EquationPoint,
    MiCP,
    MiCPPoint,
    NCPPoint,
    NLPPoint,
    NonlinearFrictionContact,
    Problem,
    VIPoint,
)
from cpbench.formulations.conic import cone_fields
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.testing import planted_nonlinear as plant
from cpbench.testing.makers import plants
from cpbench.testing.planted_nonlinear import graph

Named = dict[str, tuple[Problem, Any]]
_NONE = np.zeros(0)


def _rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def _laws(make: Callable[..., Any], seed: int, *sizes: Any) -> Named:
    return {law: make(_rng(seed + i), *sizes, law=law) for i, law in enumerate(plant.LAWS)}


@plants("ncp")
def _ncp() -> Named:
    """Return z = F(z) = 0 in half of the components, not monotone, F without a value at 0."""
    named = _laws(plant.ncp, 300, 9)
    named["not-monotone"] = plant.ncp(_rng(310), 8, "any")
    named["one"] = plant.ncp(_rng(311), 1, "positive definite", "exp")
    named["empty"] = plant.ncp(_rng(312), 0)
    z = np.array([1.0, 0.0, 2.0, 0.0])
    named["all-ties"] = (
        NCP(F=plant.monotone(_rng(313), z, np.zeros(4), "positive definite", "cube")),
        NCPPoint(z=z),
    )
    named["root-at-zero"] = (NCP(F=graph(2, lambda x: x * x + x)), NCPPoint(z=np.zeros(2)))
    named["logarithm"] = (NCP(F=graph(2, np.log), start=[2.0, 0.5]), NCPPoint(z=np.ones(2)))
    return named


@plants("micp")
def _micp() -> Named:
    """Return a problem with nothing bounded, everything fixed, at a bound with F = 0."""
    named = _laws(plant.micp, 320, 10)
    named["not-monotone"] = plant.micp(_rng(330), 8, "any")
    named["one"] = plant.micp(_rng(331), 1, "positive definite", "exp")
    named["empty"] = plant.micp(_rng(332), 0)
    z, none = np.array([1.0, -2.0, 0.5]), np.full(3, np.inf)
    named["free"] = (
        MiCP(F=plant.monotone(_rng(333), z, np.zeros(3), "positive definite"), lb=-none, ub=none),
        MiCPPoint(z=z),
    )
    named["fixed"] = (MiCP(F=plant.monotone(_rng(334), z, z, "monotone"), lb=z, ub=z), MiCPPoint(z=z))
    named["all-ties"] = (
        MiCP(F=plant.monotone(_rng(335), z, np.zeros(3), "positive definite", "tanh"), lb=z, ub=z + 1.0),
        MiCPPoint(z=z),
    )
    pair = graph(2, lambda x: (x + x * x * x) - 2.0)
    named["from-index-set"] = (MiCP.from_index_set(pair, [1]), MiCPPoint(z=np.ones(2)))
    return named


@plants("equation")
def _equation() -> Named:
    """Build smooth equations, with corners, and nothing to solve."""
    named = _laws(plant.equation, 340, 7)
    named["piecewise"] = plant.equation(_rng(350), 7, "positive definite", "piecewise")
    named["one"] = plant.equation(_rng(351), 1, "positive definite", "cube")
    named["empty"] = plant.equation(_rng(352), 0)
    named["zero-at-start"] = (Equation(F=graph(2, lambda x: x * x + x)), EquationPoint(z=np.zeros(2)))
    return named


def _ball(n: int, radius: float) -> ProductCone:
    return ProductCone.of((Cone.BALL, 1, n, radius))


@plants("vi")
def _vi() -> Named:
    """Build a box, polyhedron, ball, second-order cone, products, g(z) ≥ 0; everything at once."""
    soc = ProductCone.of((Cone.SECOND_ORDER, 3, 3, np.array([0.0, 0.5, 1.0])))
    orthant = ProductCone.of((Cone.NONNEGATIVE, 1, 4), (Cone.ZERO, 1, 2))
    named: Named = {
        "box": plant.vi(_rng(360), 8),
        "affine-box": plant.vi(_rng(361), 8, law="affine"),
        "polyhedron": plant.vi(_rng(362), 8, None, 5, 2, law="exp"),
        "affine-polyhedron": plant.vi(_rng(363), 8, None, 5, 2, law="affine"),
        "sparse-polyhedron": plant.vi(_rng(364), 8, None, 5, 2, law="cube", sparse=True),
        "equalities": plant.vi(_rng(365), 6, None, 0, 2, law="tanh"),
        "ball": plant.vi(_rng(366), 0, _ball(4, 0.75), law="tanh"),
        "second-order": plant.vi(_rng(367), 0, soc, law="cube"),
        "orthant": plant.vi(_rng(368), 3, orthant, 2, 1),
        "product": plant.vi(_rng(369), 3, plant.product(_rng(3690)), law="tanh"),
        "product-with-rows": plant.vi(_rng(370), 3, plant.product(_rng(3700)), 3, 1, 2),
        "concave": plant.vi(_rng(371), 7, None, 0, 0, 3),
        "everything": plant.vi(_rng(372), 6, orthant, 3, 1, 2, law="exp"),
        "not-monotone": plant.vi(_rng(373), 6, None, 2, 0, kind="any"),
        "one": plant.vi(_rng(374), 1, kind="positive definite", law="exp"),
        "empty": plant.vi(_rng(375), 0),
    }
    z = np.array([1.0, -2.0, 0.5])
    F = plant.monotone(_rng(376), z, np.zeros(3), "positive definite")
    named["whole-space"] = (VI(F=F), VIPoint(z=z))
    return named


@plants("ge")
def _ge() -> Named:
    soc = ProductCone.of((Cone.SECOND_ORDER, 2, 3, np.array([0.5, 1.0])))
    orthant = ProductCone.of((Cone.NONNEGATIVE, 1, 4), (Cone.ZERO, 1, 2))
    return {
        **_laws(plant.ge, 380, 8),
        "orthant": plant.ge(_rng(390), 3, orthant),
        "second-order": plant.ge(_rng(391), 2, soc, law="cube"),
        "product": plant.ge(_rng(392), 3, plant.product(_rng(3920)), law="tanh"),
        "not-monotone": plant.ge(_rng(393), 6, kind="any"),
        "one": plant.ge(_rng(394), 1, kind="positive definite", law="exp"),
        "empty": plant.ge(_rng(395), 0),
    }


@plants("cp")
def _cp() -> Named:
    """Build products with and without rows; the lecture's orthant; μ of 0 and ∞."""
    half_space = ProductCone.of((Cone.SECOND_ORDER, 3, 3, np.array([0.0, np.inf, 1.0])))
    orthant = ProductCone.of((Cone.NONNEGATIVE, 1, 6))
    return {
        **_laws(plant.cp, 400),
        "rows": plant.cp(_rng(410), None, 4),
        "sparse-rows": plant.cp(_rng(411), None, 4, law="exp", sparse=True),
        "affine-rows": plant.cp(_rng(412), None, 3, law="affine"),
        "polyhedral": plant.cp(_rng(413), ProductCone.of((Cone.FREE, 1, 5)), 4, law="tanh"),
        "orthant": plant.cp(_rng(414), orthant, law="cube"),
        "half-space": plant.cp(_rng(415), half_space),
        "one": plant.cp(_rng(416), ProductCone.of((Cone.NONNEGATIVE, 1, 1)), 0, "positive definite"),
        "empty": plant.cp(_rng(417), ProductCone.of()),
    }


@plants("nlp")
def _nlp() -> Named:
    """Build convex ones and qualified ones, ones without that word, stationary points, nothing but bounds, nothing
    at all."""
    named: Named = {
        "convex": plant.nlp(_rng(420), 8, 4, 2),
        "no-equality": plant.nlp(_rng(421), 7, 3, 0),
        "no-slater": plant.nlp(_rng(422), 7, 3, 1, slater=False),
        "only-bounds": plant.nlp(_rng(423), 8, 0, 0),
        "affine-constraints": plant.nlp(_rng(424), 6, 0, 2, slater=False),
        "not-convex": plant.nlp(_rng(425), 6, 3, 1, convex=False),
        "one": plant.nlp(_rng(426), 1, 1, 0),
        "empty": plant.nlp(_rng(427), 0, 0, 0),
    }
    free = NLP(f=graph(2, lambda x: (np.exp(x) - x).sum()), start=[1.0, -1.0], convex=True)
    named["unconstrained"] = (free, NLPPoint(z=np.zeros(2), lam=_NONE, mu=_NONE, nu=np.zeros(2)))
    linear = NLP(f=graph(2, np.sum), g=graph(2, lambda x: x - 1.0), convex=True)
    named["linear"] = (linear, NLPPoint(z=np.ones(2), lam=np.ones(2), mu=_NONE, nu=np.zeros(2)))
    problem, point = named["convex"]
    assert isinstance(problem, NLP)
    z = point.z
    fixed = dataclasses.replace(problem, lb=z, ub=z, start=z)
    named["fixed"] = (fixed, point)
    return named


@plants("qvi")
def _qvi() -> Named:
    return {
        "moving-box": plant.moving_box(_rng(440), 7),
        "affine-moving-box": plant.moving_box(_rng(441), 5, "positive definite", "affine"),
        "friction-3d": plant.friction_as_qvi(_rng(442), 4, 3, "positive definite"),
        "friction-2d": plant.friction_as_qvi(_rng(443), 4, 2),
        "moving-rows": plant.moving_rows(_rng(444), 6, 3),
        "one": plant.moving_box(_rng(445), 1, "positive definite", "exp"),
        "empty": plant.moving_box(_rng(446), 0),
    }


@plants("nfc")
def _nfc() -> Named:
    return {
        "damping-3d": plant.nfc(_rng(450), 3, 4, 3),
        "sparse-3d": plant.nfc(_rng(451), 3, 4, 3, "tanh", sparse=True),
        "plane-2d": plant.nfc(_rng(452), 2, 3, 2, "cube"),
        "affine-3d": plant.nfc(_rng(453), 2, 2, 3, "affine"),
        "one": plant.nfc(_rng(454), 1, 1, 3),
        "no-contact": plant.nfc(_rng(455), 2, 0, 3),
    }


def infeasible(node: str) -> dict[str, Problem]:
    """Return problems without solution, none of them nearly solved anywhere."""
    below = graph(1, lambda x: -x * x - 1.0)
    above = graph(1, lambda x: x * x + 1.0)
    rows, e, both = np.array([[1.0], [-1.0]]), np.ones(2), np.array([0.0, np.inf])
    match node:
        case "ncp":
            return {"negative": NCP(F=below)}
        case "micp":
            return {"no-root": MiCP(F=above, lb=[-np.inf], ub=[np.inf])}
        case "equation":
            return {"no-root": Equation(F=above)}
        case "vi":
            return {"crossed": VI(F=graph(1, lambda x: x), A=rows, b=e), "no-root": VI(F=above)}
        case "ge":
            return {"negative": GE(F=below, lb=both[:1])}
        case "cp":
            return {"negative": CP(F=below, **cone_fields(ProductCone.of((Cone.NONNEGATIVE, 1, 1))))}
        case "nlp":
            crossed = NLP(f=graph(1, lambda x: x * x), g=graph(1, lambda x: -x * x - 1.0), convex=True)
            return {"crossed": crossed}
        case "qvi":
            return {"no-root": QVI(F=above)}
        case "nfc":  # nothing moves the contact, which closes
            no_lever = NonlinearFrictionContact(
                F=graph(1, lambda x: x * x * x + x), H=np.zeros((1, 3)), w=[-1.0, 0.0, 0.0], mu=[0.5]
            )
            return {"no-lever": no_lever}
        case _:
            return {}


def draw(node: str, rng: np.random.Generator, size: int, kind: str) -> tuple[Problem, Any] | None:
    """Return a random case of a nonlinear node; None for another one."""
    few = int(rng.integers(0, 3))
    makers: dict[str, Callable[[], tuple[Problem, Any]]] = {
        "ncp": lambda: plant.ncp(rng, size, kind),
        "micp": lambda: plant.micp(rng, size, kind),
        "equation": lambda: plant.equation(rng, size, kind),
        "vi": lambda: plant.vi(
            rng, size, None if few else plant.product(rng), int(rng.integers(0, 4)), min(size, few), few, kind
        ),
        "ge": lambda: plant.ge(rng, size, None if few else plant.product(rng), kind),
        "cp": lambda: plant.cp(rng, ProductCone.of((Cone.NONNEGATIVE, 1, size)) if few else None, few, kind),
        "nlp": lambda: plant.nlp(rng, size, few, int(size > 2), convex=kind != "any"),
        "qvi": lambda: (
            plant.moving_box(rng, size, kind)
            if few == 0
            else plant.friction_as_qvi(rng, size, 1 + few, kind)
            if few == 1
            else plant.moving_rows(rng, size, 2, kind)
        ),
        "nfc": lambda: plant.nfc(rng, 1 + size // 3, size, 2 + few % 2),
    }
    return makers[node]() if node in makers else None
