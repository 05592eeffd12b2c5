"""Check a proof by an exact point: solve for it again, and check every condition over the rationals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from certificate_file import Matrix, exact, require
from flint import fmpq, fmpq_mat
from large_systems import large_system
from matrix_facts import convex, unique

INFINITE = 1e19
LARGEST = 200
"""Rows of the largest system that FLINT solves as a dense one."""
OVER_BOXES = ("lcp", "relay", "mlcp", "avi", "qp")


def put(K: list[dict[int, float]], row: int, column: int, block: Matrix, sign: float = 1.0) -> None:
    """Write a block into K, where nothing may stand yet."""
    for i, entries in enumerate(block.rows):
        for j, value in entries.items():
            require(column + j not in K[row + i], "two blocks overlap")
            K[row + i][column + j] = sign * value


def mixed(node: str, d: dict[str, Any]) -> tuple[list[dict[int, float]], Any, Any, Any, list[list[int]]]:
    """K, c, lo, hi of the mixed problem, and what of x each compared unknown is: a list of ±(j + 1)."""
    inf = math.inf
    if node in ("lcp", "relay"):
        n = d["q"].size
        lo, hi = (d["lb"], d["ub"]) if node == "relay" else (np.zeros(n), np.full(n, inf))
        return d["M"].rows, d["q"], lo, hi, [[j + 1] for j in range(n)]
    if node == "mlcp":
        n, N = d["a"].size, d["a"].size + d["b"].size
        K: list[dict[int, float]] = [{} for _ in range(N)]
        for name, i, j in (("A", 0, 0), ("C", 0, n), ("D", n, 0), ("B", n, n)):
            put(K, i, j, d[name])
        lo = np.where(np.arange(N) < n, -inf, 0.0)
        return K, np.concatenate([d["a"], d["b"]]), lo, np.full(N, inf), [[j + 1] for j in range(N)]
    if node in ("avi", "qp"):
        M, q = (d["M"], d["q"]) if node == "avi" else (d["Q"], d["p"])
        n, m, k = q.size, d["b"].size, d["d"].size
        K = [{} for _ in range(n + m + k)]
        for i, j, block, sign in ((0, 0, M, 1), (0, n, d["A"].T, -1), (0, n + m, d["C"].T, -1), (n, 0, d["A"], 1)):
            put(K, i, j, block, sign)
        put(K, n + m, 0, d["C"])
        there = d["b"] > -INFINITE
        lo = np.concatenate([d["lb"], np.zeros(m), np.full(k, -inf)])
        hi = np.concatenate([d["ub"], np.where(there, inf, 0.0), np.full(k, inf)])
        return K, np.concatenate([q, np.where(there, -d["b"], 0.0), -d["d"]]), lo, hi, [[j + 1] for j in range(n)]
    return contact(node, d)


def contact(node: str, d: dict[str, Any]) -> tuple[list[dict[int, float]], Any, Any, Any, list[list[int]]]:
    """Free unknowns y, then for every contact in the plane (r_N, β₁, β₂, ξ), r_T = β₁ − β₂; without friction r."""
    mu, inf, q = d["mu"], math.inf, d["w"] if node == "gfc" else d["q"]
    plane = q.size == 2 * mu.size
    require(plane or not mu.any(), "contacts in space with friction are no polyhedral problem")
    if node == "gfc":
        n, first = d["f"].size, np.concatenate([-d["f"], d["b"]])
        y = first.size
        own = [(0, 0, d["M"], 1), (0, n, d["G"], -1), (n, 0, d["G"].T, 1), (0, y, d["H"], -1), (y, 0, d["H"].T, 1)]
    elif node == "fcm":
        first, y = d["s"], d["s"].size
        own = [(0, 0, d["R"], 1), (0, y, d["V"].T, 1), (y, 0, d["V"], 1), (y, y, d["W"], 1)]
    else:
        first, y, own = np.zeros(0), 0, [(0, 0, d["W"], 1)]
    L: list[dict[int, float]] = [{} for _ in range(y + q.size)]
    for i, j, block, sign in own:
        put(L, i, j, block, sign)
    step = 4 if plane else 3
    places = [[(i, 1)] for i in range(y)]
    for c in range(mu.size):
        at = y + step * c
        places += [[(at, 1)], [(at + 1, 1), (at + 2, -1)]] if plane else [[(at, 1)], [(at + 1, 1)], [(at + 2, 1)]]
    K: list[dict[int, float]] = [{} for _ in range(y + step * mu.size)]
    c, lo, hi = np.zeros(len(K)), np.zeros(len(K)), np.full(len(K), inf)
    lo[:y] = -inf
    for i, value in enumerate(np.concatenate([first, q]).tolist()):
        for at, sign in places[i]:
            c[at] = sign * value
            K[at] = {to: sign * other * v for j, v in L[i].items() for to, other in places[j]}
    for k in range(mu.size if plane else 0):
        at = y + 4 * k
        K[at + 1][at + 3] = K[at + 2][at + 3] = 1.0
        K[at + 3] = {at: float(mu[k]), at + 1: -1.0, at + 2: -1.0}
    if not plane:
        hi[[y + i for i in range(q.size) if i % 3]] = 0.0
    return K, c, lo, hi, [[sign * (at + 1) for at, sign in place] for place in places[y:]]


def solved(K: list[dict[int, float]], c: Any, evidence: dict[str, Any]) -> list[Any]:
    """Return the exact point: what is held, and the solutions of the blocks, one after the other."""
    held, rows, columns = (evidence[name].tolist() for name in ("held", "rows", "columns"))
    require(len(held) == len(K) and sorted(columns) == [j for j, v in enumerate(held) if v != v], "wrong support")
    require(len(rows) == len(columns) == len(set(rows)), "the equations do not belong to the unknowns")
    x = [exact(0.0 if v != v else v) for v in held]
    start = 0
    for end in evidence["ends"].tolist():
        own, unknown = rows[start:end], {j: k for k, j in enumerate(columns[start:end])}
        A, b = [], []
        for i in own:
            A.append({unknown[j]: v for j, v in K[i].items() if j in unknown})
            b.append(-exact(c[i]) - sum((exact(v) * x[j] for j, v in K[i].items() if j not in unknown), fmpq(0)))
        for j, value in zip(unknown, system(A, b), strict=True):
            x[j] = value
        start = end
    require(start == len(rows), "some unknowns are not solved for")
    return x


def system(A: list[dict[int, float]], b: list[Any]) -> list[Any]:
    """Return the exact solution of a square system."""
    if len(A) > LARGEST:
        return large_system(A, b)
    dense = fmpq_mat([[exact(row.get(j, 0.0)) for j in range(len(A))] for row in A])
    return dense.solve(fmpq_mat([[v] for v in b])).entries()


def polyhedral(own: dict[str, Any], data: dict[str, Any], answer: Any, evidence: dict[str, Any]) -> None:
    """Solve for the exact point, check all conditions and the distance."""
    node = own["node"]
    K, c, lo, hi, compared = mixed(node, data)
    x = solved(K, c, evidence)
    common = 1
    for value in x:
        common = common * int(value.q) // math.gcd(common, int(value.q))
    whole = [int(value.p) * (common // int(value.q)) for value in x]  # sums of integers are faster than of fractions
    for i, value in enumerate(x):
        low, high = (None if math.isinf(v) or abs(v) >= INFINITE else exact(v) for v in (lo[i], hi[i]))
        require((low is None or value >= low) and (high is None or value <= high), f"unknown {i} is out of its bounds")
        if low is not None and low == high:
            continue
        units = [v.as_integer_ratio() for v in (float(c[i]), *map(float, K[i].values()))]
        unit = max(q for _, q in units)
        terms = zip((common, *(whole[j] for j in K[i])), units, strict=True)
        f = sum(a * p * (unit // q) for a, (p, q) in terms)
        require(f == 0 or (f > 0 and value == low) or (f < 0 and value == high), f"row {i} has the wrong sign")
    there = [sum(((1 if k > 0 else -1) * x[abs(k) - 1] for k in part), fmpq(0)) for part in compared]
    start = data["f"].size if node == "gfc" else 0  # the answer has v before r there
    here = [exact(v) for v in answer[start : start + len(there)].tolist()]
    first = data["a"].size if node == "mlcp" else 0  # u and v have a size each
    whole_size = max(map(abs, there), default=fmpq(0)) or fmpq(1)
    for part in (slice(0, first), slice(first, None)):
        size = max(map(abs, there[part]), default=fmpq(0)) or whole_size
        away = max((abs(a - b) for a, b in zip(there[part], here[part], strict=True)), default=fmpq(0))
        require(away / size <= exact(own["distance"]), "the answer is farther from the exact point")
    rows = node in ("avi", "qp") and len(x) > len(compared)
    fact = own["unique"]
    require(not fact or node in OVER_BOXES, "uniqueness is not known of this formulation")
    require(not (rows and fact == "P-matrix"), "a P-matrix makes solutions unique over boxes only")
    only = fact == "enumeration" and own["solutions"] == 1  # the number is checked apart
    require(not fact or only or unique(fact, K, len(compared)), "the solution is not shown to be unique")
    if node == "qp":
        z, p = x[: len(compared)], [exact(v) for v in data["p"].tolist()]
        square = sum((exact(v) * z[i] * z[j] for i, row in enumerate(data["Q"].rows) for j, v in row.items()), fmpq(0))
        value = square / 2 + sum((a * b for a, b in zip(p, z, strict=True)), fmpq(0))
        require(exact(own["value_low"]) <= value <= exact(own["value_high"]), "the objective has another value")
        require(not own["convex"] or convex(data["Q"].rows), "the program is not shown to be convex")
