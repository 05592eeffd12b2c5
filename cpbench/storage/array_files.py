"""Problems as named arrays in .npz, .mat, HDF5 and folders: one reader for all forms of `dialects`, and the .npz of
qpsolvers, which is written too."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.storage import array_problems, dialects
from cpbench.storage.array_containers import folder_files, headers, values
from cpbench.storage.arrays import npz_names
from cpbench.storage.base import Format, formats, no_member
from cpbench.storage.dialects import Dialect
from cpbench.storage.half_stored import Half
from cpbench.storage.named_arrays import NamedArrays, require_shapes, shapes_of

_LARGEST_DENSE = 50_000_000


class ArrayFile(Format):
    """Named arrays in a file or a folder; `dialect` is the form that they must have, None for that of their names."""

    suffixes = (".npz", ".mat")
    dialect: ClassVar[Dialect | None] = None

    def recognises(self, path: Path, head: bytes) -> bool:
        return False  # by its name alone: `arrays` chooses

    def load(self, path: Path, member: str) -> Problem:
        return self._read(path, member, None)

    def load_half(self, path: Path, member: str, half: Half) -> Problem:
        return self._read(path, member, half)

    def _read(self, path: Path, member: str, half: Half | None) -> Problem:
        no_member(path, member)
        entries = headers(path)
        dialect, _ = array_problems.choose(path, entries, self.dialect)
        require_shapes(path, dialect, entries)  # before the numbers are read
        arrays = NamedArrays(path, values(path, dialect.known()), half)
        return array_problems.problem(arrays, *array_problems.choose(path, shapes_of(arrays.values), self.dialect))

    def beside(self, path: Path) -> list[Path]:
        return list(folder_files(path).values()) if path.is_dir() else []


class Arrays(ArrayFile):
    """The form is chosen by the set of names."""

    name = "arrays"
    summary = "named arrays in .npz, .mat, HDF5 or a folder of .npy, .csv, .mtx: of cpbench's formulations or a package"

    def recognises(self, path: Path, head: bytes) -> bool:
        return head.startswith(b"PK") if path.suffix.lower() == ".npz" else path.suffix.lower() == ".mat"

    def in_folder(self, path: Path, head: bytes) -> bool:
        """Return whether to list the file; a .npz without all that some form needs is a matrix, or an answer."""
        if path.suffix.lower() != ".npz":
            return self.recognises(path, head)
        return head.startswith(b"PK") and dialects.has_needs(npz_names(path))


class QPNpz(ArrayFile):
    """The dense .npz of qpsolvers; what is absent is written as no rows and infinite bounds."""

    name = "qp-npz"
    summary = "QP in NumPy's .npz (P, q, G, h, A, b, lb, ub), qpsolvers"
    suffixes = (".npz",)
    writes = frozenset({"qp"})
    dialect = dialects.QPSOLVERS

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


class OSQPArrays(ArrayFile):
    """P, q, r, A, l, u, as Maros' and Meszaros' problems are kept for OSQP."""

    name = "qp-mat"
    summary = "QP in MATLAB 5 (P, q, r, A, l, u), Maros and Meszaros as OSQP keeps them"
    suffixes = (".mat",)
    dialect = dialects.OSQP


class QuadprogArrays(ArrayFile):
    """H, f, A, b, Aeq, beq, lb, ub."""

    name = "quadprog"
    summary = "QP with the names of MATLAB's quadprog (H, f, A, b, Aeq, beq, lb, ub)"
    dialect = dialects.QUADPROG


class CVXOPTArrays(ArrayFile):
    """P, q, G, h, A, b, dims."""

    name = "cvxopt"
    summary = "QP or cone QP with the names of CVXOPT's coneqp (P, q, G, h, A, b, dims)"
    dialect = dialects.CVXOPT


class BoxQPNpz(ArrayFile):
    """A box-constrained QP whose Hessian is stored by rows."""

    name = "box-qp-npz"
    summary = "QP with bounds in NumPy's .npz (CSR Hessian, q, l, u)"
    suffixes = (".npz",)
    dialect = dialects.BOX


class ContactBenchNpz(ArrayFile):
    """Frictional contact with the normal last."""

    name = "contactbench-npz"
    summary = "ContactBench's NumPy file: frictional contact, local (G, g, mus)"
    suffixes = (".npz",)
    dialect = dialects.CONTACTBENCH


class LeastSquaresArrays(ArrayFile):
    """A, b, and bounds lb, ub where there are any."""

    name = "least-squares"
    summary = "least squares min ½‖Ax − b‖² as arrays A, b, lb, ub: to be named, for a system Ax = b has the same names"
    dialect = dialects.LEAST_SQUARES


_NAMED = (QPNpz(), OSQPArrays(), QuadprogArrays(), CVXOPTArrays(), BoxQPNpz(), ContactBenchNpz(), LeastSquaresArrays())
for _format in (Arrays(), *_NAMED):
    formats.add(_format.name, _format)
