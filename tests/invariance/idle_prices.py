"""An unknown that its price holds at 0, coupled to all others: neither price nor multiplier gives a size."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.linalg as sl
from answers import RNG, Answer

from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone

PRICED = {"qp": ("Q", "p"), "coneqp": ("Q", "p"), "avi": ("M", "q"), "mlcp": ("B", "b")}
"""Nodes with the matrix and the constants of the rows beside the unknown that is added."""
LEAST = 1e3
"""The least price: the terms of the other unknowns are a few times 1."""


def coupled(answer: Answer, rng: RNG, variant: str) -> Iterator[Answer]:
    """One more unknown, the last. Its price is as large as it can be with a rounding below ε/10."""
    p, x = answer.problem, answer.point
    price = 10.0 ** rng.uniform(np.log10(LEAST), np.log10(answer.tolerance / 10.0 * 2.0**49))
    matrix, constants = PRICED[p.node]
    whole = sl.block_diag(matrices.dense(getattr(p, matrix)), np.ones((1, 1)))
    n = whole.shape[0] - 1
    whole[:n, n] = rng.standard_normal(n)
    whole[n, :n] = whole[:n, n] if matrix == "Q" else rng.standard_normal(n)
    data: dict[str, Any] = {matrix: whole, constants: np.append(getattr(p, constants), price)}
    if p.node == "mlcp":
        C, D = matrices.dense(p.C), matrices.dense(p.D)
        data |= {"C": _beside(C, rng), "D": np.vstack([D, rng.standard_normal(D.shape[1])])}
        yield answer.of(dataclasses.replace(p, **data), dataclasses.replace(x, v=np.append(x.v, 0.0)))
        return
    data["A"] = _beside(matrices.dense(p.A), rng)
    if p.node == "coneqp":
        yield _cone_row(answer, data)
        return
    data |= {"C": _beside(matrices.dense(p.C), rng), "lb": np.append(p.lb, 0.0), "ub": np.append(p.ub, np.inf)}
    z = np.append(x.z, 0.0)
    force = whole[n] @ z + price - data["A"][:, n] @ x.lam - data["C"][:, n] @ x.mu
    yield answer.of(dataclasses.replace(p, **data), dataclasses.replace(x, z=z, **_forces(x, force)))


def _beside(rows: np.ndarray, rng: RNG) -> np.ndarray:
    return np.hstack([rows, rng.standard_normal((rows.shape[0], 1))])


def _forces(x: Any, force: float) -> dict[str, np.ndarray]:
    """The force of the bound, where an answer has it."""
    return {"nu": np.append(x.nu, force)} if hasattr(x, "nu") else {}


def _cone_row(answer: Answer, data: dict[str, Any]) -> Answer:
    """The bound as a row, the first."""
    p, x, rows = answer.problem, answer.point, data["A"]
    n = rows.shape[1] - 1
    own = np.append(x.x, 0.0)
    force = data["Q"][n] @ own + data["p"][n] - rows[:, n] @ x.y
    bound: dict[str, Any] = {"cone_kind": Cone.NONNEGATIVE, "cone_size": 1, "cone_mu": 0.0, "cone_mu_r": 0.0}
    data |= {name: np.append(float(value), getattr(p, name)) for name, value in bound.items()}
    data |= {"A": np.vstack([np.eye(n + 1)[n], rows]), "b": np.append(0.0, p.b)}
    problem = dataclasses.replace(p, **data)
    return answer.of(problem, dataclasses.replace(x, x=own, y=np.append(force, x.y)))
