"""What is written comes back bit for bit: every node and storage, names, packs, provenance, atomic writing."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from tiers import some_by_day

from cpbench import storage
from cpbench.formulations import LCP
from cpbench.foundation.matrices import matrix

sys.path.insert(0, str(Path(__file__).parent))
from storage_cases import INFO, cases, same

from cpbench import graph
from cpbench.conversions.base import make
from cpbench.errors import FormatError
from cpbench.formulations import MLCP, LCPPoint
from cpbench.storage import base

CASES = cases()


def text_refusal(problem: Any) -> str:
    """Why Siconos text cannot hold a problem, "" when it can."""
    if problem.node in ("qp", "afc", "fcm", "coneqp"):
        return rf"no format writes a problem of type {problem.node} to a name that ends in '\.dat'"
    if problem.node in ("gfc", "grfc") and problem.b.size:
        return "has 2 bilateral constraints: Siconos text has no place for them"
    if problem.node == "avi" and (problem.b.size or np.isfinite(problem.ub).any()):
        return "has a set X: Siconos text has no place for it"
    if problem.node == "soclcp" and not ((problem.cone_kind == 3) & (problem.cone_mu < np.inf)).all():
        return "cone_kind 0: is zero with mu = 0: Siconos text has second-order cones"
    return ""


@pytest.mark.parametrize("name", some_by_day([n for n in CASES if "converted" not in n], 60))
def test_siconos_text_is_bit_exact(name: str, tmp_path: Path) -> None:
    problem = CASES[name]
    path = tmp_path / "p.dat"
    refusal = text_refusal(problem)
    if refusal:
        with pytest.raises(FormatError, match=refusal):
            storage.save(problem, path)
        assert not path.exists()
        return
    storage.save(problem, path)
    loaded = storage.load(path)
    assert type(loaded) is type(problem)
    assert getattr(loaded, "dimension", None) == getattr(problem, "dimension", None)
    for field, value in problem.data().items():
        got = loaded.data()[field]
        if problem.node == "mlcp" and hasattr(value, "tocsr"):
            assert np.array_equal(got.toarray() if hasattr(got, "toarray") else got, value.toarray()), field
        elif field == "G":
            assert got.shape == value.shape
        else:
            assert same(got, value), field


@pytest.mark.parametrize("name", [n for n in CASES if n.startswith("qp")])
def test_qp_npz_keeps_the_numbers_and_opens_in_qpsolvers(name: str, tmp_path: Path) -> None:
    from qpsolvers import Problem as QPSolversProblem

    problem, path = CASES[name], tmp_path / "p.npz"
    storage.save(problem, path)
    assert storage.load(path).fingerprint == problem.fingerprint
    theirs = QPSolversProblem.load(str(path))
    assert np.array_equal(theirs.q, problem.p)
    assert np.array_equal(theirs.h, -problem.b)


def test_a_converted_file_lifts_in_another_process(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    source = MLCP(
        A=np.eye(3) + 0.1 * rng.random((3, 3)),
        B=np.eye(2),
        C=rng.random((3, 2)),
        D=rng.random((2, 3)),
        a=rng.random(3),
        b=rng.random(2),
    )
    converted = make("mlcp-lcp-schur").step(source)
    storage.save(converted, tmp_path / "c.h5")
    lifted = graph.lift(converted, LCPPoint(z=np.array([0.25, 1.5])))
    code = (
        "import sys, numpy as np; from cpbench import graph, storage; from cpbench.formulations import LCPPoint; "
        "p = storage.load(sys.argv[1]); x = graph.lift(p, LCPPoint(z=np.array([0.25, 1.5]))); "
        "print(x.u.tobytes().hex(), p.provenance[0].source)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "c.h5")], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == [lifted.u.tobytes().hex(), source.fingerprint]


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


def test_an_existing_file_needs_force(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    problem = CASES["lcp-dense-11"]
    storage.save(problem, path)
    before = path.read_bytes()
    for write in (
        lambda: storage.save(problem, path),
        lambda: storage.save_pack({"a": problem}, path),
        lambda: storage.save_answer(path, problem, problem.zero_point(), {}),
    ):
        with pytest.raises(FormatError, match="exists already"):
            write()
    assert path.read_bytes() == before
    storage.save(CASES["qp-dense-7-4"], path, force=True)
    assert storage.load(path).node == "qp"


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


def test_loading_a_small_problem_is_quick(tmp_path: Path) -> None:
    """A few times h5py's own open and read, measured in turn, the least of 200: the machine is shared."""
    problem = LCP(M=np.eye(20), q=np.ones(20), name="small")
    path = tmp_path / "small.h5"
    storage.save(problem, path)

    def bare() -> None:
        with h5py.File(path, "r") as file:
            file["cpbench/M"][()], file["cpbench/vectors/q"][()]

    def seconds(action: Any) -> float:
        start = time.perf_counter()
        action()
        return time.perf_counter() - start

    taken = np.array([(seconds(lambda: storage.load(path)), seconds(bare)) for _ in range(200)])
    ours, theirs = taken.min(axis=0)
    assert ours < 5 * theirs


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
