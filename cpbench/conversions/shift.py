"""Effect of a moved origin on the accuracy: z = x + c, where c is a far bound or a solve with the constants.

Source rows Mz + q, target rows Mx + (q + Mc). An error of ε in a target row is one of its terms, |M||x| + |q + Mc|, and
at most |M||z| + |q| + 2|Mc|. The source has |M||z| + |q| to measure it by: where |q| is far below |Mc|, the terms
cancel, and an answer that is right to ε there may be off by ε (1 + 2|Mc|/|q|) here.
"""

from __future__ import annotations

import numpy as np

from cpbench.foundation.matrices import Vector

MOST = 1e4
"""The most that is asked for beyond the tolerance: methods of first order do not reach every factor."""


def amplification(moved: Vector, constants: Vector) -> float:
    """Return 1 + 2|Mc|/|q| in the row where it is least, MOST at most; 1 where no row has a constant.

    The row with the largest constant sets the size of the solution, and with it the terms of all others.

    >>> amplification(np.array([50.0, 0.0, 9.0]), np.array([1.0, 0.0, 9.0]))
    3.0
    """
    there = constants != 0.0
    ratios = np.abs(moved[there]) / np.abs(constants[there])
    return min(1.0 + 2.0 * float(ratios.min(initial=np.inf)), MOST) if there.any() else 1.0
