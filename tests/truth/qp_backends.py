"""Answers of many kinds to convex QPs: iterates of three methods, and what nine solvers return at nine tolerances.

Iterates are read by ending a method after k iterations; the conversions of their multipliers to cpbench's signs are
written here, from the manuals of Clarabel, PIQP and OSQP. Other answers come through `cpbench.solve`.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import numpy as np
import osqp
import piqp
import scipy.sparse as sp

import cpbench
from cpbench.errors import CpbenchError
from cpbench.formulations.programs import QPPoint

NO_BOUND = 1e19
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
SOLVERS = ("auto-qp", "clarabel", "piqp", "proxqp", "osqp", "scs", "highs", "quadprog", "interior-point-qp")
EXACT = frozenset({"highs", "quadprog"})
"""Solvers that take no tolerance, or end at one answer: asked at three tolerances only."""

Labelled = tuple[str, QPPoint]


def _inequalities(problem: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the rows of Az ≥ b that have a right side, and the unknowns with a lower and with an upper bound."""
    return (
        np.flatnonzero(problem.b > -NO_BOUND),
        np.flatnonzero(problem.lb > -NO_BOUND),
        np.flatnonzero(problem.ub < NO_BOUND),
    )


def clarabel_answer(problem: Any, tolerance: float, iterations: int = 200, seconds: float = 5.0) -> tuple[QPPoint, str]:
    """Return Clarabel's answer with all its tolerances at `tolerance`, or its k-th iterate, and its status."""
    rows, lower, upper = _inequalities(problem)
    Q = sp.csc_matrix(sp.triu(sp.csc_matrix(problem.Q)))
    clarabel: Any = import_module("clarabel")  # a compiled module without types
    n, k = problem.p.size, problem.d.size
    eye = sp.eye_array(n, format="csr")
    A, C = sp.csr_array(problem.A), sp.csr_array(problem.C)
    G = sp.csc_matrix(sp.vstack([C, -A[rows], -eye[lower], eye[upper]]))
    h = np.concatenate([problem.d, -problem.b[rows], -problem.lb[lower], problem.ub[upper]])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    settings.max_iter, settings.time_limit = iterations, seconds
    cones = [clarabel.ZeroConeT(k), clarabel.NonnegativeConeT(G.shape[0] - k)]
    result = clarabel.DefaultSolver(Q, problem.p, G, h, cones, settings).solve()
    y = np.array(result.z)
    lam, nu, at = np.zeros(problem.b.size), np.zeros(n), k + rows.size
    lam[rows] = y[k:at]
    nu[lower] += y[at : at + lower.size]
    nu[upper] -= y[at + lower.size :]
    return QPPoint(z=np.array(result.x), lam=lam, mu=-y[:k], nu=nu), str(result.status)


def clarabel_iterates(problem: Any, seconds: float) -> Iterator[Labelled]:
    """Yield the iterates 1, 2, ... of Clarabel with its tolerances at 1e-12, until it ends or time is over."""
    start = time.perf_counter()
    for k in range(1, 80):
        point, status = clarabel_answer(problem, 1e-12, k)
        yield f"clarabel k={k}", point
        if status != "MaxIterations" or time.perf_counter() - start > seconds:
            break
    yield "clarabel 1e-12", clarabel_answer(problem, 1e-12)[0]


def piqp_iterates(problem: Any, seconds: float) -> Iterator[Labelled]:
    """Yield the iterates of PIQP with its tolerances at 1e-12."""
    start = time.perf_counter()
    h = np.where(problem.b > -NO_BOUND, problem.b, -np.inf)
    matrices = [sp.csc_matrix(m) for m in (problem.Q, problem.C, problem.A)]
    solver = piqp.SparseSolver()
    settings = solver.settings
    settings.eps_abs = settings.eps_duality_gap_abs = 1e-12
    settings.eps_rel = settings.eps_duality_gap_rel = 1e-12
    above = np.full(h.size, np.inf)
    solver.setup(matrices[0], problem.p, matrices[1], problem.d, matrices[2], h, above, problem.lb, problem.ub)
    for k in range(1, 100):
        settings.max_iter = k
        ended = solver.solve()
        r = solver.result
        point = QPPoint(z=r.x, lam=np.array(r.z_l) - r.z_u, mu=-np.array(r.y), nu=np.array(r.z_bl) - r.z_bu)
        yield f"piqp k={k}", point
        if ended != piqp.PIQP_MAX_ITER_REACHED or time.perf_counter() - start > seconds:
            return


def osqp_iterates(problem: Any, seconds: float) -> Iterator[Labelled]:
    """Yield OSQP's answer after 25, 50, 100, ... iterations of one run, that goes on where it stopped."""
    start = time.perf_counter()
    n, k, m = problem.p.size, problem.d.size, problem.b.size
    rows = sp.csc_matrix(sp.vstack([sp.csc_array(problem.C), sp.csc_array(problem.A), sp.eye_array(n, format="csc")]))
    low = np.concatenate([problem.d, np.where(problem.b > -NO_BOUND, problem.b, -np.inf), problem.lb])
    high = np.concatenate([problem.d, np.full(m, np.inf), problem.ub])
    solver = osqp.OSQP()
    Q = sp.csc_matrix(sp.triu(sp.csc_matrix(problem.Q)))
    solver.setup(Q, problem.p, rows, low, high, eps_abs=1e-12, eps_rel=1e-12, verbose=False, max_iter=25)
    done, step = 0, 25
    while time.perf_counter() - start < seconds and done < 30_000:
        result = solver.solve()
        done += step
        y = np.array(result.y)
        if result.x is None or not np.isfinite(np.array(result.x, float)).all():
            return
        point = QPPoint(z=np.array(result.x), lam=-y[k : k + m], mu=-y[:k], nu=-y[k + m :])
        yield f"osqp k={done}", point
        if result.info.status == "solved":
            return
        step = min(2 * step, 4000)
        solver.update_settings(max_iter=step)


def returned(problem: Any, seconds: float) -> Iterator[Labelled]:
    """Yield what solvers return at several tolerances; one that needed all its time is asked for no finer answer."""
    for name in SOLVERS:
        for tolerance in TOLERANCES[1::3] if name in EXACT else TOLERANCES:
            start = time.perf_counter()
            try:
                point = cpbench.solve(problem, name, tolerance=tolerance, seconds=seconds).point
            except CpbenchError:
                break
            if point is not None and point.finite:
                yield f"{name} {tolerance:.0e}", point
            if time.perf_counter() - start > 0.8 * seconds:
                break


def answers(problem: Any, seconds: float) -> Iterator[Labelled]:
    """Yield labelled answers to a convex QP. `seconds` : of each method's iterates, and a third of it of each solve."""
    ways: list[Callable[[Any, float], Iterator[Labelled]]] = [clarabel_iterates, piqp_iterates, osqp_iterates]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for way in ways:
            try:
                yield from (found for found in way(problem, seconds) if found[1].finite)
            except (ValueError, RuntimeError, osqp.OSQPException) as cause:  # a backend that refuses the problem
                print(f"    {way.__name__}: {cause}")
        yield from returned(problem, seconds / 3)
