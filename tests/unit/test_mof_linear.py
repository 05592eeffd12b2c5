"""Linear, quadratic and conic models in MathOptFormat that others wrote, and what is none of ours."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import cpbench
from cpbench import storage
from cpbench.api.solution import objective_of
from cpbench.errors import FormatError
from cpbench.formulations import AVI, LCP, MLCP, QP


def _mof(tmp_path: Path, **parts: Any) -> Path:
    """A model of one variable x, with its parts replaced."""
    model = {
        "version": {"major": 1, "minor": 7},
        "variables": [{"name": "x"}],
        "objective": {"sense": "feasibility"},
        "constraints": [],
    }
    path = tmp_path / "m.mof.json"
    path.write_text(json.dumps(model | parts))
    return path


def _affine(constant: float = 0.0, **coefficients: float) -> dict[str, Any]:
    terms = [{"coefficient": value, "variable": name} for name, value in coefficients.items()]
    return {"type": "ScalarAffineFunction", "terms": terms, "constant": constant}


def test_a_qp_of_others(tmp_path: Path) -> None:
    """max -x² - xy - y² + 3x + 1 with every kind of row and bound, against the QP written down by hand."""
    quadratic = [("x", "x", -2.0), ("y", "x", -1.0), ("y", "y", -1.0), ("y", "y", -1.0)]
    objective = {
        "sense": "max",
        "function": {
            "type": "ScalarQuadraticFunction",
            "quadratic_terms": [{"coefficient": c, "variable_1": i, "variable_2": j} for i, j, c in quadratic],
            "affine_terms": [{"coefficient": 1.0, "variable": "x"}, {"coefficient": 2.0, "variable": "x"}],
            "constant": 1.0,
        },
    }
    vector = {
        "type": "VectorAffineFunction",
        "terms": [{"output_index": 2, "scalar_term": {"coefficient": 1.0, "variable": "y"}}],
        "constants": [1.0, 2.0],
    }
    constraints = [
        {"function": {"type": "Variable", "name": "x"}, "set": {"type": "Interval", "lower": -1, "upper": 4}},
        {
            "function": {"type": "VectorOfVariables", "variables": ["x", "y"]},
            "set": {"type": "Nonnegatives", "dimension": 2},
        },
        {"function": _affine(1.0, x=2.0), "set": {"type": "GreaterThan", "lower": 3.0}},
        {"function": _affine(x=1.0, y=1.0), "set": {"type": "LessThan", "upper": 5.0}},
        {"function": _affine(x=1.0, y=-1.0), "set": {"type": "Interval", "lower": -6.0, "upper": 6.0}},
        {"function": _affine(2.0, y=1.0), "set": {"type": "EqualTo", "value": 2.5}},
        {"function": vector, "set": {"type": "Zeros", "dimension": 2}},
    ]
    path = _mof(tmp_path, variables=[{"name": "x"}, {"name": "y"}], objective=objective, constraints=constraints)
    by_hand = QP(
        Q=np.array([[2.0, 1.0], [1.0, 2.0]]),
        p=np.array([-3.0, 0.0]),
        A=np.array([[2.0, 0.0], [-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0]]),
        b=np.array([2.0, -5.0, -6.0, -6.0]),
        C=np.array([[0.0, 1.0], [0.0, 0.0], [0.0, 1.0]]),
        d=np.array([0.5, -1.0, -2.0]),
        lb=np.zeros(2),
        ub=np.array([4.0, np.inf]),
    )
    found = storage.load(path)
    assert {
        k: np.round(np.asarray(v.todense() if sp.issparse(v) else v), 12).tolist() for k, v in found.data().items()
    } == {k: v.tolist() for k, v in by_hand.data().items()}
    assert found.info.properties["objective_offset"] == -1.0  # of the minimum that the maximum becomes


def _pair(function: dict[str, Any], variable: str) -> dict[str, Any]:
    terms = [{"output_index": 1, "scalar_term": term} for term in function["terms"]]
    itself = {"output_index": 2, "scalar_term": {"coefficient": 1.0, "variable": variable}}
    both = {"type": "VectorAffineFunction", "terms": [*terms, itself], "constants": [function["constant"], 0.0]}
    return {"function": both, "set": {"type": "Complements", "dimension": 2}}


def _bounded(name: str, **sides: float) -> dict[str, Any]:
    kind = {"lower": "GreaterThan", "upper": "LessThan"}
    kinds = "Interval" if len(sides) == 2 else kind[next(iter(sides))]
    return {"function": {"type": "Variable", "name": name}, "set": {"type": kinds, **sides}}


def test_complementarity_of_others(tmp_path: Path) -> None:
    """One pair a constraint, in another order than the variables; the bounds say which problem it is."""
    pairs = [_pair(_affine(-1.0, x=1.0, y=2.0), "y"), _pair(_affine(3.0, x=4.0, y=5.0), "x")]
    variables = [{"name": "x"}, {"name": "y"}]
    M, q = np.array([[4.0, 5.0], [1.0, 2.0]]), np.array([3.0, -1.0])

    def read(*bounds: dict[str, Any]) -> Any:
        return storage.load(_mof(tmp_path, variables=variables, constraints=[*pairs, *bounds]))

    both = read(_bounded("x", lower=0.0), _bounded("y", lower=0.0))
    assert both.fingerprint == LCP(M=M, q=q).fingerprint
    mixed = read(_bounded("x", lower=0.0))  # y is free: it comes first
    assert mixed.fingerprint == MLCP(A=[[2.0]], C=[[1.0]], D=[[5.0]], B=[[4.0]], a=[-1.0], b=[3.0]).fingerprint
    assert read(_bounded("x", lower=0.0, upper=1.0), _bounded("y", lower=-1.0, upper=1.0)).node == "relay"
    avi = read(_bounded("x", lower=0.0, upper=1.0))
    assert avi.fingerprint == AVI(M=M, q=q, lb=[0.0, -np.inf], ub=[1.0, np.inf]).fingerprint


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("parts", "says"),
    [
        ({"version": {"major": 2, "minor": 0}}, "version"),
        ({"variables": [{"name": "x"}, {"name": "x"}]}, "two of one name"),
        ({"variables": [{"name": 3}]}, "variables/0/name"),
        ({"constraints": [{"function": _affine(y=1.0), "set": {"type": "Zeros"}}]}, "'y'"),
        ({"constraints": [{"function": _affine(x=1.0), "set": {"type": "ExponentialCone"}}]}, "ExponentialCone"),
        ({"constraints": [{"function": _affine(x=1.0), "set": {"type": "EqualTo", "value": "1"}}]}, "value"),
        ({"constraints": [{"function": {"type": "ScalarNonlinearFunction"}, "set": {}}]}, "set/type"),
        ({"constraints": [{"function": {"type": "Sine"}, "set": {"type": "Zeros"}}]}, "Sine"),
        ({"constraints": [_pair(_affine(x=1.0), "x"), _pair(_affine(x=1.0), "x")]}, "beside two functions"),
        ({"constraints": [{"function": _affine(x=1.0), "set": {"type": "Complements"}}]}, "even number"),
        (
            {
                "constraints": [
                    _pair(_affine(x=1.0), "x"),
                    {"function": _affine(x=1.0), "set": {"type": "EqualTo", "value": 1.0}},
                ]
            },
            "1 rows beside",
        ),
        (
            {"variables": [{"name": "x"}, {"name": "y"}], "constraints": [_pair(_affine(x=1.0), "x")]},
            "no function beside y",
        ),
        ({"objective": {"sense": "min", "function": _affine(x=1e400)}}, "expected a finite number"),
        ({"constraints": {}}, "constraints"),
    ],
)
def test_models_that_are_none_of_ours_are_one_line(parts: dict[str, Any], says: str, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=says) as refusal:
        storage.load(_mof(tmp_path, **parts))
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("content", ["", "{", "[1]", "[" * 100_000, '{"version": 1}', "\xff\xfe"])
def test_broken_json_is_one_line(content: str, tmp_path: Path) -> None:
    path = tmp_path / "m.mof.json"
    path.write_bytes(content.encode("latin-1"))
    with pytest.raises(FormatError) as refusal:
        storage.load(path)
    assert "\n" not in str(refusal.value)


def test_a_hessian_that_rounding_made_asymmetric_has_the_same_objective(tmp_path: Path) -> None:
    Q = np.array([[2.0, 1.0], [1.0 + 2e-16, 3.0]])
    problem = QP.build(Q, np.zeros(2))
    storage.save(problem, tmp_path / "p.mof.json")
    told = json.loads((tmp_path / "p.mof.json").read_text())["objective"]["function"]["quadratic_terms"]
    z = {"z[1]": 0.3, "z[2]": -0.7}
    value = 0.0
    for term in told:  # as the schema says: ½zᵀQz, one of two mirrored entries is enough, duplicates add up
        i, j, c = term["variable_1"], term["variable_2"], term["coefficient"]
        value += 0.5 * c * z[i] ** 2 if i == j else c * z[i] * z[j]
    assert value == pytest.approx(problem.objective(np.array(list(z.values()))), rel=1e-14)


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
