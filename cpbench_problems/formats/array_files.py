"""Problems as named arrays in .npz, MATLAB's .mat and JSON, in all forms of `array_forms`, and the .npz of qpsolvers,
which is written too.

Each container first gives the names and shapes of its arrays, so that a file that does not fit is refused before its
numbers are read.
"""

from __future__ import annotations

import io
import json
import pickle
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.errors import FormatError
from cpbench.formulations import QP
from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.storage.arrays import first_line, npz_shapes, read_npz
from cpbench.storage.base import Format, formats, no_member, read_head, read_text
from cpbench_problems.formats import array_forms, array_problems
from cpbench_problems.formats.array_forms import ArrayForm
from cpbench_problems.formats.named_arrays import Shape, joined, joined_shapes, require_shapes, shapes_of
from cpbench_problems.formats.trial import require_survivor

_LARGEST_DENSE = 50_000_000
_SECONDS = 20.0
"""Processor time for a .mat: a damaged struct can declare more fields than SciPy ends with."""


class ArrayFile(Format):
    """Named arrays in a file; `form` is the one that they must have, None for that of their names."""

    suffixes = (".npz", ".mat", ".json")
    form: ClassVar[ArrayForm | None] = None

    def recognises(self, path: Path, head: bytes) -> bool:
        return False  # by its name alone: `arrays` chooses

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        entries = _headers(path)
        form, _ = array_problems.choose(path, entries, self.form)
        require_shapes(path, form, entries)  # before the numbers are read
        values = array_values(path, form.known())
        return array_problems.build_problem(path, values, *array_problems.choose(path, shapes_of(values), self.form))


class Arrays(ArrayFile):
    """The form is chosen by the set of names."""

    name = "arrays"
    summary = "named arrays in .npz, .mat or .json: of cpbench's formulations or a package"

    def recognises(self, path: Path, head: bytes) -> bool:
        suffix = path.suffix.lower()
        if suffix == ".npz":
            return head.startswith(b"PK")
        return suffix == ".mat" or (suffix == ".json" and not path.name.lower().endswith(".mof.json"))

    def in_folder(self, path: Path, head: bytes) -> bool:
        """Return whether to list the file; one without all that some form needs is a matrix, an answer or a text."""
        if path.suffix.lower() == ".mat" or not self.recognises(path, head):
            return self.recognises(path, head)
        try:
            return array_forms.has_needs(_headers(path))
        except FormatError:
            return False


class QPNpz(ArrayFile):
    """The dense .npz of qpsolvers; what is absent is written as no rows and infinite bounds."""

    name = "qp-npz"
    summary = "QP in NumPy's .npz (P, q, G, h, A, b, lb, ub), qpsolvers"
    suffixes = (".npz",)
    writes = frozenset({"qp"})
    form = array_forms.QPSOLVERS

    def encode(self, problem: Any, *, compress: bool) -> bytes:
        n = problem.p.size
        size = n * (n + problem.b.size + problem.d.size)
        if size > _LARGEST_DENSE:
            raise FormatError(problem.name or "qp", "", f"is too large for a dense .npz ({size} numbers): use .h5")
        stream = io.BytesIO()
        put = np.savez_compressed if compress else np.savez
        put(
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


def _headers(path: Path) -> dict[str, Shape | None]:
    """Return the names of the arrays of a file, with shapes, None for sparse ones; raises FormatError."""
    if path.suffix.lower() == ".npz":
        return joined_shapes(npz_shapes(path))
    if path.suffix.lower() == ".json":
        return {**shapes_of(_json_arrays(path))}

    import scipy.io  # a tenth of a second that other formats need not wait for

    def attempt() -> None:  # all that this process reads after it, in its order
        _mat_shapes(path)
        scipy.io.loadmat(path, spmatrix=False)

    read_head(path)
    require_survivor(path, attempt, "SciPy's reader", _SECONDS)
    return _mat_shapes(path)


def array_values(path: Path, optional: Collection[str] = ()) -> dict[str, Any]:
    """Read all arrays of a file; raises FormatError. `optional` ones that are None are left out."""
    if path.suffix.lower() == ".npz":
        return joined(path, read_npz(path, frozenset(optional), sparse_parts))
    if path.suffix.lower() == ".json":
        return _json_arrays(path)
    import scipy.io

    result: dict[str, Any] = {}
    for name, value in _guarded(path, lambda file: scipy.io.loadmat(file, spmatrix=False)).items():
        if name.startswith("__"):
            continue
        if sp.issparse(value):
            _require_indices(path, name, value)
            result[name] = sp.csr_array(value)
        elif value.dtype.names:
            result |= _struct(path, name, value)
        else:
            result[name] = value
    return result


def _json_arrays(path: Path) -> dict[str, Any]:
    """Return the lists of numbers of a JSON object by name, without those that are null; raises FormatError."""
    try:
        values = json.loads(read_text(path))
    except (ValueError, RecursionError) as cause:
        raise FormatError(path, "", f"is not readable JSON ({first_line(cause)})") from None
    if not isinstance(values, dict):
        raise FormatError(path, "", f"holds a {type(values).__name__}, expected an object of named arrays")
    result: dict[str, Any] = {}
    for name, value in values.items():
        try:
            if value is not None:
                result[name] = np.array(value, dtype=np.float64)
        except (ValueError, TypeError, OverflowError):
            raise FormatError(path, name, "is no number and no list of numbers") from None
    return result


def _mat_shapes(path: Path) -> dict[str, Shape | None]:
    import scipy.io

    result: dict[str, Shape | None] = {}
    for name, shape, kind in _guarded(path, scipy.io.whosmat):
        if kind == "struct":
            one = _guarded(path, lambda file, name=name: scipy.io.loadmat(file, spmatrix=False, variable_names=[name]))
            result |= dict.fromkeys(_struct(path, name, one[name]))
        else:
            result[name] = tuple(map(int, shape))
    return result


def _struct(path: Path, name: str, value: Any) -> dict[str, Any]:
    """Return the fields of a struct as NAME.field; raises FormatError where there are several structs."""
    if value.size != 1:
        raise FormatError(path, name, f"is a struct array of shape {value.shape}, expected one struct")
    return {f"{name}.{part}": np.asarray(value[part].item()) for part in value.dtype.names or ()}


def _guarded(path: Path, read: Callable[[Path], Any]) -> Any:
    """Return what a reader of SciPy finds; raises FormatError."""
    try:
        return read(path)
    except NotImplementedError:
        raise FormatError(path, "", "is a MATLAB 7.3 file, expected one of version 5 (save -v7)") from None
    except Exception as cause:  # what SciPy's reader raises depends on where a broken file leads it
        raise FormatError(path, "", f"is not a readable MATLAB file ({first_line(cause)})") from None


def _require_indices(path: Path, key: str, value: Any) -> None:
    """Refuse indices outside the shape: SciPy's reader hands them over, and its conversions write wherever they
    point.
    """
    try:
        value.check_format(full_check=True)
    except ValueError as cause:
        raise FormatError(path, key, f"is a damaged sparse matrix ({cause})") from None


def _named(form: ArrayForm) -> ArrayFile:
    """Return the format of one form, for files whose names fit several."""
    meaning = form.meaning.text if form.meaning else ", ".join(form.arrays)
    members = {"name": array_forms.format_name(form), "summary": f"arrays of {form.name}: {meaning}", "form": form}
    return type(f"{form.name}Arrays", (ArrayFile,), members)()


_FORMS = [*array_forms.FOREIGN[1:], array_forms.own(QP), array_forms.LEAST_SQUARES, array_forms.GAME]
for _format in (Arrays(), QPNpz(), *map(_named, _FORMS)):
    formats.add(_format.name, _format)


# ----------------------------------------------------------------------------------------------------- pickled matrices
# Sparse matrices that NumPy has written into an .npz as Python objects, as `qpsolvers.Problem.save` does.
#
# A pickle is a program. Here it is run with inert stand-ins for all that it names: nothing is imported or called, and
# what it would have made is read off the arguments. Only SciPy's CSC and CSR matrices of numbers come of it.

_KINDS = {"csc_matrix": "csc", "csc_array": "csc", "csr_matrix": "csr", "csr_array": "csr"}
_NUMBERS = ("f4", "f8", "i4", "i8")


class _StandIn:
    """Stand-in for what a pickle makes of a class or a function, with its arguments and its state."""

    args: tuple[Any, ...]
    state: Any = None

    def __new__(cls, *args: Any) -> _StandIn:
        instance = object.__new__(cls)
        instance.args = args
        return instance

    def __setstate__(self, state: Any) -> None:
        self.state = state


class _Inert(pickle.Unpickler):
    """An unpickler that imports nothing."""

    def find_class(self, module: str, name: str) -> type[_StandIn]:
        return type(name, (_StandIn,), {})


def sparse_parts(data: bytes) -> dict[str, Any] | None:
    """Return data, indices, indptr, shape and format of the one sparse matrix in a pickled array of objects; None where
    it holds something else."""
    try:
        (matrix,) = _Inert(io.BytesIO(data)).load().state[4]
        state = dict(matrix.state)
        parts = {name: _array(state[name]) for name in ("data", "indices", "indptr")}
        shape = np.array([int(size) for size in state["_shape"]])
    except Exception:  # a pickle that is none may end in any way
        return None
    kind = _KINDS.get(type(matrix).__name__)
    return None if kind is None else {**parts, "shape": shape, "format": np.array(kind.encode())}


def _array(matrix: Any) -> Any:
    """Return the array that `numpy._reconstruct` and a state stand for; raises what a wrong one leads to."""
    _, shape, kind, _, data = matrix.state
    (code, *_), order = kind.args, kind.state[1]
    if code not in _NUMBERS or len(shape) != 1:
        raise ValueError(f"{code} of shape {shape}")
    return np.frombuffer(data, np.dtype(order + code)).reshape(shape).copy()
