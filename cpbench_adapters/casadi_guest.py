"""Base of the CasADi adapters: its licence and citation, its matrices, and how much it is given."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Matrix

CITATION = "Andersson et al., CasADi, Math. Prog. Comp. 11 (2019)"
LICENCE = "LGPL-3.0-or-later"
INSTALL = "pip install cpbench[casadi]"
UNKNOWNS = 4000
"""Most unknowns: the Jacobian is built as an expression and factorized by a sparse QR, which fills in."""


def too_large(n: int) -> str | None:
    """Return why a problem of n unknowns is too large, else None."""
    if n <= UNKNOWNS:
        return None
    return f"n = {n} unknowns: CasADi's expressions and sparse factors are given at most {UNKNOWNS}"


def as_dm(M: Matrix) -> Any:
    """Return a CasADi matrix, sparse where M is."""
    import casadi as ca

    return ca.DM(sp.csc_matrix(M)) if sp.issparse(M) else ca.DM(np.asarray(M))
