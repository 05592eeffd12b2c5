"""Twelve QPs, MLCPs and scenes that nobody has looked at, drawn by a seed, under the same checks as the real files.

The builders are those of `unseen_algebra.py` and `unseen_scenes.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import complementary_bases
import contact_corruptions
import equivalent_edges
import measure
import numpy as np
import unseen_algebra
import unseen_scenes
from qp_literature import unknown_sizes
from qp_references import collect

from cpbench.conversions.base import make

QPS = ("predictive_control", "support_vectors", "portfolio", "nonnegative_fit", "degenerate_vertex")
MIXED = ("circuit", "trade", "mixed")
KINDS = ("qp", "qp", "qp", "qp", "qp", "mlcp", "mlcp", "mlcp", "scene", "scene", "scene", "scene")
LEAST, MOST = 8, 60
"""Sizes that are drawn: unknowns of a QP or an MLCP, contacts of a scene, about."""


def drawn(seed: int) -> Iterator[tuple[str, Any]]:
    """Yield five QPs, three MLCPs and four scenes in global form, with names that tell builder and place."""
    rng = np.random.default_rng(seed)
    for place, kind in enumerate(KINDS):
        size = int(rng.integers(LEAST, MOST))
        if kind == "scene":
            builder = str(rng.choice(list(unseen_scenes.SCENES)))
            scene = unseen_scenes.SCENES[builder](rng, size)
            problem = unseen_scenes.as_global(scene, unseen_scenes.friction(rng, len(scene.points)))
        else:
            builder = str(rng.choice(QPS if kind == "qp" else MIXED))
            problem = getattr(unseen_algebra, builder)(rng, size)
        yield f"{place}-{builder}-{size}", problem


def _of_qp(name: str, problem: Any, epsilon: float, seconds: float, lines: list[str]) -> None:
    """Add what is false of answers, edges and rewritings of a QP to `lines`."""
    answers, reference = collect(problem, seconds)
    if reference is None:
        lines.append(f"{name}: no two methods agree")
        return
    sizes = unknown_sizes(problem, reference)
    rows = [
        row for label, x in answers for row in measure.measured(name, problem, label, x, reference, sizes, (epsilon,))
    ]
    right = [row for row in rows if row.right(by_row=True)]
    lines += [f"false solved: {row}" for row in rows if row.falsely_solved]
    lines += [f"false rejection: {row}" for row in right if not row.solved]
    case = equivalent_edges.qp_case(name, problem, answers, reference, 1000 * epsilon, 4)
    if case is not None:
        _of_case(case, epsilon, lines)


def _of_case(case: equivalent_edges.Case, epsilon: float, lines: list[str]) -> None:
    for row in equivalent_edges.carried(case, epsilon):
        if row.false:
            word = "right rejected" if row.right else "wrong accepted"
            lines.append(f"{word}: {row.name} {row.edge or '(source)'} {row.label} {row.error:.1e}")


def _of_scene(name: str, problem: Any, epsilon: float, lines: list[str]) -> None:
    edge = make("gfc-fc")
    if edge.obstacle(problem) is not None:
        return
    local = edge.step(problem)
    r = contact_corruptions.right_answer(local)
    if r is None:
        return
    for row in contact_corruptions.corruptions(name, local, r, epsilon):
        if row.unflagged:
            lines.append(f"unflagged: {row.file} contact {row.contact} {row.kind} {row.error:.1e} {row.missed:.2g}")


def check(seed: int, epsilon: float, seconds: float) -> list[str]:
    """Return a line for each false verdict on the twelve problems of a seed."""
    lines: list[str] = []
    for name, problem in drawn(seed):
        if problem.node == "qp":
            _of_qp(name, problem, epsilon, seconds, lines)
            continue
        case = equivalent_edges.pair_case(name, problem, 1000 * epsilon, 4)
        if case is not None:
            _of_case(case, epsilon, lines)
        if problem.node == "gfc":
            _of_scene(name, problem, epsilon, lines)
        else:
            rows = complementary_bases.judged(name, problem, epsilon, 12)
            lines += [f"{row.file} {row.label} {row.error:.1e}" for row in rows if row.false]
    return lines
