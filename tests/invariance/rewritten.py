"""The invariances: one answer to one problem, written in other ways."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import idle_prices
import numpy as np
import redundant
import rescaled
import side_by_side
from answers import RNG, VARIANTS, Answer, answers, vector
from inclusions import pairs_of
from judges import Judge

from cpbench.conversions import base as edges
from cpbench.formulations import Kind
from cpbench.testing.cases import Case
from cpbench.testing.equivalents import renumbered

Rewrite = Callable[[Answer, RNG, str], Iterator[Answer]]


def _plain(answer: Answer, rng: RNG, variant: str) -> Iterator[Answer]:
    yield answer


def _units(answer: Answer, rng: RNG, variant: str) -> Iterator[Answer]:
    yield rescaled.rescaled(answer, rescaled.units(rng))
    yield rescaled.rescaled(answer, rescaled.one_unit(rng))


def _order(answer: Answer, rng: RNG, variant: str) -> Iterator[Answer]:
    case = renumbered(Case("", answer.problem, answer.point), int(rng.integers(2**31)))
    assert case is not None, answer.problem.node
    yield answer.of(case.problem, case.point)


def _signs(answer: Answer, rng: RNG, variant: str) -> Iterator[Answer]:
    """Equations times −1, free unknowns and tangent directions reversed, tangent frames turned by 90°."""
    reversed_ = rescaled.rescaled(answer, rescaled.signs(rng))
    yield reversed_
    p = answer.problem
    if hasattr(p, "dimension"):
        yield _turned(reversed_)


def _turned(answer: Answer) -> Answer:
    """T1 and T2 (and with rolling the axes M1 and M2) in each other's place."""
    p = answer.problem
    order = {2: [0, 1], 3: [0, 1, 2] if hasattr(p, "mu_r") else [0, 2, 1], 5: [0, 2, 1, 4, 3]}[p.dimension]
    rows = (p.dimension * np.arange(p.nc)[:, None] + order).ravel()
    data: dict[str, Any] = {}
    for field in dataclasses.fields(p):
        shape = field.metadata.get("shape", ())
        if "m" in shape:
            value = getattr(p, field.name)
            value = value[rows] if shape[0] == "m" else value
            data[field.name] = value[:, rows] if shape[1:] == ("m",) else value
    if p.node == "afc":
        data["mu"] = p.mu[:, ::-1]
    return answer.of(dataclasses.replace(p, **data), dataclasses.replace(answer.point, r=answer.point.r[rows]))


def _representations(answer: Answer, rng: RNG, variant: str) -> Iterator[Answer]:
    """Pushed along every equivalent edge that can take it; not where the lifted answer is another one, for a push may
    mend what it is given."""
    p = answer.problem
    for name in edges.conversions.names():
        edge = edges.make(name)
        if edge.source != p.node or edge.obstacle(p) is not None or edge.exactness(p) is not Kind.EQUIVALENT:
            continue
        if type(edge).push is edges.Conversion.push:
            continue
        target, trace = edge.apply(p)
        pushed = edge.push(answer.point, trace)
        back, x = vector(p, edge.lift(pushed, trace)), vector(p, answer.point)
        same = np.abs(back - x).max(initial=0.0) <= 1e-9 * np.abs(x).max(initial=0.0)
        if same and not (answer.right and _cancelled(target, pushed)):
            yield dataclasses.replace(answer.of(target, pushed), via=name)


def _cancelled(problem: Any, point: Any) -> bool:
    """Whether a constant of some row is far below 1, the size of the data: a conversion has made it of larger numbers
    (q + M lb where z is counted from lb), and errors of ε/100 in these are not ε/10 there."""
    size = np.abs(pairs_of(problem, point).constants)
    return bool(((size > 0.0) & (size < 0.1)).any())


INVARIANCES: Mapping[str, Rewrite] = {
    "plain": _plain,
    "units": _units,
    "order": _order,
    "signs": _signs,
    "idle beside": side_by_side.idle,
    "idle coupled": side_by_side.coupled,
    "idle price": idle_prices.coupled,
    "idle sides": side_by_side.idle_sides,
    "absent unknown": redundant.absent,
    "constants": redundant.constants,
    "repeated rows": redundant.repeated,
    "cancelling multipliers": redundant.cancelling,
    "union": side_by_side.union,
    "representation": _representations,
}


@dataclasses.dataclass(frozen=True)
class Said:
    """A judge's word: whether an answer solves the problem (None where the judge failed), and its error or why."""

    solved: bool | None
    error: str


def _asked(judge: Judge, answer: Answer) -> Said:
    try:
        solved, error = judge(answer.problem, answer.point, answer.tolerance)
    except Exception as cause:  # a judge that fails on one case is to be told with the others
        return Said(None, f"raises {type(cause).__name__}: {cause}")
    return Said(solved, f"{error:.1e}")


@dataclasses.dataclass(frozen=True)
class Failure:
    """A verdict that a way of writing has changed."""

    variant: str
    invariance: str
    seed: int
    answer: Answer
    plain: Said
    written: Said

    def __str__(self) -> str:
        a = self.answer
        kind = "right" if a.right else "wrong"
        said = "solved" if self.written.solved else "not solved"
        via = f" via {a.via}" if a.via else ""
        return (
            f"{self.variant}, {self.invariance}{via}, seed {self.seed}: a {kind} answer is {said} at {a.tolerance:g}, "
            f"error {self.written.error}, as first written {self.plain.error}"
        )


def examine(judge: Judge, variant: str, invariance: str, seed: int) -> tuple[int, list[Failure]]:
    """How many verdicts there were, and those that are not right."""
    rng = np.random.default_rng([seed, sum(map(ord, variant)), sum(map(ord, invariance))])
    count, failures = 0, []
    for answer in answers(variant, rng):
        plain = _asked(judge, answer)
        for written in INVARIANCES[invariance](answer, rng, variant):
            count += 1
            verdict = _asked(judge, written)
            if verdict.solved is not answer.right:
                failures.append(Failure(variant, invariance, seed, written, plain, verdict))
    return count, failures


_LIMITED: Mapping[str, tuple[str, ...]] = {
    "idle coupled": tuple(side_by_side.COUPLED),
    "idle price": tuple(idle_prices.PRICED),
    "idle sides": ("avi", "qp", "micp", "ge-box", "vi", "qvi", "nlp"),
    "absent unknown": ("qp", "nlp"),
    "constants": ("nlp",),
    "repeated rows": redundant.WITH_ROWS,
    "cancelling multipliers": ("qp", "avi", "vi-rows", "nlp", "gfc-3d-joints", "coneqp"),
}
"""Nodes, or variants, that an invariance is about; all where nothing is said."""


def _concerns(invariance: str, variant: str) -> bool:
    node = variant.split("-")[0]
    if (invariance, node) == ("idle beside", "equation"):
        return False  # no equation is ever idle
    if invariance == "representation":
        return variant not in ("nfc", "equation", "vi-rows", "vi-cones", "qvi-friction", "qvi-rows", "nlp")
    limited = _LIMITED.get(invariance)
    return limited is None or node in limited or variant in limited


PAIRS = [(variant, name) for variant in VARIANTS for name in INVARIANCES if _concerns(name, variant)]
