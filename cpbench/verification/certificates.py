"""Proofs that a problem has no solution, or that its objective has no lower bound, exact in rational arithmetic.

Data are doubles, hence rationals. A solver's certificate, or the answer of a linear program, is a hint: it is rounded,
projected exactly on the equalities that it meets to rounding, and what comes out is checked on the problem that was
asked. What holds there without any tolerance, and for all numbers within the tolerance of those of the file
(`margins`), is a proof. What the file's rounding decides is not.
"""

from __future__ import annotations

import json
import math
import time
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from decimal import ROUND_DOWN, Context, Decimal
from fractions import Fraction
from itertools import chain
from typing import Any, ClassVar, TypeAlias

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import Problem
from cpbench.matrices import Vector
from cpbench.verification import hints, margins
from cpbench.verification.exact_linear import Exact, Rationals, rationals, rounded, solve
from cpbench.verification.margins import Contradiction, FallingRay
from cpbench.verification.polyhedra import Objective, Polyhedron, conditions, multipliers, objective

SECONDS = 20.0
"""Time for the search of one proof [s]."""
TOLERANCE = 1e-6
"""Share of themselves by which the numbers of a problem may change where none is given."""
ROUNDING = (1e-9, 1e-12, 1e-6)
"""What is this small among the terms it is made of may be meant to be 0."""
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
    if known is None:
        return False
    share = Fraction(tolerance)
    if isinstance(proof, Infeasible):
        combined = known.combined(proof.multipliers)
        exact = combined is not None and combined[0] > 0 and combined[1] == 0
        return exact and Contradiction(known, proof.multipliers, margins.reach(known)).survives(share)
    if goal is None or not (known.contains(proof.point) and known.recedes(proof.ray)):
        return False
    return goal.falls(proof.point, proof.ray) and FallingRay(known, goal, proof.ray).survives(share)


def certified_infeasible(problem: Problem, certificate: Vector | None, tolerance: float = TOLERANCE) -> bool:
    """Return whether a solver's certificate, rounded and projected, proves that no problem within the tolerance of this
    one has a solution (`margins`)."""
    known = conditions(problem)
    if known is None or certificate is None:
        return False
    given = _given(problem, known, certificate)
    return _infeasible(known, given, time.perf_counter() + SECONDS, tolerance).proof is not None


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
    deadline = time.perf_counter() + seconds
    if goal is not None and kind == Unbounded.kind:
        return _unbounded(known, goal, deadline, tolerance)
    vectors = chain(_given(problem, known, certificate), hints.multipliers(known, deadline))
    return _infeasible(known, vectors, deadline, tolerance)


def reach(problem: Problem, proof: Proof) -> Vector:
    """Return R, up to which the proof excludes solutions of problems within its margin: of the unknowns of the
    conditions, or of those of optimality; empty for a ray along which the objective curves down."""
    known, goal = conditions(problem), objective(problem)
    if known is None or (goal is None and isinstance(proof, Unbounded)):
        return np.zeros(0)
    if isinstance(proof, Infeasible):
        return margins.reach(known)
    assert goal is not None
    contradiction = FallingRay(known, goal, proof.ray).contradiction
    return np.zeros(0) if contradiction is None else contradiction.R


def packed(proof: Proof) -> bytes:
    """Return the proof as bytes: its vectors as fractions of hexadecimal integers, compressed JSON."""
    vectors = {f.name: [f"{v.numerator:x}/{v.denominator:x}" for v in getattr(proof, f.name)] for f in fields(proof)}
    return zlib.compress(json.dumps(vectors).encode())


def unpacked(kind: str, data: bytes) -> Proof:
    """Return the proof that `packed` wrote; raises ValueError where the bytes are none."""
    try:
        vectors: Any = json.loads(zlib.decompress(data))
        parsed = {name: tuple(_fraction(text) for text in values) for name, values in vectors.items()}
        return _KINDS[kind](**parsed)
    except (zlib.error, KeyError, TypeError, ValueError, AttributeError, ZeroDivisionError) as cause:
        raise ValueError(f"no proof of kind {kind!r} ({type(cause).__name__}: {cause})") from None


def _fraction(text: str) -> Fraction:
    numerator, denominator = text.split("/")
    return Fraction(int(numerator, 16), int(denominator, 16))


def _given(problem: Problem, known: Polyhedron, certificate: Vector | None) -> list[Vector]:
    if certificate is None or certificate.size != known.h.size + known.f.size or not np.isfinite(certificate).all():
        return []
    return [multipliers(problem, certificate)]


def _infeasible(known: Polyhedron, vectors: Iterable[Vector], deadline: float, tolerance: float) -> ProofAttempt:
    """Return the first proof among the vectors, or the largest radius that they prove."""
    radius, best = _ZERO, -1.0
    for vector in vectors:
        for y in _multipliers(known, vector, deadline):
            if time.perf_counter() > deadline:
                break
            combined = known.combined(y)
            if combined is None or combined[0] <= 0:
                continue
            gamma, excess = combined
            if excess == 0:
                best = max(best, Contradiction(known, y, margins.reach(known)).margin())
                if best >= tolerance:
                    return _proved(Infeasible(tuple(y)), best)
            else:
                radius = max(radius, gamma / excess)
    if best >= 0.0:
        return _narrow(Infeasible, best, tolerance)
    if radius == 0:
        return ProofAttempt(None, "infeasible was claimed; no certificate of it holds in exact arithmetic")
    size = f"‖{known.unknowns}‖∞ < {_digits(radius)}"
    return ProofAttempt(None, f"infeasible was claimed; what is proved exactly: no solution with {size}")


def _unbounded(known: Polyhedron, goal: Objective, deadline: float, tolerance: float) -> ProofAttempt:
    """Return the first proof among the rays of the hints."""
    if bool((np.isfinite(known.lb) & np.isfinite(known.ub)).all()):
        return ProofAttempt(None, "unbounded was claimed; all unknowns are bounded")
    point, best = _point(known, deadline), -1.0
    if point is None:
        return ProofAttempt(None, "unbounded was claimed; no point was found that meets all constraints exactly")
    for direction in hints.rays(known, goal, deadline):
        for ray in _rays(known, goal.Q, direction, deadline):
            if known.recedes(ray) and goal.falls(point, ray):
                best = max(best, FallingRay(known, goal, ray).margin())
                if best >= tolerance:
                    return _proved(Unbounded(tuple(point), tuple(ray)), best)
    if best >= 0.0:
        return _narrow(Unbounded, best, tolerance)
    return ProofAttempt(None, "unbounded was claimed; no ray was found along which the objective falls, exactly")


def _proved(proof: Proof, margin: float) -> ProofAttempt:
    return ProofAttempt(proof, f"proved: {proof.statement}; margin {margin:.2g}", margin)


def _narrow(kind: type[Infeasible] | type[Unbounded], margin: float, tolerance: float) -> ProofAttempt:
    """Return what the numbers of the file say, and changes of them below the tolerance do not."""
    told = kind.narrow.format(share=f"{margin:.1e}")
    return ProofAttempt(None, f"{kind.kind} was claimed; {told}, below the tolerance {tolerance:g}", margin)


def _multipliers(known: Polyhedron, vector: Vector, deadline: float) -> Iterator[Rationals]:
    """Yield the vector as it is, rounded, and projected on the components of Gᵀλ + Eᵀμ that are 0 to rounding."""
    m = known.h.size
    y = vector.copy()
    y[:m] = np.where(np.isneginf(known.h), 0.0, np.maximum(y[:m], 0.0))
    if not y.any():
        return
    y = y / np.ldexp(1.0, math.frexp(float(np.abs(y).max()))[1])
    yield rationals(y)
    rows: Any = sp.vstack([sp.csr_array(known.G), sp.csr_array(known.E)], format="csr")
    sizes = np.asarray(abs(rows).max(axis=1).toarray()).ravel() if rows.nnz else np.ones(y.size)
    for rounding in ROUNDING:
        large = np.abs(y) * sizes > rounding * float((np.abs(y) * sizes).max(initial=0.0))
        support = np.flatnonzero(large | (np.arange(y.size) >= m) & (y != 0.0))
        kept = np.zeros_like(y)
        kept[support] = y[support]
        yield rounded(kept)
        nu, terms = rows.T @ kept, abs(rows).T @ np.abs(kept)
        boxed = np.isfinite(known.lb) & np.isfinite(known.ub)
        level = np.isneginf(known.lb) & np.isposinf(known.ub)
        tight = np.flatnonzero((terms > 0.0) & ~boxed & (level | (np.abs(nu) <= rounding * terms)))
        block = sp.csr_array(rows[support][:, tight].T)
        part = solve(block, [_ZERO] * tight.size, kept[support], deadline)
        if part is not None:
            whole = [_ZERO] * y.size
            for place, value in zip(support.tolist(), part, strict=True):
                whole[place] = value
            yield whole


def _point(known: Polyhedron, deadline: float) -> Rationals | None:
    """Return a point that meets all conditions exactly."""
    x = hints.interior_point(known, deadline)
    if x is None:
        return None
    G: Any = sp.csr_array(known.G)
    for rounding in (0.0, *ROUNDING):
        size = np.maximum(np.abs(x), max(float(np.abs(x).max(initial=0.0)), 1.0) * rounding)
        low = (known.lb == known.ub) | (x - known.lb <= rounding * size)
        high = ~low & (known.ub - x <= rounding * size)
        near = np.where(low, known.lb, np.where(high, known.ub, x))
        finite = np.isfinite(known.h)
        terms = abs(G) @ np.abs(near) + np.abs(np.where(finite, known.h, 0.0))
        active = np.flatnonzero(finite & (G @ near - known.h <= rounding * terms) & (rounding > 0.0))
        right = rationals(np.concatenate([known.f, known.h[active]]))
        point = _solved(known, active, None, right, near, low | high, deadline)
        if point is not None and known.contains(point):
            return point
    return None


def _rays(known: Polyhedron, Q: Any, direction: Vector, deadline: float) -> Iterator[Rationals]:
    """Yield the direction projected on the equalities that it meets to rounding; on Qd = 0 too, where it does, and then
    without, where it curves down."""
    G, curves = sp.csr_array(known.G), sp.csr_array(Q)
    d = direction / np.ldexp(1.0, math.frexp(float(np.abs(direction).max()))[1])
    flat = bool((np.abs(curves @ d) <= 1e-6 * (abs(curves) @ np.abs(d))).all())
    levels = ([curves] if flat else []) + ([None] if not flat or d @ (curves @ d) < 0.0 else [])
    for rounding in ROUNDING:
        zero = np.abs(d) <= rounding
        near = np.where(zero, 0.0, d)
        active = np.flatnonzero(np.isfinite(known.h) & (G @ near <= rounding * (abs(G) @ np.abs(near))))
        for level in levels:
            right = [_ZERO] * (known.f.size + active.size + (0 if level is None else d.size))
            ray = _solved(known, active, level, right, near, zero, deadline)
            if ray is not None:
                yield ray


def _solved(
    known: Polyhedron,
    active: Any,
    further: Any,
    right: Rationals,
    near: Vector,
    fixed: Any,
    deadline: float,
) -> Rationals | None:
    """Return an exact x near `near` with Ex and the active rows of Gx (and `further` rows) equal to `right`.

    Where `fixed`, x is what `near` is.
    """
    blocks = [sp.csr_array(known.E), sp.csr_array(known.G)[active], *([] if further is None else [further])]
    rows: Any = sp.vstack(blocks, format="csr")
    kept, free = np.flatnonzero(fixed), np.flatnonzero(~fixed)
    held = rationals(near)
    if kept.size:
        there = Exact.of(rows[:, kept]).times([held[j] for j in kept.tolist()])
        right = [b - a for a, b in zip(there, right, strict=True)]
    part = solve(rows[:, free], right, near[free], deadline)
    if part is None:
        return None
    for place, value in zip(free.tolist(), part, strict=True):
        held[place] = value
    return held


def _digits(x: Fraction) -> str:
    """Two digits, rounded down."""
    context = Context(prec=2, rounding=ROUND_DOWN)
    return f"{context.divide(Decimal(x.numerator), Decimal(x.denominator)):.1e}"
