"""The overall size of the objective, the rows or the unknowns: tolerances of solvers are absolute, at least in part."""

from __future__ import annotations

import math
from dataclasses import replace

from cpbench_lab.diagnosis.case import Cause, FailedTrial, Remedy
from cpbench_lab.diagnosis.uniform import uniform

DECADES = 3.0
"""Decades from one for a trial to be worth it. Half the digits of a tolerance of 1e-6: with an objective of this size
an absolute test at 1e-6 leaves three digits, and its square, a test of products, leaves none."""


def magnitude(case: FailedTrial) -> Cause | None:
    """Measure the unknowns at a verified answer, and the largest term; compare both with one.

    Without an answer the size of the unknowns is that of the constants over the entries of the matrix.
    """
    found = uniform(case.problem, case.known)
    if found is None:
        return None
    away = max(abs(math.log10(found.unknowns)), abs(math.log10(found.terms)))
    if away < DECADES:
        return None
    trial = replace(case.trial, problem=found.problem)
    terms = "objective" if case.problem.node == "qp" else "rows"
    change = "objective, rows and unknowns scaled to size one by powers of two"
    return Cause(
        kind="magnitude",
        evidence=f"its unknowns are of size {found.unknowns:.1e}, the largest term of its {terms} is {found.terms:.1e}",
        numbers={"unknowns": found.unknowns, "terms": found.terms},
        without=trial,
        change=change,
        remedies=(Remedy(text=f"the same solver with {change}", trial=trial, back=found.back),),
    )
