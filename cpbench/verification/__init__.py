"""From an answer to a verdict and a status; knows no solver."""

from cpbench.verification.certificates import (
    SECONDS,
    Proof,
    ProofAttempt,
    certified_infeasible,
    holds,
    packed,
    prove,
    reach,
    unpacked,
)
from cpbench.verification.multipliers import COMPLETED, completed, marked, whole
from cpbench.verification.published import PublishedMeasure
from cpbench.verification.status import (
    CHARGED_TO_ROUTE,
    FALSE_CLAIMS,
    INACCURATE_FACTOR,
    MET_TOLERANCE,
    PROVEN,
    REFUSED,
    TARGET_UNRESOLVABLE,
    VERIFIED,
    Status,
    status,
)
from cpbench.verification.verdict import DIRECTION_DEGREES, Verdict, judge, judge_by_all, measured, no_answer

__all__ = [
    "CHARGED_TO_ROUTE",
    "COMPLETED",
    "DIRECTION_DEGREES",
    "FALSE_CLAIMS",
    "INACCURATE_FACTOR",
    "MET_TOLERANCE",
    "PROVEN",
    "REFUSED",
    "SECONDS",
    "TARGET_UNRESOLVABLE",
    "VERIFIED",
    "Proof",
    "ProofAttempt",
    "PublishedMeasure",
    "Status",
    "Verdict",
    "certified_infeasible",
    "completed",
    "holds",
    "judge",
    "judge_by_all",
    "marked",
    "measured",
    "no_answer",
    "packed",
    "prove",
    "reach",
    "status",
    "unpacked",
    "whole",
]
