"""A block without full rank."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.formulations import facts
from cpbench.formulations.contact import ContactProblem
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix
from cpbench_lab.diagnosis.case import Cause, FailedTrial
from cpbench_lab.diagnosis.scaled import scaled
from cpbench_lab.diagnosis.shifted import principal, shifted


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
    return Cause(
        kind="singular",
        evidence=f"{fact} of {free.size}",
        numbers={"rank": fact.value, "size": free.size},
    )


def _free(P: Any, z: Any) -> Any:
    """Return the unknowns that are not at a bound."""
    lb = getattr(P, "lb", np.zeros(z.size) if P.node == "ncp" else np.full(z.size, -np.inf))
    ub = getattr(P, "ub", np.full(z.size, np.inf))
    return np.flatnonzero((z > lb) & (z < ub))
