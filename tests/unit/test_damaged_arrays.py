"""Exceptions of NumPy's, zipfile's, h5py's and SciPy's readers on damaged files: each ends in one line and with 2."""

from __future__ import annotations

import io
import random
import zipfile
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from command_line import cpbench
from damage import spoiled

import cpbench as cp
from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import FrictionContact
from cpbench.storage.arrays import read_array

M = np.array([[6.0, 1.0, 0.0], [2.0, 5.0, -1.0], [0.0, 0.5, 4.0]])
Q = np.array([-3.0, 2.0, -8.0])
HEADERS = {
    "ValueError": "f(1)",
    "TypeError": "{1: 1, 'descr': '<f8', 'shape': (3,)}",
    "IndexError": "{'descr': (), 'fortran_order': False, 'shape': (3,)}",
    "TokenError": "{'descr': '<f8', (((",
    "SyntaxError": "{'descr': '<,8', 'fortran_order': False, 'shape': (3,)}",
    "IndentationError": "\t1\n 2\n  3",
    "RecursionError": "~" * 3000 + "1",
    "MemoryError": "-" * 9000 + "1",
}
"""Headers of .npy files by what NumPy's reader raises: it takes them for Python."""


def _npy(header: str) -> bytes:
    raw = header.encode("latin-1")
    return b"\x93NUMPY\x01\x00" + len(raw).to_bytes(2, "little") + raw


def _zip(change: Callable[[bytearray], None], names: tuple[str, str] = ("M.npy", "q.npy")) -> bytes:
    """An archive of arrays, with bytes of it changed."""
    file, array = io.BytesIO(), io.BytesIO()
    np.save(array, np.arange(40.0))
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as zipped:
        for name in names:
            zipped.writestr(name, array.getvalue())
    whole = bytearray(file.getvalue())
    change(whole)
    return bytes(whole)


def _set(place: int, *values: int, entry: bytes = b"PK\x01\x02") -> Callable[[bytearray], None]:
    """Set bytes of the first entry of the list at the end of an archive, or of the file itself."""

    def change(whole: bytearray) -> None:
        at = whole.index(entry) + place
        whole[at : at + len(values)] = bytes(values)

    return change


def _both(place: int, local: int, *values: int) -> Callable[[bytearray], None]:
    def change(whole: bytearray) -> None:
        _set(place, *values)(whole)
        _set(local, *values, entry=b"PK\x03\x04")(whole)

    return change


ARCHIVES: dict[str, Callable[[bytearray], None]] = {  # places of PKWARE's APPNOTE.TXT, 4.3.7 and 4.3.12
    "BadZipFile": _set(16, 0, 0, 0, 0),  # the CRC
    "error": _set(45, 255, 255, 255, entry=b"PK\x03\x04"),  # of zlib: within the deflated bytes
    "RuntimeError": _both(8, 6, 1),  # encrypted
    "NotImplementedError": _both(10, 8, 96),  # a method that nobody has
    "UnicodeDecodeError": lambda whole: (_both(9, 7, 8)(whole), _set(46, 255)(whole))[0],  # a name in UTF-8
    "OSError": _set(17, 9, entry=b"PK\x05\x06"),  # the list is said to begin later: the entries before 0
}
"""Changes of archives by what zipfile raises then."""


def _refusal(read: Callable[[Path], object], path: Path) -> FormatError | None:
    found = None
    try:
        read(path)
    except FormatError as refusal:
        found = refusal
    assert "\n" not in str(found)
    return found


def _ends_in_one_line(folder: Path, *arguments: str) -> None:
    done = cpbench(folder, *arguments)
    assert (done.returncode, done.stdout) == (2, ""), done
    assert done.stderr.startswith("cpbench: "), done.stderr
    assert done.stderr.count("\n") == 1, done.stderr


@pytest.mark.parametrize("kind", HEADERS)
def test_headers_of_arrays(kind: str, tmp_path: Path) -> None:
    (tmp_path / "a.npy").write_bytes(_npy(HEADERS[kind]))
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as file:
        for name in ("M.npy", "q.npy"):
            file.writestr(name, _npy(HEADERS[kind]))
    for read, name in ((read_array, "a.npy"), (storage.load, "a.npz")):
        refusal = _refusal(read, tmp_path / name)
        assert refusal is not None
        assert type(refusal.__context__).__name__ == kind
    cp.save(cp.LCP(M=M, q=Q), tmp_path / "p.h5")
    _ends_in_one_line(tmp_path, "verify", "p.h5", "--answer", "a.npy")
    _ends_in_one_line(tmp_path, "info", "a.npz")


@pytest.mark.parametrize("kind", ARCHIVES)
def test_archives(kind: str, tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_bytes(_zip(ARCHIVES[kind]))
    refusal = _refusal(read_array, tmp_path / "a.npz")
    assert refusal is not None
    assert type(refusal.__context__).__name__ == kind
    _ends_in_one_line(tmp_path, "info", "a.npz")


def _save_mat(path: Path) -> None:
    parts = {"P": sp.csc_matrix(M), "q": Q, "r": 0.5, "A": sp.csc_matrix(M[:1]), "l": Q[:1] - 1.0, "u": Q[:1]}
    scipy.io.savemat(path, parts, do_compression=path.stem == "packed")


def _save_contact(path: Path) -> None:
    cp.save(FrictionContact(W=M, q=Q, mu=np.array([0.4]), dimension=3), path)


def _save_npz(path: Path) -> None:
    np.savez_compressed(path, M=M, q=Q)


FILES: dict[str, tuple[Callable[[Path], None], int, set[str]]] = {
    "own.h5": (lambda path: cp.save(cp.LCP(M=M, q=Q), path), 100, {"OSError", "KeyError", "RuntimeError"}),
    "fclib.hdf5": (_save_contact, 100, {"OSError", "KeyError", "RuntimeError"}),
    "arrays.npz": (_save_npz, 60, {"BadZipFile", "error"}),
    "plain.mat": (_save_mat, 12, {"ValueError"}),
    "packed.mat": (_save_mat, 12, {"error"}),
}
"""Files, how often one is damaged by day, and what its reader raises at least."""


@pytest.mark.parametrize("times", [1, pytest.param(40, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("name", FILES)
def test_what_readers_raise_on_random_damage(name: str, times: int, tmp_path: Path) -> None:
    """The first file of each class of exception is also given to the command line."""
    save, count, expected = FILES[name]
    save(tmp_path / name)
    whole, draw = (tmp_path / name).read_bytes(), random.Random(name)
    seen = set[str]()
    for _ in range(times * count):
        (tmp_path / name).write_bytes(spoiled(whole, draw))
        refusal = _refusal(storage.load, tmp_path / name)
        kind = type(refusal.__context__).__name__ if refusal is not None else ""
        if kind not in seen and refusal is not None:
            _ends_in_one_line(tmp_path, "info", name)
        seen.add(kind)
    assert seen >= expected


def _typed(path: Path, kind: object) -> None:
    """Write q as a type of HDF5 that NumPy does not have."""
    cp.save(cp.LCP(M=M, q=Q), path)
    with h5py.File(path, "a") as file:
        vectors = file["cpbench/vectors"]
        assert isinstance(vectors, h5py.Group)
        del vectors["q"]
        h5py.h5d.create(vectors.id, b"q", kind, h5py.h5s.create_simple((3,)))


def test_a_type_of_hdf5_that_numpy_lacks(tmp_path: Path) -> None:
    _typed(tmp_path / "time.h5", h5py.h5t.UNIX_D32LE)
    refusal = _refusal(storage.load, tmp_path / "time.h5")
    assert refusal is not None
    assert isinstance(refusal.__context__, TypeError)
    _ends_in_one_line(tmp_path, "info", "time.h5")
