"""Two results files, or two builds in one, compared: `compare`, `compare_labels`, `confirmed`."""

from cpbench.analysis.comparison.confirmation import confirmed, to_repeat
from cpbench.analysis.comparison.gates import Verdict
from cpbench.analysis.comparison.verdicts import Comparison, Settings, Side, compare, compare_labels, equal_pairs

__all__ = [
    "Comparison",
    "Settings",
    "Side",
    "Verdict",
    "compare",
    "compare_labels",
    "confirmed",
    "equal_pairs",
    "to_repeat",
]
