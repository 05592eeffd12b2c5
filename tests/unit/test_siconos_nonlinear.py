"""Siconos' solvers of nonlinear problems: published solutions, the guest's evaluation of maps, and functions that
fail, are no numbers, or never end."""

from __future__ import annotations

import json
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from planted_nonlinear import graph
from tiers import some_by_day

from cpbench.conversions.base import conversions
from cpbench.errors import Ended, FormatError
from cpbench.formulations import NCP, VI, MiCP
from cpbench.formulations.exchange import exchanges
from cpbench.formulations.expressions import Builder, Map, Operator
from cpbench.foundation.cones import Cone
from cpbench.generators.base import generators
from cpbench.solvers import solvers
from cpbench.solvers.base import Budget, Claim
from cpbench.solvers.external.session import ProgramError
from cpbench.testing import cases
from cpbench.verification import judge
from cpbench_adapters import siconos, siconos_families
from cpbench_problems.generators.ncp_classics import DEGENERATE, MCPLIB_STARTS, REGULAR

NCP_SOLVERS = ("siconos-ncp-newton-fb", "siconos-ncp-newton-min-fb", "siconos-ncp-pathsearch")
MCP_SOLVERS = ("siconos-mcp-newton-fb", "siconos-mcp-newton-min-fb", "siconos-mcp-old-fb")
BOX_SOLVERS = ("siconos-vi-box-qi", "siconos-vi-box-avi")
VI_SOLVERS = ("siconos-vi-eg", "siconos-vi-fpp", "siconos-vi-hp")
GUESTS = Path(siconos.GUEST).parent


@pytest.fixture(scope="module", autouse=True)
def debian() -> None:
    found = siconos.about(siconos.interpreter())
    if "version" not in found:
        pytest.skip(f"needs Siconos: {found['detail']}")


@cache
def problem(collection: str, name: str) -> Any:
    return next(i.problem for i in generators.get(collection).instances() if i.name == name)


def run(name: str, given: Any, start: Any = None, tolerance: float = 1e-8, **budget: Any) -> Any:
    point = None if start is None else type(given.zero_point())(z=np.array(start, dtype=float))
    return solvers.get(name).run(given, Budget(tolerance=tolerance, seconds=30.0, **budget), start=point)


def in_the_guest(program: str, *arguments: str) -> Any:
    """What a program prints as JSON in the Python that has Siconos, beside the guest's modules."""
    command = [siconos.interpreter(), "-c", program, *arguments]
    env = {"PYTHONPATH": str(GUESTS), "PYTHONDONTWRITEBYTECODE": "1", "PATH": "/usr/bin:/bin"}
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False, env=env)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


# ------------------------------------------------------------------------------------ published solutions


@pytest.mark.parametrize("name", some_by_day(NCP_SOLVERS, 1))
def test_both_solutions_of_kojima_and_shindo_from_published_starts(name: str) -> None:
    given = problem("ncp-classics", "kojima-shindo")
    reached = set()
    for start in MCPLIB_STARTS:
        output = run(name, given, start)
        if output.claim is Claim.SOLVED:
            assert judge(given, output.point, 1e-8).solved, start
            near = [np.allclose(output.point.z, known, atol=1e-3) for known in (REGULAR, DEGENERATE)]
            assert any(near), f"{output.point.z} from {start}"
            reached.add(near.index(True))
    assert reached == {0, 1}


@pytest.mark.parametrize(
    ("solver", "collection", "name"),
    some_by_day(
        [
            *((s, "ncp-classics", "josephy") for s in NCP_SOLVERS[:2]),
            *((s, "ncp-classics", "mathiesen") for s in NCP_SOLVERS[:2]),
            *((s, "nash-cournot", "nash-cournot-5") for s in NCP_SOLVERS),
            *((s, "nash-cournot", "nash-cournot-10") for s in NCP_SOLVERS),
            *((s, "membranes", "minimal-surface-9x9") for s in MCP_SOLVERS),
            *((s, "vi-classics", "fukushima") for s in MCP_SOLVERS),
            *((s, "membranes", "membrane-10x10") for s in BOX_SOLVERS),
            *((s, "membranes", "bratu-10x10-6") for s in BOX_SOLVERS),
            *((s, "vi-planted", "box-12") for s in VI_SOLVERS[:2]),
        ],
        5,
    ),
)
def test_problems_of_the_collections(solver: str, collection: str, name: str) -> None:
    given = problem(collection, name)
    if given.node != solvers.get(solver).spec.node:
        given = conversions.get(f"{given.node}-micp")().apply(given)[0]
    output = run(solver, given, tolerance=1e-9)
    assert judge(given, output.point, 1e-8).solved, output.message
    assert output.counters["evaluations"] > 0
    assert (output.counters["jacobians"] > 0) == (solver not in VI_SOLVERS)


@pytest.mark.parametrize("solver", MCP_SOLVERS)
def test_bounds_on_either_side_and_in_any_order(solver: str) -> None:
    """z₀ ≤ 5, z₁ ≥ −3, z₂ free, z₃ ≥ 1 at its bound: F = z − (7, −1, 2, −4) has the solution (5, −1, 2, 1)."""
    inf = np.inf
    F = graph(4, lambda z: z - np.array([7.0, -1.0, 2.0, -4.0]))
    given = MiCP(F=F, lb=[-inf, -3.0, -inf, 1.0], ub=[5.0, inf, inf, inf])
    output = run(solver, given)
    np.testing.assert_allclose(output.point.z, [5.0, -1.0, 2.0, 1.0], atol=1e-7)
    assert solver == "siconos-mcp-old-fb" or output.claim is Claim.SOLVED


@pytest.mark.parametrize("solver", VI_SOLVERS[:2])
def test_sets_are_projected_on_by_the_guest(solver: str) -> None:
    """A ball of radius 1 and a cone of slope 1 beside bounds: F = z − a, whose solution is the projection of a."""
    a = np.array([3.0, 4.0, 0.0, 2.0, 0.0, 9.0])
    given = VI(
        F=graph(6, lambda z: z - a),
        cone_kind=[float(Cone.BALL), float(Cone.SECOND_ORDER), float(Cone.FREE)],
        cone_size=[2.0, 3.0, 1.0],
        cone_mu=[1.0, 1.0, 0.0],
        cone_mu_r=np.zeros(3),
        lb=np.full(6, -np.inf),
        ub=[*[np.inf] * 5, 1.0],
    )
    output = run(solver, given)
    assert output.claim is Claim.SOLVED
    np.testing.assert_allclose(output.point.z, [0.6, 0.8, 1.0, 1.0, 0.0, 1.0], atol=1e-7)


# ------------------------------------------------------------------------------------------------ starts


@pytest.mark.parametrize("name", NCP_SOLVERS)
def test_the_start_is_where_it_begins(name: str) -> None:
    """0 for a start is no problem's start: (z − 1)(z − 3) has a root beside each."""
    F = graph(1, lambda z: (z - 1.0) * (z - 3.0))
    for first, root in ((0.8, 1.0), (3.2, 3.0)):
        assert run(name, NCP(F=F, start=[first])).point.z[0] == pytest.approx(root, abs=1e-6)
        assert run(name, NCP(F=F, start=[2.0]), start=[first]).point.z[0] == pytest.approx(root, abs=1e-6)


def test_a_start_outside_of_the_set_is_projected() -> None:
    """F is not a number where the start is; it is at its projection 0."""
    given = NCP(F=graph(1, lambda z: np.log(1.0 + z) - 1.0))
    output = run("siconos-ncp-newton-fb", given, start=[-9.0])
    assert output.claim is Claim.SOLVED
    assert output.point.z[0] == pytest.approx(np.e - 1.0, abs=1e-6)


# ---------------------------------------------------------------------------------------- the evaluation

VALUES = """
import json, sys, numpy as np
from pathlib import Path
from siconos_memory import read
from siconos_maps import Smooth
data = read(Path(sys.argv[1]))
n = int(data["F.inputs"][0])
smooth = Smooth(data, np.arange(n), np.ones(n), np.zeros(n))
z = np.load(sys.argv[2])
F, J = np.zeros(n), np.zeros((n, n), order="F")
smooth.evaluate(z.ctypes.data, F.ctypes.data)
smooth.differentiate(z.ctypes.data, J.ctypes.data)
print(json.dumps([F.tolist(), J.tolist(), str(smooth.failure), "scipy" in sys.modules, "casadi" in sys.modules]))
"""


def test_the_guest_computes_what_maps_compute(tmp_path: Path) -> None:
    """All operators, in Python without CasADi and SciPy, against the map's own values and Jacobian."""
    build = Builder(2)
    rows = []
    for operator in Operator:
        rows.append(build.apply(operator, 0, 1) if operator.binary else build.apply(operator, 0))
    build_rows = [build.apply(Operator.MUL, row, 1) for row in rows]
    F = build.finish(build_rows)
    n = F.rows
    z = np.full(n, 0.5)
    z[0], z[1] = 0.3, 0.7
    wide = Map(n, F.constants, F.heads, *(_moved(F, side, n) for side in (F.left, F.right, F.outputs)))
    exchanges.get("npy-dir").write_problem(NCP(F=wide), tmp_path / "p")
    np.save(tmp_path / "z.npy", z)
    value, jacobian, failure, *imported = in_the_guest(VALUES, str(tmp_path / "p"), str(tmp_path / "z.npy"))
    assert failure == "None"
    np.testing.assert_allclose(value, wide(z), rtol=1e-14, atol=0)
    np.testing.assert_allclose(jacobian, wide.jacobian(z).toarray(), rtol=1e-13, atol=1e-15)
    assert imported == [False, False]


def _moved(F: Map, numbers: Any, inputs: int) -> Any:
    """Numbers of values where there are more unknowns."""
    return np.where(numbers < F.inputs, numbers, numbers + inputs - F.inputs)


def test_a_folder_whose_map_is_none_is_refused(tmp_path: Path) -> None:
    exchange, path = exchanges.get("npy-dir"), tmp_path / "p"
    for name, value, why in (
        ("F.left", np.array([7]), "not an earlier value"),
        ("F.heads", np.array([99]), "not an operator"),
        ("F.heads", np.array([0.5]), "not whole"),
        ("F.inputs", np.array([1, 1]), "not whole"),
        ("F.outputs", None, "is missing"),
    ):
        exchange.write_problem(NCP(F=graph(1, lambda z: -z)), path)
        file = path / f"{name}.npy"
        file.unlink() if value is None else np.save(file, value)
        with pytest.raises(FormatError, match=why):
            exchange.read_problem(path)


# ----------------------------------------------------------------------------- what goes wrong in Siconos

FAILS = """
import json, sys
from siconos_guest import Guest
guest = Guest(sys.argv[1], "dense")
guest.load({"problem": sys.argv[2], "node": "x"})
calls = []
def broken(z):
    calls.append(1)
    raise ZeroDivisionError("in the map")
setattr(guest.loaded.smooth, sys.argv[4], broken)
request = {"start": sys.argv[3], "options": {"tolerance": 1e-9, "max_iter": 5, "inner": ""}}
try:
    print(json.dumps([guest.solve(request), len(calls)]))
except ZeroDivisionError as cause:
    print(json.dumps([str(cause), len(calls)]))
"""


@pytest.mark.parametrize("which", some_by_day(["value", "entries"], 1))
@pytest.mark.parametrize("solver", ["siconos-ncp-newton-fb", "siconos-mcp-newton-fb", "siconos-mcp-old-fb"])
def test_a_function_that_fails_is_no_answer(solver: str, which: str, tmp_path: Path) -> None:
    """Nothing can be raised through C: the first failure is kept, and told when Siconos returns."""
    given = problem("ncp-classics", "josephy")
    if solvers.get(solver).spec.node == "micp":
        given = conversions.get("ncp-micp")().apply(given)[0]
    exchange = exchanges.get("npy-dir")
    exchange.write_problem(given, tmp_path / "p")
    exchange.write_answer(given.zero_point(), tmp_path / "start")
    chosen: Any = solvers.get(solver)
    said, calls = in_the_guest(FAILS, chosen.row.constant, str(tmp_path / "p"), str(tmp_path / "start"), which)
    assert said == "in the map"
    assert calls == 1


@pytest.mark.nightly
def test_a_solver_that_does_not_end_is_killed_and_the_next_problem_is_solved() -> None:
    """A rotation, on which hyperplanes go on and on, with more iterations than anybody waits for."""
    turning = VI(F=graph(2, lambda z: np.array([z[1], -z[0]]) * 1e-9), start=[1.0, 1.0])
    with pytest.raises(ProgramError, match="did not answer"):
        solvers.get("siconos-vi-hp").run(turning, Budget(tolerance=1e-300, seconds=0.1, iterations=10**9))
    given = next(case.problem for case in cases("vi") if case.name == "one")
    assert run("siconos-vi-hp", given).claim is Claim.SOLVED


def test_a_solver_that_aborts_is_a_row_of_its_own() -> None:
    """An assertion of its path search ends its process where F is not a number; the next problem has another one."""
    nowhere = NCP(F=graph(1, lambda z: np.log(-1.0 - z)))
    with pytest.raises(Ended):
        run("siconos-ncp-pathsearch", nowhere)
    output = run("siconos-ncp-pathsearch", problem("nash-cournot", "nash-cournot-5"))
    assert output.claim is Claim.SOLVED


# ------------------------------------------------------------------------------------------------ refusals


def test_what_siconos_cannot_hold_is_refused_before_the_solve() -> None:
    one = graph(1, lambda z: z)
    both = MiCP(F=one, lb=[0.0], ub=[1.0])
    below = MiCP(F=one, lb=[0.0], ub=[np.inf])
    for solver in MCP_SOLVERS:
        assert "two bounds" in str(solvers.get(solver).obstacle(both))
        assert solvers.get(solver).obstacle(below) is None
    for solver in BOX_SOLVERS:
        assert "infinite bound" in str(solvers.get(solver).obstacle(below))
        assert solvers.get(solver).obstacle(both) is None
    rows = VI(F=one, A=np.eye(1), b=[1.0])
    assert "1 rows" in str(solvers.get("siconos-vi-eg").obstacle(rows))
    n = siconos_families.LARGEST + 1
    assert f"n = {n}" in str(solvers.get("siconos-ncp-newton-fb").obstacle(NCP(F=graph(n, lambda z: z))))
