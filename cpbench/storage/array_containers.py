"""Where named arrays are kept: .npz, MATLAB's .mat, HDF5 without a problem of cpbench, and a folder of files.

Each container first gives the names and shapes of its arrays, so that a file that does not fit is refused before its
numbers are read.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import FormatError
from cpbench.storage import dialects
from cpbench.storage.arrays import first_line, npz_shapes, read_array, read_npz
from cpbench.storage.base import read_head
from cpbench.storage.hdf5_tree import Tree, open_tree
from cpbench.storage.named_arrays import SPARSE, Shape, joined, sparse_names
from cpbench.storage.trial import require_survivor

FOLDER_SUFFIXES = (".npy", ".csv", ".mtx")
"""Files that are arrays of a folder, whatever their name; others are only refused where they have the name of one."""
_ALSO = (".npz", ".txt", ".mat", ".dat", ".tsv")


_SECONDS = 20.0
"""Processor time for a .mat: a damaged struct can declare more fields than SciPy ends with."""
Headers = dict[str, Shape | None]
"""Names with shapes; None where a shape is known only when the numbers are read."""


def headers(path: Path) -> Headers:
    """Return the names of the arrays of a file or folder, with shapes; raises FormatError."""
    if path.is_dir():
        return dict.fromkeys(folder_files(path))
    suffix = path.suffix.lower()
    if suffix == ".npz":
        result: Headers = dict(npz_shapes(path))
        for name in sparse_names(result):
            for part in SPARSE:
                del result[f"{name}.{part}"]
            result[name] = None
        return result
    if suffix == ".mat":
        return _mat_headers(path)
    with open_tree(path) as root:
        return dict.fromkeys(tree_names(root))


def values(path: Path, optional: Collection[str]) -> dict[str, Any]:
    """Read all arrays of a file or folder; raises FormatError. `optional` ones that are None are left out."""
    if path.is_dir():
        return joined(path, {name: read_array(file) for name, file in folder_files(path).items()})
    suffix = path.suffix.lower()
    if suffix == ".npz":
        return joined(path, read_npz(path, optional=frozenset(optional)))
    if suffix == ".mat":
        return _mat_values(path)
    with open_tree(path) as root:
        return tree_values(root)


# ---------------------------------------------------------------------------------------------- folders


def folder_files(folder: Path) -> dict[str, Path]:
    """Return the files of a folder that are arrays, by the name of the array.

    Raises FormatError where two files have one name, or where one with the name of an array is not read.
    """
    inside = sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))
    arrays = [path for path in inside if path.suffix.lower() in FOLDER_SUFFIXES]
    if not arrays:
        return {}
    result: dict[str, Path] = {}
    for path in arrays:
        if path.stem in result:
            raise FormatError(folder, path.stem, f"is there twice, as {result[path.stem].name} and {path.name}")
        result[path.stem] = path
    known = {name for dialect in dialects.dialects() for name in dialect.known()}
    for path in inside:
        if path.suffix.lower() in _ALSO and path.stem in known:
            expected = ", ".join(FOLDER_SUFFIXES)
            raise FormatError(folder, path.name, f"has the name of an array and is not read, expected {expected}")
    return result


def is_array_folder(names: Collection[str]) -> bool:
    """Return whether files of these names are the arrays of a problem: all that some form needs are there."""
    if "problem.json" in names:  # what stands beside it is the format mtx
        return False
    stems = {name.rpartition(".")[0] for name in names if name.lower().endswith(FOLDER_SUFFIXES)}
    stems |= {stem.removesuffix(".data") for stem in stems}
    return dialects.has_needs(stems)


# ---------------------------------------------------------------------------------------------- MATLAB


def _mat_headers(path: Path) -> Headers:
    import scipy.io

    def attempt() -> None:  # all that this process reads after it, in its order
        _mat_names(path)
        scipy.io.loadmat(path)

    read_head(path)
    require_survivor(path, attempt, "SciPy's reader", _SECONDS)
    return _mat_names(path)


def _mat_names(path: Path) -> Headers:
    import scipy.io

    result: Headers = {}
    for name, shape, kind in _guarded(path, scipy.io.whosmat):
        if kind == "struct":
            one = _guarded(path, lambda file, name=name: scipy.io.loadmat(file, variable_names=[name]))
            result |= dict.fromkeys(_struct(path, name, one[name]))
        else:
            result[name] = tuple(map(int, shape))
    return result


def _mat_values(path: Path) -> dict[str, Any]:
    import scipy.io

    result: dict[str, Any] = {}
    for name, value in _guarded(path, scipy.io.loadmat).items():
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


def _struct(path: Path, name: str, value: Any) -> dict[str, Any]:
    """Return the fields of a struct as NAME.field; raises FormatError where there are several structs."""
    if value.size != 1:
        raise FormatError(path, name, f"is a struct array of shape {value.shape}, expected one struct")
    return {f"{name}.{part}": np.asarray(value[part].item()) for part in value.dtype.names or ()}


def _guarded(path: Path, read: Any) -> Any:
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


# ---------------------------------------------------------------------------------------------- HDF5


def has_arrays(root: Tree) -> bool:
    """Return whether there are data sets in the root of an HDF5 file."""
    return any(not root.is_group(name) for name in root.names())


def tree_names(root: Tree) -> list[str]:
    """Return the names of the arrays that `tree_values` reads."""
    places = _tree_places(root)
    sparse = sparse_names(places)
    return [*sparse, *(name for name in places if name.rpartition(".")[0] not in sparse)]


def tree_values(root: Tree) -> dict[str, Any]:
    """Read the data sets of the root, and of its groups as NAME.part; raises FormatError."""
    return joined(root.path, {name: tree.array(part, None, None) for name, (tree, part) in _tree_places(root).items()})


def _tree_places(root: Tree) -> dict[str, tuple[Tree, str]]:
    """Return the name of each data set with the group that it is in."""
    result: dict[str, tuple[Tree, str]] = {}
    for name in root.names():
        if root.is_group(name):
            child = root.child(name)
            result |= {f"{name}.{part}": (child, part) for part in child.names()}
        else:
            result[name] = (root, name)
    return result
