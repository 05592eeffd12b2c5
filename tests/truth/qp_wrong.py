"""Answers to a QP that are wrong, made from a right one; wrong by measures that share nothing with the judge."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from qp_literature import Array, Reference, literature, misses, off, unknown_sizes

from cpbench.formulations.programs import QPPoint


def wrongness(problem: Any, point: Any, reference: Reference, sizes: Array) -> float:
    """Return the largest of: the objective's and a row's miss over their terms (rows of zeros aside), gradient and gap
    over the largest.

    Each is a number that any reader would call an error of that size, whatever the units of single rows.
    """
    numbers = literature(problem, point)
    primal = max(off(problem, point.z, reference), misses(problem, point.z, reference, sizes)[0])
    # forces of bounds that are given wrong are an error of the gradient; the gap is that of the other multipliers
    force = problem.Q @ point.z + problem.p - problem.A.T @ point.lam - problem.C.T @ point.mu
    gap = literature(problem, replace(point, nu=force))
    return max(primal, numbers.gradient_norm, min(gap.gap_terms, gap.gap))


def _moved(problem: Any, right: QPPoint, reference: Reference, sizes: Array, j: int, least: float) -> QPPoint | None:
    """Move z_j by doubled steps until the objective or a row is off by `least` of its terms."""
    for sign in (1.0, -1.0):
        step = sizes[j] * least / 4
        for _ in range(14):
            z = np.array(right.z)
            z[j] += sign * step
            if max(off(problem, z, reference), misses(problem, z, reference, sizes)[0]) >= least:
                return QPPoint(z=z, lam=right.lam, mu=right.mu, nu=right.nu)
            step *= 2.0
    return None


def wrong_answers(
    rng: np.random.Generator, problem: Any, right: QPPoint, reference: Reference, least: float, most: int
) -> Iterator[tuple[str, QPPoint]]:
    """Yield labelled answers that are wrong by at least `least`, up to `most` of each way to be wrong.

    One unknown moved; one multiplier zeroed; one multiplier of an inactive row, so that it is paid for nothing;
    all multipliers, or all unknowns, one percent larger.
    """
    sizes = unknown_sizes(problem, reference)

    def of(**parts: Array) -> QPPoint:
        return QPPoint(**{**right.arrays(), **parts})

    made: list[tuple[str, QPPoint | None]] = [
        (f"z_{j} moved", _moved(problem, right, reference, sizes, int(j), least))
        for j in rng.permutation(problem.p.size)[:most]
    ]
    for name in ("lam", "mu", "nu"):
        values = getattr(right, name)
        loaded = np.flatnonzero(np.abs(values) > 1e-6 * np.abs(values).max(initial=0.0))
        for i in rng.permutation(loaded)[:most]:
            changed = np.array(values)
            changed[i] = 0.0
            made.append((f"{name}_{i} zeroed", of(**{name: changed})))
    price = np.abs(right.lam).max(initial=0.0)
    idle = np.flatnonzero((problem.A @ right.z - problem.b > 1e-3 * np.abs(problem.b)) & (right.lam < 1e-9 * price))
    for i in rng.permutation(idle)[:most]:
        changed = np.array(right.lam)
        changed[i] = price
        made.append((f"lam_{i} of an inactive row", of(lam=changed)))
    made.append(("all z by 1.01", of(z=1.01 * right.z)))
    made.append(("all prices by 1.01", of(lam=1.01 * right.lam, mu=1.01 * right.mu, nu=1.01 * right.nu)))
    for label, point in made:
        if point is not None and wrongness(problem, point, reference, sizes) >= least:
            yield label, point
