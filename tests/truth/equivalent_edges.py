"""Right and wrong answers of real files, carried over every edge that is equivalent for the problem."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pair_misses
from qp_literature import Reference, literature, off, unknown_sizes
from qp_wrong import wrong_answers, wrongness

import cpbench
from cpbench.conversions.base import Conversion, conversions, make
from cpbench.errors import CpbenchError
from cpbench.formulations.base import Kind
from cpbench.verification import judge

RIGHT = 1e-9
"""An answer whose numbers are all at most this is right."""
ROUNDED = 1e-12
"""So is one that misses every pair by at most this of the largest of its kind; a row of rounding has no own size."""
WRONG = 1000.0
"""An answer off by this many ε is wrong."""
WITHOUT_OBJECTIVE = ("lcp-qp-nonsymmetric",)
"""Edges to programs whose objective is 0 at every solution: a gap has no terms there to be compared with."""
UNKNOWNS = 1500
"""Converted problems with more unknowns are left out."""


@dataclass(frozen=True)
class Case:
    """A problem with answers whose worth is known; `wrong_by(point)` is how wrong a point is by an own measure."""

    name: str
    problem: Any
    right: list[tuple[str, Any]]
    wrong: list[tuple[str, Any]]
    wrong_by: Callable[[Any], float]


NO_DIGITS = ("micp-equation-fb", "micp-equation-pfb")
"""Functions of a pair that have no more digits than the quotient of its numbers where both are nearly 0."""
KNOWN = {
    "deltasigma_mlcp.dat": ("mlcp-lcp-schur", "micp-equation"),
    "LMGC_GFC3D-i00001-1-00000.hdf5": ("fc-micp",),
    "PENTDI-n500.npz": ("mlcp-lcp-schur", "qp-qp-dual"),
    "QGROW7.mat": ("qp-mlcp", "coneqp-soclcp"),
    "BQPGABIM-n50.npz": ("avi-lcp-bounds",),
    "BQPGASIM-n50.npz": ("avi-lcp-bounds",),
}
"""Files and edges behind which verdicts are known to be false; docs/methods/verdict.md has the reasons."""


@dataclass(frozen=True)
class Carried:
    """What the judge says of one answer on one edge (`""`: of the source itself)."""

    name: str
    edge: str
    label: str
    right: bool
    solved: bool
    error: float
    source_error: float

    @property
    def false(self) -> bool:
        return self.right != self.solved

    @property
    def known(self) -> bool:
        """Whether the verdict is one of those that are known to be false."""
        if self.right and self.name.rpartition("/")[0].startswith("fc") and self.edge.endswith(NO_DIGITS):
            return True
        return any(edge in self.edge for edge in KNOWN.get(self.name.rpartition("/")[2], ()))


def edges(problem: Any, depth: int = 2) -> Iterator[tuple[str, Any, Callable[[Any], Any], Callable[[Any], Any]]]:
    """Yield (names, converted problem, push, lift) of every equivalent edge and of chains of up to `depth` of them."""
    for name in conversions.names():
        edge: Conversion = make(name)
        if edge.source != problem.node or name in WITHOUT_OBJECTIVE or edge.obstacle(problem) is not None:
            continue
        size = edge.predict(problem)
        if edge.exactness(problem) is not Kind.EQUIVALENT or (size is not None and size.bytes > 1e8):
            continue
        try:
            target, trace = edge.apply(problem)
        except CpbenchError:
            continue
        if sum(target.point_sizes.values()) > UNKNOWNS:
            continue

        def push(point: Any, edge: Conversion = edge, trace: Any = trace) -> Any:
            return edge.push(point, trace)

        def lift(point: Any, edge: Conversion = edge, trace: Any = trace) -> Any:
            return edge.lift(point, trace)

        yield name, target, push, lift
        if depth > 1:
            for further, last, on, back in edges(target, depth - 1):
                if last.node != problem.node:
                    yield (
                        f"{name} {further}",
                        last,
                        lambda x, on=on, push=push: on(push(x)),
                        lambda x, back=back, lift=lift: lift(back(x)),
                    )


def qp_case(
    name: str, problem: Any, answers: list[tuple[str, Any]], reference: Reference, least: float, most: int
) -> Case | None:
    """Return the best two answers by the literature where they are right, and wrong ones made from the best."""

    def worst(point: Any) -> float:
        return max(literature(problem, point).worst(by_row=False), off(problem, point.z, reference))

    ranked = sorted(((worst(point), label, point) for label, point in answers), key=lambda row: row[:2])
    right = [(label, point) for value, label, point in ranked if value <= RIGHT][:2]
    if not right:
        return None
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    sizes = unknown_sizes(problem, reference)
    wrong = list(wrong_answers(rng, problem, right[0][1], reference, least, most))
    return Case(name, problem, right, wrong, lambda x: wrongness(problem, x, reference, sizes))


def pair_case(name: str, problem: Any, least: float, most: int, seconds: float = 5.0) -> Case | None:
    """Return a case of any formulation: the automatic choice's answer to 1e-12 where it is right, and changed ones."""
    try:
        point = cpbench.solve(problem, tolerance=1e-12, seconds=seconds).point
    except CpbenchError:
        return None
    if point is None or not point.finite:
        return None
    wrong_by = pair_misses.by_largest(problem, point)
    if pair_misses.by_row(problem, point) > RIGHT and wrong_by(point) > ROUNDED:
        return None
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    changed = pair_misses.changed(rng, problem, point, most)
    return Case(
        name, problem, [("automatic", point)], [(label, x) for label, x in changed if wrong_by(x) >= least], wrong_by
    )


def carried(case: Case, epsilon: float, depth: int = 2) -> Iterator[Carried]:
    """Yield the verdicts on all answers of a case, at the source and behind each edge.

    An edge may not carry all of an answer (it leaves out multipliers that it computes again), and what it computes has
    rounding. So an answer counts as right where it is right by the pairs of the converted problem, too, and as wrong
    where it misses these by 10 ε and the one that comes back by `lift` is wrong by 1000 ε.
    """
    answers = [(label, x, True) for label, x in case.right] + [(label, x, False) for label, x in case.wrong]
    here = {label: judge(case.problem, x, epsilon) for label, x, _ in answers}
    for label, _, right in answers:
        verdict = here[label]
        yield Carried(case.name, "", label, right, verdict.solved, verdict.error, verdict.error)
    for names, target, push, lift in edges(case.problem, depth):
        try:
            misses = pair_misses.by_largest(target, push(case.right[0][1]))
        except CpbenchError:
            continue
        for label, x, right in answers:
            try:
                there = push(x)
                missed = misses(there)
                back = 0.0 if right else case.wrong_by(lift(there))
            except CpbenchError:
                continue
            if missed <= epsilon / 100 if right else missed >= 10 * epsilon and back >= WRONG * epsilon:
                verdict = judge(target, there, epsilon)
                yield Carried(case.name, names, label, right, verdict.solved, verdict.error, here[label].error)


OTHERS = (
    "lcp", "mlcp", "relay", "soclcp", "rolling_local", "rolling_global",
    "fc2d_local", "fc3d_local", "fc2d_global", "fc3d_global",
)  # fmt: skip
