"""Planted cases of the linear nodes and of contact with one coefficient of friction a contact."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.formulations import LCP, FrictionContact, LCPPoint, Problem
from cpbench.testing import cases_contact, planted
from cpbench.testing.makers import plants


def _rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


@plants("lcp")
def _lcp() -> dict[str, tuple[Problem, Any]]:
    named: dict[str, tuple[Problem, Any]] = {
        kind.replace(" ", "-"): planted.lcp(_rng(i), 12, kind) for i, kind in enumerate(planted.SQUARE)
    }
    named["sparse"] = planted.lcp(_rng(10), 12, "positive definite", sparse=True)
    named["one"] = (LCP(M=np.eye(1), q=[-2.0]), LCPPoint(z=[2.0]))
    named["empty"] = (LCP(M=np.zeros((0, 0)), q=[]), LCPPoint(z=[]))
    named["trivial"] = (LCP(M=np.eye(4), q=np.ones(4)), LCPPoint(z=np.zeros(4)))
    problem, point = planted.lcp(_rng(11), 8, "positive definite")
    scale = 10.0 ** np.array([-4, 4, 0, 2, -2, 3, -3, 1])
    named["badly-scaled"] = (
        LCP(M=problem.M * scale[:, None] * scale, q=problem.q * scale),
        LCPPoint(z=point.z / scale),
    )
    return named


@plants("mlcp")
def _mlcp() -> dict[str, tuple[Problem, Any]]:
    return {
        "monotone": planted.mlcp(_rng(0), 6, 8, "monotone"),
        "positive-definite": planted.mlcp(_rng(1), 6, 8, "positive definite"),
        "sparse": planted.mlcp(_rng(2), 6, 8, "positive definite", sparse=True),
        "singular-A": planted.mlcp(_rng(3), 5, 5, "singular"),
        "no-equality": planted.mlcp(_rng(4), 0, 6, "positive definite"),
        "equalities-only": planted.mlcp(_rng(5), 6, 0, "positive definite"),
        "empty": planted.mlcp(_rng(6), 0, 0, "positive definite"),
    }


@plants("qp")
def _qp() -> dict[str, tuple[Problem, Any]]:
    return {
        "definite": planted.qp(_rng(0), 10, 6, 3),
        "sparse": planted.qp(_rng(1), 10, 6, 3, sparse=True),
        "singular": planted.qp(_rng(2), 10, 6, 2, "singular semidefinite"),
        "no-constraint-rows": planted.qp(_rng(3), 8, 0, 0),
        "no-equality": planted.qp(_rng(4), 8, 5, 0),
        "one": planted.qp(_rng(5), 1, 1, 0),
    }


@plants("fc")
def _fc() -> dict[str, tuple[Problem, Any]]:
    named: dict[str, tuple[Problem, Any]] = {
        f"{kind.replace(' ', '-')}-{d}d": planted.fc(_rng(i), 5, d, kind)
        for i, kind in enumerate(planted.SQUARE[:3])
        for d in (2, 3)
    }
    named["sparse-3d"] = planted.fc(_rng(10), 5, 3, "positive definite", sparse=True)
    named["nonsymmetric-3d"] = planted.fc(_rng(11), 3, 3, "any")
    named["one-3d"] = planted.fc(_rng(12), 1, 3, "positive definite")
    problem, point = planted.fc(_rng(13), 4, 3, "positive definite")
    named["frictionless-3d"] = _without_friction(problem, point)
    named["empty-3d"] = planted.fc(_rng(14), 0, 3, "positive definite")
    return named


def _without_friction(problem: FrictionContact, point: Any) -> tuple[Problem, Any]:
    """Return μ = 0: only normal reactions, each contact either pushes at rest or is open."""
    r, u = np.zeros((problem.nc, 3)), np.zeros((problem.nc, 3))
    r[::2, 0], u[1::2, 0], u[:, 1] = 1.5, 0.5, 0.25
    W = problem.W
    replaced = FrictionContact(W=W, q=u.ravel() - W @ r.ravel(), mu=np.zeros(problem.nc), dimension=3)
    return replaced, type(point)(r=r.ravel())


@plants("gfc")
def _gfc() -> dict[str, tuple[Problem, Any]]:
    return {
        "symmetric-3d": planted.gfc(_rng(0), 3, 4, 3),
        "sparse-3d": planted.gfc(_rng(1), 3, 4, 3, sparse=True),
        "nonsymmetric-3d": planted.gfc(_rng(2), 3, 4, 3, symmetric=False),
        "plane-2d": planted.gfc(_rng(3), 2, 3, 2),
        "no-contact": planted.gfc(_rng(4), 2, 0, 3),
        **cases_contact.gfc_with_joints(),
    }
