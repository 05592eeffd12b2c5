"""Recommendation of solvers for a problem: labels ranked by their results on the most similar problems.

Losses are ℓ[p, s] = min(log₂ r[p, s], worst) in doublings of the virtual best's time, worst for a failure (the
penalised ratios of PAR10, cut where a slow answer is as little worth as none). The loss that a label is expected to
have on problem x is a mean over the measured problems p of x's node, drawn towards the label's mean over the node,
and that towards its mean over problems of other nodes, so that few measurements say little:

    ŝ = (Σ_p K ℓ + κ m₁)/(Σ_p K + κ),    m₁ = (Σ_p ℓ + m₂)/(#p + 1),    m₂ = Σ_p' K J ℓ / Σ_p' K J  (p' elsewhere),

with K = exp(−d²/2h²) of the distance d between features (`similarity`), h half the distance of the `few` nearest
problems of the node (narrower where more is known, between LEAST_WIDTH and `width`), and J the part that solvers of
p' and those of x have in common (Jaccard): the formulations from which the same solvers are reached. This is
the estimate of Nadaraya and Watson (Theory Probab. Appl. 9, 1964), with weights of prior means as in a hierarchical
model; selection by neighbours and by cost follows Rice (Adv. Comput. 15, 1976) and SATzilla (Xu et al., JAIR 32, 2008).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cpbench.advice.similarity import coordinates, distances, places
from cpbench.analysis.codes import Integers
from cpbench.analysis.table import Floats, Masks, Matrix, Texts
from cpbench.analysis.training_cases import TrainingCases

LEAST_WIDTH = 0.2
PRIOR, FAINT = 1.0, 0.05
"""κ, in problems just like this one; the weight of the mean over everything where no like problem is elsewhere."""
NEAR = 2.0
"""Widths up to which a problem counts as similar; beyond it a measurement weighs at most e⁻² of one just alike."""
TIE = 0.1
"""Doublings that make no difference: of labels so close, the one that solved most of the similar problems is taken."""
WITHIN = 2.0


@dataclass(frozen=True)
class Knobs:
    """Numbers of the estimate that no theory gives; how others do is what `validation` tries.

    Attributes
    ----------
    worst : doublings that a failure costs. few : problems whose distance gives the kernel's width, at most `width`.
    """

    worst: float = 6.0
    few: int = 8
    width: float = 0.7


SHIPPED = Knobs()


@dataclass(frozen=True)
class Advice:
    """A label with what speaks for it.

    Attributes
    ----------
    loss : expected doublings of the virtual best's time. measured : problems of any node on which it was started;
    without any it is expected to fail. similar : those of the node, near in features; solved, within : how many of
    them it solved, and within twice the time of the virtual best.
    """

    label: str
    loss: float
    measured: int
    similar: int
    solved: int
    within: int


@dataclass(frozen=True)
class Recommendation:
    """All labels, the best first, and what is known of problems like this one.

    Attributes
    ----------
    measured : problems of the node. similar : those near in features. nearest, distance : the most like, of the
    node ('' and ∞ without any).
    """

    advice: tuple[Advice, ...]
    measured: int
    similar: int
    nearest: str
    distance: float

    @property
    def known(self) -> bool:
        """True if a similar problem was measured."""
        return self.similar > 0


@dataclass(frozen=True)
class ExpectedResults:
    """Expected results of every label on query problems, queries × labels.

    Attributes
    ----------
    scores : ŝ. started, solved, within : on how many cases of the node that are near. measured : on how many cases at
    all, by label. same, near : cases of the node, and those near, asked × cases.
    """

    scores: Matrix
    started: Matrix
    solved: Matrix
    within: Matrix
    measured: Floats
    same: Masks
    near: Masks

    @cached_property
    def ranks(self) -> tuple[Matrix, Matrix]:
        """Keys that decide between labels before their scores do: scores in steps of TIE, then the share solved."""
        return np.round(self.scores / TIE), -(self.solved + 1) / (self.started + 1)

    def best(self, may: Masks) -> Integers:
        """Return the first label of each query problem, of those that may be taken."""
        left = may & (self.measured > 0)
        left = np.where(left.any(axis=1, keepdims=True), left, may)
        for key in (*self.ranks, self.scores):
            value = np.where(left, key, math.inf)
            left = left & (value == value.min(axis=1, keepdims=True))
        return left.argmax(axis=1)


def recommend(
    known: TrainingCases,
    features: Mapping[str, Any],
    applicable: Collection[str],
    used: Masks | None = None,
    knobs: Knobs = SHIPPED,
) -> Recommendation:
    """Rank the labels in `applicable` for a problem of these features; those that were never measured come last.

    `used` : which cases are used, all without it.

    >>> from cpbench.analysis.training_cases import TrainingCase, TrainingCases
    >>> facts = lambda n: {"node": "lcp", "unknowns": n}
    >>> times = lambda n: {"a": n**2 * 1e-3, "b": n * 1e-2}
    >>> seen = [TrainingCase(f"p{n}", "lcp", "", f"{n}", facts(n), times(n)) for n in (2, 4, 50, 90)]
    >>> [recommend(TrainingCases(tuple(seen)), facts(n), {"a", "b"}).advice[0].label for n in (3, 70)]
    ['a', 'b']
    """
    used = np.ones(len(known.cases), dtype=bool) if used is None else used
    may = np.array([label in applicable for label in known.labels], dtype=bool)
    distance = distances(coordinates(features)[None], places(known), used)
    found = standing(known, distance, np.array([features["node"]], dtype=object), may[None], used, knobs)
    advice = [Advice(label, knobs.worst, 0, 0, 0, 0) for label in set(applicable).difference(known.labels)]
    for j in np.flatnonzero(may):
        counts = (int(part[j]) for part in (found.measured, found.started[0], found.solved[0], found.within[0]))
        advice.append(Advice(known.labels[j], float(found.scores[0, j]), *counts))
    advice.sort(
        key=lambda a: (a.measured == 0, round(a.loss / TIE), -(a.solved + 1) / (a.similar + 1), a.loss, a.label)
    )
    same, near = found.same[0], found.near[0]
    first = int(np.where(same, distance[0], math.inf).argmin()) if same.any() else None
    return Recommendation(
        tuple(advice),
        len({known.cases[i].fingerprint for i in np.flatnonzero(same)}),
        len({known.cases[i].fingerprint for i in np.flatnonzero(near)}),
        known.cases[first].problem if first is not None else "",
        float(distance[0, first]) if first is not None else math.inf,
    )


def standing(
    known: TrainingCases, distance: Matrix, nodes: Texts, may: Masks, used: Masks, knobs: Knobs = SHIPPED
) -> ExpectedResults:
    """Score the labels on problems of these `nodes`, so far from each case, which `may` take these labels."""
    same = (known.nodes[None, :] == nodes[:, None]) & used
    near = same & (distance <= NEAR * knobs.width)
    started, solved = ~np.isnan(known.ratios), np.isfinite(known.ratios)
    near_started, near_solved, near_within = (
        near.astype(float) @ part.astype(float) for part in (started, solved, known.ratios <= WITHIN)
    )
    losses = np.minimum(np.log2(known.ratios), knobs.worst)
    scores = _scores(losses, distance, used, same, may, knobs)
    measured = started[used].sum(axis=0).astype(float)
    return ExpectedResults(scores, near_started, near_solved, near_within, measured, same, near)


def _scores(losses: Matrix, distance: Matrix, used: Masks, same: Masks, may: Masks, knobs: Knobs) -> Matrix:
    """Return ŝ of every label, queries × labels."""
    there = (~np.isnan(losses) & used[:, None]).astype(float)
    loss = np.where(there > 0, losses, 0.0)
    nearest = np.sort(np.where(same, distance, math.inf), axis=1)
    reach = nearest[:, knobs.few - 1] if nearest.shape[1] >= knobs.few else np.full(len(distance), math.inf)
    width = np.clip(0.5 * reach, LEAST_WIDTH, knobs.width)[:, None]
    kernel = np.exp(-0.5 * (distance / width) ** 2)
    both = may.astype(float) @ there.T
    common = both / np.maximum(may.sum(axis=1)[:, None] + there.sum(axis=1) - both, 1)

    def mean(weights: Matrix, prior: Matrix, strength: float) -> Matrix:
        return (weights @ loss + strength * prior) / (weights @ there + strength)

    everywhere = mean(used[None].astype(float), np.full((1, losses.shape[1]), knobs.worst), 1.0)
    elsewhere = mean(kernel * common * (used & ~same), everywhere, FAINT)
    of_node = mean(same.astype(float), elsewhere, 1.0)
    # a mean of numbers within [0, worst] leaves it by rounding
    return np.clip(mean(kernel * same, of_node, PRIOR), 0.0, knobs.worst)
