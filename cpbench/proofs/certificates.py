"""Proofs that a problem has no solution, or that its objective has no lower bound, to rounding and with a margin.

A solver's certificate, or the answer of a linear program, is checked on the problem that was asked. What holds there
for all numbers within the tolerance of those of the file (`margins`) is a proof, beside which rounding is nothing; what
the file's own rounding decides is none.
"""

from __future__ import annotations

import json
import time
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from importlib import import_module
from itertools import chain
from typing import Any, ClassVar, TypeAlias

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import Problem
from cpbench.foundation.matrices import Vector
from cpbench.proofs import hints
from cpbench.proofs.margins import contradiction, falling, optimality
from cpbench.proofs.polyhedra import Objective, Polyhedron, conditions, multipliers, objective

SECONDS = 20.0
"""Time for the search of one proof [s]."""
TOLERANCE = 1e-6
"""Share of themselves by which the numbers of a problem may change where none is given."""
NEARLY = (1e-9, 1e-12, 1e-6)
"""Shares of the terms of a sum: below one of them it may be meant to be 0."""
LARGEST = 1500
"""Rows and unknowns of the largest sums that are made 0."""


@dataclass(frozen=True, eq=False)
class Infeasible:
    """Proof that no point meets the problem's linear conditions: multipliers (Farkas)."""

    kind: ClassVar[str] = "infeasible"
    statement: ClassVar[str] = "the conditions add up to 0 ≥ γ with γ > 0"
    narrow: ClassVar[str] = "the numbers in the file contradict each other by {share} of their size"
    multipliers: Vector


@dataclass(frozen=True, eq=False)
class Unbounded:
    """Proof that the objective falls for ever: a point that meets all constraints, and a ray from it that never leaves.

    The point is required, for without one the problem is infeasible and has no objective value at all.
    """

    kind: ClassVar[str] = "unbounded"
    statement: ClassVar[str] = "from a feasible point the objective falls along a ray for ever"
    narrow: ClassVar[str] = "along a ray the objective falls by {share} of its terms"
    point: Vector
    ray: Vector


Proof: TypeAlias = Infeasible | Unbounded
_KINDS: dict[str, type[Infeasible] | type[Unbounded]] = {kind.kind: kind for kind in (Infeasible, Unbounded)}


@dataclass(frozen=True)
class ProofAttempt:
    """A proof, or none, and what is known then.

    `margin` : the largest share of themselves that all numbers may change while a contradiction or a ray remains one,
    of the best that was tried; 0 without any. It is below the tolerance where there is no proof.
    """

    proof: Proof | None
    message: str
    margin: float = 0.0


def holds(problem: Problem, proof: Proof, tolerance: float = TOLERANCE) -> bool:
    """Test whether the proof is one of every problem within the tolerance of this one, by nothing but its numbers."""
    polyhedron, goal = conditions(problem), objective(problem)
    if isinstance(proof, Infeasible):
        return polyhedron is not None and contradiction(polyhedron, proof.multipliers) > tolerance
    if polyhedron is None or goal is None or not polyhedron.contains(proof.point):
        return False
    return falling(polyhedron, goal, optimality(polyhedron, goal), proof.ray) > tolerance


def certified_infeasible(problem: Problem, certificate: Vector | None, tolerance: float = TOLERANCE) -> bool:
    """Return whether a solver's certificate proves that no problem within the tolerance of this one has a solution
    (`margins`)."""
    polyhedron = conditions(problem)
    given = multipliers(problem, certificate)
    return polyhedron is not None and bool(_infeasible(polyhedron, given, tolerance).proof)


def prove(
    problem: Problem,
    kind: str,
    certificate: Vector | None = None,
    seconds: float = SECONDS,
    tolerance: float = TOLERANCE,
) -> ProofAttempt:
    """Look for a proof that the problem is `infeasible` or `unbounded` (`kind`), for so many seconds.

    `certificate` is a solver's vector for this very problem; without one, or where it leads nowhere, linear programs
    give hints. The proof holds for all numbers within the `tolerance` of those of the problem, as `margins` defines it.
    """
    polyhedron, goal = conditions(problem), objective(problem)
    if polyhedron is None or (kind == Unbounded.kind and goal is None):
        return ProofAttempt(None, f"{kind} was claimed; no proof of that is known for {problem.node}")
    import_module("scipy.optimize")  # takes a second once, which is no part of the search
    deadline = time.perf_counter() + seconds
    if goal is not None and kind == Unbounded.kind:
        return _unbounded(polyhedron, goal, deadline, tolerance)
    vectors = chain(multipliers(problem, certificate), hints.multipliers(polyhedron, deadline))
    return _infeasible(polyhedron, vectors, tolerance)


def packed(proof: Proof) -> bytes:
    """Return the proof as bytes: its vectors as compressed JSON, which keeps every digit."""
    return zlib.compress(json.dumps({f.name: getattr(proof, f.name).tolist() for f in fields(proof)}).encode())


def unpacked(kind: str, data: bytes) -> Proof:
    """Return the proof that `packed` wrote; raises ValueError where the bytes are none."""
    try:
        vectors: Any = json.loads(zlib.decompress(data))
        return _KINDS[kind](**{name: np.array(part, dtype=np.float64) for name, part in vectors.items()})
    except (zlib.error, KeyError, TypeError, ValueError, AttributeError) as cause:
        raise ValueError(f"no proof of kind {kind!r} ({type(cause).__name__}: {cause})") from None


def _infeasible(polyhedron: Polyhedron, vectors: Iterable[Vector], tolerance: float) -> ProofAttempt:
    """Return the first proof among the vectors, or the largest margin."""
    best = 0.0
    for y in chain.from_iterable(_settled(polyhedron, vector) for vector in vectors):
        best = max(best, contradiction(polyhedron, y))
        if best > tolerance:
            return _proved(Infeasible(y), best)
    if best > 0.0:
        return _narrow(Infeasible, best, tolerance)
    return ProofAttempt(None, "infeasible was claimed; no certificate of it holds beyond rounding")


def _settled(P: Polyhedron, vector: Vector) -> Iterator[Vector]:
    """Yield multipliers with the signs that they need, and with the sums made 0 that they nearly leave of unknowns
    without a bound, by least squares."""
    m = P.h.size
    y = np.append(np.where(np.isneginf(P.h), 0.0, np.maximum(vector[:m], 0.0)), vector[m:])
    yield y
    rows: Any = sp.vstack([sp.csr_array(P.G), sp.csr_array(P.E)], format="csr")
    for rounding in NEARLY:
        sums, terms = rows.T @ y, abs(rows).T @ np.abs(y)
        free = np.isneginf(P.lb) & np.isposinf(P.ub)
        unbounded = np.isneginf(P.lb) | np.isposinf(P.ub)
        level = np.flatnonzero((terms > 0.0) & unbounded & (free | (np.abs(sums) <= rounding * terms)))
        support = np.flatnonzero(np.abs(y) > rounding * float(np.abs(y).max(initial=0.0)))
        if not 0 < max(level.size, support.size) <= LARGEST:
            return
        block = rows[support][:, level].T.toarray() / terms[level][:, None]
        settled = np.zeros_like(y)
        settled[support] = y[support]
        for _ in range(2):
            settled[support] -= np.linalg.lstsq(block, block @ settled[support], rcond=None)[0]
        settled[:m] = np.maximum(settled[:m], 0.0)
        yield settled


def _unbounded(polyhedron: Polyhedron, goal: Objective, deadline: float, tolerance: float) -> ProofAttempt:
    """Return the first proof among the rays of the hints."""
    if bool((np.isfinite(polyhedron.lb) & np.isfinite(polyhedron.ub)).all()):
        return ProofAttempt(None, "unbounded was claimed; all unknowns are bounded")
    inside, best = hints.interior_point(polyhedron, deadline), 0.0
    point = None if inside is None else np.clip(inside, polyhedron.lb, polyhedron.ub)
    if point is None or not polyhedron.contains(point):
        return ProofAttempt(None, "unbounded was claimed; no point was found that meets all constraints")
    optimal = optimality(polyhedron, goal)
    curved = (ray / np.abs(ray).max() for ray in hints.rays(polyhedron, goal, deadline))
    flat = chain.from_iterable(_settled(optimal, ray) for ray in hints.multipliers(optimal, deadline))
    for ray in chain(flat, curved):
        best = max(best, falling(polyhedron, goal, optimal, ray))
        if best > tolerance:
            return _proved(Unbounded(point, ray), best)
    if best > 0.0:
        return _narrow(Unbounded, best, tolerance)
    return ProofAttempt(None, "unbounded was claimed; no ray was found along which the objective falls")


def _proved(proof: Proof, margin: float) -> ProofAttempt:
    return ProofAttempt(proof, f"proved: {proof.statement}; margin {margin:.2g}", margin)


def _narrow(kind: type[Infeasible] | type[Unbounded], margin: float, tolerance: float) -> ProofAttempt:
    """Return what the numbers of the file say, and changes of them below the tolerance do not."""
    reason = kind.narrow.format(share=f"{margin:.1e}")
    return ProofAttempt(None, f"{kind.kind} was claimed; {reason}, below the tolerance {tolerance:g}", margin)
