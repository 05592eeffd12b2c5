"""Two results files, or two builds in one, compared: `compare`, `compare_labels`."""

from cpbench.analysis.comparison.gates import PairVerdict
from cpbench.analysis.comparison.verdicts import (
    Comparison,
    ComparisonSide,
    Thresholds,
    compare,
    compare_labels,
    equal_pairs,
)

__all__ = [
    "Comparison",
    "ComparisonSide",
    "PairVerdict",
    "Thresholds",
    "compare",
    "compare_labels",
    "equal_pairs",
]
