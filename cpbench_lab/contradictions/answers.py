"""Contradictions between the answers of a run to one problem."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from cpbench.analysis.contradictions import EXISTENCE, Contradiction, named
from cpbench.formulations import AVI, LCP, MLCP, QP
from cpbench.formulations.base import Point, Problem, formulations
from cpbench.formulations.conic import ConeQP
from cpbench.formulations.linear import Relay
from cpbench.foundation.matrices import Vector, max_abs
from cpbench.verification import FALSE_CLAIMS, VERIFIED
from cpbench_lab.contradictions import forward_error
from cpbench_lab.contradictions.forward_error import meets_conditions, objective_unit

PROGRAMS = (QP, ConeQP)
"""Formulations with a quadratic objective."""
COMPARED = (*PROGRAMS, LCP, MLCP, Relay, AVI)
"""Formulations of which verified answers are compared with each other."""
OFF = 10.0
"""Largest error of the objective of a verified answer, in tolerances of its terms."""
ALIKE = 1e-2
"""Share of the tolerance up to which answers are the same but for rounding."""
REJECTED = 10.0
"""Error of a rejected answer, in tolerances, from which its verdict contradicts an accepted one: near the tolerance,
two answers that are alike may be on either side."""
ROUNDING = 1e-13
"""Share of the sum of its terms without signs that an objective may be off by rounding."""
OPTIMAL = 0.1
"""Share of the tolerance to which a rejected answer that is optimal beside a verified one contradicts its verdict."""
MULTIPLIERS = ("lam", "mu", "nu")
"""Parts of a point that are compared in one unit."""


class Conflict(StrEnum):
    """Kinds of contradictions."""

    EXISTENCE = EXISTENCE
    OBJECTIVE = "objective"
    """Verified answers of a convex program with different objectives."""
    SOLUTION = "solution"
    """Different verified answers of a problem that has one solution."""
    VERDICT = "verdict"
    """Answers that are the same to rounding, with different verdicts; or all rejected, though methods agree on them."""


@dataclass(frozen=True, eq=False)
class KeptAnswer:
    """A row and its answer: its parts one after the other. `method` : of its solver, '' where it is not known.
    `objective` : of a program, as the verdict measured it; None where the row does not have it."""

    key: str
    label: str
    status: str
    error: float
    tolerance: float
    method: str
    vector: Vector
    objective: float | None = None


def is_one_of(node: str, classes: tuple[type[Problem], ...]) -> bool:
    """Return whether a node is a formulation of these, or a plugin's that derives from one."""
    return node in formulations and issubclass(formulations.get(node), classes)


def near(one: Vector, other: Vector, share: float) -> bool:
    """Return whether no component of two answers differs by more than `share` of their largest."""
    if one.shape != other.shape or not (np.isfinite(one).all() and np.isfinite(other).all()):
        return False
    return bool(max_abs(one - other) <= share * max(max_abs(one), max_abs(other)))


def suspicious(node: str, answers: Sequence[KeptAnswer]) -> bool:
    """Return whether the problem has to be read: verified answers differ by more than the tolerance, their objectives
    by more than OFF tolerances, or a rejected answer is like another, or there is one beside verified ones of a
    program."""
    good, bad = _split(answers)
    if is_one_of(node, COMPARED):
        if any(not near(good[0].vector, one.vector, one.tolerance) for one in good[1:]):
            return True
        if is_one_of(node, PROGRAMS) and good:
            if bad:
                return True
            f = [math.nan if one.objective is None else one.objective for one in good]
            if not max(f) - min(f) <= OFF * min(one.tolerance for one in good) * min(map(abs, f)):
                return True
    return any(near(one.vector, two.vector, ALIKE * _finer(one, two)) for one in bad for two in answers if one != two)


def of_answers(problem: Problem, answers: Sequence[KeptAnswer]) -> Iterator[Contradiction]:
    """Yield the contradictions between answers to a problem."""
    good, bad = _split(answers)
    yield from of_objectives(problem, good)
    yield from of_solutions(problem, good)
    yield from of_verdicts(problem, good, bad)


def _split(answers: Sequence[KeptAnswer]) -> tuple[list[KeptAnswer], list[KeptAnswer]]:
    good = sorted((one for one in answers if one.status in VERIFIED), key=lambda one: (one.error, one.label))
    return good, [one for one in answers if one.status in FALSE_CLAIMS]


def of_objectives(problem: Problem, good: Sequence[KeptAnswer]) -> Iterator[Contradiction]:
    """Yield a contradiction where objectives of verified answers to a convex program differ by more than OFF tolerances
    of their terms Σ|p_i z_i| + ½zᵀQz + |f|, the larger of the two; or where the middle of two answers has an objective
    that is lower by so much than both, which is ⅛ dᵀQd for the difference d of two with the same objective.

    Where all terms vanish at the solution, they do not measure what an error of the answer does: z off by ε of each
    component changes zᵀQz by ε² |z|ᵀ|Q||z|. That much is allowed too, and rounding. Beside an answer of which all terms
    vanish, others count from the size of the data on (`objective_unit`); beside z = 0 and without that, not at all.
    Where the terms of both are within OFF tolerances of that size, they are what the answers are off by.
    """
    if not isinstance(problem, PROGRAMS) or len(good) < 2:
        return
    Z = np.stack([_first(problem, one) for one in good])
    G = Z @ np.asarray(problem.Q @ Z.T)  # all zᵀQz, of which differences are to rounding of the terms
    squares = G.diagonal()
    f = 0.5 * squares + Z @ problem.p
    terms = abs(Z) @ abs(problem.p) + 0.5 * abs(squares) + abs(f)
    tolerance = np.array([one.tolerance for one in good])
    gross = np.array([x @ (abs(problem.Q) @ x) + abs(problem.p) @ x for x in abs(Z)])
    share = OFF * np.maximum.outer(tolerance, tolerance)
    share = share * np.maximum.outer(terms, terms) + (share**2 + ROUNDING) * np.maximum.outer(gross, gross)
    unit = objective_unit(problem)
    vanishing = np.minimum.outer(terms, terms) <= share
    small = (np.maximum.outer(terms, terms) <= unit) | ((unit == 0.0) & (np.minimum.outer(gross, gross) == 0.0))
    noise = np.maximum.outer(terms, terms) <= OFF * np.maximum.outer(tolerance, tolerance) * unit
    share = np.where((vanishing & small) | noise, np.inf, share)
    d = np.add.outer(squares, squares) - G - G.T
    for differences, what in ((abs(np.subtract.outer(f, f)), "objectives"), (d / 8.0, "answers")):
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.where(differences > share, differences / share, 0.0)
        i, j = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
        if not ratio[i, j] > 1.0 or not problem.convex:
            continue
        one, two = (int(i), int(j)) if f[i] <= f[j] else (int(j), int(i))
        scale = max(terms[i], terms[j])
        text = f"{good[one].label} has the objective {f[one]:.6g}, {good[two].label} {f[two]:.6g}"
        if what == "answers":
            text += ", and the middle of their answers a lower one by more than both are off"
        measured, allowed = float(differences[i, j] / scale), float(share[i, j] / scale)
        size = f"a difference of {measured:.2g} of its terms, where {allowed:.2g} is allowed"
        yield _of(problem, Conflict.OBJECTIVE, [good[one], good[two]], measured, allowed,
                  f"both are verified answers of a convex program, but {text}: {size}.")  # fmt: skip
        return


def of_solutions(problem: Problem, good: Sequence[KeptAnswer]) -> Iterator[Contradiction]:
    """Yield a contradiction where two verified answers to a problem with one solution are farther apart than
    `forward_error.apart` allows; the one with the least error is compared with all others."""
    worst: tuple[float, forward_error.AnswerDistance, KeptAnswer] | None = None
    for one in good[1:]:
        first, second = (problem.point_from_vector(answer.vector) for answer in (good[0], one))
        forms = forward_error.affine_box(problem, first), forward_error.affine_box(problem, second)
        if forms[0] is None or forms[1] is None:
            return
        M, q, z = forms[0]
        apart = forward_error.apart(M, q, z, forms[1][2], max(good[0].tolerance, one.tolerance))
        if apart is not None and apart.distance > apart.allowed:
            ratio = apart.distance / apart.allowed
            worst = max((ratio, apart, one), worst or (0.0, apart, one), key=lambda item: item[0])
    if worst is not None:
        _, apart, one = worst
        text = (
            f"the solution is unique ({apart.fact}), and the verified answers of {named([good[0].label, one.label])} "
            f"are {apart.distance:.2g} of their size apart, where {apart.allowed:.2g} is allowed."
        )
        yield _of(problem, Conflict.SOLUTION, [good[0], one], apart.distance, apart.allowed, text)


def of_verdicts(problem: Problem, good: Sequence[KeptAnswer], bad: Sequence[KeptAnswer]) -> Iterator[Contradiction]:
    """Yield a contradiction where rejected answers are like a verified one to rounding, or as good as it in a program
    with several solutions (`optimal_beside`); where there is none, one where rejected answers of different methods are
    like each other, and not zero.

    Alike: no part differs by more than ALIKE tolerances of its largest number, nor the objective of a program.
    """
    far = [one for one in bad if one.error >= REJECTED * one.tolerance]
    alike = {one.key: two for two in reversed(good) for one in far if _alike(problem, one, two)}
    rest = [one for one in far if one.key not in alike]
    optimal = {one.key: good[0] for one in rest if good and optimal_beside(problem, one, good[0])}
    reasons = (
        (alike, "and are the same to rounding as verified ones of {}."),
        (
            optimal,
            "but all conditions of optimality hold to {share:.2g}, with the objective of {}, which is verified.",
        ),
    )
    for accepted, reason in reasons:
        own = [one for one in far if one.key in accepted]
        if own:
            others = list({two.key: two for two in accepted.values()}.values())
            text = reason.format(named(two.label for two in others), share=OPTIMAL * own[0].tolerance)
            yield _of(problem, Conflict.VERDICT, [*own, *others], *_least(own), f"{_rejected(own)}, {text}")
    if alike or optimal:
        return
    agreeing = [
        one
        for one in far
        if one.vector.any() and any(_independent(one, two) and _alike(problem, one, two) for two in far)
    ]
    if agreeing:
        text = f"{_rejected(agreeing)}, though methods differ and the answers are the same to rounding."
        yield _of(problem, Conflict.VERDICT, agreeing, *_least(agreeing), text)


def _independent(one: KeptAnswer, two: KeptAnswer) -> bool:
    """Return whether two answers are of different methods, and not one computation: a solver that chooses another one
    has that one's answer to the last bit."""
    return one.method != two.method and not np.array_equal(one.vector, two.vector)


def _least(answers: Sequence[KeptAnswer]) -> tuple[float, float]:
    """Return the least error of rejected answers, and its tolerance."""
    return min((one.error, one.tolerance) for one in answers)


def _rejected(answers: Sequence[KeptAnswer]) -> str:
    least, several = _least(answers)[0], len(answers) > 1
    whose = f"answers of {named(one.label for one in answers)}" if several else f"the answer of {answers[0].label}"
    return f"{whose} {'are' if several else 'is'} rejected, with {'errors from' if several else 'error'} {least:.2g}"


def optimal_beside(problem: Problem, rejected: KeptAnswer, verified: KeptAnswer) -> bool:
    """Return whether a rejected answer to a convex quadratic program is optimal to OPTIMAL tolerances and has the
    objective of a verified one: a feasible point with the objective of a minimum is one, wherever the other is."""
    if not isinstance(problem, QP) or not problem.convex:
        return False
    point = problem.point_from_vector(rejected.vector)
    share = OPTIMAL * min(rejected.tolerance, verified.tolerance)
    f, g = problem.objective(point.z), problem.objective(_first(problem, verified))
    return abs(f - g) <= share * abs(f) and meets_conditions(problem, point, share)


def _alike(problem: Problem, one: KeptAnswer, two: KeptAnswer) -> bool:
    """Return whether two answers are the same but for rounding."""
    share = ALIKE * _finer(one, two)
    if not near(one.vector, two.vector, share):
        return False
    points = [problem.point_from_vector(answer.vector) for answer in (one, two)]
    parts = [_parts(point) for point in points]
    if not all(near(parts[0][name], parts[1][name], share) for name in parts[0]):
        return False
    if isinstance(problem, PROGRAMS):
        f, g = (problem.objective(_first(problem, answer)) for answer in (one, two))
        return abs(f - g) <= share * max(abs(f), abs(g))
    return True


def _parts(point: Point) -> dict[str, Vector]:
    """Return the parts of a point, multipliers as one."""
    arrays = point.arrays()
    known = [name for name in MULTIPLIERS if name in arrays]
    rest = {name: value for name, value in arrays.items() if name not in known}
    return {**rest, **({"multipliers": np.concatenate([arrays[name] for name in known])} if known else {})}


def _finer(one: KeptAnswer, two: KeptAnswer) -> float:
    return min(one.tolerance, two.tolerance)


def _first(problem: Problem, answer: KeptAnswer) -> Vector:
    """Return the unknowns of a program."""
    return next(iter(problem.point_from_vector(answer.vector).arrays().values()))


def _of(
    problem: Problem, kind: Conflict, answers: Sequence[KeptAnswer], measured: float, allowed: float, words: str
) -> Contradiction:
    keys, labels = tuple(one.key for one in answers), tuple(one.label for one in answers)
    return Contradiction(str(kind), problem.name, problem.fingerprint, keys, labels, words, measured, allowed)
