"""Newton-type solvers of nonlinear complementarity: published solutions, order of convergence, and what they are
made of."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import solve
from tiers import some_by_day

from cpbench import solve as solve_one
from cpbench.conversions.base import conversions, make
from cpbench.errors import UnknownName
from cpbench.formulations import AVI, LCP, MiCP, MiCPPoint
from cpbench.formulations.expressions import Map
from cpbench.formulations.ncp_functions import fischer_burmeister, minimum, penalized
from cpbench.foundation.cones import box_defect, project_box
from cpbench.generators.base import generators
from cpbench.solvers.base import Budget, Claim, solvers
from cpbench.solvers.shared.row_error import row_error
from cpbench.verification import judge
from cpbench_problems.generators.ncp_classics import DEGENERATE, MCPLIB_STARTS, REGULAR
from cpbench_solvers.nonlinear.box_newton import Reformulation
from cpbench_solvers.nonlinear.normal_path import NormalPath, normal_point

FUNCTIONS = {"min": minimum, "fb": fischer_burmeister, "pfb": penalized}
SOLVERS = (
    "josephy-newton", "newton-normal-map", "path-search",
    "newton-fb-micp", "newton-min-micp", "newton-pfb-micp",
)  # fmt: skip


@cache
def problem(collection: str, name: str) -> MiCP:
    """Of a collection, as a MiCP."""
    found = next(i.problem for i in generators.get(collection).instances() if i.name == name)
    return found if isinstance(found, MiCP) else conversions.get(f"{found.node}-micp")().apply(found)[0]


def run(name: str, micp: MiCP, start: Any = None, record: Any = None, tolerance: float = 1e-12, **options: Any) -> Any:
    solver = solvers.get(name)
    budget = Budget(tolerance=tolerance, seconds=30.0)
    point = None if start is None else MiCPPoint(z=np.array(start, dtype=float))
    return solver.run(micp, budget, solver.spec.options(**options), point, record)


# ------------------------------------------------------------------------------------ published solutions


@pytest.mark.parametrize("name", SOLVERS)
def test_kojima_and_shindo_from_the_published_starts(name: str) -> None:
    micp = problem("ncp-classics", "kojima-shindo")
    for start in MCPLIB_STARTS:
        output = run(name, micp, start)
        assert micp.residuals(output.point).error <= 1e-10, start
        # there are two solutions, and residuals of 1e-12 hold z only to 1e-6 at the degenerate one
        assert min(np.abs(output.point.z - REGULAR).max(), np.abs(output.point.z - DEGENERATE).max()) <= 1e-5, start


@pytest.mark.parametrize("name", some_by_day(SOLVERS, 40))
@pytest.mark.parametrize(
    ("collection", "instance"),
    [
        ("ncp-classics", "josephy"),
        ("ncp-classics", "munson1"),
        ("ncp-classics", "mathiesen"),
        ("nash-cournot", "nash-cournot-5"),
        ("nash-cournot", "nash-cournot-10"),
        ("membranes", "bratu-10x10-6"),
        ("harker-pang", "harker-pang-10"),
        ("walras", "cobb-douglas-4-3"),
    ],
)
def test_the_classics(name: str, collection: str, instance: str) -> None:
    micp = problem(collection, instance)
    output = run(name, micp, tolerance=1e-10)
    assert output.claim is Claim.SOLVED
    assert micp.residuals(output.point).error <= 1e-10


@pytest.mark.parametrize("name", SOLVERS)
def test_billups_problem_needs_another_start(name: str) -> None:
    """(z − 1)² − 1.01 has a local minimum of every merit at 0: said without restarts, left with them."""
    micp = problem("ncp-classics", "billups")
    stuck = run(name, micp, restarts=0)
    assert stuck.claim is Claim.FAILED
    assert "stuck" in stuck.message
    output = run(name, micp)
    assert abs(output.point.z[0] - (1.0 + math.sqrt(1.01))) <= 1e-9
    assert output.counters["restarts"] > 0


def test_iterates_may_leave_the_domain_or_not() -> None:
    """Nash–Cournot's (10 q)^(1/β) is not a number for q < 0; from 1 a full step goes there."""
    micp = problem("nash-cournot", "nash-cournot-10")
    for project in (True, False):
        for start in (np.ones(10), np.full(10, 10.0)):
            output = run("newton-fb-micp", micp, start, project=project)
            assert micp.residuals(output.point).error <= 1e-10


def test_a_start_outside_of_the_domain_is_left() -> None:
    import casadi as ca

    z = ca.SX.sym("z", 2)
    micp = MiCP(F=Map.from_casadi(z, ca.log(z) - 1.0), lb=np.zeros(2), ub=np.full(2, np.inf))
    output = run("newton-fb-micp", micp)
    assert np.abs(output.point.z - math.e).max() <= 1e-9
    nowhere = MiCP(F=Map.from_casadi(z, ca.log(-1.0 - z * z)), lb=np.zeros(2), ub=np.ones(2))
    output = run("newton-fb-micp", nowhere)
    assert output.claim is Claim.FAILED
    assert "not finite" in output.message


# ------------------------------------------------------------------------------------------------- order


def order(name: str, micp: MiCP, start: Any = None) -> float:
    """log(e₂/e₁)/log(e₁/e₀) of the last three errors above rounding that fall."""
    errors: list[float] = []
    run(name, micp, start, lambda k, error, point: errors.append(error), tolerance=1e-15)
    triples = [(a, b, c) for a, b, c in zip(errors, errors[1:], errors[2:], strict=False) if 0.2 > a > b > c > 3e-14]
    a, b, c = triples[-1]
    return math.log(c / b) / math.log(b / a)


@pytest.mark.parametrize("name", ["josephy-newton", "newton-fb-micp"])
def test_convergence_is_quadratic(name: str) -> None:
    for collection, instance in (
        ("nash-cournot", "nash-cournot-5"),
        ("nash-cournot", "nash-cournot-20"),
        ("harker-pang", "harker-pang-50"),
        ("membranes", "minimal-surface-9x9"),
    ):
        assert order(name, problem(collection, instance)) >= 1.8, instance
    josephy = problem("ncp-classics", "josephy")
    for start in MCPLIB_STARTS:
        assert order(name, josephy, start) >= 1.8, start


# ------------------------------------------------------------------------------------------ NCP functions


@pytest.mark.parametrize("name", list(FUNCTIONS))
def test_derivatives_of_the_composition(name: str, rng: np.random.Generator) -> None:
    """α and β against central differences, for every kind of bounds."""
    n = 60
    lb = np.where(np.arange(n) % 3 == 0, -np.inf, -rng.uniform(0.0, 1.0, n))
    ub = np.where(np.arange(n) % 2 == 0, np.inf, rng.uniform(0.1, 1.0, n))
    ub[6] = lb[6] = 0.25
    equation, psi, h = Reformulation(lb, ub), FUNCTIONS[name], 1e-6
    z, F = rng.standard_normal((2, n))
    _, alpha, beta = equation(psi, z, F)
    by_z = (equation(psi, z + h, F)[0] - equation(psi, z - h, F)[0]) / (2 * h)
    by_F = (equation(psi, z, F + h)[0] - equation(psi, z, F - h)[0]) / (2 * h)
    np.testing.assert_allclose(alpha, by_z, atol=1e-7)
    np.testing.assert_allclose(beta, by_F, atol=1e-7)
    if name == "min":
        np.testing.assert_allclose(equation(psi, z, F)[0], z - project_box(z - F, lb, ub), atol=1e-15)


def test_a_small_force_far_away_is_measured() -> None:
    """At z = 1e24 z − F is z: the residual once was 0 for F = 1e-2."""
    micp = problem("ncp-classics", "mathiesen")
    z = 1e24 * np.array([0.5e-24, 3.0, 1.1, 2.0])
    assert micp.residuals(MiCPPoint(z=z)).error > 1e-3
    w = np.array([1e-3, -1e-3])
    np.testing.assert_array_equal(box_defect(np.full(2, 1e20), w, np.zeros(2), np.full(2, np.inf)), w)


# --------------------------------------------------------------------------------- linear problems and paths


def linear(rng: np.random.Generator, n: int, *, sparse: bool = False) -> tuple[AVI, np.ndarray]:
    """A strongly monotone one with bounds of every kind, and a point within them."""
    A, B = rng.standard_normal((2, n, n)) / math.sqrt(n)
    M: Any = A @ A.T + B - B.T + 0.2 * np.eye(n)
    kind = np.arange(n) % 5
    lb = np.where((kind == 0) | (kind == 2), -np.inf, -rng.random(n))
    ub = np.where((kind == 0) | (kind == 1), np.inf, rng.random(n))
    ub[kind == 4] = lb[kind == 4]
    q = 3.0 * rng.standard_normal(n)
    box = AVI(M=sp.csr_array(M) if sparse else M, q=q, lb=lb, ub=ub)
    return box, project_box(rng.standard_normal(n), lb, ub)


def defect(box: AVI, z: Any) -> float:
    return float(np.linalg.norm(box_defect(z, box.M @ z + box.q, box.lb, box.ub)))


@pytest.mark.parametrize("sparse", [False, True])
def test_paths_end_at_the_zero_of_the_normal_map(sparse: bool, rng: np.random.Generator) -> None:
    for n in (1, 6, 40):
        box, present = linear(rng, n, sparse=sparse)
        F = box.M @ present + box.q
        start = normal_point(present, F, box.lb, box.ub)
        path = NormalPath(box.M, F, start, box.lb, box.ub)
        whole, half = path.trace(1.0, 1000, math.inf), path.trace(0.5, 1000, math.inf)
        assert whole is not None
        assert half is not None
        assert whole.t == 1.0
        assert defect(box, project_box(whole.x, box.lb, box.ub)) <= 1e-11
        # half of the residual is left at t = 1/2, in the normal map
        z = project_box(half.x, box.lb, box.ub)
        np.testing.assert_allclose(box.M @ z + box.q + half.x - z, 0.5 * (F + start - present), atol=1e-11)


def test_a_path_without_bounds_is_newtons_step(rng: np.random.Generator) -> None:
    M, F, x = rng.standard_normal((8, 8)), rng.standard_normal(8), rng.standard_normal(8)
    free = np.full(8, np.inf)
    found = NormalPath(M, F, x, -free, free).trace(1.0, 10, math.inf)
    assert found is not None
    np.testing.assert_allclose(found.x, x - solve(M, F), atol=1e-12)


@pytest.mark.parametrize("inner", ["lemke-avi", "auto-avi"])
def test_josephy_newton_with_any_solver_inside(inner: str) -> None:
    micp = problem("nash-cournot", "nash-cournot-10")
    output = run("josephy-newton", micp, inner=inner, tolerance=1e-9)
    assert micp.residuals(output.point).error <= 1e-9
    assert output.counters["subproblems"] <= 20


def test_inner_solvers_are_of_linear_problems() -> None:
    micp = problem("ncp-classics", "munson1")
    for inner in ("nsgs", "nobody"):
        with pytest.raises(UnknownName, match=inner):
            run("josephy-newton", micp, inner=inner)


def test_prices_have_a_kernel() -> None:
    """Demand does not notice the level of prices: each Jacobian is singular, and no regularized step may be spent on
    the ray of solutions."""
    micp = problem("walras", "cobb-douglas-40-12")
    output = run("newton-normal-map", micp, restarts=0)
    assert micp.residuals(output.point).error <= 1e-10
    assert output.counters["iterations"] <= 50, "290 iterations and 3 restarts before"


@pytest.mark.parametrize(
    ("solver", "collection", "name"),
    [
        ("newton-fb-micp", "scarf-activities", "activities-12-5-10"),
        ("newton-vi", "scarf-activities", "activities-12-5-10"),
        ("newton-vi", "ncp-classics", "mathiesen"),
        ("newton-fb-micp", "ncp-classics", "mathiesen-hard"),
        ("scipy-root-hybr", "scarf-activities", "activities-4-2-3"),
    ],
)
def test_no_claim_rests_on_a_pole_or_on_larger_rows(solver: str, collection: str, name: str) -> None:
    """The natural map as a whole is within the tolerance where prices miss by 5e-4 to 0.3 of their rows."""
    found = next(i.problem for i in generators.get(collection).instances() if i.name == name)
    answer = solve_one(found, solver=solver, tolerance=1e-6)
    assert answer.status in ("solved", "failed")


def test_a_row_counts_by_its_own_terms() -> None:
    """By hand: 10³z₁ = 10³, z₂ = 0.5 missed by 10⁻³; −2/z where z is beyond its bound, and that is positive."""
    free = np.full(2, np.inf)
    z, slope = np.array([1.0, 0.501]), sp.csr_array(np.diag([1e3, 1.0]))
    assert row_error(z, np.array([0.0, 1e-3]), slope, -free, free) == pytest.approx(1e-3)
    price = np.array([-1e-20])
    pole = row_error(price, -2.0 / price, sp.csr_array(2.0 / price[:, None] ** 2), np.zeros(1), free[:1])
    assert pole > 0.1


@pytest.mark.parametrize("name", ["newton-min", "newton-fb", "newton-pfb"])
def test_a_direction_may_be_too_long_for_its_powers(name: str) -> None:
    """z₁ = 1e150: the power 2.1 of the direction, 1e315, is no number of 64 bits."""
    problem = LCP(M=np.diag([1e-150, 1.0]), q=-np.ones(2))
    mixed = make("lcp-ncp").apply(problem)[0]
    mixed = make("ncp-micp").apply(mixed)[0]
    for solver, asked in ((name, problem), (f"{name}-micp", mixed)):
        output = solvers.get(solver).run(asked, Budget(seconds=10.0))
        assert output.claim in (Claim.SOLVED, Claim.FAILED, Claim.MAX_ITER)
        assert output.claim is not Claim.SOLVED or judge(asked, output.point, 1e-6).solved
