"""Families of problems that are drawn anew: contact scenes, games, circuits, programs of control and of statistics."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import unseen_algebra as algebra
import unseen_scenes as scenes

import cpbench
from cpbench.formulations import Problem

Rng = np.random.Generator


def _contact(name: str) -> Callable[[Rng, int], Problem]:
    def make(rng: Rng, size: int) -> Problem:
        return cpbench.convert(_whole(name)(rng, size), "fc").problem

    return make


def _whole(name: str) -> Callable[[Rng, int], Problem]:
    def make(rng: Rng, size: int) -> Problem:
        scene = scenes.jointed(rng, size) if name == "jointed" else scenes.SCENES[name](rng, size)
        return scenes.as_global(scene, scenes.friction(rng, len(scene.points)), rng.choice([0.0, 0.0, 0.5]))

    return make


def _facets(rng: Rng, size: int) -> Problem:
    name = str(rng.choice(list(scenes.SCENES)))
    fc = _contact(name)(rng, max(1, size // 6))
    return algebra.facets(np.asarray(cpbench.foundation.matrices.dense(fc.W)), fc.q, fc.mu, int(rng.choice([4, 8])))


FAMILIES: dict[str, Callable[[Rng, int], Problem]] = {
    **{name: _contact(name) for name in scenes.SCENES},
    **{f"global-{name}": _whole(name) for name in ("stack", "wall", "pile", "jointed")},
    "rolling-pile": lambda rng, size: cpbench.convert(scenes.rolling(rng, size), "rfc").problem,
    "facets": _facets,
    "bimatrix": algebra.bimatrix,
    "ties": algebra.ties,
    "p-matrix": algebra.p_matrix,
    "obstacle": algebra.obstacle,
    "ill-conditioned": algebra.ill_conditioned,
    "circuit": algebra.circuit,
    "trade": algebra.trade,
    "mixed": algebra.mixed,
    "predictive-control": algebra.predictive_control,
    "support-vectors": algebra.support_vectors,
    "portfolio": algebra.portfolio,
    "nonnegative-fit": algebra.nonnegative_fit,
    "degenerate-vertex": algebra.degenerate_vertex,
}
