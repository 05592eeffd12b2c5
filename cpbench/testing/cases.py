"""Planted cases of every node, with the corner shapes that break plugins."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations import LCP, MLCP, QP, Problem
from cpbench.formulations.conic import ConicProblem
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.recording import MapRecorder
from cpbench.generators import generators
from cpbench.generators.base import LARGE, STANDARD
from cpbench.registry import NodeTable
from cpbench.testing import (  # those that are not used here enter their makers
    cases_conic,  # noqa: F401  # pyright: ignore[reportUnusedImport]
    cases_contact,  # noqa: F401  # pyright: ignore[reportUnusedImport]
    cases_linear,  # noqa: F401  # pyright: ignore[reportUnusedImport]
    cases_nonlinear,
    corners,  # noqa: F401  # pyright: ignore[reportUnusedImport]
    corners_conic,
    corners_contact,
    planted,
    planted_conic,
    planted_contact,
)
from cpbench.testing.makers import PLANTED


@dataclass(frozen=True, eq=False)
class Case:
    """A problem with a solution that the data were made for."""

    name: str
    problem: Any
    point: Any


@cache
def cases(node: str) -> list[Case]:
    """Build dense and sparse ones, n = 0 and 1, degenerate, frictionless, singular, nonsymmetric, zero rows, units of
    1e±8.

    Of a formulation that has no such cases, the problems of its generators whose solution is known.
    """
    named: dict[str, tuple[Problem, Any]] = {}
    for make in sorted(PLANTED.get(node, ()), key=lambda make: make.__module__):
        named |= make()
    if not named:  # a formulation that has no cases here: its generators have some
        own = [one for one in generators if one.node == node and one.tier not in (STANDARD, LARGE)]
        solved = (i for one in own for i in one.instances() if i.solution is not None)
        named = {instance.name: (instance.problem, instance.solution) for instance in solved}
    return [Case(name, dataclasses.replace(problem, name=name), point) for name, (problem, point) in named.items()]


def infeasible(node: str) -> list[Case]:
    """Return problems of the node that have no solution (their point is None)."""
    if node == "lcp":  # w₁ = −z₂ − z₃ − 10⁻⁴ < 0; w = −z − 1 < 0
        pang = LCP(M=np.array([[0.0, -1, -1], [1, 0, 0], [-1, 0, 1]]), q=[-1e-4, -1, 1])
        return [Case("pang", pang, None), Case("negative", LCP(M=-np.eye(2), q=-np.ones(2)), None)]
    if node == "qp":  # z ≥ 1 and −z ≥ 1
        crossed = QP.build(np.eye(1), np.zeros(1), A=np.array([[1.0], [-1.0]]), b=np.ones(2))
        return [Case("crossed", crossed, None)]
    if node == "mlcp":  # 0 = 1 in the equalities; w = −v − 1 < 0 with u idle
        no_row = MLCP(A=np.zeros((1, 1)), B=np.eye(1), C=np.zeros((1, 1)), D=np.zeros((1, 1)), a=[1.0], b=[0.0])
        negative = MLCP(A=np.eye(1), B=-np.eye(1), C=np.zeros((1, 1)), D=np.zeros((1, 1)), a=[0.0], b=[-1.0])
        return [Case("no-row", no_row, None), Case("negative", negative, None)]
    others = corners_contact.infeasible(node) | corners_conic.infeasible(node) | cases_nonlinear.infeasible(node)
    return [Case(name, problem, None) for name, problem in others.items()]


def draw(node: str, seed: int, size: int) -> Case:
    """Return a random case; what hypothesis draws are the seed and the size. Of a formulation without random cases,
    one of the others."""
    rng = np.random.default_rng(seed)
    if node not in PLANTED:
        return cases(node)[int(rng.integers(len(cases(node))))]
    sparse = bool(rng.integers(2))
    kind = str(rng.choice(["positive definite", "singular semidefinite", "monotone", "any"]))
    nonlinear = cases_nonlinear.draw(node, rng, size, kind)
    if nonlinear is not None:
        return Case(f"{kind}-{size}-{seed}", *nonlinear)
    problem, point = {
        "lcp": lambda: planted.lcp(rng, size, kind, sparse=sparse),
        "mlcp": lambda: planted.mlcp(rng, size, int(rng.integers(0, size + 1)), kind, sparse=sparse),
        "qp": lambda: planted.qp(rng, size, int(rng.integers(0, 4)), min(size, int(rng.integers(0, 3))), sparse=sparse),
        "fc": lambda: planted.fc(rng, size, int(rng.integers(2, 4)), kind, sparse=sparse),
        "gfc": lambda: planted_contact.gfc(
            rng, size + 1, size, int(rng.integers(0, 3)), int(rng.integers(2, 4)), sparse=sparse
        ),
        "fcm": lambda: planted_contact.fcm(
            rng, size, int(rng.integers(0, 3)), int(rng.integers(2, 4)), kind, sparse=sparse
        ),
        "rfc": lambda: planted_contact.rfc(rng, size, int(rng.choice([3, 5])), kind, sparse=sparse),
        "grfc": lambda: planted_contact.grfc(
            rng, size + 1, size, int(rng.integers(0, 3)), int(rng.choice([3, 5])), sparse=sparse
        ),
        "afc": lambda: planted_contact.afc(rng, size, kind, sparse=sparse),
        "relay": lambda: planted_conic.relay(rng, size, kind, sparse=sparse),
        "avi": lambda: planted_conic.avi(
            rng, size, int(rng.integers(0, 4)), min(size, int(rng.integers(0, 3))), kind, sparse=sparse
        ),
        "soclcp": lambda: planted_conic.soclcp(rng, None, kind, sparse=sparse),
        "coneqp": lambda: planted_conic.coneqp(
            rng, size, None, "positive definite" if kind in ("monotone", "any") else kind, sparse=sparse
        ),
    }[node]()
    return Case(f"{kind}-{size}-{seed}", problem, point)


SYMBOLS: NodeTable[dict[str, tuple[str, ...]]] = NodeTable("order of dimensions", "no check of another numbering")
"""Dimensions of a node whose order has no meaning, with the parts of a point that they count."""
for _node, _counts in {
    "lcp": {"n": ("z",)},
    "mlcp": {"n": ("u",), "m": ("v",)},
    "qp": {"n": ("z", "nu"), "m": ("lam",), "k": ("mu",)},
    "fc": {"m": ("r",), "nc": ()},
    "gfc": {"n": ("v",), "m": ("r",), "nc": (), "p": ("lam",)},
    "fcm": {"m": ("r",), "nc": (), "p": ("lam",)},
    "rfc": {"m": ("r",), "nc": ()},
    "grfc": {"n": ("v",), "m": ("r",), "nc": (), "p": ("lam",)},
    "afc": {"m": ("r",), "nc": ()},
    "relay": {"n": ("z",)},
    "avi": {"n": ("z",), "m": ("lam",), "k": ("mu",)},
    "soclcp": {"n": ("x",), "k": ()},
    "coneqp": {"n": ("x",), "m": ("y",), "k": ()},
    "ncp": {"n": ("z",)},
    "micp": {"n": ("z",)},
    "equation": {"n": ("z",)},
    "nlp": {"n": ("z", "nu"), "m": ("lam",), "k": ("mu",)},
    "vi": {"n": ("z",), "m": ("lam",), "k": ("mu",), "p": ("nu",), "c": ()},
    "ge": {"n": ("z",), "c": ()},
    "cp": {"n": ("x",), "m": ("lam",), "c": ()},
    "qvi": {"n": ("z",), "p": ("nu",), "c": ()},
    "nfc": {"n": ("v",), "m": ("r",), "nc": ()},
}.items():
    SYMBOLS.enter(_counts, _node)


_NO_ROWS = np.zeros(0, dtype=np.int64)


def renumbered(case: Case, seed: int) -> Case | None:
    """Return the same problem with unknowns, rows and contacts in another order; None for a node that is not known
    here."""
    symbols = SYMBOLS.get(case.problem.node)
    if symbols is None:
        return None
    rng = _rng(seed)
    order = {symbol: rng.permutation(case.problem.sizes()[symbol]) for symbol in symbols}
    if "nc" in order:  # the rows of a contact stay together, normal first
        d = case.problem.dimension
        order["m"] = (d * order["nc"][:, None] + np.arange(d)).ravel()
    if isinstance(case.problem, ConicProblem):  # so do those of a factor
        rows = np.split(np.arange(case.problem.K.rows), np.cumsum(case.problem.cone_size.astype(int))[:-1])
        factors = order["c" if "c" in order else "k"]
        if factors.size:
            order["m" if case.problem.node == "coneqp" else "n"] = np.concatenate(
                [_NO_ROWS, *(rows[i] for i in factors)]
            )
    if case.problem.node == "qvi":  # g is of (y, z); the bounds that move are as many as the unknowns, or none
        n = order["n"].size
        order |= {"2n": np.concatenate([order["n"], n + order["n"]])}
        order |= {s: order["n"] if case.problem.sizes()[s] else _NO_ROWS for s in ("nl", "nu")}
    data: dict[str, Any] = {}
    for field in dataclasses.fields(case.problem):
        if "shape" in field.metadata:
            rows, *columns = (order.get(symbol, slice(None)) for symbol in field.metadata["shape"])
            value = getattr(case.problem, field.name)[rows]
            data[field.name] = value[:, columns[0]] if columns else value
        elif "map" in field.metadata and getattr(case.problem, field.name).rows:
            rows, columns = (order.get(symbol, _NO_ROWS) for symbol in field.metadata["map"])
            data[field.name] = _reordered(getattr(case.problem, field.name), rows, columns)
    parts = {name: getattr(case.point, name)[order[symbol]] for symbol, names in symbols.items() for name in names}
    return Case(case.name, dataclasses.replace(case.problem, **data), type(case.point)(**parts))


def _reordered(F: Map, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> Map:
    """Return x[columns] ↦ F(x)[rows]; the map to ℝ¹ has no rows to reorder."""
    record = MapRecorder(F.inputs)
    value = record(F, record.z[np.argsort(columns)])
    return record.map(value[rows] if rows.size else value)


def _rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)
