"""Known solutions in exact arithmetic, by code that shares nothing with the residuals; and the properties as said."""

from __future__ import annotations

import dataclasses
import math
from fractions import Fraction

import generated
import numpy as np
import pytest
from tiers import some_by_day

from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone
from cpbench.generators import Instance
from cpbench.testing.checks_problem import KNOWN

LISTED = {f"{entry.family}-{entry.name}": entry for entry in generated.shipped(maps=False)}
SOLVED = [name for name, entry in LISTED.items() if entry.known in KNOWN and entry.known != "planted to rounding"]

Numbers = list[Fraction]


def _exact(vector: np.ndarray) -> Numbers:
    return [Fraction(float(x)) for x in vector]


def _times(M: matrices.Matrix, x: Numbers) -> Numbers:
    """Mx without rounding."""
    S = matrices.sparse(M)
    rows = zip(S.indptr[:-1], S.indptr[1:], strict=True)
    return [sum((Fraction(float(S.data[k])) * x[S.indices[k]] for k in range(a, b)), Fraction(0)) for a, b in rows]


def _sum(*terms: Numbers) -> Numbers:
    return [sum(row, Fraction(0)) for row in zip(*terms, strict=True)]


def _minus(x: Numbers) -> Numbers:
    return [-value for value in x]


def _complementary(x: Numbers, y: Numbers) -> bool:
    return all(a >= 0 and b >= 0 and a * b == 0 for a, b in zip(x, y, strict=True))


def _coulomb(r: Numbers, u: Numbers, mu: Numbers, d: int) -> bool:
    """Signorini and Coulomb in squares: ‖r_T‖ ≤ μ r_N; with u_T ≠ 0, equality and r_T against u_T."""
    for c, friction in enumerate(mu):
        (r_N, *r_T), (u_N, *u_T) = r[d * c : d * c + d], u[d * c : d * c + d]
        limit, held = (friction * r_N) ** 2, sum(x * x for x in r_T)
        speed, power = sum(x * x for x in u_T), sum(x * y for x, y in zip(r_T, u_T, strict=True))
        if not _complementary([r_N], [u_N]) or held > limit:
            return False
        if speed > 0 and not (held == limit and power <= 0 and power * power == held * speed):
            return False
    return True


def _square(x: Numbers) -> Fraction:
    return sum((a * a for a in x), Fraction(0))


def _held(part: Numbers, moved: Numbers, limit: Fraction) -> bool:
    """‖part‖ ≤ limit; where it moves, equality and part against the motion."""
    power = sum((a * b for a, b in zip(part, moved, strict=True)), Fraction(0))
    if _square(part) > limit**2:
        return False
    return not any(moved) or (
        _square(part) == limit**2 and power <= 0 and power * power == _square(part) * _square(moved)
    )


def _rolling(r: Numbers, u: Numbers, mu: Numbers, mu_r: Numbers, d: int) -> bool:
    k = (d - 1) // 2
    for c in range(len(mu)):
        (r_N, *R), (u_N, *U) = r[d * c : d * c + d], u[d * c : d * c + d]
        if not _complementary([r_N], [u_N]):
            return False
        if not (_held(R[:k], U[:k], mu[c] * r_N) and _held(R[k:], U[k:], mu_r[c] * r_N)):
            return False
    return True


def _root(square: Fraction) -> Fraction:
    """The square root, which is a fraction on these instances."""
    root = Fraction(math.isqrt(square.numerator), math.isqrt(square.denominator))
    assert root * root == square
    return root


def _boxed(z: np.ndarray, F: Numbers, lb: np.ndarray, ub: np.ndarray) -> bool:
    """lb ≤ z ≤ ub; F ≥ 0 unless z is at ub, F ≤ 0 unless at lb."""
    return all(
        lo <= x <= hi and (f <= 0 or x == lo) and (f >= 0 or x == hi) for x, f, lo, hi in zip(z, F, lb, ub, strict=True)
    )


def _normal_to(problem, s: Numbers, y: Numbers) -> bool:
    """−y ∈ N_K(s), factor by factor: s ∈ K, y ∈ K*, sᵀy = 0 (for the cylinder: a disk of given radius)."""
    at = 0
    for kind, size, mu, mu_r in zip(
        problem.cone_kind, problem.cone_size, _exact(problem.cone_mu), _exact(problem.cone_mu_r), strict=True
    ):
        x, w = s[at : at + int(size)], y[at : at + int(size)]
        at += int(size)
        k, work = (len(x) - 1) // 2, sum((a * b for a, b in zip(x, w, strict=True)), Fraction(0))
        match Cone(int(kind)):
            case Cone.ZERO:
                good = not any(x)
            case Cone.FREE:
                good = not any(w)
            case Cone.NONNEGATIVE:
                good = _complementary(x, w)
            case Cone.SECOND_ORDER:
                inside = x[0] >= 0 and _square(x[1:]) <= (mu * x[0]) ** 2
                good = inside and w[0] >= 0 and mu**2 * _square(w[1:]) <= w[0] ** 2 and work == 0
            case Cone.CYLINDER:
                good = _complementary([x[0]], [w[0]]) and _held(x[1:], w[1:], mu)
            case rolling:
                x, w = (x, w) if rolling is Cone.ROLLING else (w, x)
                inside = all(_square(part) <= (c * x[0]) ** 2 for part, c in ((x[1 : 1 + k], mu), (x[1 + k :], mu_r)))
                slides, rolls = _square(w[1 : 1 + k]), _square(w[1 + k :])
                dual = (not any(w)) or w[0] >= mu * _root(slides) + mu_r * _root(rolls)
                good = inside and x[0] >= 0 and dual and work == 0
        if not good:
            return False
    return True


def _solved(instance: Instance) -> bool:
    p, x = instance.problem, {k: _exact(v) for k, v in instance.solution.arrays().items()}
    data = {k: _exact(v) for k, v in p.data().items() if v.ndim == 1 and np.isfinite(v).all()}
    match p.node:
        case "lcp":
            return _complementary(x["z"], _sum(_times(p.M, x["z"]), data["q"]))
        case "mlcp":
            equality = _sum(_times(p.A, x["u"]), _times(p.C, x["v"]), data["a"])
            w = _sum(_times(p.D, x["u"]), _times(p.B, x["v"]), data["b"])
            return not any(equality) and _complementary(x["v"], w)
        case "qp":
            forces = [_minus(v) for v in (_times(p.A.T, x["lam"]), _times(p.C.T, x["mu"]), x["nu"])]
            stationarity = _sum(_times(p.Q, x["z"]), data["p"], *forces)
            slack = _sum(_times(p.A, x["z"]), _minus(data["b"]))
            held = _sum(_times(p.C, x["z"]), _minus(data["d"]))
            z, nu = instance.solution.z, instance.solution.nu
            box = (p.lb <= z) & (z <= p.ub) & ((nu <= 0) | (z == p.lb)) & ((nu >= 0) | (z == p.ub))
            return not any(stationarity) and _complementary(x["lam"], slack) and not any(held) and bool(box.all())
        case "relay":
            return _boxed(instance.solution.z, _sum(_times(p.M, x["z"]), data["q"]), p.lb, p.ub)
        case "avi":
            forces = [_minus(v) for v in (_times(p.A.T, x["lam"]), _times(p.C.T, x["mu"]))]
            F = _sum(_times(p.M, x["z"]), data["q"], *forces)
            slack = _sum(_times(p.A, x["z"]), _minus(data["b"]))
            held = _sum(_times(p.C, x["z"]), _minus(data["d"]))
            return _boxed(instance.solution.z, F, p.lb, p.ub) and _complementary(x["lam"], slack) and not any(held)
        case "soclcp":
            return _normal_to(p, x["x"], _sum(_times(p.M, x["x"]), data["q"]))
        case "coneqp":
            stationarity = _sum(_times(p.Q, x["x"]), data["p"], _minus(_times(p.A.T, x["y"])))
            return not any(stationarity) and _normal_to(p, _sum(_times(p.A, x["x"]), data["b"]), x["y"])
        case "fc":
            return _coulomb(x["r"], _sum(_times(p.W, x["r"]), data["q"]), data["mu"], p.dimension)
        case "afc":
            S = _exact(np.column_stack([np.ones(p.nc), p.friction]).ravel())
            r = [a / b for a, b in zip(x["r"], S, strict=True)]
            u = [a * b for a, b in zip(_sum(_times(p.W, x["r"]), data["q"]), S, strict=True)]
            return _coulomb(r, u, [Fraction(1)] * p.nc, 3)
        case "rfc":
            u = _sum(_times(p.W, x["r"]), data["q"])
            return _rolling(x["r"], u, data["mu"], data["mu_r"], p.dimension)
        case "fcm":
            drift = _sum(_times(p.V.T, x["r"]), _times(p.R, x["lam"]), data["s"])
            u = _sum(_times(p.W, x["r"]), _times(p.V, x["lam"]), data["q"])
            return not any(drift) and _coulomb(x["r"], u, data["mu"], p.dimension)
        case _:
            forces = [_minus(v) for v in (_times(p.H, x["r"]), _times(p.G, x["lam"]), data["f"])]
            dynamics = _sum(_times(p.M, x["v"]), *forces)
            joints = _sum(_times(p.G.T, x["v"]), data["b"])
            u = _sum(_times(p.H.T, x["v"]), data["w"])
            if any(dynamics) or any(joints):
                return False
            if p.node == "grfc":
                return _rolling(x["r"], u, data["mu"], data["mu_r"], p.dimension)
            return _coulomb(x["r"], u, data["mu"], p.dimension)


@pytest.mark.parametrize("name", some_by_day(SOLVED, 40))
def test_known_solutions_hold_without_any_rounding(name: str) -> None:
    assert _solved(generated.instance(LISTED[name]))


@pytest.mark.parametrize("name", some_by_day(SOLVED, 30))
def test_the_last_bit_of_a_solution_matters(name: str) -> None:
    """The exact test is no formality: the largest number of the answer, changed in its last bit, fails it."""
    instance = generated.instance(LISTED[name])
    part, value = max(instance.solution.arrays().items(), key=lambda item: matrices.max_abs(item[1]))
    changed = value.copy()
    at = int(np.abs(changed).argmax())
    changed[at] = np.nextafter(changed[at], np.inf)
    wrong = dataclasses.replace(instance.solution, **{part: changed})
    assert not _solved(dataclasses.replace(instance, solution=wrong))


def _matrix(instance: Instance) -> matrices.Matrix:
    p = instance.problem
    if p.node == "mlcp":
        return matrices.block([[p.A, p.C], [p.D, p.B]])
    names = {**dict.fromkeys(("qp", "coneqp"), "Q"), **dict.fromkeys(("fc", "fcm", "rfc", "afc"), "W")}
    return getattr(p, names.get(p.node, "M"))


@pytest.mark.parametrize("name", LISTED)
def test_properties_are_as_said(name: str) -> None:
    instance = generated.instance(LISTED[name])
    said, D = instance.properties, matrices.dense(_matrix(instance))
    kind = str(said.get("class", ""))
    least = float(np.linalg.eigvalsh((D + D.T) / 2)[0])
    noise = 1e-12 * max(1.0, float(np.abs(D).max()))
    if "symmetric" in said:
        assert bool((D == D.T).all()) == said["symmetric"]
    if "SPD" in kind:
        assert (D == D.T).all()
        assert least > 0
    if kind == "PD nonsymmetric":
        assert least > 0
        assert (D != D.T).any()
    if kind.startswith("PSD"):
        assert least >= -noise
        assert np.linalg.matrix_rank(D) < len(D) or "rank_A" in said
    if "M-matrix" in kind:
        off = D - np.diag(np.diag(D))
        assert (off <= 0).all()
        assert (np.linalg.inv(D) >= -noise).all()
    if kind == "P" and len(D) <= 12:
        minors = [D[np.ix_(s, s)] for s in _subsets(len(D))]
        assert min(np.linalg.det(m) for m in minors) > 0
    if kind == "LP":
        assert not D.any()
    if "rank" in said:
        assert np.linalg.matrix_rank(D) == said["rank"]
    if "rank_A" in said:
        assert np.linalg.matrix_rank(matrices.dense(instance.problem.A)) == said["rank_A"]


def _subsets(n: int) -> list[np.ndarray]:
    return [np.flatnonzero([(k >> i) & 1 for i in range(n)]) for k in range(1, 2**n)]
