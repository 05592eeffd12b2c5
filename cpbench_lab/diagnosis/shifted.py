"""The nearest simple problem whose matrix is regular, definite or dominated by its diagonal, which is raised."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix
from cpbench_lab.diagnosis.attempts import SolverTrial


def principal(problem: Problem) -> str:
    """Return the name of the square matrix of the first rows, which is shifted here; "" where there is none."""
    _, sign, name, _ = problem.terms[0] if problem.terms else ("", 0, "", "")
    rows, columns = problem.shapes()[name] if sign == 1 and name in problem.shapes() else ("", "-")
    return name if rows == columns else ""


def shifted(trial: SolverTrial, *, definite: bool = False) -> SolverTrial | None:
    """Return the trial on the problem with its matrix plus its mean size (with `definite` also its negative part).

    None for formulations without such a matrix.
    """
    problem: Any = trial.problem
    name, K = _matrix(problem)
    if K is None:
        return None
    size = float(np.abs(K.diagonal()).mean()) or matrices.max_abs(K) or 1.0
    if definite:
        both: Any = K if problem.node != "mlcp" else matrices.block([[problem.A, problem.C], [problem.D, problem.B]])
        least = matrices.least_eigenvalue(both)
        size += max(-least, 0.0)
    changed = {name: matrices.with_diagonal(K, np.full(K.shape[0], size))}
    if definite and problem.node == "mlcp":
        changed["B"] = matrices.with_diagonal(problem.B, np.full(problem.b.size, size))
    return replace(trial, problem=replace(problem, **changed))


def dominated(trial: SolverTrial) -> SolverTrial | None:
    """Return the trial on the problem with the diagonal of its matrix raised to twice the other entries of its row.

    Sweeps over such a matrix contract, by half each. None for formulations without such a matrix.
    """
    problem: Any = trial.problem
    name, K = _matrix(problem)
    if K is None:
        return None
    diagonal = np.asarray(K.diagonal(), dtype=float)
    others = np.asarray(abs(sp.csr_array(K)).sum(axis=1), dtype=float).ravel() - np.abs(diagonal)
    raised = matrices.with_diagonal(K, np.maximum(2.0 * others - diagonal, 0.0))
    return replace(trial, problem=replace(problem, **{name: raised}))


def _matrix(problem: Problem) -> tuple[str, Matrix | None]:
    """Return the matrix that is shifted, by name; None where there is none, or no row of it."""
    name = principal(problem)
    K: Matrix | None = getattr(problem, name) if name else None
    return name, K if K is not None and K.shape[0] else None
