"""What is written comes back bit for bit: every node and storage, names, packs, provenance, atomic writing."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from storage_cases import INFO, cases, same

from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import LCP
from cpbench.foundation.matrices import matrix
from cpbench.storage import base

CASES = cases()


@pytest.mark.parametrize("name", [n for n in CASES if n.startswith("qp")])
def test_qp_npz_keeps_the_numbers_and_opens_in_qpsolvers(name: str, tmp_path: Path) -> None:
    from qpsolvers import Problem as QPSolversProblem

    problem, path = CASES[name], tmp_path / "p.npz"
    storage.save(problem, path)
    assert storage.load(path).fingerprint == problem.fingerprint
    theirs = QPSolversProblem.load(str(path))
    assert np.array_equal(theirs.q, problem.p)
    assert np.array_equal(theirs.h, -problem.b)


def test_pack_and_members(tmp_path: Path) -> None:
    path = tmp_path / "pack.h5"
    chosen = {n: CASES[n] for n in ("lcp-dense-11", "mlcp-sparse-7-4", "qp-dense-7-4", "fc3-sparse-5", "gfc2-dense-5")}
    storage.save_pack(chosen, path)
    assert storage.members(path) == sorted(chosen)
    for name, problem in chosen.items():
        assert same(storage.load(f"{path}::{name}"), dataclasses.replace(problem, name=problem.name or name))
    with pytest.raises(FormatError, match=r"holds 5 problems .*name one, as in"):
        storage.load(path)
    with pytest.raises(FormatError, match="has no member 'x'"):
        storage.load(f"{path}::x")
    with pytest.raises(FormatError, match="is not a name for a member"):
        storage.save_pack({"a/b": CASES["lcp-dense-11"]}, tmp_path / "q.h5")
    assert storage.problem_files([path]) == [f"{path}::{name}" for name in sorted(chosen)]


def test_a_file_with_a_local_and_a_global_problem(tmp_path: Path) -> None:
    path = tmp_path / "both.hdf5"
    storage.save(CASES["fc3-sparse-5"], tmp_path / "l.h5")
    storage.save(CASES["gfc3-sparse-5"], tmp_path / "g.h5")
    with h5py.File(path, "w") as file:
        for part, group in (("l.h5", "fclib_local"), ("g.h5", "fclib_global")):
            with h5py.File(tmp_path / part) as source:
                source.copy(group, file)
    assert storage.members(path) == ["local", "global"]
    assert storage.load(f"{path}::local").fingerprint == CASES["fc3-sparse-5"].fingerprint
    assert storage.load(f"{path}::global").fingerprint == CASES["gfc3-sparse-5"].fingerprint


def test_a_name_that_no_format_fits_is_answered_with_those_that_fit(tmp_path: Path) -> None:
    lcp = LCP(M=np.eye(2), q=np.ones(2))
    with pytest.raises(FormatError, match=r"ends in '\.jl': use \.h5 or \.dat or \.mof\.json$"):
        storage.save(lcp, tmp_path / "p.jl")


def test_names(tmp_path: Path) -> None:
    storage.save(LCP(M=np.eye(1), q=np.ones(1), name="given"), tmp_path / "a.h5")
    storage.save(LCP(M=np.eye(1), q=np.ones(1)), tmp_path / "b.h5")
    storage.save(LCP(M=np.eye(1), q=np.ones(1), name="given"), tmp_path / "c.hdf5.dat")
    assert [storage.load(tmp_path / f).name for f in ("a.h5", "b.h5", "c.hdf5.dat")] == ["given", "b", "c"]


def test_large_arrays_are_compressed_and_small_ones_are_not(tmp_path: Path) -> None:
    storage.save(CASES["lcp-large"], tmp_path / "c.h5")
    storage.save(CASES["lcp-large"], tmp_path / "u.h5", compress=False)
    with h5py.File(tmp_path / "c.h5") as c, h5py.File(tmp_path / "u.h5") as u:
        assert (c["cpbench/M"].compression, c["cpbench/M"].shuffle) == ("gzip", True)
        assert c["cpbench/vectors/q"].compression is None
        assert u["cpbench/M"].compression is None


def test_contact_files_are_fclib(tmp_path: Path) -> None:
    storage.save(CASES["fc3-sparse-5"], tmp_path / "l.h5")
    storage.save(CASES["gfc3-dense-5"], tmp_path / "g.h5")
    with h5py.File(tmp_path / "l.h5") as file:
        W = file["fclib_local/W"]
        assert {k: (W[k].shape, W[k].dtype) for k in ("m", "nz")} == {"m": ((1,), "i4"), "nz": ((1,), "i4")}
        assert W["nz"][0] == -2
        assert file["fclib_local/spacedim"][0] == 3
        assert file["fclib_local/info/title"][()].decode() == INFO.title
    with h5py.File(tmp_path / "g.h5") as file:
        H = file["fclib_global/H"]
        assert H["nz"][0] == H["x"].size
        rows, cols = H["i"][:], H["p"][:]  # CSparse order: i is the row
        assert np.array_equal(CASES["gfc3-dense-5"].H[rows, cols], H["x"][:])


def test_an_interrupted_write_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.h5"
    storage.save(CASES["lcp-dense-11"], path)
    before = path.read_bytes()

    def interrupt(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(base.os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        storage.save(CASES["qp-dense-7-4"], path, force=True)
    with pytest.raises(KeyboardInterrupt):
        storage.save(CASES["qp-dense-7-4"], tmp_path / "b.h5")
    assert os.listdir(tmp_path) == ["a.h5"]
    assert path.read_bytes() == before


def test_a_problem_that_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    bad = dataclasses.replace(CASES["lcp-converted"].provenance[0], trace={"f": print})
    with pytest.raises(FormatError, match="cannot keep a builtin_function_or_method"):
        storage.save(dataclasses.replace(CASES["lcp-dense-11"], provenance=(bad,)), tmp_path / "a.h5")
    with pytest.raises(FormatError, match="cannot be written"):
        storage.save(CASES["lcp-dense-11"], tmp_path / "no" / "a.h5")
    assert os.listdir(tmp_path) == []


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform == "win32", reason="no limits of file sizes")
def test_a_disk_that_fills_up_leaves_nothing(tmp_path: Path) -> None:
    code = (
        "import resource, signal, sys, numpy as np; from cpbench import errors, storage\n"
        "from cpbench.formulations import LCP\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (50000, 50000))\n"
        "try: storage.save(LCP(M=np.eye(200), q=np.ones(200)), sys.argv[1], compress=False)\n"
        "except errors.FormatError as refusal: print(refusal)\n"
    )
    path = tmp_path / "a.h5"
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == f"{path}: cannot be written (File too large)"
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(("stored", "held"), [("i4", np.int32), ("i8", np.int64), (">i4", np.int32), ("u2", np.int64)])
def test_indices_of_any_width_are_read(tmp_path: Path, stored: str, held: type) -> None:
    M = sp.csr_array(np.array([[2.0, 0.0, 1.0], [0.0, 3.0, 0.0], [1.0, 0.0, 4.0]]))
    path = tmp_path / "a.h5"
    storage.save(LCP(M=M, q=np.ones(3)), path)
    with h5py.File(path, "r+") as file:
        group = file["cpbench/M"]
        for name in ("i", "p"):
            values = group[name][()].astype(stored)
            del group[name]
            group[name] = values
    got = storage.load(path).M
    assert got.indices.dtype == held
    assert (got != M).nnz == 0
    assert matrix(got) is got
