"""Exchanges of problems and answers with programs: there and back, and refusals."""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from command_line import cpbench as command
from storage_cases import cases, same
from tiers import some_by_day

from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import NCP, NLP, QP
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


# CasADi's own reader of .nl files and Ipopt, with the words and the file that AMPL expects
PROGRAM = """
import sys
import casadi as ca
import numpy as np

path = sys.argv[1]
assert sys.argv[2] == "-AMPL"
nl = ca.NlpBuilder()
nl.import_nl(path)
solver = ca.nlpsol("s", "ipopt", {"x": ca.vertcat(*nl.x), "f": nl.f, "g": ca.vertcat(*nl.g)},
                   {"ipopt.print_level": 0, "print_time": False, "ipopt.tol": 1e-9})
found = solver(x0=nl.x_init, lbx=nl.x_lb, ubx=nl.x_ub, lbg=nl.g_lb, ubg=nl.g_ub)
x, rows = np.array(found["x"]).ravel(), -np.array(found["lam_g"]).ravel()
code = {"Solve_Succeeded": 0, "Infeasible_Problem_Detected": 200}.get(solver.stats()["return_status"], 500)
lines = ["Ipopt by CasADi", "", "Options", "3", "1", "1", "0", len(rows), len(rows), len(x), len(x), *rows, *x]
with open(path.removesuffix(".nl") + ".sol", "w") as file:
    file.write("\\n".join(str(line) for line in [*lines, f"objno 0 {code}", ""]))
"""


def declared(tmp_path: Path, node: str) -> Path:
    (tmp_path / "program.py").write_text(PROGRAM)
    plugin = tmp_path / "solver.toml"
    words = f"'{sys.executable}' '{tmp_path / 'program.py'}' {{problem}} -AMPL"
    plugin.write_text(f'[solver.ipopt-{node}-nl]\nnode = "{node}"\ncommand = """{words}"""\nexchange = "nl"\n')
    return plugin


@pytest.mark.parametrize("case", ["nlp", "qp"])
def test_a_program_for_ampl_is_a_solver(case: str, tmp_path: Path) -> None:
    if case == "qp":  # min over z >= 0 of (z1 - 1)^2 + (z2 - 2)^2 where z1 + z2 <= 2, at (1/2, 3/2)
        problem = QP.build(2 * np.eye(2), np.array([-2.0, -4.0]), np.array([[-1.0, -1.0]]), np.array([-2.0]))
        storage.save(problem, tmp_path / "p.h5")
    else:
        storage.save(_program(), tmp_path / "p.h5")
    plugin = declared(tmp_path, case)
    ended = command(tmp_path, "solve", "p.h5", "-s", f"ipopt-{case}-nl", "--plugin", str(plugin), "--verbose")
    status = {"qp": "solved", "nlp": "only stationary"}[case]  # of a program that is not known to be convex
    first, *details = ended.stdout.splitlines()
    assert first.startswith(f"p ({case}): {status}"), ended.stdout + ended.stderr
    assert f"by ipopt-{case}-nl" in first
    assert any("claimed solved" in line for line in details)


def _program() -> NLP:
    """min z1 z4 (z1 + z2 + z3) + z3: the 71st of Hock and Schittkowski."""
    import casadi as ca

    from cpbench.formulations.expressions import Map

    z = ca.SX.sym("z", 4)
    return NLP(
        f=Map.from_casadi(z, z[0] * z[3] * (z[0] + z[1] + z[2]) + z[2]),
        g=Map.from_casadi(z, z[0] * z[1] * z[2] * z[3] - 25),
        h=Map.from_casadi(z, ca.sumsqr(z) - 40),
        lb=np.ones(4),
        ub=np.full(4, 5.0),
        start=np.array([1.0, 5.0, 5.0, 1.0]),
    )


# ------------------------------------------------------------------------------------------------- .sol files

SOL = "words\n\nOptions\n3\n1\n1\n0\n1\n1\n2\n2\n0.5\n1.5\n2.5\nobjno 0 {code}\n"
QUADRATIC = QP.build(np.eye(2), np.array([1.0, 2.0]), np.array([[1.0, 3.0]]), np.array([0.0]))


def test_what_bounds_push_with_is_what_is_left_of_the_gradient(tmp_path: Path) -> None:
    (tmp_path / "problem.sol").write_text(SOL.format(code=0))
    point = exchanges.get("nl").read_answer(tmp_path / "problem.sol", QUADRATIC)
    assert (point.z.tolist(), point.lam.tolist(), point.mu.tolist()) == ([1.5, 2.5], [0.5], [])
    assert point.nu.tolist() == [1.5 + 1.0 - 0.5, 2.5 + 2.0 - 1.5]


def test_a_tolerance_among_the_options_is_passed_over(tmp_path: Path) -> None:
    text = SOL.format(code=0).replace("Options\n3\n1\n1\n0\n", "Options\n5\n1\n3\n0\n1e-06\n")
    (tmp_path / "problem.sol").write_text(text)
    point = exchanges.get("nl").read_answer(tmp_path / "problem.sol", QUADRATIC)
    assert point.z.tolist() == [1.5, 2.5]


@pytest.mark.parametrize(
    ("code", "claim"),
    [(0, "solved"), (99, "solved"), (103, "solved"), (200, "infeasible"), (299, "infeasible"), (300, "unbounded"),
     (400, "max_iter"), (499, "max_iter"), (500, "failed"), (550, "failed"), (-1, "failed")],
)  # fmt: skip
def test_the_result_is_the_claim(code: int, claim: str, tmp_path: Path) -> None:
    (tmp_path / "problem.sol").write_text(SOL.format(code=code))
    assert exchanges.get("nl").claim(tmp_path / "problem.sol") == {"claim": claim, "message": "words"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (SOL.replace("Options", "Option"), "has no line 'Options'"),
        (SOL.replace("objno 0 {code}\n", ""), "has no 'objno NUMBER RESULT' behind the values"),
        (SOL.replace("2.5", "x"), "line 14: has 'x', expected a number"),
        (SOL.replace("\n2\n2\n", "\n2\n99999\n"), "has the size 99999, expected a whole number of 0 to"),
        (SOL.replace("\n1\n1\n2\n2\n0.5", "\n1\n0\n2\n2"), "has 0 multipliers of rows, expected 1"),
        (SOL.replace("\n2\n2\n0.5\n1.5\n2.5", "\n2\n1\n0.5\n1.5"), "has 1 numbers, expected 2, one for each unknown"),
        ("\n".join(SOL.split("\n")[:9]), "lines behind it, expected 4"),
        (SOL + "suffix 4 1 3 0 0\nrc\n7 1.0\n", "rc: has '7 1.0', expected an unknown and a number"),
    ],
)
def test_a_solution_that_cannot_be_read_is_refused_in_one_line(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "problem.sol").write_text(text.replace("{code}", "0"))
    with pytest.raises(FormatError) as refusal:
        exchanges.get("nl").read_answer(tmp_path / "problem.sol", QUADRATIC)
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_what_has_no_number_in_the_format_is_an_obstacle() -> None:
    from cpbench.formulations.expressions import Builder, Operator

    build = Builder(1)
    problem = NCP(F=build.finish([build.apply(Operator.ERF, 0)]))
    assert exchanges.get("nl").obstacle(problem) == (
        "the exchange nl cannot carry it: F has the operator erf, for which .nl has no number"
    )
