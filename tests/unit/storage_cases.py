"""Problems of every node and storage for the tests of files, and what it means that two are the same."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations import LCP, Contacts, FrictionContact, Info, Sequence, Step, formulations
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


ALONE = ((0, 0), (1, 0), (5, 0))
JOINED = ((0, 0), (0, 2), (1, 0), (5, 2))
"""Contacts, and joints or equations beside them."""
CONTACTS = (
    ("fc", (2, 3), ALONE), ("gfc", (2, 3), ALONE), ("gfc", (2,), JOINED[1::2]), ("fcm", (2, 3), JOINED),
    ("rfc", (3, 5), ALONE), ("grfc", (3, 5), JOINED), ("afc", (3,), ALONE),
)  # fmt: skip
"""Formulations of contact, their dimensions, and how many contacts and joints."""
PLACE = Sequence(name="stack", step=3, time=0.3, dt=0.1, previous="ab12")
SECOND = ProductCone.of((Cone.SECOND_ORDER, 2, 3, np.array([0.5, 1 / 3])), (Cone.SECOND_ORDER, 1, 1, 0.0))
DISK = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 0.3), (Cone.CYLINDER, 1, 3, 1 / 3))
ALL = ProductCone.of(
    (Cone.ZERO, 1, 2),
    (Cone.FREE, 1, 1),
    (Cone.NONNEGATIVE, 1, 3),
    (Cone.SECOND_ORDER, 2, 3, np.array([0.5, np.inf])),
    (Cone.ROLLING, 1, 5, 0.5, 0.1),
    (Cone.ROLLING_DUAL, 1, 3, 0.5, 0.1),
)
Matrix = Callable[..., Any]


def cases(seed: int = 7) -> dict[str, Any]:
    """name -> problem: dense, sparse, empty, denormal and negative zero entries."""
    rng = np.random.default_rng(seed)

    def dense(*shape: int) -> np.ndarray:
        A = rng.standard_normal(shape)
        A[A > 1.2] = 0.0
        return A * 10.0 ** rng.integers(-12, 12, shape)

    def sparse(*shape: int) -> sp.csr_array:
        return sp.csr_array(sp.random_array(shape, density=0.2, rng=rng, format="csr"))

    special = dense(4, 4)
    special[0] = [-0.0, 5e-324, 1e308, 1 / 3]
    found: dict[str, Any] = {"lcp-special": LCP(M=special, q=np.array([-0.0, 1 / 3, 1e-320, -1.0]), info=INFO)}
    for kind, matrix in (("dense", dense), ("sparse", sparse)):
        found |= _linear(kind, matrix, rng) | _contact(kind, matrix, rng)
    found["gfc3-joints-only-sparse"] = dataclasses.replace(
        found["gfc3-dense-5"], G=sparse(6, 2), b=rng.random(2), info=Info(title="t")
    )
    found["fc3-mixed-place"] = dataclasses.replace(found["fc3-sparse-5"], sequence=PLACE, contacts=_places(5, rng))
    found["gfc3-mixed"] = dataclasses.replace(found["gfc3-dense-5"], M=sparse(6, 6))
    found["lcp-large"] = LCP(M=dense(120, 120), q=rng.random(120))
    found["fc3-large"] = FrictionContact(W=dense(120, 120), q=rng.random(120), mu=rng.random(40))
    found["lcp-converted"] = dataclasses.replace(found["lcp-dense-11"], provenance=steps(rng))
    found["fc3-converted"] = dataclasses.replace(found["fc3-dense-5"], provenance=steps(rng))
    return found


def build(node: str, sizes: Mapping[str, int], matrix: Matrix, rng: np.random.Generator, **given: Any) -> Any:
    """A problem whose arrays have the shapes that its formulation declares; what is given is taken as it is."""
    cls, data = formulations.get(node), {}
    for field in cls._data_fields():
        shape = [int(s) if s.isdigit() else sizes[s] for s in field.metadata["shape"]]
        data[field.name] = matrix(*shape) if len(shape) == 2 else rng.random(shape)
    if "Q" in data:
        data["Q"] = data["Q"] + data["Q"].T
    if "lb" in data:
        data["lb"] = -data["lb"]
    return cls(**(data | given))


def _linear(kind: str, matrix: Matrix, rng: np.random.Generator) -> dict[str, Any]:
    """Formulations with matrices: empty, of one row, with every part and with few."""
    found: dict[str, Any] = {}
    for n, m in ((0, 0), (1, 0), (0, 2), (7, 4)):
        found[f"lcp-{kind}-{n + m}"] = build("lcp", {"n": n + m}, matrix, rng, name="stored")
        found[f"mlcp-{kind}-{n}-{m}"] = build("mlcp", {"n": n, "m": m}, matrix, rng)
        below = {"lb": np.full(n, -np.inf), "info": INFO}
        found[f"qp-{kind}-{n}-{m}"] = build("qp", {"n": n, "m": m, "k": 1}, matrix, rng, **below)
    for n in (0, 1, 7):
        below, above = {"lb": np.full(n, -np.inf)}, {"ub": np.full(n, np.inf)}
        found[f"relay-{kind}-{n}"] = build("relay", {"n": n}, matrix, rng)
        found[f"avi-{kind}-{n}"] = build("avi", {"n": n, "m": 0, "k": 0}, matrix, rng, **below, **above)
        found[f"avi-{kind}-set-{n}"] = build("avi", {"n": n, "m": 2, "k": 1}, matrix, rng, **below, info=INFO)
    for name, cone in (("none", ProductCone.of()), ("second", SECOND), ("disk", DISK), ("all", ALL)):
        fields: Any = cone_fields(cone)
        k = len(fields["cone_kind"])
        if cone is not DISK:
            found[f"soclcp-{kind}-{name}"] = build("soclcp", {"n": cone.rows, "k": k}, matrix, rng, **fields)
        found[f"coneqp-{kind}-{name}"] = build("coneqp", {"n": 4, "m": cone.rows, "k": k}, matrix, rng, **fields)
    return found


def _contact(kind: str, matrix: Matrix, rng: np.random.Generator) -> dict[str, Any]:
    """Formulations of contact: without any, and with places and a sequence where they have them."""
    found: dict[str, Any] = {}
    for node, dimensions, counts in CONTACTS:
        for d, (nc, p) in itertools.product(dimensions, counts):
            given: dict[str, Any] = {"info": INFO} | ({"mu": 0.1 + rng.random((nc, 2))} if node == "afc" else {})
            if node in ("gfc", "grfc", "rfc"):
                given |= {"sequence": PLACE, "contacts": _places(nc, rng)}
            size = f"{nc}-{p}" if counts is not ALONE else f"{nc}"
            sizes = {"n": 6, "m": d * nc, "nc": nc, "p": p}
            label = node if node == "afc" else f"{node}{d}"
            found[f"{label}-{kind}-{size}"] = build(node, sizes, matrix, rng, dimension=d, **given)
    return found


def _places(nc: int, rng: np.random.Generator) -> Contacts:
    bodies, frame = np.arange(2 * nc).reshape(nc, 2), rng.standard_normal((nc, 3, 3))
    return Contacts(id=np.arange(nc) + 2**40, bodies=bodies, position=rng.standard_normal((nc, 3)), frame=frame)


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
