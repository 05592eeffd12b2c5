"""Any program with an interface to AMPL as a solver: an .nl file in, a .sol file out."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import cpbench as command

from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import NCP, NLP, QP
from cpbench.formulations.exchange import exchanges

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
