"""Sizes that lie far apart, or far from one: tolerances of solvers are absolute, at least in part."""

from __future__ import annotations

import math
from dataclasses import replace

from cpbench.foundation.text import counted
from cpbench_lab.diagnosis.case import Cause, FailedTrial, Remedy
from cpbench_lab.diagnosis.even_masses import even_masses
from cpbench_lab.diagnosis.other_units import scaled, uniform

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
