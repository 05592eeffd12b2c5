"""Linear and quadratic models in MathOptFormat that others wrote, and what is none of ours."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench import storage
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
        ({"constraints": [_bounded("x", lower=2.0, upper=1.0)]}, "lb"),
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
