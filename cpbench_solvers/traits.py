"""The traits that most methods share."""

from cpbench.solvers.base import Trait

ITERATIVE = frozenset({Trait.SPARSE, Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC})
"""Of methods that take sparse data and a start, record their iterates, and do the same every time."""
