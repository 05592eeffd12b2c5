"""Rows said twice, rows that cancel with multipliers that cancel, constants in the objective, unknowns in no row."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
from answers import RNG, Answer

from cpbench.formulations.expressions import Map
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone

ONE_SIZE = ("qp", "avi", "coneqp", "nlp")
"""Nodes of which all prices are compared with the largest: of multipliers t that cancel, ε t is an error of a price,
and a row that a right answer misses by ε/100 gives t ε/100 away."""


def _size(rng: RNG, answer: Answer) -> float:
    """A power of two up to 1e7, and up to what leaves rounding below ε/10; up to 16 where prices have one size."""
    most = 4 if answer.problem.node in ONE_SIZE else min(23, int(np.log2(answer.tolerance / 10.0 * 2.0**49)))
    return 2.0 ** float(rng.integers(0, most + 1))


def constants(answer: Answer, rng: RNG, variant: str) -> Iterator[Answer]:
    p = answer.problem
    if p.node == "nlp":
        import casadi as ca

        x = ca.SX.sym("x", p.f.inputs)
        constant = float(rng.choice([-1.0, 1.0])) * 10.0 ** rng.uniform(3.0, 12.0)
        yield answer.of(dataclasses.replace(p, f=Map.from_casadi(x, p.f.sx(x) + constant)), answer.point)


def _stacked(F: Map, rows: list[tuple[Map, int, float]]) -> Map:
    import casadi as ca

    x = ca.SX.sym("x", F.inputs)
    parts = [F.sx(x)] if F.rows else []
    return Map.from_casadi(x, ca.vertcat(*parts, *(sign * G.sx(x)[i] for G, i, sign in rows)))


def _with_rows(answer: Answer, kind: str, row: int, signs: list[float], multipliers: list[float]) -> Answer:
    """Row `row` of the equalities again, with signs, as inequalities (`lam`) or equalities (`mu`)."""
    p, x = answer.problem, answer.point
    matrix, side, name = {"lam": ("A", "b", "g"), "mu": ("C", "d", "h")}[kind]
    if p.node == "nlp":
        data = {name: _stacked(getattr(p, name), [(p.h, row, sign) for sign in signs])}
    else:
        again, s = matrices.dense(p.C)[row], np.array(signs)
        data = {
            matrix: np.vstack([matrices.dense(getattr(p, matrix)), s[:, None] * again]),
            side: np.concatenate([getattr(p, side), s * p.d[row]]),
        }
    point = dataclasses.replace(x, **{kind: np.concatenate([getattr(x, kind), multipliers])})
    return answer.of(dataclasses.replace(p, **data), point)


WITH_ROWS = ("qp", "avi", "vi", "nlp")


def repeated(answer: Answer, rng: RNG, variant: str) -> Iterator[Answer]:
    """An inequality again, an equality again, and an equality as two inequalities beside itself."""
    p, x = answer.problem, answer.point
    if p.node not in WITH_ROWS:
        return
    if x.mu.size:
        k = int(rng.integers(x.mu.size))
        yield _with_rows(answer, "mu", k, [1.0], [0.0])
        yield _with_rows(answer, "lam", k, [1.0, -1.0], [0.0, 0.0])
    if p.node != "nlp" and x.lam.size:
        i = int(rng.integers(x.lam.size))
        more = dataclasses.replace(
            p, A=np.vstack([matrices.dense(p.A), matrices.dense(p.A)[i]]), b=np.append(p.b, p.b[i])
        )
        yield answer.of(more, dataclasses.replace(x, lam=np.append(x.lam, 0.0)))


def cancelling(answer: Answer, rng: RNG, variant: str) -> Iterator[Answer]:
    """An equality as row and −row with equal multipliers, and beside itself with opposite ones; likewise rows of
    {0} and joints."""
    p, x, t = answer.problem, answer.point, _size(rng, answer)
    if p.node in WITH_ROWS and x.mu.size:
        k = int(rng.integers(x.mu.size))
        yield _with_rows(answer, "lam", k, [1.0, -1.0], [t, t])
        yield _with_rows(_with_rows(answer, "mu", k, [1.0], [-t]), "lam", k, [1.0], [t])
    if p.node == "gfc" and p.b.size:
        k = int(rng.integers(p.b.size))
        G = matrices.dense(p.G)
        more = dataclasses.replace(p, G=np.hstack([G, G[:, [k, k]]]), b=np.append(p.b, [p.b[k], p.b[k]]))
        yield answer.of(more, dataclasses.replace(x, lam=np.append(x.lam, [t, -t])))
    if p.node == "coneqp":
        yield _cone_rows(answer, t)


def _cone_rows(answer: Answer, t: float) -> Answer:
    p, x = answer.problem, answer.point
    at = int((np.cumsum(p.K.size) - p.K.size)[p.K.kind == Cone.ZERO][0])
    A = matrices.dense(p.A)
    more: dict[str, Any] = {"cone_kind": float(Cone.ZERO), "cone_size": 2.0, "cone_mu": 0.0, "cone_mu_r": 0.0}
    data = {name: np.append(getattr(p, name), value) for name, value in more.items()}
    problem = dataclasses.replace(p, A=np.vstack([A, A[[at, at]]]), b=np.append(p.b, p.b[[at, at]]), **data)
    return answer.of(problem, dataclasses.replace(x, y=np.append(x.y, [t, -t])))


def absent(answer: Answer, rng: RNG, variant: str) -> Iterator[Answer]:
    """An unknown that is in no row, whatever its value."""
    p, x = answer.problem, answer.point
    value = 10.0 ** rng.uniform(0.0, 12.0)
    if p.node == "qp":
        n = p.p.size
        wider = {
            name: np.hstack([matrices.dense(getattr(p, name)), np.zeros((k.size, 1))])
            for name, k in (("A", p.b), ("C", p.d))
        }
        Q = np.zeros((n + 1, n + 1))
        Q[:n, :n] = matrices.dense(p.Q)
        lb, ub = np.append(p.lb, -np.inf), np.append(p.ub, np.inf)
        problem = dataclasses.replace(p, Q=Q, p=np.append(p.p, 0.0), lb=lb, ub=ub, **wider)
        yield answer.of(problem, dataclasses.replace(x, z=np.append(x.z, value), nu=np.append(x.nu, 0.0)))
    if p.node == "nlp":
        maps = {name: _wider(getattr(p, name)) for name in ("f", "g", "h")}
        lb, ub = np.append(p.lb, -np.inf), np.append(p.ub, np.inf)
        problem = dataclasses.replace(p, **maps, lb=lb, ub=ub, start=np.append(p.start, 0.0))
        yield answer.of(problem, dataclasses.replace(x, z=np.append(x.z, value), nu=np.append(x.nu, 0.0)))


def _wider(F: Map) -> Map:
    import casadi as ca

    x = ca.SX.sym("x", F.inputs + 1)
    return Map.from_casadi(x, F.sx(x[: F.inputs])) if F.rows else Map.empty(F.inputs + 1)
