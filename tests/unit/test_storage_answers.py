"""Answers and bare arrays: written, read back, refused when they belong to another problem."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from storage_cases import cases, same
from tiers import some_by_day

from cpbench import __version__, storage
from cpbench.errors import FormatError, PointError

CASES = {
    n: p for n, p in cases().items() if n.endswith(("-11", "-7-4", "-5", "-special", "-5-2", "-0-2", "-7", "-all"))
}
ATTRS = {"solver": "lemke", "claim": "solved", "verdict": "solved", "residual": 1e-12, "tolerance": 1e-8}


@pytest.mark.parametrize("name", some_by_day(CASES, 25))
def test_an_answer_comes_back(name: str, tmp_path: Path, rng: np.random.Generator) -> None:
    problem = CASES[name]
    point = problem.point_from_vector(rng.standard_normal(sum(problem.point_sizes.values())))
    path = tmp_path / "a.h5"
    storage.save_answer(path, problem, point, ATTRS)
    assert same(storage.load_answer(path, problem), point)
    found = storage.solution(path)
    assert found is not None
    assert same(found[0], point)
    said = found[1]
    assert {k: said[k] for k in ATTRS} == ATTRS
    assert said["node"] == problem.node
    assert said["fingerprint"] == problem.fingerprint
    assert said["cpbench_version"] == __version__
    parts = set(point.arrays())
    if problem.node in ("fcm", "gfc", "grfc"):  # λ is FCLIB's l, which it has where there are joints
        parts = parts - {"lam"} | ({"l"} if point.lam.size else set())
    with h5py.File(path) as file:  # FCLIB's slack u stands beside r
        assert set(file["solution"]) == parts | set(problem.slacks(point))
    with pytest.raises(FormatError, match="holds an answer, not a problem"):
        storage.load(path)
    assert storage.problem_files([tmp_path]) == []


def test_an_answer_with_nan_is_still_an_answer(tmp_path: Path) -> None:
    problem = CASES["lcp-dense-11"]
    point = problem.point_from_vector(np.full(11, np.nan))
    storage.save_answer(tmp_path / "a.h5", problem, point, ATTRS)
    assert same(storage.load_answer(tmp_path / "a.h5", problem), point)


def test_an_answer_to_another_problem_is_refused(tmp_path: Path) -> None:
    mine, path = CASES["lcp-dense-11"], tmp_path / "a.h5"
    storage.save_answer(path, mine, mine.zero_point(), ATTRS)
    with pytest.raises(FormatError, match=r"solution/@fingerprint: is the answer to another problem \([0-9a-f]{12}\)"):
        storage.load_answer(path, CASES["lcp-sparse-11"])
    with pytest.raises(FormatError, match=r"solution/@node: is the answer to a problem of type lcp, asked was .* qp"):
        storage.load_answer(path, CASES["qp-dense-7-4"])
    storage.save_point(tmp_path / "p.h5", mine.zero_point(), node="lcp", fingerprint="00ff", attrs={"name": "x"})
    with pytest.raises(FormatError, match="is the answer to another problem"):
        storage.load_answer(tmp_path / "p.h5", mine)
    with pytest.raises(PointError, match="the answer is a LCPPoint, expected QPPoint"):
        storage.save_answer(tmp_path / "q.h5", CASES["qp-dense-7-4"], mine.zero_point(), ATTRS)
    assert not (tmp_path / "q.h5").exists()


def test_a_solution_in_the_problem_s_own_file(tmp_path: Path) -> None:
    problem, other = CASES["gfc3-sparse-5"], CASES["gfc3-dense-5"]
    storage.save_pack({"one": problem, "two": other}, tmp_path / "p.h5")
    with h5py.File(tmp_path / "p.h5", "r+") as file:
        file["one/solution/v"], file["one/solution/r"] = np.ones(6), np.ones(15)
        file["one/guesses/number_of_guesses"] = np.array([2], np.int32)
        for k in (1, 2):
            file[f"one/guesses/{k}/v"], file[f"one/guesses/{k}/r"] = np.ones(6) * k, np.ones(15)
    address = f"{tmp_path / 'p.h5'}::one"
    point = storage.load_answer(address, problem)
    assert point.v.tolist() == [1.0] * 6
    assert [g.v[0] for g in storage.guesses(address)] == [1.0, 2.0]
    assert storage.solution(f"{tmp_path / 'p.h5'}::two") is None
    with pytest.raises(FormatError, match="is the answer to another problem"):
        storage.load_answer(address, other)
    with h5py.File(tmp_path / "p.h5", "r+") as file:
        del file["one/solution/r"]
        file["one/solution/r"] = np.ones(14)
        file["one/guesses/number_of_guesses"][0] = 3
    with pytest.raises(FormatError, match="one/solution: gfc: the answer's r has 14 numbers, expected 15"):
        storage.solution(address)
    with pytest.raises(FormatError, match="one/guesses/number_of_guesses: is 3, the file holds 2"):
        storage.guesses(address)


def test_joint_reactions_are_l_in_files(tmp_path: Path, rng: np.random.Generator) -> None:
    """FCLIB's name for λ; the files of a first version have lam, and without joints there is neither."""
    for name in ("gfc2-dense-5-2", "fcm3-sparse-5-2", "grfc5-dense-5-2"):
        problem, path = CASES[name], tmp_path / f"{name}.h5"
        point = problem.point_from_vector(rng.standard_normal(sum(problem.point_sizes.values())))
        storage.save_answer(path, problem, point, ATTRS)
        with h5py.File(path, "r+") as file:
            file.move("solution/l", "solution/lam")
        assert same(storage.load_answer(path, problem), point)
        with h5py.File(path, "r+") as file:
            del file["solution/lam"]
        with pytest.raises(FormatError, match=f"{problem.node}: the answer's lam has 0 numbers, expected 2"):
            storage.load_answer(path, problem)
    free = CASES["gfc3-sparse-5"]
    storage.save_answer(tmp_path / "f.h5", free, free.zero_point(), ATTRS)
    with h5py.File(tmp_path / "f.h5") as file:
        assert set(file["solution"]) == {"v", "r", "u"}
    assert same(storage.load_answer(tmp_path / "f.h5", free), free.zero_point())
    np.savez(tmp_path / "f.npz", v=np.ones(6), r=np.ones(15))
    assert storage.load_answer(tmp_path / "f.npz", free).v.tolist() == [1.0] * 6


def test_guesses_beside_an_answer(tmp_path: Path) -> None:
    problem = CASES["soclcp-sparse-all"]
    ones = problem.point_from_vector(np.ones(problem.q.size))
    storage.save_answer(tmp_path / "a.h5", problem, problem.zero_point(), ATTRS, with_problem=True, guesses=[ones])
    (guess,) = storage.guesses(tmp_path / "a.h5")
    assert same(guess, ones)
    with pytest.raises(PointError, match="the answer is a SOCLCPPoint, expected LCPPoint"):
        storage.save_answer(
            tmp_path / "b.h5", CASES["lcp-dense-11"], CASES["lcp-dense-11"].zero_point(), {}, guesses=[ones]
        )
    assert not (tmp_path / "b.h5").exists()


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".csv", ".txt"])
def test_plain_vectors(suffix: str, tmp_path: Path) -> None:
    problem, path = CASES["mlcp-dense-7-4"], tmp_path / f"z{suffix}"

    def write(x: np.ndarray) -> None:
        if suffix == ".npy":
            np.save(path, x)
        elif suffix == ".npz":
            np.savez(path, x)
        else:
            np.savetxt(path, x, fmt="%.17g", header="z", comments="# " if suffix == ".txt" else "")

    x = np.arange(11.0) / 3
    write(x)
    point = storage.load_answer(path, problem)
    assert np.concatenate([point.u, point.v]).tolist() == x.tolist()
    write(x[:10])
    with pytest.raises(FormatError, match=r"mlcp: the answer has 10 numbers, expected 7 \(u\) \+ 4 \(v\)"):
        storage.load_answer(path, problem)


def test_named_parts(tmp_path: Path) -> None:
    problem = CASES["mlcp-dense-7-4"]
    np.savez(tmp_path / "p.npz", v=np.ones(4), u=np.zeros(7))
    assert storage.load_answer(tmp_path / "p.npz", problem).v.tolist() == [1.0] * 4
    np.savez(tmp_path / "p.npz", v=np.ones(3), u=np.zeros(7))
    with pytest.raises(FormatError, match="the answer's v has 3 numbers, expected 4"):
        storage.load_answer(tmp_path / "p.npz", problem)
    np.savez(tmp_path / "p.npz", v=np.ones(3), w=np.zeros(7))
    with pytest.raises(FormatError, match="w: is no part of an answer to mlcp: u, v"):
        storage.load_answer(tmp_path / "p.npz", problem)


def test_matrices(tmp_path: Path, rng: np.random.Generator) -> None:
    M = rng.standard_normal((4, 3))
    S = sp.csr_array(sp.random_array((5, 6), density=0.3, rng=rng))
    np.save(tmp_path / "m.npy", np.asfortranarray(M))
    np.savez(tmp_path / "m.npz", M)
    np.savetxt(tmp_path / "m.csv", M, delimiter=",", fmt="%.17g", header="a,b,c", comments="")
    np.savetxt(tmp_path / "m.txt", M, fmt="%.17g")
    scipy.io.mmwrite(tmp_path / "m.mtx", M, precision=17)
    for name in ("m.npy", "m.npz", "m.csv", "m.txt", "m.mtx"):
        assert np.array_equal(storage.read_matrix(tmp_path / name), M), name
    sp.save_npz(tmp_path / "s.npz", S)
    sp.save_npz(tmp_path / "c.npz", sp.csc_array(S))
    scipy.io.mmwrite(tmp_path / "s.mtx", S, precision=17)
    for name in ("s.npz", "c.npz", "s.mtx"):
        read = storage.read_matrix(tmp_path / name)
        assert sp.issparse(read), name
        assert np.array_equal(read.toarray(), S.toarray()), name
    with pytest.raises(FormatError, match=r"has shape \(4, 3\), expected a vector"):
        storage.read_vector(tmp_path / "m.npy")


def test_vectors(tmp_path: Path) -> None:
    (tmp_path / "row.csv").write_text("1, 2.5; -3\n")
    (tmp_path / "column.txt").write_text("# comment\n1\n2.5 # here too\n\n-3\n")
    np.save(tmp_path / "v.npy", np.array([[1.0], [2.5], [-3.0]]))
    for name in ("row.csv", "column.txt", "v.npy"):
        assert storage.read_vector(tmp_path / name).tolist() == [1.0, 2.5, -3.0]
    for text, reason in (
        ("", "is empty"),
        ("# nothing\n", "holds no numbers"),
        ("1 2\n3\n", "row 2: has 1 numbers, expected 2 as in the first row"),
        ("1\ntwo\n", "holds something that is not a number"),
    ):
        (tmp_path / "bad.csv").write_text(text)
        with pytest.raises(FormatError, match=reason):
            storage.read_vector(tmp_path / "bad.csv")
    np.save(tmp_path / "v.npy", np.ones(3))
    with pytest.raises(FormatError, match="expected a matrix"):
        storage.read_matrix(tmp_path / "v.npy")
    (tmp_path / "bad.mtx").write_text(
        "%%MatrixMarket matrix coordinate real general\n99999999999 3 99999999999\n1 1 1\n"
    )
    with pytest.raises(FormatError, match="is not a readable Matrix Market file"):
        storage.read_matrix(tmp_path / "bad.mtx")


def test_problem_files(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    problem = CASES["lcp-dense-11"]
    storage.save(problem, tmp_path / "sub" / "b.h5")
    storage.save(problem, tmp_path / "a.dat")
    storage.save_pack({"y": problem, "x": problem}, tmp_path / "c.hdf5")
    storage.save_answer(tmp_path / "answer.h5", problem, problem.zero_point(), {})
    np.savetxt(tmp_path / "case-M1.txt", problem.M)
    np.savetxt(tmp_path / "case-q1.txt", problem.q)
    np.savetxt(tmp_path / "lone-M1.txt", problem.M)
    np.savez(tmp_path / "answer.npz", z=np.ones(11))
    (tmp_path / "notes.md").write_text("nothing to see")
    (tmp_path / ".hidden.dat").write_text("1")
    (tmp_path / "broken.h5").write_text("nothing to see")
    expected = ["a.dat", "broken.h5", "c.hdf5::x", "c.hdf5::y", "case-M1.txt", "sub/b.h5"]
    assert storage.problem_files([tmp_path]) == [f"{tmp_path}/{name}" for name in expected]
    named = [tmp_path / "notes.md", f"{tmp_path}/c.hdf5::y", tmp_path / "c.hdf5"]
    assert storage.problem_files(named) == [f"{tmp_path}/{n}" for n in ("notes.md", "c.hdf5::y", "c.hdf5::x")]
    assert storage.load(tmp_path / "case-M1.txt").node == "lcp"
