"""Check that a program or variational inequality with rows has no solution z in a box: a direction that every condition
allows that may bind there descends all over it, or some condition fails all over it."""

from __future__ import annotations

import math
from typing import Any

from certificate_file import exact, require
from flint import fmpq, fmpq_mat

INFINITE = 1e19


def descends(own: dict[str, Any], data: dict[str, Any], z: list[Any], radius: Any, evidence: dict[str, Any]) -> bool:
    """Return whether the box of this radius around z holds no solution, by the direction of the evidence."""
    M, q = (data["Q"], data["p"]) if own["node"] == "qp" else (data["M"], data["q"])
    n = len(z)
    rows = [*data["A"].rows, *data["C"].rows]
    low = [_finite(v) for v in data["b"].tolist()] + [exact(v) for v in data["d"].tolist()]
    high = [None] * data["b"].size + low[data["b"].size :]
    # bounds are rows of one entry
    rows += [{j: 1.0} for j in range(n)]
    low += [_finite(v) for v in data["lb"].tolist()]
    high += [_finite(v) for v in data["ub"].tolist()]
    d = _direction(rows[: len(rows) - n], n, evidence)
    for row, below, above in zip(rows, low, high, strict=True):
        value, reach, step = fmpq(0), fmpq(0), fmpq(0)
        for j, entry in row.items():
            value, reach, step = (
                value + exact(entry) * z[j],
                reach + abs(exact(entry)) * radius,
                step + exact(entry) * d[j],
            )
        if (below is not None and value + reach < below) or (above is not None and value - reach > above):
            return True
        # at a solution, a row at its lower side may grow only, one at its upper side may shrink only
        require(step >= 0 or below is None or value - reach > below, "the direction leaves a condition that may bind")
        require(step <= 0 or above is None or value + reach < above, "the direction leaves a condition that may bind")
    slope = [fmpq(0)] * n
    for i, row in enumerate(M.rows):
        for j, entry in row.items():
            slope[j] += exact(entry) * d[i]
    worst = sum((a * v + abs(a) * radius for a, v in zip(slope, z, strict=True)), fmpq(0))
    return worst + sum((exact(a) * v for a, v in zip(q.tolist(), d, strict=True)), fmpq(0)) < 0


def _finite(value: float) -> Any:
    return None if math.isinf(value) or abs(value) >= INFINITE else exact(value)


def _direction(rows: list[dict[int, float]], n: int, evidence: dict[str, Any]) -> list[Any]:
    """Return the direction: what is held, and what some rows that are 0 give."""
    held, used, solved = (evidence[f"direction{part}"].tolist() for part in ("", "_rows", "_columns"))
    require(
        len(held) == n and sorted(solved) == [j for j, v in enumerate(held) if v != v], "the direction is not whole"
    )
    require(len(used) == len(solved), "the rows do not belong to the unknowns")
    d = [exact(0.0 if v != v else v) for v in held]
    if used:
        left = [[exact(rows[i].get(j, 0.0)) for j in solved] for i in used]
        right = [[-sum((exact(v) * d[j] for j, v in rows[i].items()), fmpq(0))] for i in used]
        for j, v in zip(solved, fmpq_mat(left).solve(fmpq_mat(right)).entries(), strict=True):
            d[j] = v
    return d
