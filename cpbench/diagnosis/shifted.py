"""The nearest simple problem whose matrix is regular, or definite: a multiple of the identity is added to it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench import matrices
from cpbench.diagnosis.attempts import SolverTrial
from cpbench.matrices import Matrix

MATRIX = {"lcp": "M", "relay": "M", "avi": "M", "mlcp": "A", "qp": "Q", "fc": "W"}
"""The matrix of each formulation that is shifted."""


def shifted(trial: SolverTrial, *, definite: bool = False) -> SolverTrial | None:
    """Return the trial on the problem with its matrix plus its mean size (with `definite` also its negative part).

    None for formulations without such a matrix.
    """
    problem: Any = trial.problem
    name = MATRIX.get(problem.node)
    if name is None or not getattr(problem, name).shape[0]:
        return None
    K: Matrix = getattr(problem, name)
    size = float(np.abs(K.diagonal()).mean()) or matrices.max_abs(K) or 1.0
    if definite:
        both: Any = K if problem.node != "mlcp" else matrices.block([[problem.A, problem.C], [problem.D, problem.B]])
        least = matrices.least_eigenvalue(both)
        size += max(-least, 0.0)
    changed = {name: _plus(K, size)}
    if definite and problem.node == "mlcp":
        changed["B"] = _plus(problem.B, size)
    return replace(trial, problem=replace(problem, **changed))


def _plus(K: Matrix, size: float) -> Matrix:
    n = K.shape[0]
    return sp.csr_array(K + size * sp.eye_array(n)) if matrices.is_sparse(K) else K + size * np.eye(n)
