"""Facts of a problem for conditions, measured by the referee of every problem and kept in the results.

Every problem of every run is measured, so that the cost is bounded: passes over the entries of the matrices, and one
dense decomposition where a side has at most `DENSE` rows. What would cost more is absent, and a condition that names
it does not hold. The *operator* of a problem is its square matrix: M, W, Q, or [[A, C], [D, B]] of an MLCP.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from cpbench.formulations import MLCP, NonlinearFrictionContact
from cpbench.formulations.base import Problem, formulations
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix

DENSE = 200
"""Rows of the largest matrix whose eigenvalues or singular values are computed: some milliseconds."""
TEXTS = ("node", "family", "name", "sequence")
GLOBAL = ("gfc", "grfc", "nfc")
"""Nodes whose n is the number of degrees of freedom, which local ones do not have."""
NUMBERS: Mapping[str, str] = {
    "unknowns": "numbers in an answer",
    "dimension": "rows of a contact",
    "ndof": "degrees of freedom (global contact problems)",
    "nnz": "nonzeros of all matrices",
    "entries": "entries of all matrices, zero or not",
    "density": "nnz / entries",
    "step": "in its sequence",
    "operations": "operations of the nonlinear maps",
    "asymmetry": "of the operator, largest |M_ij - M_ji| over max(√|M_ii M_jj|, |M_ij|, |M_ji|), 0 where symmetric",
    "dominant": "share of the operator's rows with M_ii >= sum of |M_ij|",
    "negative_couplings": "share of the operator's nonzeros off the diagonal that are negative (1: a Z-matrix)",
    "zero_diagonal": "share of the operator's diagonal that is zero",
    "negative_diagonal": "share of the operator's diagonal that is negative",
    "spread": "largest over least nonzero |M_ii|",
    "least_eigenvalue": f"of the operator's symmetric part, over max|M| (up to {DENSE} rows)",
    "rank": f"of the operator; of H in a global contact problem (up to {DENSE} rows or columns)",
    "deficiency": "rows or columns, whichever are fewer, less the rank",
    "condition": "largest singular value over the least that counts for the rank",
    "equalities": "equations beside the complementarity: rows of C and h, of A in an MLCP, bilateral constraints",
    "inequalities": "rows of Az >= b and of g(z) >= 0",
    "bounds": "finite bounds on single unknowns",
    "driven": "share of q that is negative, of its normal components in a contact problem: 0 is solved by z = 0",
    "mu_min": "least coefficient of friction",
    "mu_median": "median coefficient of friction",
    "mu_max": "largest coefficient of friction",
    "frictionless": "share of the contacts with no friction",
    "hyperstatic": "contact rows over the rank of W or H; over the degrees of freedom where that is too costly",
}
_OPERATORS = ("M", "W", "Q")


def features(problem: Problem) -> dict[str, float | str]:
    """Return the facts of a problem, all finite, with its sizes under their symbols.

    >>> from cpbench.formulations import LCP
    >>> found = features(LCP(M=[[2.0, 0], [1, 2]], q=[-1.0, 1]))
    >>> [round(found[name], 9) for name in ("density", "asymmetry", "dominant", "rank", "driven")]
    [0.75, 0.5, 1.0, 2.0, 0.5]
    """
    found: dict[str, float | str] = {"node": problem.node, "family": problem.info.family, "name": problem.name}
    sizes = problem.sizes()
    found |= {name: float(size) for name, size in sizes.items()}
    found["unknowns"] = float(sum(problem.point_sizes.values()))
    tables: list[Any] = [value for value in problem.data().values() if value.ndim == 2]
    nonzeros = sum(matrices.nnz(table) for table in tables)
    entries = sum(table.shape[0] * table.shape[1] for table in tables)
    found |= {"nnz": float(nonzeros), "entries": float(entries)}
    if entries:
        found["density"] = nonzeros / entries
    if problem.maps():
        found["operations"] = float(sum(F.operations for F in problem.maps().values()))
    if problem.node in GLOBAL:
        found["ndof"] = float(sizes["n"])
    dimension = getattr(problem, "dimension", None)
    if dimension is not None:
        found["dimension"] = float(dimension)
    sequence = getattr(problem, "sequence", None)
    if sequence is not None:
        found |= {"sequence": sequence.name, "step": float(sequence.step)}
    measured = {**_of_operator(problem), **_of_constraints(problem)}
    measured |= _of_contacts(problem, measured)
    return found | {name: float(value) for name, value in measured.items() if math.isfinite(value)}


def known() -> dict[str, type]:
    """Return the names and types of all facts, which a condition may name."""
    symbols = {
        symbol
        for formulation in formulations
        for data in fields(formulation)
        for symbol in data.metadata.get("shape") or data.metadata.get("map", ())
        if not symbol[0].isdigit()
    }
    return dict.fromkeys(TEXTS, str) | dict.fromkeys([*sorted(symbols), *NUMBERS], float)


def _of_operator(problem: Problem) -> dict[str, float]:
    """Return symmetry, signs and scales of the operator, and its spectrum, or that of H, where that is cheap."""
    M: Any
    if isinstance(problem, MLCP):
        M = matrices.block([[problem.A, problem.C], [problem.D, problem.B]])
    else:
        M = next((getattr(problem, name) for name in _OPERATORS if hasattr(problem, name)), None)
        if M is None:  # the operator is a nonlinear map
            return _singular(problem.H) if isinstance(problem, NonlinearFrictionContact) else {}
    n, top = M.shape[0], matrices.max_abs(M)
    if not n or top == 0.0:
        return {}
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is not finite, and left out
        diagonal = np.asarray(M.diagonal())
        size = np.abs(diagonal)
        apart = np.asarray(abs(M).sum(axis=1)).ravel() - size
        values = M.data if matrices.is_sparse(M) else M
        negative = int(np.count_nonzero(values < 0)) - int(np.count_nonzero(diagonal < 0))
        off = int(np.count_nonzero(values)) - int(np.count_nonzero(diagonal))
        result = {
            "asymmetry": matrices.asymmetry(M),
            "dominant": float(np.mean(diagonal >= apart)),
            "zero_diagonal": float(np.mean(size == 0)),
            "negative_diagonal": float(np.mean(diagonal < 0)),
        }
        if off:
            result["negative_couplings"] = negative / off
        if size.any():
            result["spread"] = float(size.max()) / float(size[size > 0].min())
        H: Any = getattr(problem, "H", None)
        if H is not None:
            return result | _singular(H)
        if n > DENSE:
            return result
        D = matrices.dense(M)
        S = 0.5 * D + 0.5 * D.T
        try:
            eigenvalues = np.linalg.eigvalsh(S)
            result["least_eigenvalue"] = float(eigenvalues[0]) / top
            symmetric = result["asymmetry"] <= matrices.SYMMETRY_TOLERANCE
            return result | (_ranked(np.abs(eigenvalues), D.shape) if symmetric else _singular(D))
        except np.linalg.LinAlgError:
            return result


def _singular(M: Matrix) -> dict[str, float]:
    """Return rank and condition by singular values, of a matrix with one side of at most DENSE."""
    if not 0 < min(M.shape) <= DENSE or max(M.shape) > 4 * DENSE:
        return {}
    try:
        return _ranked(np.linalg.svd(matrices.dense(M), compute_uv=False), M.shape)
    except np.linalg.LinAlgError:
        return {}


def _ranked(values: Any, shape: tuple[int, ...]) -> dict[str, float]:
    """Count the singular values above rounding, and return their ratio."""
    kept = values[values > max(shape) * float(np.finfo(float).eps) * values.max(initial=0.0)]
    found = {"rank": float(kept.size), "deficiency": float(min(shape) - kept.size)}
    return found | ({"condition": float(kept.max()) / float(kept.min())} if kept.size else {})


def _of_constraints(problem: Problem) -> dict[str, float]:
    """Return sizes beside the complementarity conditions, and the share of q that excludes the answer 0."""
    sizes = problem.sizes()
    result: dict[str, float] = {}
    if isinstance(problem, MLCP):
        result["equalities"] = sizes["n"]
    elif problem.node in ("qp", "avi", "nlp"):
        result |= {"equalities": sizes["k"], "inequalities": sizes["m"]}
    elif problem.node in ("vi", "cp", "qvi"):
        result |= {"equalities": sizes.get("k", 0), "inequalities": sizes.get("m", 0) + sizes.get("p", 0)}
    elif "p" in sizes:
        result["equalities"] = sizes["p"]
    bounds: list[Any] = [getattr(problem, name) for name in ("lb", "ub") if hasattr(problem, name)]
    if bounds:
        result["bounds"] = sum(int(np.isfinite(bound).sum()) for bound in bounds)
    q: Any = getattr(problem, "b" if isinstance(problem, MLCP) else "q", None)
    if q is not None and problem.node not in ("avi", "relay", "soclcp"):
        components = q[:: getattr(problem, "dimension", 1)]  # normal first in every contact
        if components.size:
            result["driven"] = float(np.mean(components < 0))
    return result


def _of_contacts(problem: Problem, measured: Mapping[str, float]) -> dict[str, float]:
    """Return facts of friction, and the ratio of reactions to degrees of freedom."""
    nc = problem.sizes().get("nc", 0)
    if not nc:
        return {}
    mu = matrices.dense(getattr(problem, "mu")).reshape(nc, -1)  # noqa: B009
    found = {
        "mu_min": float(mu.min()),
        "mu_median": float(np.median(mu)),
        "mu_max": float(mu.max()),
        "frictionless": float(np.mean((mu == 0).all(axis=1))),
    }
    able = measured.get("rank") or (problem.sizes()["n"] if problem.node in GLOBAL else 0)
    return found | ({"hyperstatic": problem.sizes()["m"] / able} if able else {})
