"""What the problem lacks: strict complementarity, determined reactions, monotony, a block of full rank."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations import MLCP
from cpbench.formulations.base import Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix
from cpbench.foundation.text import counted
from cpbench_lab import facts
from cpbench_lab.diagnosis.attempts import SolverTrial
from cpbench_lab.diagnosis.case import Cause, FailedTrial, Remedy
from cpbench_lab.diagnosis.even_masses import even_masses
from cpbench_lab.diagnosis.other_units import scaled, uniform

ROUNDING = 1e-12
"""Share of the terms of a row that its sum is taken to be accurate to."""


def degenerate(case: FailedTrial) -> Cause | None:
    """Count the pairs of a known answer that are both zero, to the square root of the tolerance."""
    P: Any = case.problem
    if P.node not in ("lcp", "ncp", "mlcp") or case.known is None:
        return None
    z = case.known.v if P.node == "mlcp" else case.known.z
    w = P.slacks(case.known)["w"]
    near = np.sqrt(case.trial.tolerance)
    constants = {"lcp": "q", "mlcp": "b"}.get(P.node)
    z_size = matrices.max_abs(z) or 1.0
    w_size, terms = matrices.max_abs(w), matrices.max_abs(getattr(P, constants)) if constants else 0.0
    # where all w are small, their sums of terms are 0 to rounding
    both = (np.abs(z) <= near * z_size) & (np.abs(w) <= max(near * w_size, ROUNDING * terms))
    if not both.any():
        return None
    first = int(np.flatnonzero(both)[0]) + 1
    without = None
    if constants:
        moved = replace(P, **{constants: getattr(P, constants) + np.where(both, max(w_size, terms) or 1.0, 0.0)})
        without = replace(case.trial, problem=moved)
    return Cause(
        kind="degenerate",
        evidence=f"{counted(int(both.sum()), 'pair')} of {both.size} are both zero at a verified answer, first {first}",
        numbers={"pairs": int(both.sum())},
        without=without,
        change="these rows raised, so that every pair is strict",
    )


def hyperstatic(case: FailedTrial) -> Cause | None:
    """Count the reactions less the rank of the operator that takes them to velocities."""
    if not isinstance(case.problem, ContactProblem):
        return None
    fact = next((fact for fact in case.source_facts if fact.name == "hyperstaticity"), None)
    if fact is None or not isinstance(fact.value, int) or fact.value <= 0:
        return None
    rows = case.problem.nc * case.problem.dimension
    return Cause(
        kind="hyperstatic",
        evidence=f"{rows} components of reactions, rank {rows - fact.value}: {fact.value} are not determined",
        numbers={"undetermined": fact.value, "components": rows},
        without=shifted(case.trial),
        change="W with its mean diagonal added to it",
    )


def nonmonotone(case: FailedTrial) -> Cause | None:
    """Look at the least eigenvalue of the symmetric part of the problem's matrix."""
    whole = "[[A, C], [D, B]]" if isinstance(case.problem, MLCP) else ""
    subject = whole or principal(case.problem)
    fact = next((f for f in case.source_facts if f.name == "definiteness" and f.matrix == subject), None)
    if fact is None or fact.value not in ("indefinite", "negative semidefinite", "not positive semidefinite"):
        return None
    return Cause(
        kind="nonmonotone",
        evidence=f"{fact}",
        numbers={"least": fact.number or 0.0},
        without=shifted(case.trial, definite=True),
        change=f"{subject} with its diagonal raised until it is definite",
    )


def singular(case: FailedTrial) -> Cause | None:
    """Count the rank of the block that methods of the formulation factor, or of the Jacobian where the solver ended."""
    P: Any = case.problem
    name = "" if isinstance(case.problem, ContactProblem) else principal(P)  # W is singular in most heaps, and may be
    if name:
        in_units = scaled(P)  # the rank of a matrix has none
        block: Matrix = getattr(P if in_units is None else in_units.problem, name)
        fact = facts.rank(block, name)
        n = block.shape[0]
        if not isinstance(fact.value, int) or fact.value >= n:
            return None
        return Cause(
            kind="singular",
            evidence=f"{fact} of {n}",
            numbers={"rank": fact.value, "size": n},
            without=shifted(case.trial),
            change=f"{name} with its mean diagonal added to it",
        )
    where = case.failed.answer if case.failed.answer is not None else case.known
    if getattr(P, "F", None) is None or where is None or not where.finite:
        return None
    J = matrices.dense(P.F.jacobian(where.z))
    free = _free(P, where.z)
    if not free.size or not np.isfinite(J).all():
        return None
    fact = facts.rank(J[np.ix_(free, free)], "the Jacobian of the free unknowns where it ended")
    if not isinstance(fact.value, int) or fact.value >= free.size:
        return None
    return Cause(kind="singular", evidence=f"{fact} of {free.size}", numbers={"rank": fact.value, "size": free.size})


def _free(P: Any, z: Any) -> Any:
    """Return the unknowns that are not at a bound."""
    lb = getattr(P, "lb", np.zeros(z.size) if P.node == "ncp" else np.full(z.size, -np.inf))
    ub = getattr(P, "ub", np.full(z.size, np.inf))
    return np.flatnonzero((z > lb) & (z < ub))


# ---------------------------------------------------------------------------------------------------------------- sizes

SPREAD = 3.0
"""Decades by which units have to shrink the spread of the rows for a trial to be worth it."""
TIGHTER = 0.1
"""Share of the tolerance that is asked for in other units: what counts is measured in those of the problem."""
DECADES = 3.0
"""Decades from one for a trial to be worth it. Half the digits of a tolerance of 1e-6: with an objective of this size
an absolute test at 1e-6 leaves three digits, and its square, a test of products, leaves none."""
APART = 100.0
"""Ratio of masses for a trial to be worth it. Even bodies have gaps, too: a slender stack of them bends as a
cantilever, whose first two eigenvalues are (4.694/1.875)⁴ = 39 apart; nothing even is known to have a wider one."""


def scale(case: FailedTrial) -> Cause | None:
    """Compare the sizes of the rows with those in units, powers of two, in which the entries are alike."""
    found = scaled(case.problem)
    if found is None or found.numbers["before"] - found.numbers["after"] < SPREAD:
        return None
    trial = replace(case.trial, problem=found.problem, tolerance=TIGHTER * case.trial.tolerance)
    change = "units in which the entries are alike"
    return Cause(
        kind="scale",
        evidence="its rows lie {before:.1f} decades apart, {after:.1f} in ".format(**found.numbers) + change,
        numbers=found.numbers,
        without=trial,
        change=change,
        remedies=(Remedy(text=f"the same solver in {change}", trial=trial, back=found.back),),
    )


def magnitude(case: FailedTrial) -> Cause | None:
    """Measure the unknowns at a verified answer, and the largest term; compare both with one.

    Without an answer the size of the unknowns is that of the constants over the entries of the matrix.
    """
    found = uniform(case.problem, case.known)
    if found is None:
        return None
    if max(abs(math.log10(size)) for size in found.numbers.values()) < DECADES:
        return None
    trial = replace(case.trial, problem=found.problem)
    terms = "objective" if case.problem.node == "qp" else "rows"
    change = "objective, rows and unknowns scaled to size one by powers of two"
    return Cause(
        kind="magnitude",
        evidence="its unknowns are of size {unknowns:.1e}, the largest term of its {} is {terms:.1e}".format(
            terms, **found.numbers
        ),
        numbers=found.numbers,
        without=trial,
        change=change,
        remedies=(Remedy(text=f"the same solver with {change}", trial=trial, back=found.back),),
    )


def masses(case: FailedTrial) -> Cause | None:
    """Compare the masses that contacts move; the same scene with even masses, and the same contacts, is the check."""
    found = even_masses(case.problem)
    if found is None or found.ratio < APART:
        return None
    modes = counted(found.heavy, "mode") + f" of motion of {found.of} " + ("is" if found.heavy == 1 else "are")
    evidence = f"contacts move masses that are {found.ratio:.1e} apart: {modes} so much heavier than the next"
    return Cause(
        kind="masses far apart",
        evidence=f"{evidence} (eigenvalues of W, by pairs of bodies)",
        numbers={"ratio": found.ratio, "heavy": found.heavy, "of": found.of},
        without=replace(case.trial, problem=found.problem),
        change="the same contacts, on bodies that make these modes as light as the next",
    )


# ------------------------------------------------------------------------------------------- the nearest simple problem


def principal(problem: Problem) -> str:
    """Return the name of the square matrix of the first rows, which is shifted here; "" where there is none."""
    _, sign, name, _ = problem.terms[0] if problem.terms else ("", 0, "", "")
    rows, columns = problem.shapes()[name] if sign == 1 and name in problem.shapes() else ("", "-")
    return name if rows == columns else ""


def shifted(trial: SolverTrial, *, definite: bool = False) -> SolverTrial | None:
    """Return the trial on the problem with its matrix plus its mean size (with `definite` also its negative part).

    None for formulations without such a matrix.
    """
    problem: Any = trial.problem
    name, K = _matrix(problem)
    if K is None:
        return None
    size = float(np.abs(K.diagonal()).mean()) or matrices.max_abs(K) or 1.0
    if definite:
        both: Any = K if problem.node != "mlcp" else matrices.block([[problem.A, problem.C], [problem.D, problem.B]])
        least = matrices.least_eigenvalue(both)
        size += max(-least, 0.0)
    changed = {name: matrices.with_diagonal(K, np.full(K.shape[0], size))}
    if definite and problem.node == "mlcp":
        changed["B"] = matrices.with_diagonal(problem.B, np.full(problem.b.size, size))
    return replace(trial, problem=replace(problem, **changed))


def dominated(trial: SolverTrial) -> SolverTrial | None:
    """Return the trial on the problem with the diagonal of its matrix raised to twice the other entries of its row.

    Sweeps over such a matrix contract, by half each. None for formulations without such a matrix.
    """
    problem: Any = trial.problem
    name, K = _matrix(problem)
    if K is None:
        return None
    diagonal = np.asarray(K.diagonal(), dtype=float)
    others = np.asarray(abs(sp.csr_array(K)).sum(axis=1), dtype=float).ravel() - np.abs(diagonal)
    raised = matrices.with_diagonal(K, np.maximum(2.0 * others - diagonal, 0.0))
    return replace(trial, problem=replace(problem, **{name: raised}))


def _matrix(problem: Problem) -> tuple[str, Matrix | None]:
    """Return the matrix that is shifted, by name; None where there is none, or no row of it."""
    name = principal(problem)
    K: Matrix | None = getattr(problem, name) if name else None
    return name, K if K is not None and K.shape[0] else None
