"""Quadratic programs in MATLAB and NumPy files.

.mat   P, q, r, A, l, u: min ½xᵀPx + qᵀx + r, l ≤ Ax ≤ u, sides from ±1e19 on are infinite (Maros and Meszaros, as OSQP
       keeps them: 1e20, or 1e20 after a scaling of the row)
.npz   P, q, G, h, A, b, lb, ub: Gx ≤ h, Ax = b, lb ≤ x ≤ ub (qpsolvers and qpbenchmark); None where a part is absent
.npz   data, indices, indptr, shape, q, l, u: min ½xᵀMx + qᵀx, l ≤ x ≤ u, M by rows (box-constrained QPs)
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench import matrices
from cpbench.errors import FormatError
from cpbench.formulations.base import Info, Problem
from cpbench.formulations.qp import QP
from cpbench.matrices import Matrix, Vector
from cpbench.storage.arrays import npz_names, npz_shapes, read_npz, sparse_from_parts
from cpbench.storage.base import Format, build, formats, no_member, stem
from cpbench.storage.trial import require_survivor

INFINITE = 1e19
_MAT_KEYS = ("P", "q", "r", "A", "l", "u")
_NPZ_KEYS = ("P", "q", "G", "h", "A", "b", "lb", "ub")
_BOX_KEYS = ("data", "indices", "indptr", "shape", "q", "l", "u")
_LARGEST_DENSE = 50_000_000


class QPMat(Format):
    """Two-sided rows become Az ≥ b (both sides where both are finite) and, where l = u, Cz = d.

    A row that is one variable with coefficient 1 becomes a bound of that variable (the last n rows of these
    files are the bounds). The constant r changes no solution: it is kept in `info.properties`.
    """

    name = "qp-mat"
    summary = "QP in MATLAB 5 (P, q, r, A, l, u), Maros and Meszaros"
    suffixes = (".mat",)

    def recognises(self, path: Path, head: bytes) -> bool:
        return path.suffix.lower() == ".mat"

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        found = _load_mat(path)
        n = found["q"].size
        A, lower, upper = found["A"], found["l"], found["u"]
        if found["P"].shape != (n, n):
            raise FormatError(
                path, "P", f"is {'x'.join(map(str, found['P'].shape))}, expected {n}x{n} (q has {n} numbers)"
            )
        for name, size in (("l", lower.size), ("u", upper.size)):
            if A.shape != (size, n):
                raise FormatError(
                    path, "A", f"is {'x'.join(map(str, A.shape))}, expected {size}x{n} ({name} has {size})"
                )
        parts = two_sided(path, matrices.sparse(sp.csr_array(A)), lower, upper)
        offset = float(found["r"][0]) if found["r"].size else 0.0
        info = Info(properties={"objective_offset": offset} if offset else {})
        return build(path, QP, "", name=stem(path), info=info, Q=sp.csr_array(found["P"]), p=found["q"], **parts)


def two_sided(path: Path, A: sp.csr_array, lower: Vector, upper: Vector) -> dict[str, Any]:
    """Return A, b, C, d, lb, ub of the QP with rows lower ≤ Az ≤ upper; raises FormatError on a row nothing can
    satisfy.
    """
    lower, upper = infinite(lower), infinite(upper)
    bad = np.flatnonzero(np.isnan(lower) | np.isnan(upper) | (lower > upper) | (lower == np.inf) | (upper == -np.inf))
    if bad.size:
        i = int(bad[0])
        raise FormatError(path, f"row {i} of A", f"has the limits l = {lower[i]:g}, u = {upper[i]:g}, expected l <= u")
    n = A.shape[1]
    lb, ub = np.full(n, -np.inf), np.full(n, np.inf)
    single = np.flatnonzero(np.diff(A.indptr) == 1)
    single = single[A.data[A.indptr[single]] == 1.0]
    variable = A.indices[A.indptr[single]]
    np.maximum.at(lb, variable, lower[single])
    np.minimum.at(ub, variable, upper[single])
    rest = np.setdiff1d(np.arange(A.shape[0]), single)
    equal = rest[lower[rest] == upper[rest]]
    other = rest[lower[rest] != upper[rest]]
    below, above = other[np.isfinite(lower[other])], other[np.isfinite(upper[other])]
    return {
        "A": sp.csr_array(sp.vstack([A[below], -A[above]], format="csr")),
        "b": np.concatenate([lower[below], -upper[above]]),
        "C": A[equal],
        "d": lower[equal],
        "lb": lb,
        "ub": ub,
    }


class QPNpz(Format):
    """The dense .npz of qpsolvers; what is absent is written as no rows and infinite bounds."""

    name = "qp-npz"
    summary = "QP in NumPy's .npz (P, q, G, h, A, b, lb, ub), qpsolvers"
    suffixes = (".npz",)
    writes = frozenset({"qp"})

    def recognises(self, path: Path, head: bytes) -> bool:
        return head.startswith(b"PK") and {"P", "q"} <= npz_names(path)

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        shapes = npz_shapes(path)
        size = max(shapes["q"], default=0)  # a vector, or a column
        if len(shapes["P"]) == 2 and shapes["P"] != (size, size):
            shown = "x".join(map(str, shapes["P"]))
            raise FormatError(path, "P", f"is {shown}, expected {size}x{size} (q has {size} numbers)")
        found = read_npz(path, optional=frozenset(_NPZ_KEYS[2:]))
        P, q = _matrix(path, found, "P", None), _vector(path, found, "q")
        n = q.size
        none: Matrix = np.zeros((0, n))
        G, A = _matrix(path, found, "G", none), _matrix(path, found, "A", none)
        h, b = _vector(path, found, "h", 0), _vector(path, found, "b", 0)
        if G.shape[0] != h.size:
            raise FormatError(path, "h", f"has {h.size} numbers, expected {G.shape[0]} as G has rows")
        h = infinite(h)
        kept = h != np.inf
        lb = infinite(_vector(path, found, "lb", n, -np.inf))
        ub = infinite(_vector(path, found, "ub", n, np.inf))
        parts = {"Q": P, "p": q, "A": -G[kept], "b": -h[kept], "C": A, "d": b, "lb": lb, "ub": ub}
        return build(path, QP, "", name=stem(path), **parts)

    def encode(self, problem: Any, *, compress: bool) -> bytes:
        n = problem.p.size
        size = n * (n + problem.b.size + problem.d.size)
        if size > _LARGEST_DENSE:
            raise FormatError(problem.name or "qp", "", f"is too large for a dense .npz ({size} numbers): use .h5")
        stream = io.BytesIO()
        (np.savez_compressed if compress else np.savez)(
            stream,
            P=matrices.dense(problem.Q),
            q=problem.p,
            G=-matrices.dense(problem.A),
            h=-problem.b,
            A=matrices.dense(problem.C),
            b=problem.d,
            lb=problem.lb,
            ub=problem.ub,
        )
        return stream.getvalue()


class BoxQPNpz(Format):
    """A box-constrained QP whose Hessian is stored by rows."""

    name = "box-qp-npz"
    summary = "QP with bounds in NumPy's .npz (CSR Hessian, q, l, u)"
    suffixes = (".npz",)

    def recognises(self, path: Path, head: bytes) -> bool:
        return head.startswith(b"PK") and set(_BOX_KEYS) <= npz_names(path)

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        found = read_npz(path)
        missing = [key for key in _BOX_KEYS if key not in found]
        if missing:
            raise FormatError(path, missing[0], f"is missing, expected {', '.join(_BOX_KEYS)}")
        M, q = sparse_from_parts(path, "", found), _vector(path, found, "q")
        bounds = {"lb": infinite(_vector(path, found, "l")), "ub": infinite(_vector(path, found, "u"))}
        none = sp.csr_array((0, q.size))
        parts = {"Q": M, "p": q, "A": none, "b": np.zeros(0), "C": none, "d": np.zeros(0), **bounds}
        return build(path, QP, "", name=stem(path), **parts)


def infinite(x: Vector) -> Vector:
    """Return sides with those of ±INFINITE and beyond made infinite."""
    return np.where(np.abs(x) >= INFINITE, np.copysign(np.inf, x), x)


def _load_mat(path: Path) -> dict[str, Any]:
    import scipy.io

    require_survivor(path, lambda: scipy.io.loadmat(path, variable_names=_MAT_KEYS), "SciPy's reader")
    try:
        found: dict[str, Any] = scipy.io.loadmat(path, variable_names=_MAT_KEYS)
    except NotImplementedError:
        raise FormatError(path, "", "is a MATLAB 7.3 file, expected one of version 5 (save -v7)") from None
    except Exception as cause:  # what SciPy's reader raises depends on where a broken file leads it
        raise FormatError(path, "", f"is not a readable MATLAB file ({str(cause).splitlines()[0][:100]})") from None
    for key in _MAT_KEYS:
        if key not in found and key != "r":
            raise FormatError(path, key, f"is missing, expected the variables {', '.join(_MAT_KEYS)}")
        value: Any = found.get(key, np.zeros(0))
        if value.dtype.kind not in "biuf" or (value.ndim != 2 and key != "r"):
            raise FormatError(path, key, f"holds {value.dtype}, expected a matrix of numbers")
        if sp.issparse(value):
            _require_indices(path, key, value)
        if key in ("P", "A"):
            found[key] = sp.csr_array(value).astype(np.float64)
        else:
            found[key] = np.asarray(matrices.dense(value), np.float64).reshape(-1)
    return found


def _require_indices(path: Path, key: str, value: Any) -> None:
    """Refuse indices outside the shape: SciPy's reader hands them over, and its conversions write wherever they
    point.
    """
    try:
        value.check_format(full_check=True)
    except ValueError as cause:
        raise FormatError(path, key, f"is a damaged sparse matrix ({cause})") from None


def _matrix(path: Path, found: dict[str, Any], name: str, default: Matrix | None) -> Any:
    if name not in found:
        if default is None:
            raise FormatError(path, name, "is missing")
        return default
    value = found[name]
    if value.dtype.kind not in "biuf" or value.ndim != 2:
        raise FormatError(path, name, f"holds {value.dtype} of shape {value.shape}, expected a matrix of numbers")
    return value.astype(np.float64)


def _vector(path: Path, found: dict[str, Any], name: str, size: int | None = None, fill: float = 0.0) -> Vector:
    """Return the vector `name`; when absent, `size` times `fill`. Raises FormatError."""
    if name not in found:
        if size is None:
            raise FormatError(path, name, "is missing")
        return np.full(size, fill)
    value = found[name]
    if value.dtype.kind not in "biuf" or value.size != max(value.shape, default=1):
        raise FormatError(path, name, f"holds {value.dtype} of shape {value.shape}, expected a vector of numbers")
    return value.astype(np.float64).reshape(-1)


formats.add("qp-mat", QPMat())
formats.add("qp-npz", QPNpz())
formats.add("box-qp-npz", BoxQPNpz())
