"""Second-order cones in MathOptFormat, plain and rotated, against the optimum that CVXPY finds of the same program."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cpbench
from cpbench.api.solution import objective_of
from cpbench.errors import FormatError

N = 3


def affine(F: Any, g: Any) -> dict[str, Any]:
    """The vector Fz + g as a function of MathOptFormat."""
    terms = [
        {"output_index": i + 1, "scalar_term": {"coefficient": float(F[i, j]), "variable": f"z{j}"}}
        for i, j in np.argwhere(F).tolist()
    ]
    return {"type": "VectorAffineFunction", "terms": terms, "constants": [float(value) for value in g]}


def model(objective: dict[str, Any], constraints: list[dict[str, Any]]) -> str:
    version = {"major": 1, "minor": 7}
    variables = [{"name": f"z{j}"} for j in range(N)]
    return json.dumps({"version": version, "variables": variables, "objective": objective, "constraints": constraints})


def loaded(folder: Path, objective: dict[str, Any], constraints: list[dict[str, Any]]) -> Any:
    path = folder / "program.mof.json"
    path.write_text(model(objective, constraints))
    return cpbench.load(path)


def least(p: Any, Q: Any = None, constant: float = 0.0, sense: str = "min") -> dict[str, Any]:
    """½zᵀQz + pᵀz + constant as an objective."""
    affine_terms = [{"coefficient": float(value), "variable": f"z{j}"} for j, value in enumerate(p)]
    quadratic = [
        {"coefficient": float(Q[i, j]), "variable_1": f"z{i}", "variable_2": f"z{j}"}
        for i in range(N)
        for j in range(i, N)
        if Q is not None
    ]
    function = {
        "type": "ScalarQuadraticFunction",
        "affine_terms": affine_terms,
        "quadratic_terms": quadratic,
        "constant": constant,
    }
    return {"sense": sense, "function": function}


def cone(kind: str, function: dict[str, Any]) -> dict[str, Any]:
    return {"function": function, "set": {"type": kind, "dimension": len(function["constants"])}}


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["SecondOrderCone", "RotatedSecondOrderCone"])
@pytest.mark.parametrize("quadratic", [False, True])
def test_programs_have_the_optimum_of_cvxpy(tmp_path: Path, seed: int, kind: str, quadratic: bool) -> None:
    """CVXPY has the rotated cone as ‖x‖²/u ≤ 2t, which is another text than the sum and difference of t and u here."""
    cvxpy = pytest.importorskip("cvxpy", reason="needs CVXPY: pip install cvxpy")
    rng = np.random.default_rng(seed)
    F, g = 0.3 * rng.standard_normal((4, N)), rng.standard_normal(4)
    g[:2] = 3.0, 2.5  # so that 0 is inside
    H = rng.standard_normal((N, N))
    Q = H @ H.T if quadratic else None
    p, row, upper = rng.standard_normal(N), rng.standard_normal(N), 1.5
    bound = {"function": {"type": "Variable", "name": "z0"}, "set": {"type": "LessThan", "upper": upper}}
    floor = {"function": {"type": "Variable", "name": "z1"}, "set": {"type": "GreaterThan", "lower": -50.0}}
    equal = {"function": affine(row[None], [-0.25]), "set": {"type": "Zeros", "dimension": 1}}
    ball = cone("SecondOrderCone", affine(np.vstack([np.zeros(N), np.eye(N)]), [9.0, 0, 0, 0]))
    rows = [cone(kind, affine(F, g)), bound, floor, equal, ball]
    problem = loaded(tmp_path, least(p, Q, constant=4.0), rows)
    solution = cpbench.solve(problem, tolerance=1e-8)

    z = cvxpy.Variable(N)
    s = F @ z + g
    inside = cvxpy.norm(s[1:]) <= s[0] if kind == "SecondOrderCone" else cvxpy.quad_over_lin(s[2:], s[1]) <= 2 * s[0]
    limits = [inside, z[0] <= upper, z[1] >= -50, row @ z == 0.25, cvxpy.norm(z) <= 9]
    quad = 0.5 * cvxpy.quad_form(z, Q) if Q is not None else 0
    value = cvxpy.Problem(cvxpy.Minimize(quad + p @ z + 4), limits).solve(solver="CLARABEL")
    assert problem.node == "coneqp"
    assert cpbench.verify(problem, solution, tolerance=1e-6)
    assert objective_of(problem, solution.point) == pytest.approx(value, rel=1e-5)
    assert solution.point.x == pytest.approx(z.value, abs=1e-3)


@pytest.mark.parametrize(("t", "u", "x", "inside"), [(1, 2, 2, True), (1, 2, 2.001, False), (-1, -2, 1, False)])
def test_points_at_the_boundary_of_the_rotated_cone(tmp_path: Path, t: float, u: float, x: float, inside: bool) -> None:
    """2tu ≥ x², t and u ≥ 0; both factors of the product may not be negative."""
    rotated = cone("RotatedSecondOrderCone", affine(np.eye(N), np.zeros(N)))
    problem = loaded(tmp_path, least(np.zeros(N)), [rotated])
    s = problem.slacks(problem.point_from_vector([t, u, x, *np.zeros(3)]))["s"]
    assert (problem.K.project(s) == pytest.approx(s, abs=1e-12)) == inside


@pytest.mark.parametrize(
    ("constraint", "cause"),
    [
        (cone("RotatedSecondOrderCone", affine(np.eye(N)[:1], [0])), "has 1 values in RotatedSecondOrderCone"),
        (cone("ExponentialCone", affine(np.eye(N), np.zeros(N))), "is ExponentialCone, cpbench reads GreaterThan"),
        (
            {"function": affine(np.eye(N), np.zeros(N)), "set": {"type": "SecondOrderCone", "dimension": 4}},
            "has dimension 4, its function 3 values",
        ),
        (
            cone("SecondOrderCone", {**least(np.zeros(N), np.eye(N))["function"], "constants": [0]}),
            "is not affine, expected affine values in SecondOrderCone",
        ),
    ],
)
def test_cones_that_no_coneqp_has_are_refused(tmp_path: Path, constraint: Any, cause: str) -> None:
    with pytest.raises(FormatError, match=cause) as caught:
        loaded(tmp_path, least(np.zeros(N)), [constraint])
    assert "\n" not in str(caught.value)


def test_cones_beside_other_kinds_of_functions_are_refused(tmp_path: Path) -> None:
    """Cones beside Complements make no formulation, and neither do cones beside a nonlinear objective."""
    ball = cone("SecondOrderCone", affine(np.eye(N), np.zeros(N)))
    pairs = {"function": affine(np.vstack([np.eye(N)] * 2), np.zeros(2 * N)), "set": {"type": "Complements"}}
    with pytest.raises(FormatError, match="has 1 rows beside Complements"):
        loaded(tmp_path, {"sense": "feasibility"}, [pairs, ball])
    root = {"type": "exp", "args": ["z0"]}
    nonlinear = {"sense": "min", "function": {"type": "ScalarNonlinearFunction", "root": root, "node_list": []}}
    with pytest.raises(FormatError, match="has second-order cones beside functions that are not affine"):
        loaded(tmp_path, nonlinear, [ball])
