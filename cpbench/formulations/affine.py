"""Base of the nodes with one affine map z ↦ Mz + q: facts of M that conversions and solvers ask for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix


class _HasMap:
    """Declared by the nodes, in the order of their data."""

    M: Matrix


@dataclass(frozen=True, eq=False, kw_only=True)
class AffineProblem(_HasMap, Problem):
    """A problem in terms of Mz + q."""

    @cached_property
    def symmetric(self) -> bool:
        """M = Mᵀ (matrices.is_symmetric)."""
        return matrices.is_symmetric(self.M)

    @cached_property
    def monotone(self) -> bool:
        """M + Mᵀ positive semidefinite (matrices.is_psd): the solution set is convex, and not empty if feasible."""
        return matrices.is_psd(self.M)
