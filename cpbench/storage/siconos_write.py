"""Writing Siconos text with all digits, so that Siconos and we read back the very numbers."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from cpbench import matrices
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.formulations.lcp import LCP
from cpbench.formulations.mlcp import MLCP
from cpbench.matrices import Matrix, Vector


def write_lcp(p: LCP) -> str:
    """n, M, q."""
    n = p.q.size
    return f"{n}\n{text_matrix(p.M)}{text_rows(p.q, n or 1)}"


def write_mlcp(p: MLCP) -> str:
    """M with q, and A, B, C, D too where they are dense (Siconos' own solvers want both)."""
    n, m = p.a.size, p.b.size
    M, q = matrices.block([[p.A, p.C], [p.D, p.B]]), np.concatenate([p.a, p.b])
    dense = not matrices.is_sparse(M)
    ends = [0] + ([n] if n else []) + ([n + m] if m else [])
    kinds = (["0"] if n else []) + (["1"] if m else [])
    text = f"1\n{int(dense)}\n{n}\n{m}\n{' '.join(map(str, ends))} \n{' '.join(kinds)} \n{text_matrix(M)}"
    text += text_rows(q, n + m or 1)
    if dense:
        text += "".join(text_rows(matrices.dense(X).reshape(-1), X.shape[1] or 1) for X in (p.A, p.B, p.C, p.D))
        text += text_rows(p.a, n or 1) + text_rows(p.b, m or 1)
    return text


def write_fc(p: FrictionContact) -> str:
    """d, nc, M, q, mu."""
    return f"{p.dimension}\n{p.nc}\n{text_matrix(p.W)}{text_rows(p.q, p.q.size or 1)}{text_rows(p.mu, p.nc or 1)}"


def write_gfc(p: GlobalFrictionContact) -> str:
    """d, nc, M, H, q, b, mu."""
    vectors = "".join(text_rows(x, x.size or 1) for x in (p.f, p.w, p.mu))
    return f"{p.dimension}\n{p.nc}\n{text_matrix(p.M)}{text_matrix(p.H)}{vectors}"


def text_matrix(M: Matrix) -> str:
    """The matrix block of `M` with all its digits: dense, or a CSparse triplet."""
    rows, cols = M.shape
    if not matrices.is_sparse(M):
        body = text_rows(matrices.dense(M).T.reshape(-1), max(cols, 1))
        return f"0\n{rows}\n{cols}\n{rows}\t{cols}\n{body}"
    coo = sp.coo_array(M)
    entries = zip(coo.row.tolist(), coo.col.tolist(), coo.data.tolist(), strict=True)
    lines = "".join(f"    {i} {j} : {v!r}\n" for i, j, v in entries)
    heading = (
        f"CSparse triplet, written by cpbench\ntriplet: {rows}-by-{cols}, nzmax: {max(coo.nnz, 1)} nnz: {coo.nnz}\n"
    )
    return f"2\n{rows}\n{cols}\n1\n{heading}{lines}"


def text_rows(x: Vector, width: int) -> str:
    """Numbers with all their digits, `width` to a line."""
    words = list(map(repr, x.tolist()))
    return "".join(" ".join(words[k : k + width]) + "\n" for k in range(0, len(words), width))
