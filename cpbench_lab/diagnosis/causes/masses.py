"""Masses that lie far apart: a contact carries, or is pressed by, much more than it moves by itself."""

from __future__ import annotations

from dataclasses import replace

from cpbench.foundation.plurals import counted
from cpbench_lab.diagnosis.case import Cause, FailedTrial
from cpbench_lab.diagnosis.even_masses import even_masses

APART = 100.0
"""Ratio of masses for a trial to be worth it. Even bodies have gaps, too: a slender stack of them bends as a
cantilever, whose first two eigenvalues are (4.694/1.875)⁴ = 39 apart; nothing even is known to have a wider one."""


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
