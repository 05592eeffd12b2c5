"""The penalty ρ of ADMM, which follows the ratio of primal and dual residual, less often every time."""

from __future__ import annotations

import math
from dataclasses import dataclass

FIRST_REST = 20
"""Iterations with one ρ before it may change for the first time."""
UNBALANCED, LARGEST_CHANGE = 3.0, 30.0
"""ρ changes by a factor between these, or not at all."""
TINY = 1e-300
"""Keeps from dividing by nothing."""


@dataclass
class StepPenalty:
    """A penalty that balances the residuals.

    Attributes
    ----------
    rho : ρ. least, most : its bounds. longer : how much longer each new ρ must stay. balance : whether ρ changes.
    """

    rho: float
    least: float
    most: float
    longer: float
    balance: bool
    _rest: float = float(FIRST_REST)
    _since: int = 0

    def due(self) -> bool:
        """Count an iteration, and return whether ρ may change after it."""
        self._since += 1
        return self.balance and self._since >= self._rest

    def follow(self, primal: float, dual: float) -> float:
        """Multiply ρ by √(primal/dual), and return the old ρ over the new one, 1 where ρ stays.

        primal, dual : residuals, each relative to what it is made of (Wohlberg 2017, arXiv:1704.06209).
        """
        factor = math.sqrt(max(primal, TINY) / max(dual, TINY))
        factor = min(max(factor, 1.0 / LARGEST_CHANGE), LARGEST_CHANGE)
        rho = min(max(self.rho * factor, self.least), self.most)
        change = self.rho / rho
        if max(change, 1.0 / change) < UNBALANCED:
            return 1.0
        self.rho, self._rest, self._since = rho, self.longer * self._rest, 0
        return change
