"""Two results files, or two builds in one, compared: `compare`, `compare_labels`."""

from cpbench.analysis.comparison.gates import Verdict
from cpbench.analysis.comparison.verdicts import Comparison, Settings, Side, compare, compare_labels, equal_pairs

__all__ = ["Comparison", "Settings", "Side", "Verdict", "compare", "compare_labels", "equal_pairs"]
