"""From an answer to a verdict and a status; knows no solver."""

from cpbench.verification.published import BESIDE, OPTIMALITY_GAP, beside
from cpbench.verification.status import (
    CHARGED_TO_ROUTE,
    CONTRADICTION,
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
from cpbench.verification.verdict import (
    DIRECTION_DEGREES,
    Verdict,
    error_text,
    judge,
    measured,
    no_answer,
)

__all__ = [
    "BESIDE",
    "CHARGED_TO_ROUTE",
    "CONTRADICTION",
    "DIRECTION_DEGREES",
    "FALSE_CLAIMS",
    "INACCURATE_FACTOR",
    "MET_TOLERANCE",
    "OPTIMALITY_GAP",
    "PROVEN",
    "REFUSED",
    "TARGET_UNRESOLVABLE",
    "VERIFIED",
    "Status",
    "Verdict",
    "beside",
    "error_text",
    "judge",
    "measured",
    "no_answer",
    "status",
]
