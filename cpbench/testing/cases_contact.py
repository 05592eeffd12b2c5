"""Planted cases of the contact nodes with bilateral constraints, rolling friction or elliptic cones."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.formulations import Problem
from cpbench.testing import planted_contact
from cpbench.testing.makers import plants


def _rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


@plants("fcm")
def _fcm() -> dict[str, tuple[Problem, Any]]:
    return {
        "definite-3d": planted_contact.fcm(_rng(0), 4, 3, 3),
        "definite-2d": planted_contact.fcm(_rng(1), 4, 3, 2),
        "sparse-3d": planted_contact.fcm(_rng(2), 4, 3, 3, sparse=True),
        "no-constraint": planted_contact.fcm(_rng(3), 3, 0, 3),
        "no-contact": planted_contact.fcm(_rng(4), 0, 3, 3),
        "monotone-3d": planted_contact.fcm(_rng(5), 4, 2, 3, "monotone"),
    }


def gfc_with_joints() -> dict[str, tuple[Problem, Any]]:
    """Return cases of gfc whose G has columns."""
    return {
        "joints-3d": planted_contact.gfc(_rng(0), 3, 4, 2, 3),
        "joints-2d": planted_contact.gfc(_rng(1), 3, 4, 2, 2),
        "sparse-joints-3d": planted_contact.gfc(_rng(2), 3, 4, 2, 3, sparse=True),
        "nonsymmetric-joints": planted_contact.gfc(_rng(3), 3, 4, 2, 3, symmetric=False),
        "joints-only": planted_contact.gfc(_rng(4), 2, 0, 3, 3),
    }


@plants("rfc")
def _rfc() -> dict[str, tuple[Problem, Any]]:
    return {
        "definite-5": planted_contact.rfc(_rng(0), 4, 5),
        "definite-3": planted_contact.rfc(_rng(1), 4, 3),
        "sparse-5": planted_contact.rfc(_rng(2), 4, 5, sparse=True),
        "monotone-5": planted_contact.rfc(_rng(3), 3, 5, "monotone"),
        "nonsymmetric-5": planted_contact.rfc(_rng(4), 3, 5, "any"),
        "one-5": planted_contact.rfc(_rng(5), 1, 5),
        "empty-5": planted_contact.rfc(_rng(6), 0, 5),
    }


@plants("grfc")
def _grfc() -> dict[str, tuple[Problem, Any]]:
    return {
        "free-5": planted_contact.grfc(_rng(0), 3, 4, 0, 5),
        "joints-5": planted_contact.grfc(_rng(1), 3, 4, 2, 5),
        "joints-3": planted_contact.grfc(_rng(2), 3, 4, 2, 3),
        "sparse-5": planted_contact.grfc(_rng(3), 3, 4, 1, 5, sparse=True),
        "no-contact": planted_contact.grfc(_rng(4), 2, 0, 1, 5),
    }


@plants("afc")
def _afc() -> dict[str, tuple[Problem, Any]]:
    return {
        "definite": planted_contact.afc(_rng(0), 5),
        "sparse": planted_contact.afc(_rng(1), 5, sparse=True),
        "nonsymmetric": planted_contact.afc(_rng(2), 3, "any"),
        "one": planted_contact.afc(_rng(3), 1),
        "empty": planted_contact.afc(_rng(4), 0),
    }
