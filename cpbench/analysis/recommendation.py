"""Which solver for a problem: the labels ranked by what they came to on the problems most like it.

Losses are ℓ[p, s] = min(log₂ r[p, s], WORST) in doublings of the virtual best's time, WORST for a failure (the
penalised ratios of PAR10, cut where a slow answer is as little worth as none). The loss that a label is expected to
have on problem x is a mean over the measured problems p of x's node, drawn towards the label's mean over the node,
and that towards its mean over problems of other nodes, so that few measurements say little:

    ŝ = (Σ_p K ℓ + κ m₁)/(Σ_p K + κ),    m₁ = (Σ_p ℓ + m₂)/(#p + 1),    m₂ = Σ_p' K J ℓ / Σ_p' K J  (p' elsewhere),

with K = exp(−d²/2h²) of the distance d between features (`likeness`), h half the distance of the FEW nearest problems
of the node (narrower where more is known, between LEAST_WIDTH and WIDTH), and J the part that the solvers which take p'
and those which take x have in common (Jaccard): the formulations from which the same solvers are reached. This is the
estimate of Nadaraya and Watson (Theory Probab. Appl. 9, 1964), with weights of prior means as in a hierarchical model;
selection by neighbours and by cost follows Rice (Adv. Comput. 15, 1976) and SATzilla (Xu et al., JAIR 32, 2008).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis.experience import Experience
from cpbench.analysis.likeness import distances, places
from cpbench.analysis.table import Floats

WORST = 6.0
"""Doublings that a failure costs: 64 times the time of the virtual best."""
FEW, LEAST_WIDTH, WIDTH = 8, 0.2, 0.7
PRIOR, FAINT = 1.0, 0.05
"""κ, in problems just like this one; the weight of the mean over everything where no like problem is elsewhere."""
NEAR = 2 * WIDTH
"""Distance up to which a problem counts as similar; beyond it a measurement weighs at most e⁻² of one just alike."""
TIE = 0.1
"""Doublings that make no difference: of labels so close, the one that solved most of the similar problems is taken."""
WITHIN = 2.0


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
        """Whether anything like it was measured."""
        return self.similar > 0


def recommend(
    known: Experience, features: Mapping[str, Any], applicable: Collection[str], without: Collection[int] = ()
) -> Recommendation:
    """The labels in `applicable`, ranked for a problem of these features; those that were never measured come last.

    `without` : places of cases that are not to be used.

    >>> from cpbench.analysis.experience import Case
    >>> facts = lambda n: {"node": "lcp", "unknowns": n}
    >>> seen = [Case(f"p{n}", "lcp", "", f"{n}", facts(n), {"a": n**2 * 1e-3, "b": n * 1e-2}) for n in (2, 4, 50, 90)]
    >>> [recommend(Experience(tuple(seen)), facts(n), {"a", "b"}).advice[0].label for n in (3, 70)]
    ['a', 'b']
    """
    return _recommend(known, places(known), features, applicable, without)


def _recommend(
    known: Experience, at: Any, features: Mapping[str, Any], applicable: Collection[str], without: Collection[int]
) -> Recommendation:
    used = np.ones(len(known.cases), dtype=bool)
    used[list(without)] = False
    may = np.array([label in applicable for label in known.labels], dtype=bool)
    node = str(features["node"])
    same = (np.array(known.nodes, dtype=object) == node) & used
    distance = distances(at, features, used)
    losses = np.minimum(np.log2(known.ratios), WORST)
    score = _scores(losses, distance, used, same, may)
    near = same & (distance <= NEAR)
    started = ~np.isnan(known.ratios[near])
    solved = np.isfinite(known.ratios[near])
    within = known.ratios[near] <= WITHIN
    advice = [Advice(label, WORST, 0, 0, 0, 0) for label in set(applicable).difference(known.labels)]
    for j in np.flatnonzero(may):
        counts = (int(part[:, j].sum()) for part in (~np.isnan(losses[used]), started, solved, within))
        advice.append(Advice(known.labels[j], float(score[j]), *counts))
    advice.sort(
        key=lambda a: (a.measured == 0, round(a.loss / TIE), -(a.solved + 1) / (a.similar + 1), a.loss, a.label)
    )
    first = int(np.where(same, distance, math.inf).argmin()) if same.any() else None
    return Recommendation(
        tuple(advice),
        len({known.cases[i].fingerprint for i in np.flatnonzero(same)}),
        len({known.cases[i].fingerprint for i in np.flatnonzero(near)}),
        known.cases[first].problem if first is not None else "",
        float(distance[first]) if first is not None else math.inf,
    )


def evaluate(known: Experience, node: str = "", most: int | None = None) -> pd.DataFrame:
    """Leave one family out: every case with the label that the cases of all other families recommend.

    `node` : its cases only. `most` : at most so many, evenly spaced.

    A problem that another family has, too, is left out with both. The labels that take the problem are known
    beforehand, as they are to whoever asks: an edge or a solver refuses before anything is solved.

    Columns: node, family, problem, label, ratio (its time over the virtual best, ∞ for a failure), similar.
    """
    families, prints = ([getattr(case, name) for case in known.cases] for name in ("family", "fingerprint"))
    records: list[dict[str, Any]] = []
    at = places(known)
    asked = [i for i, case in enumerate(known.cases) if node in ("", case.node)]
    if most is not None and len(asked) > most:
        asked = [asked[k * len(asked) // most] for k in range(most)]
    for i in asked:
        case = known.cases[i]
        alike = [k for k in range(len(known.cases)) if families[k] == families[i] or prints[k] == prints[i]]
        found = _recommend(known, at, case.features, case.outcomes.keys(), alike)
        label = found.advice[0].label
        ratio = float(known.ratios[i, known.labels.index(label)])
        records.append(
            {
                "node": case.node,
                "family": case.family,
                "problem": case.problem,
                "label": label,
                "ratio": ratio,
                "similar": found.similar,
            }
        )
    return pd.DataFrame(records, columns=["node", "family", "problem", "label", "ratio", "similar"])


def rates(known: Experience, evaluation: pd.DataFrame) -> pd.DataFrame:
    """One row a node, and the sum of all as the last, 'all': what `evaluate` found, beside the best label by itself.

    Columns: node, problems, families, solved, within (of the virtual best, twice), single (the label that is within
    on most cases of the node, chosen in hindsight), single_solved, single_within.
    """
    records: list[dict[str, Any]] = []
    for node, rows in evaluation.groupby("node", sort=True):
        ratios = known.ratios[np.array(known.nodes, dtype=object) == node]
        reached, close = np.isfinite(ratios).sum(axis=0), (ratios <= WITHIN).sum(axis=0)
        best = int(np.lexsort((-reached, -close))[0])
        records.append(
            {
                "node": str(node),
                "problems": len(rows),
                "families": rows["family"].nunique(),
                "solved": int(np.isfinite(rows["ratio"]).sum()),
                "within": int((rows["ratio"] <= WITHIN).sum()),
                "single": known.labels[best],
                "single_solved": int(reached[best]),
                "single_within": int(close[best]),
            }
        )
    counts = ["problems", "solved", "within", "single_solved", "single_within"]
    found = pd.DataFrame(records, columns=["node", "problems", "families", "solved", "within", "single", *counts[3:]])
    total = {name: int(found[name].sum()) for name in counts}
    total |= {"families": evaluation["family"].nunique()}
    return pd.concat([found, pd.DataFrame([{"node": "all", "single": "", **total}])], ignore_index=True)[found.columns]


# ------------------------------------------------------------------------------------------- mathematics


def _scores(losses: Any, distance: Floats, used: Any, same: Any, may: Any) -> Floats:
    """ŝ of every label."""
    there = ~np.isnan(losses) & used[:, None]
    loss = np.where(there, losses, 0.0)
    nearest = np.sort(distance[same])[:FEW]
    width = max(LEAST_WIDTH, min(WIDTH, 0.5 * float(nearest[-1]))) if nearest.size == FEW else WIDTH
    kernel = np.exp(-0.5 * (distance / width) ** 2)
    either, both = (there | may).sum(axis=1), (there & may).sum(axis=1)
    common = both / np.maximum(either, 1)

    def mean(weights: Floats, prior: Floats, strength: float) -> Floats:
        weighted = weights[:, None] * there
        return ((weighted * loss).sum(axis=0) + strength * prior) / (weighted.sum(axis=0) + strength)

    everywhere = mean(used.astype(float), np.full(losses.shape[1], WORST), 1.0)
    elsewhere = mean(kernel * common * (used & ~same), everywhere, FAINT)
    of_node = mean(same.astype(float), elsewhere, 1.0)
    return mean(kernel * same, of_node, PRIOR)
