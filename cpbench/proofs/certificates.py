"""Proofs that a problem has no solution, or that its objective has no lower bound, exact in rational arithmetic.

Data are doubles, hence rationals. A solver's certificate, or the answer of a linear program, is a hint: it is rounded,
projected exactly on the equalities that it meets to rounding, and what comes out is checked on the problem that was
asked. What holds there without any tolerance, and for all numbers within the tolerance of those of the file
(`margins`), is a proof. What the file's rounding decides is not.
"""

from __future__ import annotations

import json
import time
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, fields
from fractions import Fraction
from importlib import import_module
from itertools import chain
from typing import Any, ClassVar, TypeAlias

import numpy as np

from cpbench.formulations.base import Problem
from cpbench.foundation.matrices import Vector
from cpbench.proofs import hints
from cpbench.proofs.exact_vectors import exact_multipliers, exact_point
from cpbench.proofs.margins import contradiction, falling, optimality, rounded_down
from cpbench.proofs.polyhedra import Objective, Polyhedron, conditions, multipliers, objective

SECONDS = 20.0
"""Time for the search of one proof [s]."""
TOLERANCE = 1e-6
"""Share of themselves by which the numbers of a problem may change where none is given."""
_Vector: TypeAlias = tuple[Fraction, ...]
_ZERO = Fraction(0)


@dataclass(frozen=True)
class Infeasible:
    """Proof that no point meets the problem's linear conditions: multipliers (Farkas)."""

    kind: ClassVar[str] = "infeasible"
    statement: ClassVar[str] = "the conditions add up to 0 ≥ γ with γ > 0, in rational arithmetic"
    narrow: ClassVar[str] = "the numbers in the file contradict each other by {share} of their size"
    multipliers: _Vector


@dataclass(frozen=True)
class Unbounded:
    """Proof that the objective falls for ever: a point that meets all constraints, and a ray from it that never leaves.

    The point is required, for without one the problem is infeasible and has no objective value at all.
    """

    kind: ClassVar[str] = "unbounded"
    statement: ClassVar[str] = "from a feasible point the objective falls along a ray for ever, in rational arithmetic"
    narrow: ClassVar[str] = "along a ray the objective falls by {share} of its terms"
    point: _Vector
    ray: _Vector


Proof: TypeAlias = Infeasible | Unbounded
_KINDS: dict[str, type[Infeasible] | type[Unbounded]] = {kind.kind: kind for kind in (Infeasible, Unbounded)}


@dataclass(frozen=True)
class ProofAttempt:
    """A proof, or none, and what is known then.

    `margin` : the largest share of themselves that all numbers may change while a contradiction or a ray remains one,
    of the best that was found; 0 without any. It is below the tolerance where there is no proof.
    """

    proof: Proof | None
    message: str
    margin: float = 0.0


def holds(problem: Problem, proof: Proof, tolerance: float = TOLERANCE) -> bool:
    """Test whether the proof is one of every problem within the tolerance of this one, in exact arithmetic and by
    nothing but its numbers."""
    known, goal = conditions(problem), objective(problem)
    if isinstance(proof, Infeasible):
        return known is not None and contradiction(known, proof.multipliers) > Fraction(tolerance)
    if known is None or goal is None or not known.contains(proof.point):
        return False
    return falling(known, goal, optimality(known, goal), proof.ray) > Fraction(tolerance)


def certified_infeasible(problem: Problem, certificate: Vector | None, tolerance: float = TOLERANCE) -> bool:
    """Return whether a solver's certificate, rounded and projected, proves that no problem within the tolerance of this
    one has a solution (`margins`)."""
    known = conditions(problem)
    given = multipliers(problem, certificate)
    return known is not None and bool(_infeasible(known, given, time.perf_counter() + SECONDS, tolerance).proof)


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
    known, goal = conditions(problem), objective(problem)
    if known is None or (kind == Unbounded.kind and goal is None):
        return ProofAttempt(None, f"{kind} was claimed; no exact proof of that is known for {problem.node}")
    import_module("scipy.optimize")  # takes a second once, which is no part of the search
    deadline = time.perf_counter() + seconds
    if goal is not None and kind == Unbounded.kind:
        return _unbounded(known, goal, deadline, tolerance)
    vectors = chain(multipliers(problem, certificate), hints.multipliers(known, deadline))
    return _infeasible(known, vectors, deadline, tolerance)


def packed(proof: Proof) -> bytes:
    """Return the proof as bytes: its vectors as fractions of hexadecimal integers, compressed JSON."""
    vectors = {f.name: [f"{v.numerator:x}/{v.denominator:x}" for v in getattr(proof, f.name)] for f in fields(proof)}
    return zlib.compress(json.dumps(vectors).encode())


def unpacked(kind: str, data: bytes) -> Proof:
    """Return the proof that `packed` wrote; raises ValueError where the bytes are none."""
    try:
        vectors: Any = json.loads(zlib.decompress(data))
        pairs = {name: [text.split("/") for text in part] for name, part in vectors.items()}
        return _KINDS[kind](**{name: tuple(Fraction(int(a, 16), int(b, 16)) for a, b in pairs[name]) for name in pairs})
    except (zlib.error, KeyError, TypeError, ValueError, AttributeError, ZeroDivisionError) as cause:
        raise ValueError(f"no proof of kind {kind!r} ({type(cause).__name__}: {cause})") from None


def _infeasible(known: Polyhedron, vectors: Iterable[Vector], deadline: float, tolerance: float) -> ProofAttempt:
    """Return the first proof among the vectors, or the largest radius that they prove."""
    radius, best = _ZERO, _ZERO
    for vector in vectors:
        for y in exact_multipliers(known, vector, deadline):
            gamma, excess, _ = known.combined(y) or (_ZERO, _ZERO, _ZERO)
            if excess:
                radius = max(radius, gamma / excess)
            best = max(best, contradiction(known, y))
            if best > Fraction(tolerance):
                return _proved(Infeasible(tuple(y)), best)
    if best > 0:
        return _narrow(Infeasible, best, tolerance)
    if radius == 0:
        return ProofAttempt(None, "infeasible was claimed; no certificate of it holds in exact arithmetic")
    far = f"‖{known.unknowns}‖∞ < {rounded_down(radius):.1e}"
    return ProofAttempt(None, f"infeasible was claimed; what is proved exactly: no solution with {far}")


def _unbounded(known: Polyhedron, goal: Objective, deadline: float, tolerance: float) -> ProofAttempt:
    """Return the first proof among the rays of the hints."""
    if bool((np.isfinite(known.lb) & np.isfinite(known.ub)).all()):
        return ProofAttempt(None, "unbounded was claimed; all unknowns are bounded")
    inside, best = hints.interior_point(known, deadline), _ZERO
    point = None if inside is None else exact_point(known, inside, deadline)
    if point is None:
        return ProofAttempt(None, "unbounded was claimed; no point was found that meets all constraints exactly")
    optimal, cone = optimality(known, goal), known.recession
    flat = (exact_multipliers(optimal, vector, deadline) for vector in hints.multipliers(optimal, deadline))
    curved = (exact_point(cone, ray / np.abs(ray).max(), deadline) for ray in hints.rays(known, goal, deadline))
    for ray in chain(chain.from_iterable(flat), filter(None, curved)):
        best = max(best, falling(known, goal, optimal, ray))
        if best > Fraction(tolerance):
            return _proved(Unbounded(tuple(point), tuple(ray)), best)
    if best > 0:
        return _narrow(Unbounded, best, tolerance)
    return ProofAttempt(None, "unbounded was claimed; no ray was found along which the objective falls, exactly")


def _proved(proof: Proof, margin: Fraction) -> ProofAttempt:
    share = rounded_down(margin)
    return ProofAttempt(proof, f"proved: {proof.statement}; margin {share:.2g}", share)


def _narrow(kind: type[Infeasible] | type[Unbounded], margin: Fraction, tolerance: float) -> ProofAttempt:
    """Return what the numbers of the file say, and changes of them below the tolerance do not."""
    share = rounded_down(margin)
    told = kind.narrow.format(share=f"{share:.1e}")
    return ProofAttempt(None, f"{kind.kind} was claimed; {told}, below the tolerance {tolerance:g}", share)
