"""QP backends on planted problems: judged by our residuals, never by what the backend says.

A planted QP chooses z, the multipliers and the active set first and computes p, b, d and the bounds from them, so
the KKT conditions hold by construction. Failures that were measured stand in `spec.known_failures` and are strict:
a backend that stops failing fails the test.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from tiers import by_night, some_by_day

from cpbench import storage
from cpbench.errors import Unavailable
from cpbench.formulations.linear import AVI
from cpbench.formulations.programs import QP, QPPoint
from cpbench.solvers import Budget, Claim, Trait, solvers
from cpbench.solvers.base import Availability
from cpbench.verification import judge
from cpbench_adapters.qp_backend import DENSE_LIMIT
from cpbench_adapters.qp_standard_form import standard_form
from cpbench_adapters.qp_tolerances import TABLE, translate

BACKENDS = sorted(TABLE)
TIMED = (
    "casadi-qpoases",
    "clarabel",
    "copt",
    "daqp",
    "gurobi",
    "highs",
    "osqp",
    "qpalm",
    "scs",
    "sip",
    "moreau",
    "moreau-ipm",
)
"""The backends that know a time limit."""
PROPRIETARY = [name for name in BACKENDS if solvers.get(name).spec.licence == "proprietary"]


def planted(
    n: int,
    m: int,
    k: int,
    seed: int,
    *,
    rank: int | None = None,
    bounds: bool = True,
    degenerate: bool = False,
    fixed: int = 0,
    sparse: bool = False,
) -> tuple[QP, QPPoint]:
    """A QP with a known KKT point; bounds are a mix of none, one-sided, two-sided, active at either end, equal."""
    rng = np.random.default_rng(seed)
    F = rng.normal(size=(n, n if rank is None else rank))
    Q = F @ F.T / n
    A, C, z = rng.normal(size=(m, n)), rng.normal(size=(k, n)), rng.normal(size=n)
    lam = np.where(rng.random(m) < 0.5, rng.random(m) + 0.1, 0.0)
    mu, nu = rng.normal(size=k), np.zeros(n)
    lb, ub = np.full(n, -np.inf), np.full(n, np.inf)
    if bounds:
        kind = rng.integers(0, 6, n)
        lb = np.select([kind == 0, kind == 1, kind == 4], [z, z - 1.0, z - 0.5], -np.inf)
        ub = np.select([kind == 2, kind == 3, kind == 4], [z, z + 1.0, z + 0.5], np.inf)
        nu = np.select([kind == 0, kind == 2], [rng.random(n) + 0.1, -rng.random(n) - 0.1], 0.0)
        lb[:fixed] = ub[:fixed] = z[:fixed]
        nu[:fixed] = rng.normal(size=fixed)
    slack = np.where((lam > 0) | degenerate, 0.0, rng.random(m) + 0.1)
    p = -(Q @ z) + A.T @ lam + C.T @ mu + nu
    M: Callable[[Any], Any] = sp.csr_array if sparse else np.asarray
    problem = QP.build(Q=M(Q), p=p, A=M(A), b=A @ z - slack, C=M(C), d=C @ z, lb=lb, ub=ub)
    return problem, QPPoint(z=z, lam=lam, mu=mu, nu=nu)


CASES: dict[str, tuple[QP, QPPoint]] = {
    "mixed": planted(12, 8, 3, 1),
    "sparse": planted(12, 8, 3, 1, sparse=True),
    "n60": planted(60, 20, 5, 2),
    "psd": planted(12, 10, 2, 3, rank=6),
    "lp": planted(6, 14, 2, 4, rank=0),
    "unconstrained": planted(8, 0, 0, 5, bounds=False),
    "unconstrained-psd": planted(8, 0, 0, 12, rank=4, bounds=False),
    "box": planted(10, 0, 0, 6),
    "box-psd": planted(20, 0, 0, 13, rank=6),
    "one-unknown": planted(1, 2, 0, 7),
    "degenerate": planted(8, 14, 1, 8, degenerate=True),
    "equalities": planted(8, 0, 3, 9, bounds=False),
    "inequalities": planted(8, 9, 0, 10, bounds=False),
    "fixed": planted(10, 6, 2, 11, fixed=3),
}


@pytest.fixture(params=BACKENDS)
def backend(request: pytest.FixtureRequest) -> Any:
    solver = solvers.get(request.param)
    available = solver.availability()
    if not available.ok:
        if solver.spec.licence == "proprietary":
            pytest.skip(f"needs a licence: pip install 'cpbench[commercial]' and one of {request.param}")
        pytest.skip(f"needs a package: {available.detail}")
    return solver


LEEWAY = 100.0
"""The backward error may be so much above the tolerance: it measures a bound by its own size, and what a tolerance
means to a backend measures it by the problem's."""


def error_of(solver: Any, problem: QP, tolerance: float) -> float:
    """The error by which a backend is asked to stop, or the backward error over `LEEWAY` where that is more.

    ∞ when the backend raises or has no answer.
    """
    try:
        point = solver.run(problem, Budget(tolerance=tolerance)).point
    except Exception:
        return np.inf
    if point is None:
        return np.inf
    return max(problem.residuals(point, tolerance).error, judge(problem, point, tolerance).error / LEEWAY)


@pytest.mark.parametrize("name", some_by_day(CASES, 5))
def test_planted(backend: Any, name: str) -> None:
    problem, _ = CASES[name]
    if why := backend.obstacle(problem):
        assert backend.definite
        assert "positive definite" in why
        assert "least eigenvalue" in why
        return
    failure = backend.spec.known_failures.get(f"planted-{name}")
    error = error_of(backend, problem, 1e-6)
    assert (error > 1e-6) == (failure is not None), f"error {error:.1e}; known failure: {failure}"


@pytest.mark.parametrize("tolerance", [1e-4, *by_night([1e-8])])
def test_the_error_follows_the_tolerance(backend: Any, tolerance: float) -> None:
    missed = {}
    for name, (problem, _) in CASES.items():
        if backend.obstacle(problem) is None and f"planted-{name}" not in backend.spec.known_failures:
            error = error_of(backend, problem, tolerance)
            if error > tolerance:
                missed[name] = f"{error:.1e}"
    failure = backend.spec.known_failures.get(f"tolerance-{tolerance:.0e}")
    assert bool(missed) == (failure is not None), f"missed: {missed}; known failure: {failure}"


# ------------------------------------------------------------------------------------------- claims


@pytest.mark.parametrize("name", PROPRIETARY)
def test_a_licence_that_does_not_do_says_so(name: str) -> None:
    """The free licences of Gurobi and COPT end at 2000 variables."""
    solver = solvers.get(name)
    if solver.availability().state in ("missing", "broken"):
        pytest.skip(f"needs a licence: pip install 'cpbench[commercial]' and one of {name}")
    n = 2001
    refusal = None
    try:
        solver.run(QP.build(Q=sp.csr_array(sp.eye_array(n)), p=-np.ones(n), lb=np.zeros(n)))
    except Unavailable as cause:
        refusal = cause
    if refusal is None:
        pytest.skip("does not apply: a licence without limits")
    assert refusal.state == "licence"
    assert "\n" not in refusal.detail


# --------------------------------------------------------------------------------------- obstacles


@pytest.mark.parametrize("name", BACKENDS)
def test_refusals(name: str) -> None:
    solver = solvers.get(name)
    indefinite = QP.build(Q=np.diag([1.0, -2.0]), p=np.zeros(2))
    why = str(solver.obstacle(indefinite))
    assert "not convex: Q has a negative eigenvalue (least eigenvalue at unit diagonal -1.0e+00" in why
    assert "n = 0" in str(solver.obstacle(QP.build(Q=np.zeros((0, 0)), p=np.zeros(0))))
    n = DENSE_LIMIT + 1
    large = QP.build(Q=sp.csr_array(sp.eye_array(n)), p=np.zeros(n))
    refused = solver.obstacle(large)
    assert (refused is None) == (Trait.SPARSE in solver.spec.traits)
    if refused:
        assert f"n = {n}" in refused
        assert " GB" in refused


@pytest.mark.parametrize("name", [name for name in BACKENDS if solvers.get(name).definite])
def test_a_singular_q_is_refused_with_its_eigenvalue(name: str) -> None:
    why = str(solvers.get(name).obstacle(QP.build(Q=np.diag([1.0, 0.0]), p=np.zeros(2))))
    assert "positive definite" in why
    assert "least eigenvalue at unit diagonal 0.0e+00" in why


# ----------------------------------------------------------------------------- form and settings


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("rows", [False, True])
def test_multipliers_survive_the_way_to_standard_form_and_back(sparse: bool, rows: bool) -> None:
    problem, point = planted(10, 6, 2, 11, fixed=3, sparse=True)
    form = standard_form(problem, sparse=sparse, bounds_as_rows=rows)
    lower, upper, fixed = (getattr(form, name) for name in ("lower", "upper", "fixed"))
    z = np.concatenate([point.lam, np.maximum(point.nu[lower], 0), np.maximum(-point.nu[upper], 0)])
    y = np.concatenate([-point.mu, -point.nu[fixed]])
    z_box = -point.nu if not rows else np.zeros(0)
    gradient = form.P @ point.z + form.q + form.G.T @ z + form.A.T @ y + (z_box if not rows else 0.0)
    assert np.abs(gradient).max() < 1e-13
    assert (form.G @ point.z <= form.h + 1e-13).all()
    assert np.abs(form.A @ point.z - form.b).max() < 1e-13
    back = form.point(point.z, z, y, z_box)
    for part, value in back.arrays().items():
        assert np.array_equal(value, getattr(point, part)), part


@pytest.mark.parametrize("name", BACKENDS)
def test_settings_follow_the_budget(name: str) -> None:
    loose, tight = (translate(name, Budget(tolerance=t)) for t in (1e-3, 1e-9))
    assert name == "quadprog" or loose != tight
    timed = translate(name, Budget(seconds=2.5))
    assert (2.5 in timed.values()) == (name in TIMED)
    assert name == "quadprog" or 7 in translate(name, Budget(iterations=7)).values()


def test_a_time_limit_reaches_the_backend(backend: Any) -> None:
    assert error_of(backend, CASES["mixed"][0], 1e-6) <= 1e-6  # the settings are accepted
    output = backend.run(CASES["mixed"][0], Budget(seconds=100.0))
    assert output.claim is Claim.SOLVED


# -------------------------------------------------------------------------------- published problems

MAROS_MESZAROS = {  # published optimal values (Maros and Mészáros 1999), the constant r included
    "HS35": 1.11111111e-01,
    "HS76": -4.68181818e00,
    "HS118": 6.64820452e02,
    "HS268": 5.73107049e-07,
    "HS52": 5.32664756e00,
    "DUAL4": 7.46090842e-01,
    "QAFIRO": -1.59078179e00,
    "CVXQP2_S": 8.12094048e03,
    "ZECEVIC2": -4.12500000e00,
}


@pytest.mark.parametrize("name", some_by_day(MAROS_MESZAROS, 1))
def test_maros_meszaros(backend: Any, name: str, shared_data: Path) -> None:
    problem: Any = storage.load(shared_data / "qp" / f"{name}.mat")
    constant = problem.info.properties.get("objective_offset", 0.0)
    if backend.obstacle(problem):
        return
    failure = backend.spec.known_failures.get(f"maros-meszaros-{name}")
    error = error_of(backend, problem, 1e-6)
    assert (error > 1e-6) == (failure is not None), f"error {error:.1e}; known failure: {failure}"
    if failure is None:
        z = backend.run(problem).point.z
        # relative to the terms of the objective: those of HS268 cancel to 1e-6 of themselves
        scale = max(1.0, abs(MAROS_MESZAROS[name]), abs(problem.p @ z), abs(constant))
        assert abs(problem.objective(z) + constant - MAROS_MESZAROS[name]) <= 1e-6 * scale


def test_interior_points_of_highs_need_both_packages_in_one_version(monkeypatch: pytest.MonkeyPatch) -> None:
    """With packages of two versions HiGHS takes its active set, and says nothing."""
    versions = {"highspy": "1.16.0", "highspy_extras": "1.15.1"}
    monkeypatch.setattr("cpbench_adapters.highs.package_version", versions.__getitem__)
    monkeypatch.setattr("cpbench.solvers.base.probe", lambda requires, install: Availability("ok"))
    state = solvers.get("hipo").availability()
    assert (state.state, state.detail.split(":")[0]) == (
        "broken", "highspy 1.16.0 and highspy-extras 1.15.1 are of two versions"
    )  # fmt: skip


@pytest.mark.parametrize("unit", [1e-8, 1.0, 1e8])
def test_daqp_solves_affine_inequalities_with_an_m_that_is_not_symmetric(unit: float) -> None:
    """Its answer is the planted one: bounds of all kinds, rows and equalities, in whatever unit z is."""
    pytest.importorskip("daqp")
    problem, z = planted_avi(30, 10, 3, unit)
    found = solvers.get("daqp-avi").run(problem, Budget(tolerance=1e-8))
    assert found.claim is Claim.SOLVED
    assert judge(problem, found.point, 1e-8).solved
    assert np.abs(found.point.z - z).max() <= 1e-8 * unit


def planted_avi(n: int, m: int, k: int, unit: float) -> tuple[AVI, np.ndarray]:
    """Return a strictly monotone problem and its solution, of the size of `unit`."""
    rng = np.random.default_rng(3)
    G, kind = rng.standard_normal((n, n)), rng.integers(0, 4, n)
    M, z = G @ G.T / n + 0.5 * (G - G.T) + 0.1 * np.eye(n), unit * rng.standard_normal(n)
    lb, ub = np.select([kind == 0, kind == 1], [z, z - unit], -np.inf), np.where(kind == 2, z, np.inf)
    nu = np.select([kind == 0, kind == 2], [1.0, -1.0], 0.0) * rng.uniform(0.1, 1.0, n) * unit
    A, C, lam = rng.standard_normal((m, n)), rng.standard_normal((k, n)), np.where(rng.random(m) < 0.5, unit, 0.0)
    mu = unit * rng.standard_normal(k)
    rows = {"A": A, "b": A @ z - unit * (lam == 0), "C": C, "d": C @ z}
    return AVI(M=M, q=nu - M @ z + A.T @ lam + C.T @ mu, **rows, lb=lb, ub=ub), z
