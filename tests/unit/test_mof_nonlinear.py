"""Nonlinear problems in MathOptFormat and HDF5: there and back bit for bit, as JuMP writes them, and hostile ones."""

from __future__ import annotations

import json
import math
import tracemalloc
from pathlib import Path
from typing import Any

import casadi as ca
import h5py
import mpmath
import numpy as np
import pytest
from drawn_cases import NUMBERS, draw, maps
from hypothesis import given, settings
from mof_schema import violations
from tiers import by_night

from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import NCP, NLP, MiCP, formulations
from cpbench.formulations.expressions import Map, Operator
from cpbench_problems.formats import mof_json, to_mof
from cpbench_problems.formats.model_problem import program
from cpbench_problems.formats.mof_functions import Functions
from cpbench_problems.formats.mof_model import read_model
from cpbench_problems.formats.mof_operators import KNOWN

NODES = ("nlp", "ncp", "micp", "equation", "cp", "vi", "qvi", "ge", "nfc")
WRITTEN = ("nlp", "ncp", "micp")


def _names(n: int) -> list[str]:
    return [f"z[{k}]" for k in range(1, n + 1)]


def _read(function: Any, inputs: int) -> Map:
    """A vector or a list of scalar functions, out of JSON again."""
    functions = Functions("text", {name: k for k, name in enumerate(_names(inputs))})
    loaded = json.loads(json.dumps(function, allow_nan=False))
    rows = loaded if isinstance(loaded, list) else [loaded]
    return functions.map([value for row in rows for value in functions.rows(row, "function")])


def _program(text: str | bytes) -> NLP:
    return NLP(**program(read_model(text, "text")))


# ----------------------------------------------------------------------------------------- there and back


EVERY = [*Operator, *5 * [Operator.ADD, Operator.SUB, Operator.MUL, Operator.NOT, Operator.CHOOSE]]


@pytest.mark.nightly
@settings(max_examples=300, deadline=None, derandomize=True)
@given(maps(EVERY, (0, 3), NUMBERS, 30, (0, 4)))
def test_a_map_comes_back_bit_for_bit(F: Map) -> None:
    assert _read(to_mof.vector(F, _names(F.inputs)), F.inputs) == F
    scalars = to_mof.scalars(F, _names(F.inputs))
    assert scalars is None or _read(scalars, F.inputs) == F


def test_simple_functions_are_written_as_such(tmp_path: Path) -> None:
    """Linear and quadratic ones, for solvers that know them; the constant of a row is in its set, as JuMP wants it."""
    z = ca.SX.sym("z", 2)
    problem = NLP(
        f=Map.from_casadi(z, 0.5 * z[0] ** 2 + z[0] * z[1] + 3 * z[1] + 2),
        g=Map.from_casadi(z, ca.vertcat(3 * z[0] - 2 * z[1] + 1, ca.exp(z[0]) - 1, z[1])),
        h=Map.from_casadi(z, z[0] * z[1] - 4),
    )
    storage.save(problem, tmp_path / "p.mof.json")
    model = json.loads((tmp_path / "p.mof.json").read_text())
    assert model["objective"]["function"] == {
        "type": "ScalarQuadraticFunction",
        "quadratic_terms": [
            {"coefficient": 1.0, "variable_1": "z[1]", "variable_2": "z[1]"},
            {"coefficient": 1.0, "variable_1": "z[1]", "variable_2": "z[2]"},
        ],
        "affine_terms": [{"coefficient": 3.0, "variable": "z[2]"}],
        "constant": 2.0,
    }
    kinds = [(c["name"], c["function"]["type"], c["set"]) for c in model["constraints"]]
    assert kinds == [
        ("g[1]", "ScalarAffineFunction", {"type": "GreaterThan", "lower": -1.0}),
        ("g[2]", "ScalarNonlinearFunction", {"type": "GreaterThan", "lower": 0.0}),
        ("g[3]", "ScalarAffineFunction", {"type": "GreaterThan", "lower": 0.0}),
        ("h[1]", "ScalarQuadraticFunction", {"type": "EqualTo", "value": 4.0}),
    ]
    assert storage.load(tmp_path / "p.mof.json").fingerprint == problem.fingerprint


def test_rows_that_share_most_of_themselves_are_one_vector(tmp_path: Path) -> None:
    """As rows of their own they would take n times the space."""
    n = 60
    z = ca.SX.sym("z", n)
    common = ca.exp(z[0])
    for k in range(n):
        common = ca.sin(common + z[k])
    problem = NLP(f=Map.from_casadi(z, ca.sumsqr(z)), g=Map.from_casadi(z, common * z))
    assert to_mof.scalars(problem.g, _names(n)) is None
    path = tmp_path / "p.mof.json"
    storage.save(problem, path)
    assert path.stat().st_size < 40_000
    assert storage.load(path).fingerprint == problem.fingerprint


@pytest.mark.parametrize("node", sorted(set(formulations.names()) - storage.formats.get("mof").writes))
def test_what_the_format_cannot_say_is_refused_with_a_reason(node: str, tmp_path: Path) -> None:
    if node not in NODES:
        assert storage.formats.get("mof").why_not(node) or node in ("soclcp", "coneqp")
        return
    with pytest.raises(FormatError, match=r"not a problem of type \w+: ") as refusal:
        storage.save(draw(node, 0, 2).problem, tmp_path / "p.mof.json")
    assert "\n" not in str(refusal.value)
    assert not (tmp_path / "p.mof.json").exists()


# --------------------------------------------------------------------------------------------- the schema


@pytest.fixture(scope="module")
def schema(shared_data: Path) -> dict[str, Any]:
    return json.loads((shared_data.parent / "formats" / "mof.1.9.schema.json").read_text())


@pytest.mark.parametrize(
    "node", [*by_night(["nlp"]), *(n for n in WRITTEN if n != "nlp"), "lcp", "mlcp", "relay", "qp"]
)
def test_files_keep_to_the_schema(node: str, schema: dict[str, Any], tmp_path: Path) -> None:
    for seed in range(4):
        storage.save(draw(node, seed, 4).problem, tmp_path / "p.mof.json", force=True)
        assert violations(json.loads((tmp_path / "p.mof.json").read_text()), schema, schema) == []


def test_every_operator_is_the_schemas_or_told_apart(schema: dict[str, Any]) -> None:
    named = {
        name
        for term in schema["definitions"]["NonlinearTerm"]["oneOf"]
        for name in term.get("properties", {}).get("type", {}).get("enum", ())
    }
    assert named >= KNOWN
    assert named - KNOWN == {
        "erfinv", "erfc", "erfcinv", "erfi", "gamma", "lgamma", "digamma", "invdigamma", "trigamma", "airyai", "airybi",
        "airyaiprime", "airybiprime", "besselj0", "besselj1", "bessely0", "bessely1", "erfcx", "dawson",
    }  # fmt: skip


# ------------------------------------------------------------------------------------------ as others write

_DEGREE = mpmath.pi / 180
AS_JULIA: dict[str, Any] = {
    "cbrt": lambda x: mpmath.sign(x) * mpmath.cbrt(abs(x)), "abs2": lambda x: x * x, "inv": lambda x: 1 / x,
    "log10": mpmath.log10, "log2": lambda x: mpmath.log(x, 2), "exp2": lambda x: 2**x, "sec": mpmath.sec,
    "csc": mpmath.csc, "cot": mpmath.cot, "asec": mpmath.asec, "acsc": mpmath.acsc, "acot": mpmath.acot,
    "sech": mpmath.sech, "csch": mpmath.csch, "coth": mpmath.coth, "asech": mpmath.asech, "acsch": mpmath.acsch,
    "acoth": mpmath.acoth, "deg2rad": lambda x: x * _DEGREE, "rad2deg": lambda x: x / _DEGREE,
    "sind": lambda x: mpmath.sin(x * _DEGREE), "cosd": lambda x: mpmath.cos(x * _DEGREE),
    "tand": lambda x: mpmath.tan(x * _DEGREE), "secd": lambda x: mpmath.sec(x * _DEGREE),
    "cscd": lambda x: mpmath.csc(x * _DEGREE), "cotd": lambda x: mpmath.cot(x * _DEGREE),
    "asind": lambda x: mpmath.asin(x) / _DEGREE, "acosd": lambda x: mpmath.acos(x) / _DEGREE,
    "atand": lambda x: mpmath.atan(x) / _DEGREE, "asecd": lambda x: mpmath.asec(x) / _DEGREE,
    "acscd": lambda x: mpmath.acsc(x) / _DEGREE, "acotd": lambda x: mpmath.acot(x) / _DEGREE,
}  # fmt: skip
"""Operators of one argument that are several operations here, after the manual of Julia."""


@pytest.mark.parametrize("head", sorted(AS_JULIA))
def test_an_operator_of_julia(head: str) -> None:
    F = _term({"type": head, "args": ["z[1]"]})
    for z in (0.4, 0.9, -0.4, 2.5, -3.0):
        reference = AS_JULIA[head](mpmath.mpf(z))
        if isinstance(reference, mpmath.mpf) and mpmath.isfinite(reference):
            assert F.evaluate(np.array([z, 0.0]))[0] == pytest.approx(float(reference), rel=1e-14)


def _term(term: Any, nodes: list[Any] | None = None) -> Map:
    return _read({"type": "ScalarNonlinearFunction", "root": term, "node_list": nodes or []}, 2)


@pytest.mark.parametrize(
    ("head", "arguments", "value"),
    [
        ("+", [3.0], 3.0), ("+", [1, 2, 4], 7.0), ("-", [3.0], -3.0), ("-", [10, 2, 3], 5.0), ("*", [2, 3, 4], 24.0),
        ("/", [3, 4], 0.75), ("^", [2, 3], 8.0), ("atan", [1.0], math.pi / 4), ("atan", [1.0, -1.0], 3 * math.pi / 4),
        ("min", [3, 1, 2], 1.0), ("max", [3, 1, 2], 3.0), ("min", [3], 3.0), ("ifelse", [1, 5, 6], 5.0),
        ("ifelse", [0, 5, 6], 6.0), ("ifelse", [0, 0, 1], 1.0), ("ifelse", [1, 5, 0], 5.0), ("<", [1, 1], 0.0),
        ("<=", [1, 1], 1.0), (">", [2, 1], 1.0), (">=", [1, 2], 0.0), ("==", [1, 1], 1.0), ("&&", [1, 0], 0.0),
        ("||", [1, 0], 1.0),
    ],
)  # fmt: skip
def test_operators_of_any_number_of_arguments(head: str, arguments: list[float], value: float) -> None:
    assert _term({"type": head, "args": arguments}).evaluate(np.zeros(2))[0] == pytest.approx(value, rel=1e-15)


def test_terms_may_refer_to_later_ones_and_to_ones_that_refer_on() -> None:
    """sin(x)² + 2x + y by a list in the order of JuMP, turned round, and with references to references."""
    nodes = [
        {"type": "*", "args": [2, {"type": "variable", "name": "z[1]"}]},
        {"type": "sin", "args": ["z[1]"]},
        {"type": "^", "args": [{"type": "node", "index": 2}, {"type": "real", "value": 2}]},
        {"type": "+", "args": [{"type": "node", "index": 1}, {"type": "node", "index": 3}, "z[2]"]},
    ]
    last = {"type": "node", "index": 4}
    F = _term(last, nodes)
    z = np.array([0.3, 0.7])
    assert F.evaluate(z)[0] == pytest.approx(math.sin(0.3) ** 2 + 1.3, rel=1e-15)
    numbers = {1: 4, 2: 3, 3: 2, 4: 1}

    def renumbered(term: Any) -> Any:
        if isinstance(term, dict):
            return {k: numbers[v] if k == "index" else renumbered(v) for k, v in term.items()}
        return [renumbered(t) for t in term] if isinstance(term, list) else term

    assert _term(renumbered(last), renumbered(nodes)[::-1]) == F
    chain = [*nodes, last, {"type": "node", "index": 5}, {"type": "node", "index": 6}]
    assert _term({"type": "node", "index": 7}, chain) == F


def _affine(constant: float = 0.0, **coefficients: float) -> dict[str, Any]:
    terms = [{"coefficient": value, "variable": name} for name, value in coefficients.items()]
    return {"type": "ScalarAffineFunction", "terms": terms, "constant": constant}


def _nonlinear(root: Any, *nodes: Any) -> dict[str, Any]:
    return {"type": "ScalarNonlinearFunction", "root": root, "node_list": list(nodes)}


def _model(**parts: Any) -> dict[str, Any]:
    return {
        "name": "MathOptFormat Model",
        "version": {"major": 1, "minor": 7},
        "variables": [{"name": "x", "primal_start": 1}, {"name": "y", "primal_start": 5.0}],
        "objective": {"sense": "feasibility"},
        "constraints": [],
    } | parts


def test_a_nonlinear_program_of_others(tmp_path: Path) -> None:
    """A maximum with every kind of function and set, against the same problem in CasADi."""
    quadratic = {
        "type": "ScalarQuadraticFunction",
        "quadratic_terms": [
            {"coefficient": 2.0, "variable_1": "x", "variable_2": "x"},
            {"coefficient": 3.0, "variable_1": "x", "variable_2": "y"},
        ],
        "affine_terms": [{"coefficient": -1.0, "variable": "y"}],
        "constant": 0.5,
    }
    vector = {
        "type": "VectorNonlinearFunction",
        "rows": [{"type": "node", "index": 1}, {"type": "+", "args": ["x"]}],
        "node_list": [{"type": "exp", "args": ["y"]}],
    }
    products = {
        "type": "VectorQuadraticFunction",
        "constants": [1.0, 2.0],
        "affine_terms": [{"output_index": 1, "scalar_term": {"coefficient": 1.0, "variable": "y"}}],
        "quadratic_terms": [
            {"output_index": 2, "scalar_term": {"coefficient": 4.0, "variable_1": "y", "variable_2": "y"}}
        ],
    }
    sine = _nonlinear({"type": "sin", "args": ["x"]})
    constraints = [
        {"function": {"type": "Variable", "name": "x"}, "set": {"type": "Interval", "lower": -1, "upper": 4}},
        {"function": {"type": "Variable", "name": "y"}, "set": {"type": "EqualTo", "value": 2}},
        {"name": "c1", "function": sine, "set": {"type": "Interval", "lower": -0.5, "upper": 0.5}},
        {"function": sine, "set": {"type": "LessThan", "upper": 0.0}},
        {"function": quadratic, "set": {"type": "LessThan", "upper": 7.0}},
        {"function": quadratic, "set": {"type": "EqualTo", "value": 1.0}},
        {"function": _affine(1.0, x=2.0), "set": {"type": "GreaterThan", "lower": 3.0}},
        {"function": vector, "set": {"type": "Nonnegatives", "dimension": 2}},
        {"function": vector, "set": {"type": "HyperRectangle", "lower": [0.0, 1.0], "upper": [0.0, 2.0]}},
        {"function": products, "set": {"type": "Zeros", "dimension": 2}},
    ]
    objective = {"sense": "max", "function": _nonlinear({"type": "log", "args": ["x"]})}
    path = tmp_path / "m.mof.json"
    path.write_text(json.dumps(_model(objective=objective, constraints=constraints)))
    found = storage.load(path)
    assert isinstance(found, NLP)
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    q = x**2 + 3 * x * y - y + 0.5
    z = ca.vertcat(x, y)
    g = ca.vertcat(ca.sin(x) + 0.5, 0.5 - ca.sin(x), -ca.sin(x), 7 - q, 2 * x - 2, ca.exp(y), x, x - 1, 2 - x)
    h = ca.vertcat(q - 1, ca.exp(y), y + 1, 2 * y**2 + 2)
    at = np.array([0.8, 1.7])
    for mine, theirs in ((found.f, -ca.log(x)), (found.g, g), (found.h, h)):
        reference = Map.from_casadi(z, theirs)
        np.testing.assert_allclose(mine(at), reference(at), rtol=1e-14)
        np.testing.assert_allclose(mine.jacobian(at).toarray(), reference.jacobian(at).toarray(), rtol=1e-13)
    assert (found.lb.tolist(), found.ub.tolist(), found.start.tolist()) == ([-1, 2], [4, 2], [1, 5])
    assert not found.convex


def _pair(F: Any, *nodes: Any) -> dict[str, Any]:
    """F(x, y) beside x, as JuMP writes it."""
    function = {"type": "VectorNonlinearFunction", "rows": [F, {"type": "node", "index": len(nodes) + 1}]}
    variable = {"type": "+", "args": ["x"]}
    return {
        "function": function | {"node_list": [*nodes, variable]},
        "set": {"type": "Complements", "dimension": 2},
    }


def test_complementarity_of_others(tmp_path: Path) -> None:
    """x beside a nonlinear function, y beside a quadratic one; the bounds say whether it is an ncp."""
    pairs = [_pair({"type": "-", "args": [{"type": "exp", "args": ["x"]}, "y"]})]
    beside_y = {
        "type": "VectorQuadraticFunction",
        "constants": [-1.0, 0.0],
        "affine_terms": [{"output_index": 2, "scalar_term": {"coefficient": 1.0, "variable": "y"}}],
        "quadratic_terms": [
            {"output_index": 1, "scalar_term": {"coefficient": 2.0, "variable_1": "y", "variable_2": "y"}}
        ],
    }
    bounds = [
        {"function": {"type": "Variable", "name": name}, "set": {"type": "GreaterThan", "lower": 0.0}}
        for name in ("x", "y")
    ]
    pairs.append({"function": beside_y, "set": {"type": "Complements", "dimension": 2}})
    path = tmp_path / "m.mof.json"
    path.write_text(json.dumps(_model(constraints=[*pairs, *bounds])))
    found = storage.load(path)
    assert isinstance(found, NCP)
    np.testing.assert_allclose(found.F(np.array([0.5, 2.0])), [math.exp(0.5) - 2.0, 3.0], rtol=1e-15)
    assert found.start.tolist() == [1.0, 5.0]
    path.write_text(json.dumps(_model(constraints=[*pairs, bounds[0]])))
    mixed = storage.load(path)
    assert isinstance(mixed, MiCP)
    assert mixed.lb.tolist() == [0.0, -np.inf]


# ------------------------------------------------------------------------------------------------- hostile


def _refused(function: Any, says: str, variables: Any = None) -> None:
    model = _model(objective={"sense": "min", "function": function})
    text = json.dumps(model | ({"variables": variables} if variables else {}))
    with pytest.raises(FormatError, match=says) as refusal:
        _program(text)
    assert "\n" not in str(refusal.value)
    str(refusal.value).encode()


NODE = {"type": "node", "index": 1}


@pytest.mark.parametrize(
    ("root", "nodes", "says"),
    [
        ({"type": "gamma", "args": ["x"]}, [], "root: has the operator 'gamma'"),
        ({"type": "complex", "real": 1, "imag": 2}, [], "'complex'"),
        ({"type": "erfc", "args": ["x"]}, [], "'erfc'"),
        ({"type": "sin", "args": ["x", "y"]}, [], "2 arguments of sin"),
        ({"type": "sin", "args": []}, [], "0 arguments of sin"),
        ({"type": "+", "args": []}, [], "0 arguments"),
        ({"type": "^", "args": ["x", 2, 3]}, [], "3 arguments"),
        ({"type": "ifelse", "args": ["x", 2]}, [], "2 arguments"),
        ({"type": "sin"}, [], "no list of args"),
        ({"type": "sin", "args": "x"}, [], "no list of args"),
        ({"args": ["x"]}, [], "without a type"),
        ({"type": ["sin"], "args": ["x"]}, [], "without a type"),
        (None, [], "without a type"),
        (["x"], [], "without a type"),
        (True, [], "finite"),
        ("w", [], "'w'"),
        ("\ud800", [], "ud800"),
        ({"type": "variable", "name": 3}, [], "'3'"),
        ({"type": "real", "value": "1"}, [], "finite"),
        ({"type": "real"}, [], "missing"),
        (math.nan, [], "'nan'"),
        ({"type": "*", "args": ["x", math.inf]}, [], "'inf'"),
        (10**400, [], "bits"),
        (NODE, [], "refers to node '1', expected 1 to 0"),
        ({"type": "node", "index": 0}, ["x"], "refers to node '0'"),
        ({"type": "node", "index": 10**60}, ["x"], "refers to node"),
        ({"type": "node", "index": True}, ["x"], "refers to node"),
        ({"type": "node", "index": 1.0}, ["x"], "refers to node"),
        (NODE, [NODE], "refers back"),
        (NODE, [{"type": "sin", "args": [{"type": "node", "index": 2}]}, {"type": "cos", "args": [NODE]}], "list/1"),
        (NODE, [{"type": "sin", "args": ["w"]}], "node_list/0: names the variable 'w'"),
    ],
)
def test_terms_that_are_none_are_one_line(root: Any, nodes: list[Any], says: str) -> None:
    _refused(_nonlinear(root, *nodes), says)


@pytest.mark.parametrize(
    ("function", "says"),
    [
        ({"type": "ScalarNonlinearFunction", "node_list": []}, "root"),
        ({"type": "ScalarNonlinearFunction", "root": "x"}, "node_list"),
        ({"type": "ScalarNonlinearFunction", "root": "x", "node_list": {}}, "node_list"),
        ({"type": "VectorNonlinearFunction", "rows": ["x", "y"], "node_list": []}, "2 values"),
        ({"type": "VectorNonlinearFunction", "node_list": []}, "rows"),
        ({"type": "Nothing"}, "Nothing"),
        ({"type": []}, "type"),
        ({"type": "ScalarQuadraticFunction", "affine_terms": [], "constant": 0.0}, "quadratic_terms"),
    ],
)
def test_functions_that_are_none_are_one_line(function: Any, says: str) -> None:
    _refused(function, says)


def test_names_that_occur_twice_are_refused() -> None:
    _refused(_nonlinear("x"), "two of one name, 'x'", variables=[{"name": "x"}, {"name": "x"}])


@pytest.mark.nightly
def test_nesting_is_bounded_by_the_parser_and_chains_are_not() -> None:
    deep = '{"type":"sin","args":[' * 100_000
    text = json.dumps(_model(objective={"sense": "min", "function": _nonlinear("HERE")}))
    with pytest.raises(FormatError, match="nested too deep"):
        _program(text.replace('"HERE"', deep))
    n = 100_000
    nodes = [{"type": "sin", "args": ["x" if k == 0 else {"type": "node", "index": k}]} for k in range(n)]
    function = _nonlinear({"type": "node", "index": n}, *nodes)
    assert _program(json.dumps(_model(objective={"sense": "min", "function": function}))).f.operations == n
    wide = _nonlinear({"type": "+", "args": ["x"] * n})
    assert _program(json.dumps(_model(objective={"sense": "min", "function": wide}))).f.operations == n - 1


def test_shared_terms_are_looked_at_once() -> None:
    """Written out, this sum would have 2^200 terms."""
    nodes: list[Any] = [{"type": "exp", "args": ["x"]}]
    nodes += [{"type": "+", "args": [{"type": "node", "index": k}] * 2} for k in range(1, 201)]
    function = _nonlinear({"type": "node", "index": 201}, *nodes)
    f = _program(json.dumps(_model(objective={"sense": "min", "function": function}))).f
    assert f.operations == 201
    assert f.evaluate(np.zeros(2))[0] == 2.0**200
    assert _read(to_mof.scalars(f, _names(2)), 2) == f


@pytest.mark.parametrize("piece", [b'{"type":"sin","args":["x"]},', b"{},", b"[],"])
def test_too_many_terms_are_refused_before_they_are_parsed(piece: bytes) -> None:
    """10⁷ nodes, or as much memory in other forms; what is allocated meanwhile stays a few kilobytes."""
    count = 1 + mof_json.LARGEST // mof_json.memory(piece)
    assert count <= 5e7
    text = b'{"version": {"major": 1}, "x": [' + piece * count + b"0]}"
    tracemalloc.start()
    with pytest.raises(FormatError, match="as parsed JSON"):
        mof_json.parse(text, "text")
    assert tracemalloc.get_traced_memory()[1] < 100_000
    tracemalloc.stop()
    assert mof_json.memory(b'{"type":"sin","args":["x"]},' * 1000) * 10_000 > mof_json.LARGEST


@pytest.mark.parametrize(
    ("part", "put", "says"),
    [
        ("operations", None, "F/operations: is missing"),
        ("operations", [[1, 0]], "operations: has 2 columns"),
        ("operations", [[99, 0, -1], [1, 1, -1]], "map.heads"),
        ("operations", [[1, 9, -1], [1, 1, -1]], "map.left: is 9 at 0"),
        ("constants", [math.inf], "map.constants"),
        ("outputs", [2], "F: has shape"),
        ("outputs", [2, 7], "map.outputs"),
        ("parameters", "{", "is not a JSON object"),
        ("parameters", '{"p": "1"}', "is not a JSON object of places"),
        ("parameters", '{"p": 7}', "map.named"),
        ("other", [1.0], "other: is none of"),
        ("@inputs", 3, "F: has shape"),
        ("@inputs", "2", "@inputs: is missing"),
    ],
)
def test_damaged_maps_in_hdf5_are_one_line(part: str, put: Any, says: str, tmp_path: Path) -> None:
    z = ca.SX.sym("z", 2)
    path = tmp_path / "p.h5"
    storage.save(NCP.from_casadi(z, ca.exp(z)), path)
    with h5py.File(path, "r+") as file:
        stored: Any = file["cpbench/maps/F"]
        if part.startswith("@"):
            stored.attrs[part[1:]] = put
        else:
            if part in stored:
                del stored[part]
            if put is not None:
                stored.create_dataset(part, data=put)
    with pytest.raises(FormatError, match=says) as refusal:
        storage.load(path)
    assert str(path) in str(refusal.value)
    assert "\n" not in str(refusal.value)
