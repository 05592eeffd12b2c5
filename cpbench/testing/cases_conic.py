"""Planted cases of the nodes over boxes, polyhedra and cones."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.formulations import Problem
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.testing import planted, planted_conic
from cpbench.testing.makers import plants


def _rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


@plants("relay")
def _relay() -> dict[str, tuple[Problem, Any]]:
    named: dict[str, tuple[Problem, Any]] = {
        kind.replace(" ", "-"): planted_conic.relay(_rng(i), 10, kind) for i, kind in enumerate(planted.SQUARE)
    }
    named["sparse"] = planted_conic.relay(_rng(10), 10, sparse=True)
    named["one"] = planted_conic.relay(_rng(11), 1, "positive definite")
    named["empty"] = planted_conic.relay(_rng(12), 0)
    return named


@plants("avi")
def _avi() -> dict[str, tuple[Problem, Any]]:
    return {
        "monotone": planted_conic.avi(_rng(0), 8, 5, 2),
        "definite": planted_conic.avi(_rng(1), 8, 5, 2, "positive definite"),
        "sparse": planted_conic.avi(_rng(2), 8, 5, 2, "positive definite", sparse=True),
        "only-bounds": planted_conic.avi(_rng(3), 8, 0, 0, "positive definite"),
        "no-equality": planted_conic.avi(_rng(4), 6, 4, 0),
        "any": planted_conic.avi(_rng(5), 6, 3, 1, "any"),
        "one": planted_conic.avi(_rng(6), 1, 1, 0, "positive definite"),
        "empty": planted_conic.avi(_rng(7), 0, 0, 0),
    }


@plants("soclcp")
def _soclcp() -> dict[str, tuple[Problem, Any]]:
    named: dict[str, tuple[Problem, Any]] = {
        kind.replace(" ", "-"): planted_conic.soclcp(_rng(i), None, kind) for i, kind in enumerate(planted.SQUARE)
    }
    named["sparse"] = planted_conic.soclcp(_rng(10), None, "positive definite", sparse=True)
    half_space = ProductCone.of((Cone.SECOND_ORDER, 3, 3, np.array([0.0, np.inf, 1.0])))
    named["half-space"] = planted_conic.soclcp(_rng(11), half_space, "positive definite")
    named["one"] = planted_conic.soclcp(_rng(12), ProductCone.of((Cone.NONNEGATIVE, 1, 1)), "positive definite")
    named["empty"] = planted_conic.soclcp(_rng(13), ProductCone.of())
    return named


@plants("coneqp")
def _coneqp() -> dict[str, tuple[Problem, Any]]:
    contacts = ProductCone.of((Cone.SECOND_ORDER, 4, 3, np.array([0.0, 0.3, 0.6, 1.0])))
    return {
        "definite": planted_conic.coneqp(_rng(0), 12),
        "singular": planted_conic.coneqp(_rng(1), 12, None, "singular semidefinite"),
        "sparse": planted_conic.coneqp(_rng(2), 12, sparse=True),
        "plain": planted_conic.plain_coneqp(_rng(3)),
        "contacts": planted_conic.plain_coneqp(_rng(4), contacts),
        "cones-only": planted_conic.coneqp(_rng(5), 12, planted_conic.cone(_rng(6))),
        "one": planted_conic.plain_coneqp(_rng(7), ProductCone.of((Cone.NONNEGATIVE, 1, 1))),
        "empty": planted_conic.plain_coneqp(_rng(8), ProductCone.of()),
    }
