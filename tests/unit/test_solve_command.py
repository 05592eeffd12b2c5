"""`cpbench solve`: the automatic choice, the answer first, limits, and what contacts do."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from command_line import cpbench as command
from tiers import some_by_day

import cpbench
from cpbench import storage
from cpbench.analysis.contact_table import contact_table
from cpbench.bench.planning import grids
from cpbench.bench.planning.plan import all_automatic
from cpbench.errors import CpbenchError
from cpbench.formulations import LCP, QP, Contacts, FCPoint, FrictionContact
from cpbench.verification import Status


def saved(folder: Path, problem: cpbench.LCP | QP | FrictionContact) -> str:
    storage.save(problem, folder / f"{problem.name}.h5")
    return f"{problem.name}.h5"


def first_line(text: str) -> str:
    return text.splitlines()[0]


# --------------------------------------------------------------------------------------- the choice


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    "address",
    some_by_day(
        [
            "lcp/lcp-classics.h5::pang-isolated",
            "ncp/walras.h5::cobb-douglas-4-3",
            "afc/anisotropic.h5::planted-10",
            "equation/equations.h5::rosenbrock",
        ],
        2,
    ),
)
def test_without_a_solver_the_command_chooses_as_python_does(address: str, tmp_path: Path) -> None:
    chosen = cpbench.solve(cpbench.load(f"builtin/{address}"))
    for given in ([], ["-s", "auto"]):
        row = json.loads(command(tmp_path, "solve", f"builtin/{address}", *given, "--json").stdout)
        assert (row["solver"], row["status"], row["route"]) == (chosen.solver, str(chosen.status), chosen.route)
    assert cpbench.solve(cpbench.load(f"builtin/{address}"), "auto").solver == chosen.solver


@pytest.mark.needs("cpbench_solvers")
def test_a_run_by_auto_has_one_row_a_problem_by_its_own_choice(tmp_path: Path) -> None:
    lcp = LCP(M=np.eye(2), q=[-1.0, 1.0], name="a")
    qp = QP.build(Q=np.eye(2), p=[-1.0, 1.0], lb=[0.0, 0.0], name="b")
    frame = cpbench.run([lcp, qp], "auto", repeats=1).frame
    assert dict(zip(frame["problem"], frame["solver"], strict=True)) == {"a": "auto-lcp", "b": "auto-qp"}


@pytest.mark.needs("cpbench_solvers")
def test_auto_has_no_options_and_no_row_of_its_own() -> None:
    with pytest.raises(CpbenchError, match="no options"):
        grids.grid("auto[members=installed]")
    assert grids.named(["auto", "lemke"]) == {"lemke"}
    assert {entry.solver for entry in grids.grid("auto")} == {*all_automatic()}


# --------------------------------------------------------------------------------------- the answer


@pytest.mark.needs("cpbench_solvers")
def test_the_first_line_has_status_objective_and_error(tmp_path: Path) -> None:
    """min (x − 3)²/2 − 4.5 over [0, 1]: x = 1, −2.5."""
    qp = QP.build(Q=[[1.0]], p=[-3.0], lb=[0.0], ub=[1.0], name="bounded")
    done = command(tmp_path, "solve", saved(tmp_path, qp))
    found = re.fullmatch(
        r"bounded \(qp\): solved; objective (\S+), error (\S+) \(1e-06 asked for\); by auto-qp in \S+ ms",
        first_line(done.stdout),
    )
    assert found is not None, done.stdout
    assert float(found[1]) == pytest.approx(-2.5)
    assert float(found[2]) <= 1e-6
    assert re.search(r"^  z\[0\] = 1$", done.stdout, re.MULTILINE)
    assert "seconds" not in done.stdout
    assert "seconds" in command(tmp_path, "solve", "bounded.h5", "--verbose").stdout


@pytest.mark.needs("cpbench_solvers")
def test_a_proof_of_no_solution_has_words_and_an_exit_code(tmp_path: Path) -> None:
    done = command(tmp_path, "solve", saved(tmp_path, LCP(M=[[-1.0]], q=[-1.0], name="none")))
    assert "there is no solution: infeasible, proved" in first_line(done.stdout)
    assert done.returncode == 0


# --------------------------------------------------------------------------------------- contacts


@pytest.mark.needs("cpbench_solvers")
def test_a_box_pushed_on_two_feet() -> None:
    """u = r + q: foot 0 sticks (|q_T| = 0.3 < 0.5·1), foot 1 slips (r_T = −0.5, u_T = 0.7), foot 2 opens."""
    frame = np.broadcast_to(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), (3, 3, 3))
    contacts = Contacts(id=[7, 8, 9], bodies=[[1, 0], [1, 0], [2, 1]], frame=frame)
    box = FrictionContact(W=np.eye(6), q=[-1.0, 0.3, -1.0, 1.2, 0.5, 0.0], mu=[0.5] * 3, dimension=2, contacts=contacts)
    table = cpbench.solve(box, tolerance=1e-9).contacts
    assert table is not None
    assert table.state.tolist() == ["stick", "slip", "open"]
    assert table.counts() == {"stick": 1, "slip": 1, "open": 1}
    assert table.id.tolist() == [7, 8, 9]
    np.testing.assert_allclose(table.normal, [1.0, 1.0, 0.0], atol=1e-8)
    np.testing.assert_allclose(table.friction, [0.6, 1.0, 0.0], atol=1e-8)
    np.testing.assert_allclose(table.opening, [0.0, 0.0, 0.5], atol=1e-8)
    np.testing.assert_allclose(table.sliding, [0.0, 0.7, 0.0], atol=1e-8)
    # normals are y, tangents x: on body 1 from the ground (2 up, −0.3 − 0.5 along x), nothing from body 2
    assert (table.bodies.tolist(), table.touched.tolist()) == ([0, 1, 2], [2, 2, 0])
    np.testing.assert_allclose(table.load, [[0.8, -2.0, 0.0], [-0.8, 2.0, 0.0], [0.0, 0.0, 0.0]], atol=1e-8)


def test_rolling_contacts_that_turn_without_slipping_roll() -> None:
    """The generator plants sticking, slipping, rolling and open contacts in turn."""
    address = "builtin/rfc/rolling.h5::planted-12"
    problem = cpbench.load(address)
    from cpbench.bench.planning.places import located
    from cpbench.generators.collection import builtin_folder

    planted = storage.solution(located(address, builtin_folder))
    assert planted is not None
    table = contact_table(problem, planted[0])
    turning = table.rolling > 0.1
    closed = table.state != "open"
    assert (table.state[closed & turning & (table.sliding < 0.1)] == "rolls").all()
    assert {*table.state.tolist()} == {"stick", "slip", "open", "rolls"}
    np.testing.assert_allclose(table.moment[table.state == "rolls"], 1.0)


def test_a_motion_below_the_tolerance_is_none() -> None:
    """r = (1, 0.5) at its edge, u_T a hundredth of the tolerance and a hundred times it."""
    for speed, state in ((1e-8, "stick"), (1e-4, "slip")):
        problem = FrictionContact(W=np.eye(2), q=[-1.0, 0.5 + speed], mu=[0.5], dimension=2)
        assert contact_table(problem, FCPoint(r=np.array([1.0, -0.5])), 1e-6).state.tolist() == [state]


@pytest.mark.needs("cpbench_solvers")
def test_the_command_shows_the_table_of_contacts(tmp_path: Path) -> None:
    box = FrictionContact(W=np.eye(4), q=[-1.0, 0.3, -1.0, 1.2], mu=[0.5] * 2, dimension=2, name="box")
    lines = command(tmp_path, "solve", saved(tmp_path, box)).stdout.splitlines()
    assert lines[1] == "  2 contacts: 1 stick, 1 slip"
    assert lines[2].split()[:3] + lines[2].split()[-1:] == ["contact", "normal", "force", "state"]
    assert [line.split()[-1] for line in lines[3:]] == ["stick", "slip"]
    assert cpbench.solve(LCP(M=[[1.0]], q=[-1.0])).contacts is None


# --------------------------------------------------------------------------------------- limits


@pytest.mark.needs("cpbench_solvers")
def test_the_memory_of_a_solve_is_limited(tmp_path: Path) -> None:
    """A factor of a dense 2100 × 2100 matrix has 35 MB, of which 4 MB are allowed.

    glibc serves up to 32 MB from memory that was freed before, which a limit of the address space does not see.
    """
    rng = np.random.default_rng(0)
    A = rng.standard_normal((2100, 2100))
    name = saved(tmp_path, LCP(M=A @ A.T + np.eye(2100), q=rng.standard_normal(2100), name="large"))
    done = command(tmp_path, "solve", name, "-s", "interior-point-lcp", "--memory", "4M", "--json")
    assert json.loads(done.stdout)["status"] == "memout", done.stdout
    assert done.returncode == 1


def test_a_solver_of_others_is_limited_alike(tmp_path: Path) -> None:
    pytest.importorskip("osqp", reason="needs a package: osqp")
    name = saved(tmp_path, QP.build(Q=[[1.0]], p=[-3.0], lb=[0.0], ub=[1.0], name="bounded"))
    row = json.loads(command(tmp_path, "solve", name, "-s", "osqp", "--json").stdout)
    assert (row["solver"], row["status"], row["route"]) == ("osqp", "solved", "direct")


@pytest.mark.parametrize(
    ("work", "status"), [("import time; time.sleep(60)", "timeout"), ("import os; os.kill(os.getpid(), 9)", "crash")]
)
def test_a_plugin_that_hangs_or_dies_is_stopped(tmp_path: Path, work: str, status: str) -> None:
    (tmp_path / "bad.py").write_text(
        "from cpbench.solvers.base import Solver, SolverSpec, register\n\n\n@register\nclass Bad(Solver):\n"
        "    spec = SolverSpec(name='bad', node='lcp', summary='bad', method='none')\n\n"
        f"    def solve(self, problem, budget, options, start=None):\n        {work}\n"
    )
    name = saved(tmp_path, LCP(M=np.eye(2), q=[-1.0, 1.0], name="small"))
    done = command(tmp_path, "solve", name, "-s", "bad", "--plugin", "bad.py", "--timeout", "1s", "--json")
    assert (json.loads(done.stdout)["status"], done.returncode) == (status, 1)


@pytest.mark.needs("cpbench_solvers")
def test_the_objective_is_that_of_the_file(tmp_path: Path) -> None:
    """max 3 + x + 2 y over x + y ≤ 4, x ≤ 3, y ≤ 2: x = 2, y = 2 and 9; the unknowns have the names of the file."""
    path = tmp_path / "best.mps"
    path.write_text(
        "NAME best\nOBJSENSE\n  MAX\nROWS\n N gain\n L room\nCOLUMNS\n east gain 1 room 1\n west gain 2 room 1\n"
        "RHS\n rhs room 4 gain -3\nBOUNDS\n UP b east 3\n UP b west 2\nENDATA\n"
    )
    first, *rest = command(tmp_path, "solve", path.name).stdout.splitlines()
    assert first.startswith("best (qp): solved; objective 9, ")
    assert [line.split() for line in rest[:2]] == [["east", "=", "2"], ["west", "=", "2"]]


SADDLE = np.diag([1.0, -1.0])
NO_POINT = LCP(M=[[-1.0, -1.0], [0.0, 1.0]], q=[-1.0, 1.0])
"""−z₁ − z₂ ≥ 1 with z ≥ 0."""


def squeezed(opposed: float, dimension: int = 3) -> FrictionContact:
    """Two contacts of one body, which close with 1 from both sides; `opposed` of a reaction acts at the other one."""
    W = np.eye(2 * dimension)
    W[0, dimension] = W[dimension, 0] = -opposed
    return FrictionContact(W=W, q=np.tile(-np.eye(dimension)[0], 2), mu=[0.5, 0.5], dimension=dimension)


@pytest.mark.needs("cpbench_solvers")
def test_what_has_no_solution_is_not_called_a_failure() -> None:
    for problem, status in ((squeezed(1.0), Status.INFEASIBLE), (QP.build(SADDLE, -np.ones(2)), Status.UNBOUNDED)):
        found = cpbench.solve(problem, seconds=5.0)
        assert found.status == status, (found.status, found.message)
        assert "proved" in found.message
    for problem in (squeezed(0.5), QP.build(SADDLE, -np.ones(2), ub=np.ones(2), lb=-np.ones(2))):
        assert cpbench.solve(problem, seconds=5.0).status not in (Status.INFEASIBLE, Status.UNBOUNDED)


@pytest.mark.needs("cpbench_solvers")
def test_a_proof_on_an_equivalent_problem_is_one_of_the_problem_that_was_asked() -> None:
    """No conditions are known of a nonlinear map; those of the LCP that it is stand for it."""
    problem = cpbench.convert(NO_POINT, "ncp").problem
    found = cpbench.solve(problem, seconds=5.0)
    assert found.status == Status.INFEASIBLE, (found.status, found.route, found.message)
    assert "which has the same solutions" in found.message
