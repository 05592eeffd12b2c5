"""Named parameters of nonlinear maps: stored, shown, changed, and read as JuMP writes them."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from click.testing import CliRunner

from cpbench import storage
from cpbench.cli import cli
from cpbench.errors import CpbenchError, FormatError, ProblemError
from cpbench.formulations import NCP, NLP, QP, MiCP, Problem
from cpbench.formulations.expressions import Map

Z, NU = ca.SX.sym("z", 2), ca.SX.sym("nu")
AT = np.array([0.5, 2.0])
ROWS = [ca.exp(Z[0]) - NU, Z[1] * Z[1] - 2 * Z[0] + NU / 2]
"""The constant 2 is no other one than the parameter, even where that is 2."""


def _ncp(nu: float = 2.0) -> NCP:
    return NCP.from_casadi(Z, ROWS, {"nu": nu}, name="mine", start=[1.0, 1.0])


def _nlp() -> NLP:
    f, g = Map.from_casadi(Z, NU * ca.exp(Z[0]), {"nu": 2.0}), Map.from_casadi(Z, Z[0] + Z[1] - NU, {"nu": 2.0})
    return NLP(f=f, g=g, lb=[0.0, 0.0], ub=[np.inf, np.inf], convex=True)


def _expected(nu: float) -> np.ndarray[Any, Any]:
    return np.array([np.exp(0.5) - nu, 4.0 - 1.0 + nu / 2])


def test_a_parameter_has_a_value_that_can_be_changed() -> None:
    problem = _ncp()
    assert problem.parameters == {"nu": 2.0}
    np.testing.assert_allclose(problem.F(AT), _expected(2.0), rtol=1e-15)
    other = problem.with_parameters({"nu": 5.0})
    np.testing.assert_allclose(other.F(AT), _expected(5.0), rtol=1e-15)
    assert other.fingerprint != problem.fingerprint
    assert other.with_parameters({"nu": 2.0}).fingerprint == problem.fingerprint
    assert pickle.loads(pickle.dumps(other)).parameters == {"nu": 5.0}


@pytest.mark.parametrize("suffix", [".h5", ".mof.json"])
@pytest.mark.parametrize("problem", [_ncp(), _ncp(0.5), _nlp()], ids=["ncp", "ncp-half", "nlp"])
def test_a_file_keeps_them(problem: Problem, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"m{suffix}"
    storage.save(problem, path)
    found = storage.load(path)
    assert (found.fingerprint, found.parameters) == (problem.fingerprint, problem.parameters)
    nu = {"nu": -7.25}
    assert found.with_parameters(nu).fingerprint == problem.with_parameters(nu).fingerprint


def _model(function: dict[str, Any], set_: dict[str, Any], *more: dict[str, Any]) -> dict[str, Any]:
    """x and y, between them p in Parameter(3), which JuMP has among its variables."""
    p = {"function": {"type": "Variable", "name": "p"}, "set": {"type": "Parameter", "value": 3.0}}
    return {
        "version": {"major": 1, "minor": 9},
        "variables": [{"name": "x", "primal_start": 1.0}, {"name": "p"}, {"name": "y"}],
        "objective": {"sense": "feasibility"},
        "constraints": [p, {"name": "c", "function": function, "set": set_}, *more],
    }


def test_a_variable_in_parameter_is_one_in_a_complementarity_problem(tmp_path: Path) -> None:
    """Affine functions: (x − p, 2y, x, y) in Complements."""
    terms = [(1, 1.0, "x"), (1, -1.0, "p"), (2, 2.0, "y"), (3, 1.0, "x"), (4, 1.0, "y")]
    scalar = [{"output_index": k, "scalar_term": {"coefficient": c, "variable": v}} for k, c, v in terms]
    function = {"type": "VectorAffineFunction", "terms": scalar, "constants": [0.0] * 4}
    model = _model(function, {"type": "Complements", "dimension": 4})
    path = tmp_path / "m.mof.json"
    path.write_text(json.dumps(model))
    found = storage.load(path)
    assert isinstance(found, MiCP)
    assert found.parameters == {"p": 3.0}
    assert found.start.tolist() == [1.0, 0.0]
    assert found.F(AT).tolist() == [-2.5, 4.0]


def test_in_a_linear_program_it_stays_a_fixed_variable(tmp_path: Path) -> None:
    terms = [{"coefficient": 1.0, "variable": name} for name in ("x", "p", "y")]
    function = {"type": "ScalarAffineFunction", "terms": terms, "constant": 0.0}
    (tmp_path / "m.mof.json").write_text(json.dumps(_model(function, {"type": "GreaterThan", "lower": 1.0})))
    found = storage.load(tmp_path / "m.mof.json")
    assert isinstance(found, QP)
    assert (found.lb[1], found.ub[1]) == (3.0, 3.0)


_VECTOR = {"type": "VectorNonlinearFunction", "node_list": []}
_PAIRS = {**_VECTOR, "rows": ["x", "y", "x", "y"]}


@pytest.mark.parametrize(
    ("model", "says"),
    [
        (_model({**_VECTOR, "rows": ["x", "x", "y", "x", "p", "y"]}, {"type": "Complements", "dimension": 6}), "bare"),
        (_model(_PAIRS, {"type": "Complements", "dimension": 6}), "has dimension 6, its function 4 values"),
        (
            _model(
                _PAIRS,
                {"type": "Complements", "dimension": 4},
                {"function": {"type": "Variable", "name": "p"}, "set": {"type": "GreaterThan", "lower": 0.0}},
            ),
            "constraints/2: bounds a parameter",
        ),
        (
            _model(
                _PAIRS,
                {"type": "Complements", "dimension": 4},
                {"function": {"type": "Variable", "name": "p"}, "set": {"type": "Parameter", "value": 1.0}},
            ),
            "second value for the parameter 'p'",
        ),
    ],
    ids=["unknown", "dimension", "bound", "twice"],
)
def test_models_that_use_them_wrong_are_one_line(model: dict[str, Any], says: str, tmp_path: Path) -> None:
    path = tmp_path / "m.mof.json"
    path.write_text(json.dumps(model))
    with pytest.raises(FormatError, match=says) as refusal:
        storage.load(path)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: NCP.from_casadi(Z, ROWS), "has the symbol nu, which is not a variable"),
        (lambda: _ncp(np.nan), "parameter nu = nan"),
        (lambda: _ncp().with_parameters({"mu": 1.0}), "no parameter mu: it has nu"),
        (lambda: _ncp().with_parameters({"nu": np.inf}), "cannot have nu = inf"),
        (lambda: Map.from_casadi(Z, [ca.SX.sym("z[1]")], {"z[1]": 1.0}), "give it another"),
        (
            lambda: NLP(
                f=Map.from_casadi(Z, NU * Z[0], {"nu": 1.0}),
                g=Map.from_casadi(Z, NU * Z[0], {"nu": 2.0}),
                lb=[0.0, 0.0],
                ub=[1.0, 1.0],
            ),
            "has nu = 1, another map 2",
        ),
    ],
)
def test_what_no_parameter_can_be_is_refused(make: Any, says: str) -> None:
    with pytest.raises(ProblemError, match=says) as refusal:
        make()
    assert isinstance(refusal.value, CpbenchError)


def test_show_info_and_convert_set(tmp_path: Path) -> None:
    def said(*words: object) -> str:
        done = CliRunner().invoke(cli, [str(word) for word in words], catch_exceptions=False)
        assert done.exit_code == 0, done.output
        return done.output

    mine, other, back = tmp_path / "mine.h5", tmp_path / "other.mof.json", tmp_path / "back.h5"
    storage.save(_ncp(), mine)
    assert "F1 = exp(z1) - nu" in said("info", mine, "--data")
    assert "parameters: nu = 2" in said("info", mine, "--data")
    assert "parameter    nu = 2" in said("info", mine)
    said("convert", mine, other, "--set", "nu=5")
    said("convert", other, back)
    assert storage.load(back).fingerprint == _ncp(5.0).fingerprint
    micp = tmp_path / "micp.h5"
    said("convert", mine, micp, "--to", "micp", "--set", "nu=5")
    np.testing.assert_allclose(storage.load(micp).F(AT), _expected(5.0), rtol=1e-15)
