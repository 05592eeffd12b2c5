"""Check how many solutions a small LCP or MLCP has: the vertices of every complementary face are looked at.

A face takes xⱼ or wⱼ of each pair, Σ columns · y = −c, y ≥ 0 but for the free unknowns. It is their vertices and
directions: without a vertex it is empty, and with a direction, or two vertices, it is a continuum.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Any

from certificate_file import exact, require
from flint import fmpq, fmpq_mat
from polyhedral_proofs import mixed


def enumeration(own: dict[str, Any], data: dict[str, Any], evidence: dict[str, Any]) -> str:
    """Count the solutions again and say how many there are; '' where the file says nothing of it."""
    count = float(own["solutions"])
    if math.isnan(count):
        require("solutions" not in evidence and "endless" not in evidence, "solutions are listed and not counted")
        return ""
    require(own["node"] in ("lcp", "mlcp"), "solutions of others are not counted")
    K, c, lo, _, _ = mixed(own["node"], data)
    pairs = [j for j, low in enumerate(lo.tolist()) if low == 0.0]
    if math.isinf(count):
        states = evidence["endless"].tolist()
        require(len(states) == len(K) and count > 0, "the face has the wrong size")
        points, many = face(K, c, pairs, {j for j in pairs if states[j] == 0})
        require(bool(points) and many, "the face has no continuum of solutions")
        return "a continuum of solutions"
    found = set[tuple[float, ...]]()
    number = set[tuple[Any, ...]]()
    for chosen in itertools.product((False, True), repeat=len(pairs)):
        points, many = face(K, c, pairs, {j for j, basic in zip(pairs, chosen, strict=True) if basic})
        require(not many, "there is a continuum of solutions")
        number.update(tuple((int(v.p), int(v.q)) for v in x) for x in points)
    found = {tuple(p / q for p, q in x) for x in number}
    require(len(number) == count, f"there are {len(number)} solutions")
    require({tuple(x) for x in evidence["solutions"].tolist()} == found, "other solutions are listed")
    return f"{len(number)} solutions, all listed"


def face(K: list[dict[int, float]], c: Any, pairs: list[int], basic: set[int]) -> tuple[list[list[Any]], bool]:
    """Return the vertices of a face, and whether it has more than one point."""
    n = len(K)
    free = [j for j in range(n) if j not in pairs]
    used = [*free, *sorted(basic)]
    if used and fmpq_mat([[_entry(K, i, j, True) for j in used] for i in used]).det() != 0:
        return regular(K, c, used, len(free)), False
    unknowns = [*free, *pairs]
    A = [[_entry(K, i, j, j in basic or j in free) for j in unknowns] for i in range(n)]
    points: list[list[Any]] = []
    R, b, back = reduced(A, [-exact(float(v)) for v in c], len(free))
    if R is None:
        return [], False
    for y in vertices(R, b, len(pairs)):
        own = back(y)
        x = [fmpq(0)] * n
        for j, v in zip(unknowns, own, strict=True):
            x[j] = v if j in basic or j in free else fmpq(0)
        if x not in points:
            points.append(x)
    if not points or len(points) > 1:
        return points, bool(points)
    if free and fmpq_mat([row[: len(free)] for row in A]).rank() < len(free):
        return points, True
    away = [*R, [fmpq(1)] * len(pairs)]
    return points, any(True for _ in vertices(away, [fmpq(0)] * len(R) + [fmpq(1)], len(pairs)))


def regular(K: list[dict[int, float]], c: Any, used: list[int], free: int) -> list[list[Any]]:
    """Return the one point of a face whose basis is regular, if its signs are right."""
    n, right = len(K), [[-exact(float(c[i]))] for i in used]
    x = [fmpq(0)] * n
    for j, v in zip(
        used,
        fmpq_mat([[_entry(K, i, j, True) for j in used] for i in used]).solve(fmpq_mat(right)).entries(),
        strict=True,
    ):
        x[j] = v
    if any(x[j] < 0 for j in used[free:]):
        return []
    rows = (sum((exact(v) * x[j] for j, v in K[i].items()), exact(float(c[i]))) for i in range(n) if i not in used)
    return [x] if all(f >= 0 for f in rows) else []


def _entry(K: list[dict[int, float]], i: int, j: int, basic: bool) -> Any:
    return exact(K[i].get(j, 0.0)) if basic else fmpq(-1 if i == j else 0)


def reduced(A: Any, b: list[Any], free: int) -> tuple[Any, Any, Any]:
    """Return the equations on the unknowns y ≥ 0 alone, and the function from y to all; None where they contradict."""
    T, rank = fmpq_mat([[*row, side] for row, side in zip(A, b, strict=True)]).rref()
    rows = T.tolist()[: int(rank)]
    first = [next(k for k, v in enumerate(row) if v != 0) for row in rows]
    if first and first[-1] == len(A[0]):
        return None, None, None

    def back(y: list[Any]) -> list[Any]:
        x = [fmpq(0)] * free + y
        for row, k in zip(rows, first, strict=True):
            if k < free:
                x[k] = row[-1] - sum((v * w for v, w in zip(row[free:-1], y, strict=True)), fmpq(0))
        return x

    own = [row for row, k in zip(rows, first, strict=True) if k >= free]
    return [row[free:-1] for row in own], [row[-1] for row in own], back


def vertices(R: Any, b: Any, width: int) -> Iterator[list[Any]]:
    """Yield the nonnegative basic solutions of R y = b, those of several bases more than once."""
    if not R or not width:
        if not any(b):
            yield [fmpq(0)] * width
        return
    T, rank = fmpq_mat([[*row, side] for row, side in zip(R, b, strict=True)]).rref()
    rows = T.tolist()[: int(rank)]
    if not rows or not any(rows[-1][:-1]):
        if not rows:
            yield [fmpq(0)] * width
        return
    for some in itertools.combinations(range(width), len(rows)):
        try:
            found = fmpq_mat([[row[k] for k in some] for row in rows]).solve(fmpq_mat([[row[-1]] for row in rows]))
        except ZeroDivisionError:
            continue
        if all(v >= 0 for v in found.entries()):
            y = [fmpq(0)] * width
            for k, v in zip(some, found.entries(), strict=True):
                y[k] = v
            yield y
