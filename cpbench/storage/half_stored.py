"""Symmetric matrices of which a file holds one half, as OSQP, Clarabel and SCS take them: refused, or completed."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp

from cpbench.errors import FormatError
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix

Half = Literal["upper", "lower"]


def whole(path: Path, name: str, M: Matrix, half: Half | None, *, symmetric: bool = True) -> Matrix:
    """Return a matrix of a file as it is meant.

    Parameters
    ----------
    half : the triangle that the file holds, as `--symmetric` says; None where nothing was said. symmetric : whether the
    formulation requires a symmetric matrix: one without entries in one triangle is then refused unless `half` is given.

    Raises FormatError; where `half` is given, also if there are other numbers in the other triangle than in this one.
    """
    if M.shape[0] != M.shape[1] or (half is None and not symmetric):
        return M
    entries = sp.coo_array(M)
    entries.eliminate_zeros()
    held = {"upper": bool((entries.row < entries.col).any()), "lower": bool((entries.row > entries.col).any())}
    if half is None:
        for full, empty in (("upper", "lower"), ("lower", "upper")):
            if held[full] and not held[empty]:
                text = f"is not symmetric: the {empty} triangle is empty; --symmetric {full} completes it"
                raise FormatError(path, name, text)
        return M
    other = "lower" if half == "upper" else "upper"
    if not held[other]:
        return _completed(M)
    if matrices.asymmetry(matrices.matrix(M)) == 0.0:
        return M
    if not held[half]:
        raise FormatError(path, name, f"has an empty {half} triangle: --symmetric {other} completes it")
    raise FormatError(
        path, name, f"has entries in both triangles and is not symmetric: --symmetric {half} is of halves"
    )


def _completed(M: Any) -> Any:
    """Return M + Mᵀ without twice the diagonal."""
    if matrices.is_sparse(M):
        return sp.csr_array(M + M.T - sp.diags_array(M.diagonal()))
    return M + M.T - np.diag(np.diag(M))
