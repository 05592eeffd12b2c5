"""More contact reactions than the bodies determine."""

from __future__ import annotations

from cpbench.formulations.contact import ContactProblem
from cpbench_lab.diagnosis.case import Cause, FailedTrial
from cpbench_lab.diagnosis.shifted import shifted


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
