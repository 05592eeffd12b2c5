"""Check that a box around an answer holds no solution: some condition is contradicted at every point of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from ball_proofs import ContactEquations
from certificate_file import exact, require
from directions import INFINITE, descends
from flint import arb
from map_values import DualBall, duals
from polyhedral_proofs import mixed

INF = float("inf")


def refutation(own: dict[str, Any], data: dict[str, Any], answer: Any, evidence: dict[str, Any]) -> None:
    """Raise ValueError unless no solution is within `excluded` of the answer, over its size."""
    node = own["node"]
    if node in ("qp", "avi"):
        n, m, k = data["lb"].size, data["b"].size, data["d"].size
        lam = np.where(data["b"] > -INFINITE, answer[n : n + m], 0.0)
        whole = np.concatenate([answer[:n], lam, answer[n + m : n + m + k]])
        answer = answer[:n] if "direction" in evidence else whole
    size = float(np.abs(answer).max(initial=0.0)) or 1.0
    if "direction" in evidence:
        require(node in ("qp", "avi"), "directions refute programs and variational inequalities with rows")
        own_radius = exact(size) * exact(own["excluded"])
        require(descends(own, data, [exact(v) for v in answer.tolist()], own_radius, evidence), "nothing descends")
        return
    box = [arb(v) + arb(0, size * own["excluded"]) for v in answer.tolist()]
    if node in ("fc", "fcm", "gfc"):
        k = data["f"].size if node == "gfc" else 0
        n = data["mu"].size * (data["w" if node == "gfc" else "q"].size // data["mu"].size)
        # (v, r, λ) and (r, λ) of the file are (v, λ, r) and (λ, r) here
        scene = ContactEquations(node, data)
        none = contradicted(scene, [*box[:k], *box[k + n :], *box[k : k + n]])
    elif "F" in data:
        n = answer.size
        lo, hi = {"ncp": (np.zeros(n), [INF] * n), "equation": ([-INF] * n, [INF] * n)}.get(node, (None, None))
        lo, hi = (lo, hi) if lo is not None else (data["lb"], data["ub"])
        none = misses([d.v for d in duals(data["F"], [DualBall(v, {}) for v in box])], box, lo, hi)
    else:
        K, c, lo, hi, _ = mixed(node, data)
        rows = [sum((box[j] * arb(v) for j, v in row.items()), arb(float(q))) for row, q in zip(K, c, strict=True)]
        none = misses(rows, box, lo, hi)
    require(none, "a solution may be as near to the answer as is denied")


def misses(f: list[Any], box: list[Any], lo: Any, hi: Any) -> bool:
    """Return whether some unknown cannot be where its row wants it."""
    for v, row, low, high in zip(box, f, map(float, lo), map(float, hi), strict=True):
        if v < low or v > high or (low < high and ((row > 0 and v > low) or (row < 0 and v < high))):
            return True
    return False


def contradicted(scene: ContactEquations, x: list[Any]) -> bool:
    """Return whether some equation or contact cannot hold."""
    equations, u = scene.apply(x, arb)
    if any(row > 0 or row < 0 for row in equations):
        return True
    d = len(u) // len(scene.mu)
    for c, mu in enumerate(map(arb, scene.mu)):
        (u_N, *u_T), (r_N, *r_T) = u[d * c : d * c + d], x[scene.k + d * c : scene.k + d * c + d]
        rub, slip = (sum((v * v for v in part), arb(0)) for part in (r_T, u_T))
        if u_N < 0 or r_N < 0 or (u_N > 0 and any(v > 0 or v < 0 for v in (r_N, *r_T))) or rub > mu * mu * r_N * r_N:
            return True
        speed = slip.sqrt() if slip > 0 else arb(0)
        if slip > 0 and any(v > 0 or v < 0 for v in (speed * a + mu * r_N * b for a, b in zip(r_T, u_T, strict=True))):
            return True
    return False
