"""Native solvers of variational and quasi-variational inequalities and of equations: on problems of the generators and
on planted ones, judged by residuals; generalized Jacobians against differences; what they say of what is not theirs."""

from __future__ import annotations

import numpy as np
import planted_nonlinear as plant
import pytest
from planted_nonlinear import graph
from tiers import some_by_day

from cpbench.formulations import QVI, VI, Equation, VIPoint
from cpbench.formulations.conic import cone_fields
from cpbench.formulations.expressions.recording import MapRecorder
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.generators import generators
from cpbench.graph import arrive, lift
from cpbench.solvers.base import Budget, Claim, solvers
from cpbench.testing import cases
from cpbench.verification import judge
from cpbench_solvers.nonlinear.natural_newton import VIConditions

PROJECTION = ("projection-vi", "extragradient-vi")
INSTANCES = {
    i.name: i.problem
    for c in generators
    if c.builtin and c.node in ("vi", "qvi")
    for i in c.instances()
    if i.problem.node in ("vi", "qvi")
}
PROBLEMS = INSTANCES | {f"{node}-{case.name}": case.problem for node in ("vi", "qvi") for case in cases(node)}


def _solved(solver: str, problem, tolerance: float):
    """Its claim is true by the natural map, and the verdict's error is not far above that."""
    output = solvers.get(solver).run(problem, Budget(tolerance=tolerance, seconds=20.0))
    assert output.claim is Claim.SOLVED, f"{output.claim}: {output.message}"
    assert problem.residuals(output.point, tolerance).error <= tolerance
    assert judge(problem, output.point, tolerance).error <= 100 * tolerance
    return output


@pytest.mark.parametrize("name", some_by_day(PROBLEMS, 20))
def test_newton_solves_every_problem(name: str) -> None:
    """Where F has a pole beside a bound, as in mathiesen-polyhedron, the natural map is 0 on its other side, too."""
    problem = PROBLEMS[name]
    _solved(f"newton-{problem.node}", problem, 1e-10)


@pytest.mark.parametrize("name", ["generalized-2", "generalized-10"])
def test_newton_goes_on_until_the_parts_are_solved_too(name: str) -> None:
    """Of these cubic equations the natural map is below 1e-6 a step before the part that is worst."""
    (problem,) = [i.problem for i in generators.get("ge-planted").instances() if i.name == name]
    arrival = arrive(problem, "vi")
    output = solvers.get("newton-vi").run(arrival.problem, Budget(tolerance=1e-6))
    assert output.claim is Claim.SOLVED
    assert judge(problem, lift(arrival.problem, output.point), 1e-6).solved


@pytest.mark.parametrize("name", ["generalized-2", "membrane-20x20"])
@pytest.mark.parametrize("solver", PROJECTION)
def test_claims_of_projections_hold_in_every_unit(solver: str, name: str) -> None:
    """A cubic equation over balls of other sizes, and an affine one of 400 rows: norms over all are met too early."""
    problem = next(
        i.problem for c in ("ge-planted", "membranes") for i in generators.get(c).instances() if i.name == name
    )
    arrival = arrive(problem, "vi")
    output = solvers.get(solver).run(arrival.problem, Budget(tolerance=1e-6))
    assert output.claim is Claim.SOLVED
    assert judge(problem, lift(arrival.problem, output.point), 1e-6).solved


@pytest.mark.parametrize("solver", PROJECTION)
def test_a_rotation_is_solved_by_all_but_the_fixed_point(solver: str) -> None:
    """F(z) = (z₂ − 1, 1 − z₁), monotone and not cocoercive: steps of z − γF(z) only lead away from (1, 1)."""

    problem = VI(F=graph(2, lambda x: np.array([x[1] - 1.0, 1.0 - x[0]])), lb=[-5.0, -5.0], ub=[5.0, 5.0])
    output = solvers.get(solver).run(problem, Budget(tolerance=1e-9, iterations=3000))
    assert judge(problem, output.point, 1e-9).solved == (solver != "projection-vi")
    assert (output.claim is Claim.SOLVED) == (solver != "projection-vi")


@pytest.mark.parametrize("name", [n for n in PROBLEMS if PROBLEMS[n].node == "qvi" and not PROBLEMS[n].g.rows])
def test_projection_on_moving_sets(name: str) -> None:
    _solved("projection-qvi", PROBLEMS[name], 1e-10)


@pytest.mark.parametrize("solver", [*PROJECTION, "projection-qvi"])
def test_rows_are_refused_with_a_way_out(solver: str) -> None:
    node = solvers.get(solver).spec.node
    problem = PROBLEMS["vi-everything" if node == "vi" else "qvi-moving-rows"]
    why = solvers.get(solver).obstacle(problem)
    assert why is not None
    assert f"newton-{node}" in why


@pytest.mark.parametrize("power", [-8, 8])
@pytest.mark.parametrize("solver", [*PROJECTION, "newton-vi"])
def test_units_do_not_matter(solver: str, power: int) -> None:
    """F in other units is solved as well: step lengths are measured."""
    problem = PROBLEMS["vi-box"]
    scale = 10.0**power
    record = MapRecorder(problem.start.size)
    F = record.map(scale * record(problem.F, record.z))
    scaled = VI(F=F, lb=problem.lb, ub=problem.ub, start=problem.start)
    _solved(solver, scaled, 1e-8)


def test_newton_converges_quadratically() -> None:
    """F(z) = exp(z) + Mz on a box, a regular solution: the order of the last steps above rounding is nearly 2."""

    M = np.array([[3.0, 1.0, 0.0], [-1.0, 2.0, 1.0], [0.0, -1.0, 2.0]])
    F = graph(3, lambda x: np.exp(x) + M @ x - np.array([40.0, 5.0, -9.0]))
    errors: list[float] = []
    problem = VI(F=F, lb=np.zeros(3), start=[5.0, 5.0, 5.0])
    solvers.get("newton-vi").run(problem, Budget(tolerance=1e-13), record=lambda k, error, point: errors.append(error))
    steps = np.log([e for e in errors if e > 1e-13])
    orders = np.diff(steps)[1:] / np.diff(steps)[:-1]
    assert errors[-1] <= 1e-13
    assert orders[-2:].max() > 1.8


def _off_corners(node: str) -> dict[str, VI | QVI]:
    rng = np.random.default_rng(500)
    if node == "vi":
        return {
            "product": plant.vi(rng, 3, plant.product(rng), 3, 1, 2)[0],
            "ball": plant.vi(rng, 2, ProductCone.of((Cone.BALL, 2, 3, 0.5)), 1, 1, 1)[0],
        }
    return {
        "box": plant.moving_box(rng, 6)[0],
        "disk": plant.friction_as_qvi(rng, 4, 3)[0],
        "rows": plant.moving_rows(rng, 5, 3)[0],
    }


@pytest.mark.parametrize(
    ("node", "name"), [("vi", "product"), ("vi", "ball"), ("qvi", "box"), ("qvi", "disk"), ("qvi", "rows")]
)
def test_the_newton_matrix_is_the_derivative(node: str, name: str) -> None:
    """At random points, where the natural map is differentiable: against central differences."""
    problem = _off_corners(node)[name]
    field, rng = VIConditions(problem), np.random.default_rng(501)
    compared = 0
    for _ in range(5):
        x = rng.standard_normal(field.size)
        J, moving = field.projection(x - field.F(x), x)
        eye = np.eye(x.size)
        V = eye - J.toarray() @ (eye - field.derivative(x).toarray()) - moving.toarray()
        numbers = {}
        for h in (1e-6, 3e-6):
            columns = [
                (field.defect(x + h * e, field.F(x + h * e)) - field.defect(x - h * e, field.F(x - h * e))) / (2 * h)
                for e in eye
            ]
            numbers[h] = np.array(columns).T
        if np.abs(numbers[1e-6] - numbers[3e-6]).max() < 1e-6:  # else a corner is between
            np.testing.assert_allclose(V, numbers[1e-6], atol=1e-6)
            compared += 1
    assert compared >= 3


def test_a_pole_is_not_a_root() -> None:
    """z²/z is z for all numbers but 0, where it has no value: steps to 0 end at numbers that look like a root."""
    equation = Equation(F=graph(1, lambda x: x * x / x), start=[1.0])
    output = solvers.get("newton-equation").run(equation, Budget(iterations=300))
    assert output.claim is not Claim.SOLVED


def test_f_beside_a_huge_z_is_not_lost() -> None:
    """F = 1 everywhere has no root; z − (z − 1) is 0 in floating point for z = −1e20."""
    constant = graph(1, lambda x: 1.0 + 0.0 * x)
    free = VI(F=constant)
    assert judge(free, VIPoint(z=np.array([-1e20])), 1e-6).error > 0.9
    moving = QVI(F=constant)
    assert judge(moving, moving.point_from_vector([-1e20]), 1e-6).error >= 1.0
    whole = VI(F=constant, **cone_fields(ProductCone.of((Cone.FREE, 1, 1))))
    assert judge(whole, VIPoint(z=np.array([1e20])), 1e-6).error > 0.9
