"""Problems of every node and storage for the tests of files, and what it means that two are the same."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations import (
    AVI,
    LCP,
    MLCP,
    QP,
    SOCLCP,
    AnisotropicFrictionContact,
    ConeQP,
    Contacts,
    FrictionContact,
    GlobalFrictionContact,
    GlobalRollingFrictionContact,
    Info,
    MixedFrictionContact,
    Relay,
    RollingFrictionContact,
    Sequence,
    Step,
)
from cpbench.formulations.conic import cone_fields
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.factorization import Factorization

INFO = Info(
    title="Würfel",
    description="two\nlines",
    math_info="P-matrix",
    source="a book",
    licence="CC0",
    family="boxes",
    citation="Author 1999",
    properties={"rank": 3, "psd": True, "known": [1.5, 2.0]},
)


def cases(seed: int = 7) -> dict[str, Any]:
    """name -> problem: dense, sparse, empty, denormal and negative zero entries."""
    rng = np.random.default_rng(seed)

    def dense(*shape: int) -> np.ndarray:
        A = rng.standard_normal(shape)
        A[A > 1.2] = 0.0
        return A * 10.0 ** rng.integers(-12, 12, shape)

    def sparse(*shape: int) -> sp.csr_array:
        return sp.csr_array(sp.random_array(shape, density=0.2, rng=rng, format="csr"))

    def symmetric(A: Any) -> Any:
        return A + A.T

    def contacts(nc: int) -> Contacts:
        return Contacts(
            id=np.arange(nc) + 2**40,
            bodies=np.arange(2 * nc).reshape(nc, 2),
            position=rng.standard_normal((nc, 3)),
            frame=rng.standard_normal((nc, 3, 3)),
        )

    place = Sequence(name="stack", step=3, time=0.3, dt=0.1, previous="ab12")
    special = dense(4, 4)
    special[0] = [-0.0, 5e-324, 1e308, 1 / 3]
    found: dict[str, Any] = {"lcp-special": LCP(M=special, q=np.array([-0.0, 1 / 3, 1e-320, -1.0]), info=INFO)}
    for kind, make in (("dense", dense), ("sparse", sparse)):
        for n, m in ((0, 0), (1, 0), (0, 2), (7, 4)):
            found[f"lcp-{kind}-{n + m}"] = LCP(M=make(n + m, n + m), q=rng.standard_normal(n + m), name="stored")
            found[f"mlcp-{kind}-{n}-{m}"] = MLCP(
                A=make(n, n), B=make(m, m), C=make(n, m), D=make(m, n), a=rng.random(n), b=rng.random(m)
            )
            found[f"qp-{kind}-{n}-{m}"] = QP(
                Q=symmetric(make(n, n)),
                p=rng.random(n),
                A=make(m, n),
                b=rng.random(m),
                C=make(1, n),
                d=rng.random(1),
                lb=np.full(n, -np.inf),
                ub=rng.random(n),
                info=INFO,
            )
        for d in (2, 3):
            for nc in (0, 1, 5):
                found[f"fc{d}-{kind}-{nc}"] = FrictionContact(
                    W=make(d * nc, d * nc), q=rng.random(d * nc), mu=rng.random(nc), dimension=d, info=INFO
                )
                found[f"gfc{d}-{kind}-{nc}"] = GlobalFrictionContact(
                    M=make(6, 6),
                    H=make(6, d * nc),
                    f=rng.random(6),
                    w=rng.random(d * nc),
                    mu=rng.random(nc),
                    dimension=d,
                    sequence=place,
                    contacts=contacts(nc),
                    info=INFO,
                )
        found |= _linear(kind, make, symmetric, rng)
        for nc, p in ((0, 0), (0, 2), (1, 0), (5, 2)):
            size = f"{kind}-{nc}-{p}"
            for d in (2, 3):
                found[f"fcm{d}-{size}"] = MixedFrictionContact(
                    W=make(d * nc, d * nc),
                    V=make(d * nc, p),
                    R=make(p, p),
                    q=rng.random(d * nc),
                    s=rng.random(p),
                    mu=rng.random(nc),
                    dimension=d,
                    info=INFO,
                )
            joints = {"G": make(6, p), "b": rng.random(p)}
            globals_ = ((3, GlobalRollingFrictionContact), (5, GlobalRollingFrictionContact))
            for d, cls in (*globals_, (2, GlobalFrictionContact)) if p else globals_:  # gfc without joints: above
                rolling = {"mu_r": rng.random(nc)} if cls is GlobalRollingFrictionContact else {}
                found[f"{cls.node}{d}-{size}"] = cls(
                    M=make(6, 6),
                    H=make(6, d * nc),
                    f=rng.random(6),
                    w=rng.random(d * nc),
                    mu=rng.random(nc),
                    dimension=d,
                    sequence=place,
                    contacts=contacts(nc),
                    info=INFO,
                    **joints,
                    **rolling,
                )
        for nc in (0, 1, 5):
            for d in (3, 5):
                found[f"rfc{d}-{kind}-{nc}"] = RollingFrictionContact(
                    W=make(d * nc, d * nc),
                    q=rng.random(d * nc),
                    mu=rng.random(nc),
                    mu_r=rng.random(nc),
                    dimension=d,
                    sequence=place,
                    contacts=contacts(nc),
                )
            found[f"afc-{kind}-{nc}"] = AnisotropicFrictionContact(
                W=make(3 * nc, 3 * nc), q=rng.random(3 * nc), mu=0.1 + rng.random((nc, 2)), info=INFO
            )
    found["gfc3-joints-only-sparse"] = dataclasses.replace(
        found["gfc3-dense-5"], G=sparse(6, 2), b=rng.random(2), info=Info(title="t")
    )
    found["fc3-mixed-place"] = dataclasses.replace(found["fc3-sparse-5"], sequence=place, contacts=contacts(5))
    found["gfc3-mixed"] = dataclasses.replace(found["gfc3-dense-5"], M=sparse(6, 6))
    found["lcp-large"] = LCP(M=dense(120, 120), q=rng.random(120))
    found["fc3-large"] = FrictionContact(W=dense(120, 120), q=rng.random(120), mu=rng.random(40))
    found["lcp-converted"] = dataclasses.replace(found["lcp-dense-11"], provenance=steps(rng))
    found["fc3-converted"] = dataclasses.replace(found["fc3-dense-5"], provenance=steps(rng))
    return found


def _linear(kind: str, make: Any, symmetric: Any, rng: np.random.Generator) -> dict[str, Any]:
    """Relays, variational inequalities and conic problems: empty, of one row, with every part and with few."""
    found: dict[str, Any] = {}
    K = ProductCone.of(
        (Cone.ZERO, 1, 2),
        (Cone.FREE, 1, 1),
        (Cone.NONNEGATIVE, 1, 3),
        (Cone.SECOND_ORDER, 2, 3, np.array([0.5, np.inf])),
        (Cone.ROLLING, 1, 5, 0.5, 0.1),
        (Cone.ROLLING_DUAL, 1, 3, 0.5, 0.1),
    )
    second = ProductCone.of((Cone.SECOND_ORDER, 2, 3, np.array([0.5, 1 / 3])), (Cone.SECOND_ORDER, 1, 1, 0.0))
    disk = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 0.3), (Cone.CYLINDER, 1, 3, 1 / 3))
    for n in (0, 1, 7):
        found[f"relay-{kind}-{n}"] = Relay(M=make(n, n), q=rng.random(n), lb=-rng.random(n), ub=rng.random(n))
        found[f"avi-{kind}-{n}"] = AVI(M=make(n, n), q=rng.random(n))
        found[f"avi-{kind}-set-{n}"] = AVI(
            M=make(n, n),
            q=rng.random(n),
            A=make(2, n),
            b=rng.random(2),
            C=make(1, n),
            d=rng.random(1),
            lb=np.full(n, -np.inf),
            ub=rng.random(n),
            info=INFO,
        )
    for name, cone in (("none", ProductCone.of()), ("second", second), ("all", K)):
        fields, n = cone_fields(cone), cone.rows
        found[f"soclcp-{kind}-{name}"] = SOCLCP(M=make(n, n), q=rng.random(n), **fields)  # pyright: ignore
    for name, cone in (("none", ProductCone.of()), ("disk", disk), ("all", K)):
        fields, m = cone_fields(cone), cone.rows
        found[f"coneqp-{kind}-{name}"] = ConeQP(
            Q=symmetric(make(4, 4)),
            p=rng.random(4),
            A=make(m, 4),
            b=rng.random(m),
            **fields,  # pyright: ignore
        )
    return found


def steps(rng: np.random.Generator) -> tuple[Step, ...]:
    """Two recorded conversions whose traces hold every kind of value."""
    trace: dict[str, Any] = {
        "factor": Factorization(rng.standard_normal((3, 3))),
        "sparse_factor": Factorization(sp.csr_array(np.eye(4) * 1.5)),
        "C": rng.standard_normal((3, 2)),
        "S": sp.csr_array(sp.random_array((4, 5), density=0.4, rng=rng)),
        "none": np.zeros((0, 3)),
        "a": rng.standard_normal(3),
        "order": np.array([2, 0, 1]),
        "kept": np.array([True, False]),
        "radius": 1 / 3,
        "limit": float("inf"),
        "count": 8,
        "flag": True,
        "label": "normal map ν",
        "inner": {"n": 2, "v": np.ones(2)},
    }
    first = Step("a-b", {"facets": 8, "angle": 0.1}, "equivalent", "mlcp", "00ff", trace)
    return (first, Step("b-c-how", {}, "approximate", "lcp", "ff00", {}))


def same(a: Any, b: Any) -> bool:
    """Equal bit for bit, in value, type and storage."""
    if sp.issparse(a) or sp.issparse(b):
        if not (sp.issparse(a) and sp.issparse(b)) or a.shape != b.shape:
            return False
        return all(same(np.asarray(getattr(a, k)), np.asarray(getattr(b, k))) for k in ("data", "indices", "indptr"))
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        if a.dtype.kind == b.dtype.kind == "i":
            return a.shape == b.shape and bool((a == b).all())
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, Factorization):
        return isinstance(b, Factorization) and same(a.A, b.A)
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, Mapping):
        return isinstance(b, Mapping) and set(a) == set(b) and all(same(a[k], b[k]) for k in a)
    if isinstance(a, tuple | list):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and a == b
