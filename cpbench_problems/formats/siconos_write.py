"""Writing Siconos text with all digits, so that Siconos and we read back the very numbers."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from cpbench.errors import FormatError
from cpbench.formulations.conic import SOCLCP
from cpbench.formulations.contact import ContactProblem, LocalContact
from cpbench.formulations.global_contact import GlobalContact
from cpbench.formulations.linear import AVI, LCP, MLCP, Relay
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone
from cpbench.foundation.matrices import Matrix, Vector


def write_lcp(p: LCP) -> str:
    """Write n, M, q."""
    n = p.q.size
    return f"{n}\n{text_matrix(p.M)}{text_rows(p.q, n or 1)}"


def write_mlcp(p: MLCP) -> str:
    """Write M with q, and A, B, C, D too where they are dense (Siconos' own solvers want both)."""
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


def write_avi(p: AVI) -> str:
    """Write n, M, q; refuse a set X, for which there is no place."""
    if not p.only_box or np.isfinite(p.lb).any() or np.isfinite(p.ub).any():
        raise FormatError(p.name or p.node, "", "has a set X: Siconos text has no place for it, .h5 has")
    n = p.q.size
    return f"{n}\n{text_matrix(p.M)}{text_rows(p.q, n or 1)}"


def write_relay(p: Relay) -> str:
    """Write n, M, q, lb, ub."""
    n = p.q.size
    return f"{n}\n{text_matrix(p.M)}{''.join(text_rows(x, n or 1) for x in (p.q, p.lb, p.ub))}"


def write_soclcp(p: SOCLCP) -> str:
    """Write n, nc, M, q, cone ends, tau; refuse cones that are not of second order."""
    other = (p.cone_kind != Cone.SECOND_ORDER) | ~np.isfinite(p.cone_mu)
    if other.any():
        i = int(np.flatnonzero(other)[0])
        kind = Cone(int(p.cone_kind[i])).name.lower()
        raise FormatError(
            p.name or p.node,
            f"cone_kind {i}",
            f"is {kind} with mu = {p.cone_mu[i]:g}: Siconos text has second-order cones with finite mu, .h5 has all",
        )
    n, nc = p.q.size, p.cone_size.size
    ends = " ".join(str(int(end)) for end in (0, *np.cumsum(p.cone_size)))
    return f"{n}\n{nc}\n{text_matrix(p.M)}{text_rows(p.q, n or 1)}{ends}\n{text_rows(p.cone_mu, nc or 1)}"


def write_fc(p: LocalContact) -> str:
    """Write d, nc, M, q, mu, and mu_r with rolling."""
    vectors = "".join(text_rows(x, x.size or 1) for x in (p.q, *_coefficients(p)))
    return f"{p.dimension}\n{p.nc}\n{text_matrix(p.W)}{vectors}"


def write_gfc(p: GlobalContact) -> str:
    """Write d, nc, M, H, q, b, mu, and mu_r with rolling; refuse joints, for which there is no place."""
    if p.b.size:
        raise FormatError(
            p.name or p.node, "G", f"has {p.b.size} bilateral constraints: Siconos text has no place for them, .h5 has"
        )
    vectors = "".join(text_rows(x, x.size or 1) for x in (p.f, p.w, *_coefficients(p)))
    return f"{p.dimension}\n{p.nc}\n{text_matrix(p.M)}{text_matrix(p.H)}{vectors}"


def _coefficients(p: ContactProblem) -> list[Vector]:
    return [getattr(p, name) for name in ("mu", "mu_r") if hasattr(p, name)]


def text_matrix(M: Matrix) -> str:
    """Write the matrix block of `M` with all its digits: dense, or a CSparse triplet."""
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
    """Write numbers with all their digits, `width` to a line."""
    words = list(map(repr, x.tolist()))
    return "".join(" ".join(words[k : k + width]) + "\n" for k in range(0, len(words), width))
