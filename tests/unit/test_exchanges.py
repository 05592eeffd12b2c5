"""Exchanges of problems and answers with programs: there and back, and refusals."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from storage_cases import cases, same
from tiers import some_by_day

from cpbench.errors import FormatError
from cpbench.formulations.exchange import exchanges

CASES = {name: problem for name, problem in cases().items() if not name.endswith("-large")}
MINE = ("npy-dir", "fclib", "nl")
PAIRS = [
    pytest.param(name, case, id=f"{name}-{case}")
    for name in MINE
    for case, problem in CASES.items()
    if exchanges.get(name).nodes is None or problem.node in (exchanges.get(name).nodes or ())
]


def _path(folder: Path, name: str, what: str = "problem") -> Path:
    return folder / f"{what}{exchanges.get(name).suffix}"


@pytest.mark.parametrize(("name", "case"), some_by_day(PAIRS, 80))
def test_a_problem_comes_back(name: str, case: str, tmp_path: Path) -> None:
    problem, path = CASES[case], _path(tmp_path, name)
    exchanges.get(name).write_problem(problem, path)
    again = exchanges.get(name).read_problem(path)
    assert again.node == problem.node
    assert again.fingerprint == problem.fingerprint
    assert not again.provenance
    for part, value in problem.data().items():
        if name != "nl":  # it has no dense matrices
            assert sp.issparse(again.data()[part]) == sp.issparse(value)
        if value.ndim == 1:
            assert same(again.data()[part], value), f"{part}: a sign of a zero changed"


@pytest.mark.parametrize(("name", "case"), some_by_day(PAIRS, 80))
def test_an_answer_comes_back(name: str, case: str, tmp_path: Path, rng: np.random.Generator) -> None:
    problem, path = CASES[case], _path(tmp_path, name, "answer")
    point = problem.point_from_vector(rng.standard_normal(sum(problem.point_sizes.values())))
    exchanges.get(name).write_answer(point, path)
    assert same(exchanges.get(name).read_answer(path, problem), point)
    spoilt = problem.point_type(**{part: np.full(value.size, np.nan) for part, value in point.arrays().items()})
    exchanges.get(name).write_answer(spoilt, path)  # in place of the first
    found = exchanges.get(name).read_answer(path, problem)
    assert all(np.isnan(value).all() for value in found.arrays().values())


@pytest.mark.parametrize("name", MINE)
def test_a_problem_replaces_the_one_before(name: str, tmp_path: Path) -> None:
    case = {"fclib": "fc3", "nl": "qp"}.get(name, "mlcp")
    exchange, path = exchanges.get(name), _path(tmp_path, name)
    old, new = [p for n, p in CASES.items() if n.startswith(f"{case}-")][:2]
    exchange.write_problem(old, path)
    exchange.write_problem(new, path)
    assert exchange.read_problem(path).fingerprint == new.fingerprint


@pytest.mark.parametrize("name", MINE)
def test_an_answer_of_a_wrong_size_is_refused(name: str, tmp_path: Path) -> None:
    small, large = CASES["fc3-dense-1"], CASES["fc3-dense-5"]
    if name == "nl":
        small, large = CASES["qp-dense-1-0"], CASES["qp-dense-7-4"]
    path = _path(tmp_path, name, "answer")
    exchanges.get(name).write_answer(small.zero_point(), path)
    with pytest.raises(FormatError, match="expected") as refusal:
        exchanges.get(name).read_answer(path, large)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("name", MINE)
def test_what_is_not_there_is_refused(name: str, tmp_path: Path) -> None:
    exchange, path = exchanges.get(name), _path(tmp_path, name)
    for read in (exchange.read_problem, lambda p: exchange.read_answer(p, CASES["fc3-dense-1"])):
        with pytest.raises(FormatError, match=r"no such file|No such file|no such folder") as refusal:
            read(path)
        assert str(path) in str(refusal.value)


@pytest.mark.parametrize("name", ["fclib", "nl"])
def test_a_problem_that_it_cannot_carry_is_refused(name: str, tmp_path: Path) -> None:
    problem = CASES["lcp-dense-2" if name == "fclib" else "fc3-dense-1"]
    with pytest.raises(FormatError, match=f"not a problem of type {problem.node}"):
        exchanges.get(name).write_problem(problem, _path(tmp_path, name))
    assert not _path(tmp_path, name).exists()


@pytest.mark.parametrize("name", MINE)
def test_what_an_exchange_refuses_is_known_before(name: str, tmp_path: Path) -> None:
    """Met only when it is written it would be an error of the solver's row."""
    exchange = exchanges.get(name)
    for case, problem in CASES.items():
        try:
            exchange.write_problem(problem, _path(tmp_path, name))
            refused = False
        except FormatError:
            refused = True
        if exchange.nodes is not None:
            assert (exchange.obstacle(problem) is not None) == refused, case


# ------------------------------------------------------------------------------------------- HDF5 and FCLIB


def test_an_answer_may_stand_in_a_copy_of_its_problem(tmp_path: Path) -> None:
    problem, path = CASES["fc3-dense-1"], tmp_path / "p.hdf5"
    exchanges.get("fclib").write_problem(problem, path)
    with pytest.raises(FormatError, match="holds no answer"):
        exchanges.get("fclib").read_answer(path, problem)
    with h5py.File(path, "a") as file:
        file["solution/r"] = np.ones(3)
    np.testing.assert_array_equal(exchanges.get("fclib").read_answer(path, problem).r, np.ones(3))
    with pytest.raises(FormatError, match="another problem"):
        exchanges.get("fclib").read_answer(path, CASES["fc3-sparse-1"])


def test_fclib_reads_a_file_without_our_group(tmp_path: Path) -> None:
    problem = CASES["fc3-sparse-5"]
    exchanges.get("fclib").write_problem(problem, tmp_path / "p.hdf5")
    with h5py.File(tmp_path / "p.hdf5", "a") as file:
        del file["cpbench"]
    assert exchanges.get("fclib").read_problem(tmp_path / "p.hdf5").fingerprint == problem.fingerprint
