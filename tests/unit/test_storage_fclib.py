"""FCLIB files: what its own C library reads in ours, every storage and trap, candidates, what is refused."""

from __future__ import annotations

import logging
import shutil
import subprocess
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from storage_cases import cases, same
from tiers import some_by_day

from cpbench import storage
from cpbench.errors import FormatError

CASES = cases()


@pytest.fixture(scope="module")
def c_reader(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small C program linked with libfclib."""
    if shutil.which("gcc") is None or not Path("/usr/include/fclib.h").exists():
        pytest.skip("needs FCLIB's C library and a compiler: apt-get install libfclib-dev gcc")
    program = tmp_path_factory.mktemp("fclib") / "fclib_read"
    source = Path(__file__).with_name("fclib_read.c")
    subprocess.run(["gcc", "-o", str(program), str(source), "-lfclib"], check=True)
    return program


def read_with_c(program: Path, kind: str, path: Path, *more: str) -> dict[str, list[str]]:
    done = subprocess.run([str(program), kind, str(path), *more], capture_output=True, text=True, errors="replace")
    assert done.returncode == 0, done.stderr
    return {line.split()[0]: line.split()[1:] for line in done.stdout.splitlines() if line.strip()}


def matrix_sums(A: Any, triplet: bool) -> list[str]:
    """Rows, columns, storage, count, sum, and sum weighted by 1 + i (rows in a triplet, columns by rows)."""
    coo = sp.coo_array(A)
    index = coo.row if triplet else coo.col
    order = np.lexsort((coo.col, coo.row))
    x, index = coo.data[order], index[order]
    total, weighted = 0.0, 0.0
    for value, i in zip(x.tolist(), index.tolist(), strict=True):
        total += value
        weighted += value * (1 + i)
    storage_code = coo.nnz if triplet else -2
    return [*(str(v) for v in (*coo.shape, storage_code, coo.nnz)), f"{total:.17g}", f"{weighted:.17g}"]


def vector_sum(x: np.ndarray) -> list[str]:
    weighted = 0.0
    for k, value in enumerate(x.tolist()):
        weighted += value * (k + 1)
    return [str(x.size), f"{weighted:.17g}"]


@pytest.mark.parametrize("compress", some_by_day([True, False], 3))
@pytest.mark.parametrize("name", ["fc2-dense-5", "fc3-sparse-5", "fc3-mixed-place", "fc3-converted", "fc3-large"])
def test_the_c_library_reads_our_local_files(name: str, compress: bool, c_reader: Path, tmp_path: Path) -> None:
    problem = CASES[name]
    storage.save(problem, tmp_path / "p.hdf5", compress=compress)
    with h5py.File(tmp_path / "p.hdf5") as file:
        assert file["fclib_local/W/x"].compression == ("gzip" if compress and name == "fc3-large" else None)
    found = read_with_c(c_reader, "local", tmp_path / "p.hdf5")
    assert found["spacedim"] == [str(problem.dimension)]
    assert found["W"] == matrix_sums(problem.W, triplet=False)
    assert found["q"] == vector_sum(problem.q)
    assert found["mu"] == vector_sum(problem.mu)
    assert found.get("title", [""]) == [problem.info.title]


GLOBAL = ["gfc2-sparse-5", "gfc3-dense-5", "gfc3-mixed", "gfc3-sparse-1", "gfc2-dense-5-2", "gfc3-joints-only-sparse"]


@pytest.mark.parametrize("name", GLOBAL)
def test_the_c_library_reads_our_global_files(name: str, c_reader: Path, tmp_path: Path) -> None:
    problem = CASES[name]
    storage.save(problem, tmp_path / "p.hdf5")
    found = read_with_c(c_reader, "global", tmp_path / "p.hdf5")
    compare_global(problem, found)


def compare_global(problem: Any, found: dict[str, list[str]]) -> None:
    assert found["spacedim"] == [str(problem.dimension)]
    for part in ("M", "H", "G") if problem.b.size else ("M", "H"):
        assert found[part] == matrix_sums(getattr(problem, part), triplet=True)
    for part in ("f", "w", "mu", "b") if problem.b.size else ("f", "w", "mu"):
        assert found[part] == vector_sum(getattr(problem, part))
    assert ("G" in found) == (problem.b.size > 0)


@pytest.mark.parametrize("name", ["fc3-sparse-5", "fcm3-dense-5-2", "gfc3-dense-5", "gfc3-joints-only-sparse"])
def test_the_c_library_reads_our_points(name: str, c_reader: Path, tmp_path: Path, rng: np.random.Generator) -> None:
    problem = CASES[name]
    solution, *guesses = (
        problem.point_from_vector(rng.standard_normal(sum(problem.point_sizes.values()))) for _ in range(3)
    )
    path = tmp_path / "p.hdf5"
    storage.save_answer(path, problem, solution, {}, with_problem=True, guesses=guesses)
    kind = "local" if problem.node.startswith("fc") else "global"
    found = read_with_c(c_reader, kind, path, "points")
    assert found["guesses"] == ["2"]
    assert found["solution.u"] == vector_sum(problem.slacks(solution)["u"])
    for part, size in problem.point_sizes.items():
        stored = "l" if part == "lam" else part
        if size:
            assert found[f"solution.{stored}"] == vector_sum(getattr(solution, part))
            assert found[f"guess.{stored}"] == vector_sum(getattr(guesses[-1], part))
    mine = storage.solution(path)
    assert mine is not None
    assert all(
        same(got, sent) for got, sent in zip([mine[0], *storage.guesses(path)], [solution, *guesses], strict=True)
    )
    assert storage.load(path).fingerprint == problem.fingerprint


# --------------------------------------------------------------------------------- storages and traps

W = np.array([[4.0, 1, 0], [2, 5, 0], [0, 3, 6]])


def write_local(path: Path, **replaced: Any) -> None:
    """An FCLIB file written by hand: W by rows; keyword arguments replace data sets of W (`nz`, `p`, ...)."""
    csr = sp.csr_array(W)
    parts = {"nzmax": [6], "m": [3], "n": [3], "nz": [-2], "p": csr.indptr, "i": csr.indices, "x": csr.data}
    parts |= replaced
    with h5py.File(path, "w") as file:
        group = file.create_group("fclib_local")
        group["spacedim"] = np.array([3], np.int32)
        matrix = group.create_group("W")
        for name, value in parts.items():
            matrix[name] = np.asarray(value, np.float64 if name == "x" else np.int32)
        group["vectors/q"], group["vectors/mu"] = np.array([-1.0, 0.5, 0]), np.array([0.3])


def loaded(path: Path) -> np.ndarray:
    problem: Any = storage.load(path)
    assert sp.issparse(problem.W)
    return problem.W.toarray()


def test_every_storage(tmp_path: Path) -> None:
    csc, coo = sp.csc_array(W), sp.coo_array(W)
    forms: dict[str, dict[str, Any]] = {
        "rows": {},
        "columns": {"nz": [-1], "p": csc.indptr, "i": csc.indices, "x": csc.data},
        "triplet": {"nz": [6], "i": coo.row, "p": coo.col, "x": coo.data},
        "longer nzmax": {"nz": [6], "nzmax": [99], "i": coo.row, "p": coo.col, "x": coo.data},
        "spare room": {"nzmax": [8], "i": [*sp.csr_array(W).indices, 0, 0], "x": [*sp.csr_array(W).data, 7, 7]},
        "duplicates": {"nz": [7], "i": [*coo.row, 0], "p": [*coo.col, 0], "x": [3.0, *coo.data[1:], 1.0]},
    }
    for name, replaced in forms.items():
        write_local(tmp_path / f"{name}.h5", **replaced)
        assert np.array_equal(loaded(tmp_path / f"{name}.h5"), W), name


def test_swapped_triplet_indices_are_detected_by_the_shape(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    H = np.arange(15.0).reshape(5, 3)
    coo = sp.coo_array(H)
    with h5py.File(tmp_path / "g.h5", "w") as file:
        group = file.create_group("fclib_global")
        group["spacedim"] = np.array([3], np.int32)
        for name, A, rows, cols in (("M", sp.eye_array(5, format="coo"), "i", "p"), ("H", coo, "p", "i")):
            values = {"nzmax": [A.nnz], "m": [5], "n": [A.shape[1]], "nz": [A.nnz], rows: A.row, cols: A.col}
            for key, value in values.items():
                group[f"{name}/{key}"] = np.asarray(value, np.int32)
            group[f"{name}/x"] = A.data
        group["vectors/f"], group["vectors/w"], group["vectors/mu"] = np.zeros(5), np.zeros(3), np.ones(1)
    with caplog.at_level(logging.WARNING, "cpbench.storage"):
        problem: Any = storage.load(tmp_path / "g.h5")
    assert np.array_equal(problem.H.toarray(), H)
    assert "i and p are swapped" in caplog.text


@pytest.mark.parametrize("where", ["fclib_local/W", "fclib_local", "/"])
def test_symmetric_packed(where: str, tmp_path: Path) -> None:
    symmetric = W + W.T
    lower = sp.csc_array(np.tril(symmetric))
    write_local(tmp_path / "p.h5", nz=[-1], p=lower.indptr, i=lower.indices, x=lower.data)
    with h5py.File(tmp_path / "p.h5", "r+") as file:
        file[where].attrs["symmetric_packed"] = 1
    assert np.array_equal(loaded(tmp_path / "p.h5"), symmetric)
    write_local(tmp_path / "full.h5")
    with h5py.File(tmp_path / "full.h5", "r+") as file:
        file[where].attrs["symmetric_packed"] = 1
    with pytest.raises(FormatError, match="fclib_local/W: is symmetric_packed but has 1 entries above the diagonal"):
        storage.load(tmp_path / "full.h5")


def test_info_that_is_not_utf8(tmp_path: Path) -> None:
    write_local(tmp_path / "p.h5")
    with h5py.File(tmp_path / "p.h5", "r+") as file:
        file["fclib_local/info/title"] = np.bytes_(b"\xa8W\xfcrfel")
    assert storage.load(tmp_path / "p.h5").info.title == "\ufffdW\ufffdrfel"


def test_formats_by_name(tmp_path: Path) -> None:
    write_local(tmp_path / "f.h5")
    storage.save(CASES["fc3-sparse-5"], tmp_path / "n.h5")
    storage.save(CASES["lcp-dense-11"], tmp_path / "l.h5")
    assert storage.load(tmp_path / "f.h5", format="fclib").node == "fc"
    assert storage.load(tmp_path / "n.h5", format="fclib").node == "fc"
    assert storage.load(tmp_path / "n.h5", format="native").node == "fc"
    with pytest.raises(FormatError, match="cpbench: is missing, expected a native problem"):
        storage.load(tmp_path / "f.h5", format="native")
    with pytest.raises(FormatError, match=r"fclib_local: is missing, and so is fclib_global\[_rolling\]"):
        storage.load(tmp_path / "l.h5", format="fclib")
    with pytest.raises(FormatError, match="the format fclib writes fc, fcm, gfc, grfc, not a problem of type lcp"):
        storage.save(CASES["lcp-dense-11"], tmp_path / "x.h5", format="fclib")
    for name, reason in (
        ("afc-dense-5", "of type afc: FCLIB has one coefficient of friction a contact"),
        ("rfc5-dense-5", "of type rfc: FCLIB has rolling friction in global form alone"),
    ):
        with pytest.raises(FormatError, match=reason):
            storage.save(CASES[name], tmp_path / "x.h5", format="fclib")
    assert not (tmp_path / "x.h5").exists()


def test_candidates_of_real_files(shared_data: Path) -> None:
    """Solutions in the traces are placeholders of zeros, guesses are warm starts: both are read, none is believed."""
    file = shared_data / "fc3d_local" / "Capsules-i125-1213.hdf5"
    found = storage.solution(file)
    assert found is not None
    assert not found[0].r.any()
    (guess,) = storage.guesses(file)
    problem = storage.load(file)
    assert 0 < np.linalg.norm(guess.r) < 0.1
    assert problem.residuals(found[0]).measured["natural"] > problem.residuals(guess).measured["natural"]
    both = storage.solution(shared_data / "fc3d_global" / "Box_Stacks-i0122-82-5.hdf5")
    assert both is not None
    assert both[0].v.size == 450
    assert storage.solution(shared_data / "fc3d_global" / "CubeH8.hdf5") is None
    assert storage.guesses(shared_data / "fc3d_global" / "CubeH8.hdf5") == []
