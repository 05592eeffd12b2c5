"""Nonlinear problems made around a chosen solution: F(x) = Mx + Dφ(x) + q with q such that F(z) is what z asks for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import planted
import planted_conic
from planted import bodies_and_contacts, contact_state, friction, square

from cpbench.formulations import (
    CP,
    GE,
    NCP,
    NLP,
    QVI,
    VI,
    CPPoint,
    Equation,
    EquationPoint,
    GEPoint,
    MiCP,
    MiCPPoint,
    NCPPoint,
    NFCPoint,
    NLPPoint,
    NonlinearFrictionContact,
    QVIPoint,
    VIPoint,
)
from cpbench.formulations.conic import cone_fields
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.recording import maximum, recorded
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import Vector

LAWS = ("affine", "tanh", "exp", "cube")
"""φ of `monotone`, increasing in every component."""


def graph(n: int, expression: Callable[[Any], Any]) -> Map:
    """Return x ↦ expression(x) as a map of n unknowns, an expression of NumPy columns."""
    return recorded(n, expression)


def _law(name: str) -> Callable[[Any], Any]:
    laws: Mapping[str, Callable[[Any], Any]] = {
        "affine": lambda x: 0.0 * x,
        "tanh": np.tanh,
        "exp": np.exp,
        "cube": lambda x: x * x * x,
        "piecewise": lambda x: maximum(x, 0.0),
        "damping": lambda x: x * np.abs(x),
    }
    return laws[name]


def map_with_value(n: int, expression: Callable[[Any], Any], at: Vector, value: Vector) -> Map:
    """Return the map x ↦ expression(x) + q, with q such that its value at the point `at` is `value`."""
    q = value - graph(n, expression)(at)
    return graph(n, lambda x: expression(x) + q)


def monotone(rng: np.random.Generator, z: Vector, w: Vector, kind: str = "monotone", law: str = "") -> Map:
    """Build F with F(z) = w; M of a kind of `planted.square`, D ≥ 0 diagonal with zeros, φ drawn unless given."""
    n = z.size
    M, D = square(rng, n, kind), np.where(rng.random(n) < 0.25, 0.0, rng.uniform(0.2, 1.5, n))
    phi = _law(law or str(rng.choice(LAWS)))
    return map_with_value(n, lambda x: M @ x + D * phi(x), z, w)


def ncp(rng: np.random.Generator, n: int, kind: str = "monotone", law: str = "") -> tuple[NCP, NCPPoint]:
    z, w = planted.complementary(rng, n)
    return NCP(F=monotone(rng, z, w, kind, law), start=rng.uniform(0.0, 2.0, n)), NCPPoint(z=z)


def micp(rng: np.random.Generator, n: int, kind: str = "monotone", law: str = "") -> tuple[MiCP, MiCPPoint]:
    """Plant free unknowns and those bounded from below, from above, from both sides, and fixed."""
    z, w, lb, ub = planted_conic.boxed(rng, n, finite=False)
    F = monotone(rng, z, w, kind, law)
    return MiCP(F=F, lb=lb, ub=ub, start=rng.standard_normal(n)), MiCPPoint(z=z)


def equation(rng: np.random.Generator, n: int, kind: str = "any", law: str = "") -> tuple[Equation, EquationPoint]:
    z = rng.standard_normal(n)
    F = monotone(rng, z, np.zeros(n), kind, law)
    return Equation(F=F, start=rng.standard_normal(n)), EquationPoint(z=z)


def product(rng: np.random.Generator, *, cones: bool = False) -> ProductCone:
    """Draw every kind of factor; only cones, or a disk with an axis and balls too. Free components come last."""
    factors = list(
        zip(*(getattr(planted_conic.cone(rng), part) for part in ("kind", "size", "mu", "mu_r")), strict=True)
    )
    runs = [(Cone(int(kind)), 1, size, mu, mu_r) for kind, size, mu, mu_r in factors if kind != Cone.FREE]
    if not cones:
        runs += [(Cone.CYLINDER, 1, 3, 0.75), (Cone.BALL, 2, 2, rng.uniform(0.5, 2.0, 2))]
    return ProductCone.of(*runs)


def _in_set(rng: np.random.Generator, n: int, K: ProductCone | None) -> tuple[Vector, Vector, dict[str, Any]]:
    """Return z, G and the fields of K × [lb, ub] with −G in the normal cone at z; n components are free of K."""
    z, G, lb, ub = planted_conic.boxed(rng, n, finite=False)
    if K is None:
        return z, G, {"lb": lb, "ub": ub}
    s, y = planted_conic.pair(rng, K)
    none = np.full(K.rows, np.inf)
    whole = ProductCone(
        *(
            np.append(getattr(K, part), last)
            for part, last in (("kind", Cone.FREE), ("size", n), ("mu", 0.0), ("mu_r", 0.0))
        )
    )
    bounds = {"lb": np.concatenate([-none, lb]), "ub": np.concatenate([none, ub])}
    return np.concatenate([s, z]), np.concatenate([y, G]), {**bounds, **cone_fields(whole)}


def _concave(rng: np.random.Generator, at: Vector, slack: Vector) -> tuple[Map, np.ndarray]:
    """Return g with concave components of the values `slack` at a point, and their slopes there."""
    p, n = slack.size, at.size
    slopes, weights = rng.standard_normal((p, n)), rng.uniform(0.0, 1.0, (p, n))

    def g(x: Any) -> Any:
        d = x - at
        return slack + slopes @ d - 0.5 * weights @ (d * d)

    return graph(n, g), slopes


def vi(
    rng: np.random.Generator,
    n: int,
    K: ProductCone | None = None,
    m: int = 0,
    k: int = 0,
    p: int = 0,
    kind: str = "monotone",
    law: str = "",
    *,
    sparse: bool = False,
) -> tuple[VI, VIPoint]:
    """Return n unknowns with bounds of every kind beside those of K; m, k, p rows of A, C and g."""
    z, G, fields = _in_set(rng, n, K)
    A, C = rng.standard_normal((m, z.size)), rng.standard_normal((k, z.size))
    lam, room = planted.complementary(rng, m)
    nu, slack = planted.complementary(rng, p)
    mu = rng.standard_normal(k)
    g, slopes = _concave(rng, z, slack)
    problem = VI(
        F=monotone(rng, z, G + A.T @ lam + C.T @ mu + slopes.T @ nu, kind, law),
        g=g if p else None,  # pyright: ignore[reportArgumentType]
        A=planted.stored(A, sparse),
        b=A @ z - room,
        C=planted.stored(C, sparse),
        d=C @ z,
        start=rng.standard_normal(z.size),
        **fields,
    )
    return problem, VIPoint(z=z, lam=lam, mu=mu, nu=nu)


def ge(
    rng: np.random.Generator, n: int, K: ProductCone | None = None, kind: str = "monotone", law: str = ""
) -> tuple[GE, GEPoint]:
    z, G, fields = _in_set(rng, n, K)
    return GE(F=monotone(rng, z, G, kind, law), start=rng.standard_normal(z.size), **fields), GEPoint(z=z)


def cp(
    rng: np.random.Generator,
    K: ProductCone | None = None,
    m: int = 0,
    kind: str = "monotone",
    law: str = "",
    *,
    sparse: bool = False,
) -> tuple[CP, CPPoint]:
    """Return m rows of A, turned so that Ax is what λ asks for."""
    K = product(rng, cones=True) if K is None else K
    x, y = planted_conic.pair(rng, K)
    lam, room = planted.complementary(rng, m)
    A = rng.standard_normal((m, x.size))
    if x.any():
        A += np.outer(room - A @ x, x) / (x @ x)
        A[np.abs(A) < 1e-12] = 0.0  # rounding, where one component of x carries the row
    F = monotone(rng, x, y + A.T @ lam, kind, law)
    problem = CP(F=F, A=planted.stored(A, sparse), start=rng.standard_normal(x.size), **cone_fields(K))
    return problem, CPPoint(x=x, lam=lam)


def nlp(
    rng: np.random.Generator, n: int, m: int, k: int, *, convex: bool = True, slater: bool = True
) -> tuple[NLP, NLPPoint]:
    """Return f a quadratic and three exponentials, g concave, h affine, bounds of every kind.

    With `slater`, the start is a point with g > 0, h = 0 within the bounds, unless every unknown is fixed. Not
    `convex`: the quadratic is indefinite, and z a stationary point.
    """
    z, nu, lb, ub = planted_conic.boxed(rng, n, finite=False)
    lam, slack = planted.complementary(rng, m)
    mu = rng.standard_normal(k)
    inward = np.where(z == lb, 1.0, np.where(z == ub, -1.0, rng.choice([-1.0, 1.0], n)))
    step = np.where(lb == ub, 0.0, inward * rng.uniform(0.1, 0.4, n))
    g_slopes, g_weights = rng.standard_normal((m, n)), rng.uniform(0.0, 1.0, (m, n))
    C = rng.standard_normal((k, n))
    if step.any():
        lacking = np.maximum(0.1 + 0.5 * g_weights @ step**2 - slack - g_slopes @ step, 0.0)
        g_slopes += np.outer(lacking, step) / (step @ step)
        C -= np.outer(C @ step, step) / (step @ step)
    Q = square(rng, n, "positive definite" if convex else "symmetric indefinite")
    E = 0.5 * rng.standard_normal((3, n))
    p = g_slopes.T @ lam + C.T @ mu + nu - Q @ z - E.T @ np.exp(E @ z)

    def f(x: Any) -> Any:
        return 0.5 * (x @ (Q @ x)) + (np.exp(E @ x).sum() if n else 3.0) + p @ x

    def g(x: Any) -> Any:
        d = x - z
        return slack + g_slopes @ d - 0.5 * g_weights @ (d * d)

    problem = NLP(
        f=graph(n, f),
        g=graph(n, g),
        h=graph(n, lambda x: C @ x - C @ z),
        lb=lb,
        ub=ub,
        start=z + step if slater else rng.standard_normal(n),
        convex=convex,
    )
    return problem, NLPPoint(z=z, lam=lam, mu=mu, nu=nu)


def moving_box(rng: np.random.Generator, n: int, kind: str = "monotone", law: str = "") -> tuple[QVI, QVIPoint]:
    """Plant a box both of whose bounds move with z, and some of the numbers lb, ub lie within them."""
    z, w, lower, upper = planted_conic.boxed(rng, n, finite=True)
    moves = 0.1 * rng.standard_normal((2, n, n))
    bounds = [
        graph(n, lambda x, b=bound, L=L: b + L @ np.tanh(x - z)) for bound, L in zip((lower, upper), moves, strict=True)
    ]
    own = rng.random(n) < 0.5
    problem = QVI(
        F=monotone(rng, z, w, kind, law),
        lower=bounds[0],
        upper=bounds[1],
        lb=np.where(own, lower - 0.25, -np.inf),
        start=rng.standard_normal(n),
    )
    return problem, QVIPoint(z=z)


def friction_as_qvi(rng: np.random.Generator, nc: int, d: int, kind: str = "monotone") -> tuple[QVI, QVIPoint]:
    """Plant ℝ₊ × a disk of radius μ r_N a contact, F(r) = Wr + q."""
    contact, point = planted.fc(rng, nc, d, kind)
    K = ProductCone.of((Cone.CYLINDER, nc, d, contact.mu))
    F = monotone(rng, point.r, np.asarray(contact.W @ point.r + contact.q), kind, "affine")
    return QVI(F=F, start=np.zeros(nc * d), **cone_fields(K)), QVIPoint(z=point.r)


def moving_rows(
    rng: np.random.Generator, n: int, p: int, kind: str = "monotone", law: str = ""
) -> tuple[QVI, QVIPoint]:
    """Return g(y, z) ≥ 0, concave in y, beside bounds that stay."""
    z, G, lb, ub = planted_conic.boxed(rng, n, finite=False)
    nu, slack = planted.complementary(rng, p)
    slopes, weights = rng.standard_normal((p, n)), rng.uniform(0.0, 1.0, (p, n))
    moves = rng.standard_normal((p, n))

    def g(x: Any) -> Any:
        dy, dz = x[:n] - z, x[n:] - z
        return slack + slopes @ dy - 0.5 * weights @ (dy * dy) + moves @ np.sin(dz)

    F = monotone(rng, z, G + slopes.T @ nu, kind, law)
    problem = QVI(F=F, g=graph(2 * n, g), lb=lb, ub=ub, start=rng.standard_normal(n))
    return problem, QVIPoint(z=z, nu=nu)


def nfc(
    rng: np.random.Generator, bodies: int, nc: int, d: int, law: str = "damping", *, sparse: bool = False
) -> tuple[NonlinearFrictionContact, NFCPoint]:
    """Plant rigid bodies that something slows down: F(v) = Mv + Dφ(v) + q."""
    M, H = bodies_and_contacts(rng, bodies, nc, d, True)
    n = 6 * bodies
    D, mu = rng.uniform(0.0, 1.0, n), friction(rng, nc)
    r, u = contact_state(rng, nc, d, mu)
    v, phi = rng.standard_normal(n), _law(law)
    problem = NonlinearFrictionContact(
        F=map_with_value(n, lambda x: M @ x + D * phi(x), v, H @ r),
        H=planted.stored(H, sparse),
        w=u - H.T @ v,
        mu=mu,
        dimension=d,
        start=rng.standard_normal(n),
    )
    return problem, NFCPoint(v=v, r=r)
