"""What packages are asked for: declared defaults beside the installed packages, the second solve, and its row."""

from __future__ import annotations

import json
import subprocess
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import command_line
import numpy as np
import planted
import pytest

import cpbench as cp
from cpbench import storage
from cpbench.bench.outcome import of_both
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store
from cpbench.formulations import NCP, MiCP, NCPPoint
from cpbench.formulations.expressions.recording import recorded
from cpbench.solvers.base import Budget, Claim, solvers
from cpbench.solvers.stopping import Stopping, second_tolerance
from cpbench.testing.cases import Case
from cpbench.testing.equivalents import in_unit
from cpbench.verification import judge
from cpbench_adapters import siconos, siconos_families
from cpbench_adapters.gams_mcp import path_settings
from cpbench_adapters.qp_tolerances import TESTS


def _package(tolerance: float) -> Stopping:
    return Stopping(test="max|F|", settings={"abstol": max(0.1 * tolerance, 1e-13)}, defaults={"abstol": 1e-6})


def test_the_second_tolerance_is_a_hundredth_over_the_factor_of_the_miss() -> None:
    assert second_tolerance(_package, 1e-6, "solved", 4e-6) == pytest.approx(2.5e-9, rel=1e-12)
    assert second_tolerance(_package, 1e-6, "solved", 5e-3) == pytest.approx(2e-12, rel=1e-12)


def test_the_second_tolerance_stays_above_rounding() -> None:
    """Ten digits below 1e-6 are beyond double precision: 1e-14 is the least."""
    finer = lambda tolerance: Stopping(test="max|F|", settings={"abstol": tolerance})  # noqa: E731
    assert second_tolerance(finer, 1e-6, "solved", 1e3) == 1e-14
    assert second_tolerance(finer, 1e-6, "solved", 0.25) == pytest.approx(4e-14, rel=1e-12)


@pytest.mark.parametrize(
    ("translate", "claim", "error"),
    [
        pytest.param(_package, "solved", 1e-6, id="met"),
        pytest.param(_package, "max_iter", 1e-3, id="not-claimed"),
        pytest.param(_package, "solved", None, id="not-measured"),
        pytest.param(_package, "solved", float("inf"), id="no-number"),
        pytest.param(lambda tolerance: None, "solved", 1e-3, id="no-package"),
        pytest.param(lambda tolerance: Stopping(test="pivoting"), "solved", 1e-3, id="no-tolerance"),
        pytest.param(lambda tolerance: _package(1e-13), "solved", 1e-3, id="at-its-least"),
    ],
)
def test_a_package_is_not_asked_twice_for_the_same(translate: Any, claim: str, error: float | None) -> None:
    assert second_tolerance(translate, 1e-6, claim, error) is None


FIRST = Outcome(
    status="wrong", claim="solved", error=5e-3, flags="clock", message="Optimal", solve=1.0, target_tolerance=1e-6
)


def test_a_right_second_answer_has_the_row() -> None:
    second = Outcome(
        status="solved", claim="solved", error=2e-9, flags="", message="", solve=3.0, target_tolerance=2e-11
    )
    row = of_both(FIRST, second, 2e-11)
    assert (row.status, row.error, row.solve, row.flags) == ("solved", 2e-9, 3.0, "twice")
    assert row.target_tolerance == 1e-6
    assert row.message == "asked twice, then for 2.0e-11; a first answer, claimed solved, was wrong: error 5.0e-03"


@pytest.mark.parametrize("status", ["wrong", "timeout", "failed", "error"])
def test_a_second_answer_that_is_not_right_leaves_the_first(status: str) -> None:
    row = of_both(FIRST, Outcome(status=status, error=4e-5, solve=3.0), 2e-11)
    assert (row.status, row.error, row.solve, row.flags) == ("wrong", 5e-3, 1.0, "clock,twice")
    assert row.message == f"Optimal; asked twice, then for 2.0e-11; the second answer is {status}: error 4.0e-05"


def _qp_in_small_units() -> Any:
    """Build a planted QP with its objective in units of 1e-6: stationarity to 1e-8 is two digits."""
    problem, point = planted.qp(np.random.default_rng(30), 6, 4, 2)
    case = in_unit(Case("qp", problem, point), 1e-6)
    assert case is not None
    return case.problem


def test_a_run_asks_a_package_twice_and_says_so(tmp_path: Path) -> None:
    """PIQP ends by absolute residuals."""
    pytest.importorskip("piqp", reason="needs the package: pip install cpbench[backends]")
    problem = _qp_in_small_units()
    alone = solvers.get("piqp").run(problem, Budget(tolerance=1e-6))
    assert alone.claim is Claim.SOLVED
    assert judge(problem, alone.point, 1e-6).error > 1e-6
    storage.save_pack({"small": problem}, tmp_path / "p.h5")
    done = command_line.cpbench(tmp_path, "run", "p.h5", "-s", "piqp", "-t", "1e-6", "-o", "r.sqlite", "--no-report")
    assert done.returncode == 0, done.stderr
    with Store(tmp_path / "r.sqlite") as store:
        (row,) = store.rows()
    assert (row.status, row.flags) == ("solved", "twice")
    assert row.error is not None
    assert row.error <= 1e-6
    assert row.message is not None
    assert "asked twice" in row.message


def test_a_solve_in_this_process_asks_a_package_twice_and_says_so() -> None:
    pytest.importorskip("piqp", reason="needs the package: pip install cpbench[backends]")
    solution = cp.solve(_qp_in_small_units(), "piqp", tolerance=1e-6)
    assert solution.status == "solved"
    assert "asked twice" in solution.message


def _cournot(firms: int, regions: int) -> NCP:
    """Build an oligopoly in several regions, whose prices (A_r/Q_r)^(1/1.1) have a pole where nothing is sold."""
    rng = np.random.default_rng(1)
    size = rng.uniform(2000.0, 7000.0, regions)
    cost, g = rng.uniform(2.0, 8.0, (firms, regions)), 1.0 / 1.1

    def profit(z: Any) -> Any:
        q = z.reshape(firms, regions)
        sold = q.sum(axis=0) + 1e-3
        price = np.array([(size[r] / sold[r]) ** g for r in range(regions)], dtype=object)
        capacity = q.sum(axis=1) / 5.0
        marginal = cost + 1.0 + np.stack([capacity] * regions, axis=1)
        return (marginal - price + q * (g * price / sold)).ravel()

    return NCP(F=recorded(firms * regions, profit))


def test_no_size_at_the_start_loosens_what_a_guest_is_asked_for() -> None:
    """‖F(0)‖ is about 1e7; the model of 20 firms and 5 regions was claimed solved at errors of 4e-3."""
    problem = _cournot(20, 5)
    assert problem.scale > 1e6
    box = MiCP(F=problem.F, lb=np.zeros(100), ub=np.full(100, np.inf), start=problem.start)
    for solver in solvers:
        if solver.spec.node in ("ncp", "micp") and solver.stopping(1e-8) is not None:
            asked = solver.stopping(1e-8, box if solver.spec.node == "micp" else problem)
            assert asked is not None
            assert max(asked.settings.values()) <= 1e-8, solver.spec.name


@pytest.mark.parametrize("name", ["siconos-ncp-newton-fb", "siconos-ncp-newton-min-fb"])
def test_claims_about_prices_with_a_pole_hold(name: str) -> None:
    solver = solvers.get(name)
    if not solver.availability().ok:
        pytest.skip(f"needs the package: {solver.availability().detail}")
    problem, rng = _cournot(20, 5), np.random.default_rng(2)
    for most in (1.0, 10.0):  # from farther starts its steps leave the quantities that can be sold
        output = solver.run(problem, Budget(tolerance=1e-8), start=NCPPoint(z=rng.uniform(0, most, 100)))
        assert output.claim is Claim.SOLVED
        assert judge(problem, output.point, 1e-8).within


def _siconos_defaults() -> Mapping[str, float]:
    found = siconos.about(siconos.interpreter())
    if "version" not in found:
        pytest.skip(f"Siconos is {found['state']}: {found['detail']}")
    program = (
        "import json, sys, siconos.numerics as n\n"
        "made = {name: n.SolverOptions(getattr(n, name)) for name in sys.argv[1:]}\n"
        "print(json.dumps({name: one.dparam[n.SICONOS_DPARAM_TOL] for name, one in made.items()}))"
    )
    command = [siconos.interpreter(), "-c", program, *_siconos_table()]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def _siconos_table() -> dict[str, float]:
    table = tomllib.loads(Path(siconos_families.__file__).with_suffix(".toml").read_text("utf-8"))
    return {row["constant"]: row["default"] for rows in table.values() if isinstance(rows, list) for row in rows}


def test_declared_defaults_of_siconos_are_its_own() -> None:
    assert _siconos_table() == _siconos_defaults()


def _defaults(package: str) -> Mapping[str, Any]:
    """Return an installed package's own settings by name."""
    module = pytest.importorskip(package, reason=f"needs the package: pip install {package}")
    if package == "clarabel":
        return _named(module.DefaultSettings())
    if package == "piqp":
        return _named(module.SparseSolver().settings)
    if package == "proxsuite":
        return _named(module.proxqp.Settings())
    if package == "qpalm":
        return _named(module.Settings())
    highs = module.Highs()
    return {name: highs.getOptionValue(name)[1] for name in TESTS["highs"].defaults}


def _named(settings: Any) -> dict[str, Any]:
    return {name: getattr(settings, name) for name in dir(settings) if not name.startswith("_")}


@pytest.mark.parametrize(
    ("backend", "package"),
    [
        ("clarabel", "clarabel"),
        ("piqp", "piqp"),
        ("proxqp", "proxsuite"),
        ("qpalm", "qpalm"),
        ("highs", "highspy"),
    ],
)
def test_declared_defaults_are_the_packages_own(backend: str, package: str) -> None:
    own = _defaults(package)
    declared = {name: value for name, value in TESTS[backend].defaults.items() if np.isfinite(value)}
    assert declared == {name: own[name] for name in declared}


def test_an_option_file_of_gams_has_the_translated_tolerance() -> None:
    """PATH's own default is 1e-6; a tenth of ours is asked for, at most that."""
    path: Any = solvers.get("gams-path-micp")
    options = path_settings(path.stopping(1e-8), Budget())
    assert options["convergence_tolerance"] == pytest.approx(1e-9, rel=1e-12)
    assert path_settings(path.stopping(1e-2), Budget())["convergence_tolerance"] == 1e-6
