"""Models that Pyomo writes as .nl: values of its own expressions at a drawn point, and complementarity problems."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cpbench
from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import MLCP, NLP, QP, MiCP

pyo: Any = pytest.importorskip("pyomo.environ", reason="needs a package: pyomo (extra dev)")
mpec: Any = pytest.importorskip("pyomo.mpec", reason="needs a package: pyomo (extra dev)")
MODELS: dict[str, Callable[[], Any]] = {}


def model(build: Callable[[Any], None]) -> Callable[[Any], None]:
    def made() -> Any:
        m = pyo.ConcreteModel()
        build(m)
        return m

    MODELS[build.__name__] = made
    return build


@model
def linear_maximum(m: Any) -> None:
    m.x = pyo.Var(range(4), bounds=(-1, 2))
    m.o = pyo.Objective(expr=sum((k + 1) * m.x[k] for k in range(4)) + 5, sense=pyo.maximize)
    m.c = pyo.Constraint(expr=pyo.inequality(-1, m.x[0] - m.x[3], 4))
    m.d = pyo.Constraint(expr=m.x[1] + 0.1 * m.x[2] == 0.3)


@model
def hs71(m: Any) -> None:
    m.x = pyo.Var(range(1, 5), bounds=(1, 5), initialize={1: 1, 2: 5, 3: 5, 4: 1})
    m.o = pyo.Objective(expr=m.x[1] * m.x[4] * (m.x[1] + m.x[2] + m.x[3]) + m.x[3])
    m.c = pyo.Constraint(expr=m.x[1] * m.x[2] * m.x[3] * m.x[4] >= 25)
    m.d = pyo.Constraint(expr=sum(m.x[k] ** 2 for k in range(1, 5)) == 40)


@model
def functions(m: Any) -> None:
    m.x = pyo.Var(initialize=0.4)
    m.y = pyo.Var(initialize=1.4)
    x, y = m.x, m.y
    m.o = pyo.Objective(expr=pyo.exp(x) + pyo.log(y) + pyo.log10(y) + pyo.sqrt(y))
    m.c = pyo.Constraint(expr=pyo.sin(x) + pyo.cos(x) + pyo.tan(x) + pyo.sinh(x) + pyo.cosh(x) + pyo.tanh(x) <= 8)
    m.d = pyo.Constraint(expr=pyo.asin(x) + pyo.acos(x) + pyo.atan(x) + pyo.asinh(x) + pyo.atanh(x) >= -5)
    m.e = pyo.Constraint(expr=abs(x - y) + pyo.acosh(1 + y) + x**y == 2)


@model
def shared(m: Any) -> None:
    """Named expressions, which become defined variables, with linear parts."""
    m.x = pyo.Var(range(3), initialize=1.0)
    m.s = pyo.Expression(expr=m.x[0] * m.x[1] + 3 * m.x[2] + 1)
    m.t = pyo.Expression(expr=pyo.exp(m.s / 10) - m.x[0])
    m.o = pyo.Objective(expr=m.s**2 + m.t)
    m.c = pyo.Constraint(expr=m.s * m.t >= 1)
    m.d = pyo.Constraint(expr=m.t + m.x[1] == 2)


@model
def choice(m: Any) -> None:
    m.x = pyo.Var(range(2), initialize=1.0)
    m.o = pyo.Objective(expr=pyo.Expr_if(m.x[0] <= m.x[1], m.x[0] ** 3, 2 * m.x[1]))
    m.c = pyo.Constraint(expr=pyo.Expr_if(m.x[1] >= 0.1, m.x[0] / m.x[1], 1.0) >= 0.01)


@model
def fixed(m: Any) -> None:
    """A fixed variable, which Pyomo leaves out, and a constraint with numbers on both sides."""
    m.x = pyo.Var(range(3), initialize=2.0)
    m.x[1].fix(3.0)
    m.o = pyo.Objective(expr=m.x[0] ** 2 * m.x[1] + m.x[2] ** 2)
    m.c = pyo.Constraint(expr=3 + m.x[0] * m.x[1] + m.x[2] >= 2 * m.x[0] - 7)


@model
def without_objective(m: Any) -> None:
    m.x = pyo.Var(range(2), initialize=1.0)
    m.c = pyo.Constraint(expr=m.x[0] ** 2 + m.x[1] ** 2 == 1)
    m.d = pyo.Constraint(expr=m.x[0] - m.x[1] == 0)


def written(m: Any, tmp_path: Path) -> Path:
    path = tmp_path / "m.nl"
    m.write(str(path), io_options={"symbolic_solver_labels": True})
    return path


def lines(path: Path) -> list[str]:
    return path.read_text().split("\n")[:-1] if path.exists() else []


@pytest.mark.parametrize("name", MODELS)
def test_a_model_of_pyomo_has_the_values_of_its_expressions(
    name: str, tmp_path: Path, rng: np.random.Generator
) -> None:
    m = MODELS[name]()
    path = written(m, tmp_path)
    problem: Any = storage.load(path)
    variables = [m.find_component(label) for label in lines(path.with_suffix(".col"))]
    assert [v.value for v in variables] == problem.start.tolist() if problem.node == "nlp" else True
    assert [-math.inf if v.lb is None else v.lb for v in variables] == problem.lb.tolist()
    assert [math.inf if v.ub is None else v.ub for v in variables] == problem.ub.tolist()
    z = rng.uniform(0.3, 0.9, len(variables))
    for v, value in zip(variables, z, strict=True):
        v.set_value(value, skip_validation=True)
    above, equal = _rows(m, lines(path.with_suffix(".row")))
    if problem.node == "qp":
        g, h = problem.A @ z - problem.b, problem.C @ z - problem.d
    else:
        g, h = problem.g(z), problem.h(z)
    np.testing.assert_allclose(g, above, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(h, equal, rtol=1e-13, atol=1e-13)
    for objective in m.component_data_objects(pyo.Objective):
        f = problem.objective(z) + problem.info.properties.get("objective_offset", 0.0)
        sign = -1.0 if objective.sense == pyo.maximize else 1.0
        assert f == pytest.approx(sign * pyo.value(objective.expr), rel=1e-13)
    assert isinstance(problem, QP if name in ("quadratic", "linear_maximum", "fixed") else NLP)


def _rows(m: Any, labels: list[str]) -> tuple[list[float], list[float]]:
    """What Pyomo says of Ax - b and Cx - d, or g and h, in the order of the file."""
    above: list[float] = []
    equal: list[float] = []
    for label in labels:
        row = m.find_component(label)
        if not hasattr(row, "body"):
            continue  # the objective
        body, low, high = pyo.value(row.body), pyo.value(row.lower), pyo.value(row.upper)
        if low is not None and low == high:
            equal.append(body - low)
            continue
        above += [body - low] if low is not None else []
        above += [high - body] if high is not None else []
    return above, equal


# ------------------------------------------------------------------------------------ complementarity problems


def pairs(m: Any, tmp_path: Path) -> Any:
    pyo.TransformationFactory("mpec.nl").apply_to(m)
    return storage.load(written(m, tmp_path))


def solution(problem: Any, m: Any, tmp_path: Path) -> dict[str, float]:
    answer = cpbench.solve(problem)
    assert answer.status == "solved"
    point = answer.point
    z = np.concatenate([point.u, point.v]) if isinstance(problem, MLCP) else point.z
    labels = lines((tmp_path / "m.nl").with_suffix(".col"))
    if isinstance(problem, MLCP):  # the free ones first
        bounded = [m.find_component(label).lb is not None for label in labels]
        labels = [x for x, b in zip(labels, bounded, strict=True) if not b] + [
            x for x, b in zip(labels, bounded, strict=True) if b
        ]
    return dict(zip(labels, z.tolist(), strict=True))


@pytest.mark.needs("cpbench_solvers")
def test_a_nonlinear_complementarity_problem_of_pyomo(tmp_path: Path) -> None:
    """Kojima and Shindo 1986, whose solutions are (√6/2, 0, 0, 1/2) and (1, 0, 3, 0)."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(range(1, 5), bounds=(0, None), initialize=1.0)
    a, b, c, d = (m.x[k] for k in range(1, 5))
    F = [
        3 * a**2 + 2 * a * b + 2 * b**2 + c + 3 * d - 6,
        2 * a**2 + a + b**2 + 10 * c + 2 * d - 2,
        3 * a**2 + a * b + 2 * b**2 + 2 * c + 9 * d - 9,
        a**2 + 3 * b**2 + 2 * c + 3 * d - 3,
    ]
    m.p = pyo.Block(range(4))
    for k in range(4):
        m.p[k].c = mpec.Complementarity(expr=mpec.complements(m.x[k + 1] >= 0, F[k] >= 0))
    problem = pairs(m, tmp_path)
    assert isinstance(problem, MiCP)
    found = solution(problem, m, tmp_path)
    x = np.array([found[f"x[{k}]"] for k in range(1, 5)])
    known = np.array([[math.sqrt(6.0) / 2.0, 0.0, 0.0, 0.5], [1.0, 0.0, 3.0, 0.0]])
    # the first is degenerate, so that it is known to about the square root of the error
    assert np.abs(known - x).max(axis=1).min() < 1e-3


@pytest.mark.needs("cpbench_solvers")
def test_a_linear_complementarity_problem_of_pyomo(tmp_path: Path) -> None:
    """M = [2 1; 1 2], q = (-3, 1): 2x - 3 = 0 and y = 0, as x + 1 > 0."""
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(bounds=(0, None)), pyo.Var(bounds=(0, None))
    m.c = mpec.Complementarity(expr=mpec.complements(m.x >= 0, 2 * m.x + m.y - 3 >= 0))
    m.d = mpec.Complementarity(expr=mpec.complements(m.y >= 0, m.x + 2 * m.y + 1 >= 0))
    problem = pairs(m, tmp_path)
    assert isinstance(problem, MLCP)
    found = solution(problem, m, tmp_path)
    np.testing.assert_allclose([found["x"], found["y"]], [1.5, 0.0], atol=1e-6)


def test_an_mpcc_of_pyomo_is_refused_as_such(tmp_path: Path) -> None:
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(bounds=(0, None)), pyo.Var(bounds=(0, 2))
    m.o = pyo.Objective(expr=(m.x - 1) ** 2 + m.y)
    m.c = mpec.Complementarity(expr=mpec.complements(m.x >= 0, m.x + m.y - 1 >= 0))
    with pytest.raises(FormatError, match=r"is an MPCC .* 1 equation for 2 variables \(v\d, v\d\), 1 of"):
        pairs(m, tmp_path)
