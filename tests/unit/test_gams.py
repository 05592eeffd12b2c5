"""GAMS' scalar text: real files against Python's own parser and published values, pairs and bounds, hostile texts."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gams_oracle import declared, equations
from tiers import by_night, some_by_day

import cpbench
from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import LCP, MLCP, NCP, NLP, QP, MiCP, Relay

# W. Hock and K. Schittkowski, Test Examples for Nonlinear Programming Codes, Springer 1981
PUBLISHED = {
    "hs001": 0.0,
    "hs003": 0.0,
    "hs005": -(math.sqrt(3.0) / 2.0 + math.pi / 3.0),
    "hs010": -1.0,
    "hs014": 9.0 - 2.875 * math.sqrt(7.0),
    "hs021": -99.96,
    "hs026": 0.0,
    "hs028": 0.0,
    "hs034": -math.log(math.log(10.0)),
    "hs035": 1.0 / 9.0,
    "hs043": -44.0,
    "hs065": 0.9535288567,
    "hs071": 17.0140173,
    "hs076": -4.681818181,
    "hs100": 680.6300573,
    "hs113": 24.3062091,
}
BLOCKS = {1: (349, 332), 2: (589, 564), 3: (445, 408), 4: (514, 464)}
SQUARE = {"kehoe1": ("micp", 10), "kehoe2": ("micp", 10), "kojshin3": ("ncp", 4)}
CHOICES = [
    "aampec_1", "bard1", "bard2", "bartruss3_0", "bartruss3_5", "dempe", "dempe2", "desilva", "ex9_1_1m",
    "ex9_1_2m", "ex9_1_3m", "ex9_1_4m", "finda10l", "findb10s", "findc10t", "fjq1", "gauvin", "mss", "nappi_a",
    "outrata31", "outrata32", "outrata33", "oz3", "qvi", "three", "tinloi", "tollmpec",
]  # fmt: skip
ALL = (*PUBLISHED, *(f"frictionalblock_{k}" for k in BLOCKS), *SQUARE, *CHOICES)


def model(rows: str, *, pairs: str = "all", bounds: str = "", kind: str = "MCP", names: str = "x, y") -> str:
    """A file with these equations; `pairs` is the list of the model."""
    equations_ = ", ".join(re.findall(r"^(\w+)\s*\.\.", rows, re.MULTILINE))
    return (
        f"Variables {names};\nEquations {equations_};\n{rows}\n{bounds}\nModel m / {pairs} /;\nSolve m using {kind};\n"
    )


def read(tmp_path: Path, text: str) -> Any:
    path = tmp_path / "m.gms"
    path.write_text(text, encoding="latin-1")
    return storage.load(path)


# ----------------------------------------------------------------------------------------------- real files


@pytest.mark.parametrize("name", some_by_day(ALL, 12))
def test_rows_have_the_values_that_python_computes(name: str, shared_data: Path, tmp_path: Path) -> None:
    """Every file as a program without its pairs, which keeps all rows."""
    text = (shared_data / "gams" / f"{name}.gms").read_text()
    program = re.sub(r"^Model m /[^/]*/;", "Model m / all /;", text.replace("using MPEC", "using NLP"), flags=re.M)
    program = program.replace("=N=", "=E=")
    problem = read(tmp_path, program)
    assert _agrees(problem, program, np.random.default_rng(3)) > 0


def _agrees(problem: Any, text: str, rng: np.random.Generator) -> int:
    """Assert that all rows of a program have the values of the equations; return how many there are, 0 where the
    objective variable is more than the name of a function.
    """
    names = declared(text)
    found = equations(text)
    objective = text.lower().rpartition("minimizing")[2].strip(" ;\n")
    places = [equation for equation, row in found.items() if row.uses(objective)]
    x = rng.uniform(0.4, 0.9, len(names))
    z = np.array([value for name, value in zip(names, x, strict=True) if name != objective])
    if len(places) != 1 or problem.sizes()["n"] != z.size or z.size != len(names) - 1:
        return 0
    if isinstance(problem, QP):
        f = problem.objective(z) + problem.info.properties.get("objective_offset", 0.0)
        g, h = problem.A @ z - problem.b, problem.C @ z - problem.d
    else:
        f, g, h = problem.objective(z), problem.g(z), problem.h(z)
    point = dict(zip(names, x, strict=True))
    row = found.pop(places[0])
    point[objective] = f
    left, right = row.sides(point)
    assert left == pytest.approx(right, abs=1e-13 * row.size(point))
    inequalities = iter(g)
    measured = {"e": iter(h), "g": inequalities, "l": inequalities}
    for row in found.values():
        left, right = row.sides(point)
        wanted = right - left if row.relation == "l" else left - right
        # sums of the same terms: 1e-13 of the largest of some hundred
        assert next(measured[row.relation]) == pytest.approx(wanted, rel=1e-12, abs=1e-13 * row.size(point))
    assert not any(True for rest in measured.values() for _ in rest)
    return len(found) + 1


@pytest.mark.parametrize("name", PUBLISHED)
def test_programs_have_their_published_optimum(name: str, shared_data: Path) -> None:
    problem = cpbench.load(shared_data / "gams" / f"{name}.gms")
    assert isinstance(problem, NLP | QP)
    answer = cpbench.solve(problem, "scipy-slsqp")
    optimum = problem.objective(answer.point.z) + problem.info.properties.get("objective_offset", 0.0)
    assert optimum == pytest.approx(PUBLISHED[name], rel=1e-8, abs=1e-8)


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("number", [1, *by_night([2, 3, 4])])
def test_blocks_with_friction_are_mixed_complementarity_problems(
    number: int, shared_data: Path, caplog: pytest.LogCaptureFixture
) -> None:
    problem = cpbench.load(shared_data / "gams" / f"frictionalblock_{number}.gms")
    assert isinstance(problem, MLCP)
    assert (problem.a.size, problem.b.size) == BLOCKS[number]
    left_out = "the objective (minimizing objvar) is left out"
    assert left_out in problem.info.description
    assert left_out in caplog.text
    answer = cpbench.solve(problem, "interior-point-mlcp")
    assert answer.status == "solved"


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("name", SQUARE)
def test_square_models_are_complementarity_problems(name: str, shared_data: Path) -> None:
    problem = cpbench.load(shared_data / "gams" / f"{name}.gms")
    assert (problem.node, problem.sizes()["n"]) == SQUARE[name]
    assert cpbench.solve(problem, "path-search").status == "solved"


@pytest.mark.parametrize("name", CHOICES)
def test_models_that_are_not_square_are_refused_as_such(name: str, shared_data: Path) -> None:
    with pytest.raises(FormatError, match=r"is an MPCC \(a mathematical program with complementarity") as refusal:
        storage.load(shared_data / "gams" / f"{name}.gms")
    assert "cpbench has no such formulation" in str(refusal.value)
    assert "\n" not in str(refusal.value)


# ----------------------------------------------------------------------------------------------- expressions

VALUES = {"x": 1.5, "y": 0.25}
EXPRESSIONS = {
    "-x**2": -2.25,
    "- x*y": -0.375,
    "2**(-1)*x": 0.75,
    "x - y - x - y": -0.5,
    "x - (y - x)": 2.75,
    "x/y/x": 4.0,
    "x/(y/x)": 9.0,
    "2*x**2*y": 1.125,
    "(x + y)*(x - y)": 2.1875,
    "+x": 1.5,
    "4/2*x": 3.0,
    "1.e1*x + .5E+1": 20.0,
    "sqr(x) + POWER(x,3)": 2.25 + 3.375,
    "power(x,-2)": 1 / 2.25,
    "x**y": 1.5**0.25,
    "(x*y)**y": 0.375**0.25,
    "rpower(x,y) + vcpower(x,3) + cvpower(2,y)": 1.5**0.25 + 3.375 + 2**0.25,
    "exp(y) + log(x) + log10(x) + log2(x) + sqrt(x)": math.exp(0.25)
    + math.log(1.5)
    + math.log10(1.5)
    + math.log2(1.5)
    + math.sqrt(1.5),
    "sin(x) + cos(x) + tan(x)": math.sin(1.5) + math.cos(1.5) + math.tan(1.5),
    "arcsin(y) + arccos(y) + arctan(y) + arctan2(x,y)": math.asin(0.25)
    + math.acos(0.25)
    + math.atan(0.25)
    + math.atan2(1.5, 0.25),
    "sinh(x) + cosh(x) + tanh(x)": math.sinh(1.5) + math.cosh(1.5) + math.tanh(1.5),
    "abs(y - x) + floor(x) + ceil(x)": 1.25 + 1.0 + 2.0,
    "min(x,y) + max(x,y,2)": 2.25,
    "errorf(x)": 0.5 * (1 + math.erf(1.5 / math.sqrt(2))),
    "div(x,y)": 6.0,
    "((((x))))": 1.5,
}


@pytest.mark.parametrize("text", EXPRESSIONS)
def test_expressions_have_the_value_of_their_formula(text: str, tmp_path: Path) -> None:
    problem = read(tmp_path, model(f"e.. {text} + 0*x*y =E= 0;\nd.. y =E= 0;", pairs="e.x, d.y"))
    z = np.array([VALUES["x"], VALUES["y"]])
    assert isinstance(problem, MiCP)
    assert problem.F(z)[0] == pytest.approx(EXPRESSIONS[text], rel=1e-15)


@pytest.mark.parametrize(
    "text",
    ["2*-x", "x**y**x", "x y", "(x", "x)", "x +", "sqr(x,y)", "sqr()", "power(x,y)", "power(x,1.5)", "gamma(x)", "q",
     "x =E= y", "1e400*x", "arctan2(x)", "--x", "x..y", ""],
)  # fmt: skip
def test_expressions_that_gams_does_not_have_are_refused(text: str, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="line 3: ") as refusal:
        read(tmp_path, model(f"e.. {text} =E= 0;\nd.. y =E= 0;", pairs="e.x, d.y"))
    assert "\n" not in str(refusal.value)


# ------------------------------------------------------------------------------------------ what a model is


def test_pairs_between_bounds_have_the_signs_of_a_micp(tmp_path: Path) -> None:
    """A planted solution at a lower bound, at an upper bound, between two, at a fixed value and of a free one."""
    rows = "a.. exp(v) + w =G= 1;\nb.. v - 2 =L= 3;\nc.. w**3 =N= 0.125;\nd.. u + v =E= 1;\ne.. 1 - u*u =G= 0;"
    bounds = "u.lo = 2; v.up = 4; w.lo = -1; w.up = 1; t.fx = 7;"
    text = model(rows, pairs="a.u, b.v, c.w, d.s, e.t", bounds=bounds, names="s, t, u, v, w")
    problem = read(tmp_path, text)
    assert isinstance(problem, MiCP)
    inf = np.inf
    assert problem.lb.tolist() == [-inf, 7.0, 2.0, -inf, -1.0]
    assert problem.ub.tolist() == [inf, 7.0, inf, 4.0, 1.0]
    s, t, u, v, w = z = np.array([0.3, 7.0, 2.0, 4.0, 0.5])
    np.testing.assert_allclose(problem.F(z), [u + v - 1, 1 - u * u, np.exp(v) + w - 1, v - 5, w**3 - 0.125])
    assert (t, s) == (7.0, 0.3)


def test_affine_pairs_become_the_linear_formulation_that_fits(tmp_path: Path) -> None:
    rows = "e.. 2*x - y =G= 3;\nd.. x + y =G= -1;"
    lcp = read(tmp_path, model(rows, pairs="d.y, e.x", bounds="x.lo = 0; y.lo = 0;"))
    assert isinstance(lcp, LCP)
    assert cpbench.foundation.matrices.dense(lcp.M).tolist() == [[2.0, -1.0], [1.0, 1.0]]
    assert lcp.q.tolist() == [-3.0, 1.0]
    mlcp = read(tmp_path, model(rows.replace("G", "E", 1), pairs="e.x, d.y", bounds="y.lo = 0;"))
    assert isinstance(mlcp, MLCP)
    assert (mlcp.a.tolist(), mlcp.b.tolist()) == ([-3.0], [1.0])
    between = rows.replace("=G=", "=N=")
    relay = read(tmp_path, model(between, pairs="e.x, d.y", bounds="x.lo=-1; x.up=1; y.lo=0; y.up=2;"))
    assert isinstance(relay, Relay)
    assert read(tmp_path, model(between, pairs="e.x, d.y", bounds="x.lo = -1;")).node == "avi"
    curved = rows.replace("y =G= 3", "exp(y) =G= 3")
    assert isinstance(read(tmp_path, model(curved, pairs="e.x, d.y", bounds="x.lo = 0; y.lo = 0;")), NCP)


def test_equations_without_a_variable_stand_beside_the_free_ones(tmp_path: Path) -> None:
    """Which stands beside which changes no solution; a fixed variable needs no equation."""
    rows = "e.. x + y - z =G= 0;\nd.. y - z =E= 1;\nc.. exp(z) - w =E= 0;"
    text = model(rows, pairs="e.x, d, c", bounds="x.lo = 0; w.fx = 2;", names="x, y, z, w", kind="MPEC")
    problem = read(tmp_path, text)
    assert isinstance(problem, MiCP)
    z = np.array([0.5, 3.0, 1.0, 2.0])
    np.testing.assert_allclose(problem.F(z), [2.5, 1.0, math.e - 2.0, 0.0])
    assert (problem.lb[3], problem.ub[3]) == (2.0, 2.0)


def test_a_program_has_its_objective_in_place_of_its_variable(tmp_path: Path) -> None:
    rows = "o.. x*y - z =E= -4;\ne.. x + y =L= 3;\nd.. 2 =L= exp(x);"
    text = model(rows, kind="NLP maximizing z", names="x, z, y", bounds="x.up = 1; y.l = 2;")
    problem = read(tmp_path, text)
    assert isinstance(problem, NLP)
    z = np.array([0.5, 3.0])
    np.testing.assert_allclose([problem.f(z)[0], *problem.g(z)], [-(0.5 * 3.0 + 4.0), 3.0 - 3.5, math.exp(0.5) - 2.0])
    assert problem.start.tolist() == [0.0, 2.0]
    assert problem.ub.tolist() == [1.0, np.inf]


@pytest.mark.parametrize(
    ("rows", "bounds"),
    [
        ("o.. 2*z =E= x;\ne.. x + y =G= 1;", ""),  # with a factor
        ("o.. exp(z) =E= x;\ne.. x + y =G= 1;", ""),  # inside a function
        ("o.. z =E= x;\ne.. x + y + z =G= 1;", ""),  # in two equations
        ("o.. z =G= x;\ne.. x + y =G= 1;", ""),  # in an inequality
        ("o.. z - x =E= 0;\ne.. x + y =G= 1;", "z.lo = 0;"),  # with a bound
    ],
)
def test_an_objective_variable_that_is_more_stays_an_unknown(rows: str, bounds: str, tmp_path: Path) -> None:
    problem = read(tmp_path, model(rows, kind="NLP minimizing z", names="x, y, z", bounds=bounds))
    assert problem.sizes()["n"] == 3
    z = np.array([0.0, 0.0, 1.0])
    assert problem.objective(z) == 1.0


def test_a_quadratic_program_keeps_the_numbers_of_the_file(tmp_path: Path) -> None:
    rows = "o.. - (0.1*sqr(x) + x*y - 3*y) + z =E= 7;\ne.. 0.1*x + y =G= 0.3;\nd.. x =E= 1;"
    problem = read(tmp_path, model(rows, kind="QCP minimizing z", names="x, y, z", bounds="y.up = 2;"))
    assert isinstance(problem, QP)
    assert problem.info.properties == {"objective_offset": 7.0, "unknowns": ["x", "y"]}
    assert cpbench.foundation.matrices.dense(problem.Q).tolist() == [[0.2, 1.0], [1.0, 0.0]]
    assert (problem.p.tolist(), problem.b.tolist(), problem.d.tolist()) == ([0.0, -3.0], [0.3], [1.0])
    assert cpbench.foundation.matrices.dense(problem.A).tolist() == [[0.1, 1.0]]


def test_the_way_of_writing_changes_nothing(tmp_path: Path) -> None:
    rows = "e.. 2*x - exp(y) =G= 3;\nd.. x + y =E= -1;"
    text = model(rows, pairs="e.x, d.y", bounds="x.lo = 0.5; y.l = 3;")
    plain = read(tmp_path, text).fingerprint
    others = [
        text.upper(),
        text.replace(" ", "\n  "),
        text.replace("\n", "\r\n"),
        f"* a comment; with $ and %x%\n$onText\nanything at all\n$offText\n{text}",
        text.replace("Solve", "$if NOT '%gams.u1%' == '' $include '%gams.u1%'\n\nm.limrow=0; m.tolproj=0.0;\nSolve"),
        text.replace("Solve m using MCP", "$if not set MCP $set MCP MCP\nSolve m using %MCP%"),
        text.replace("Variables x, y", "Variables x, y, unused"),
        text.replace("Model", "x.m = 3; e.m = -2; e.l = 1; y.scale = 10;\nModel"),
    ]
    for other in others:
        assert read(tmp_path, other).fingerprint == plain, other


def test_statements_change_the_problem_or_are_missed(tmp_path: Path) -> None:
    """Each statement that is left out changes the problem or its absence is an error."""
    rows = "e.. 2*x - exp(y) =G= 3;\nd.. x + y =E= -1;"
    text = model(rows, pairs="e.x, d.y", bounds="x.lo = 0.5; y.l = 3;")
    plain = read(tmp_path, text).fingerprint
    statements = text.split(";")
    for k in range(len(statements) - 1):
        shorter = ";".join([*statements[:k], *statements[k + 1 :]])
        assert _read_or_refused(tmp_path, shorter) != plain, statements[k]


def _read_or_refused(tmp_path: Path, text: str) -> str:
    """The fingerprint of a problem, or the one line of the refusal."""
    try:
        return read(tmp_path, text).fingerprint
    except FormatError as refusal:
        return _one_line(refusal)


def _one_line(refusal: FormatError) -> str:
    line = str(refusal)
    assert "\n" not in line
    return line


# ------------------------------------------------------------------------------------------------- hostile

ROWS = "e.. x + y =E= 0;\nd.. x - y =E= 0;"
GOOD = model(ROWS, pairs="e.x, d.y")
REFUSED = {
    "call": (f"$call rm -rf /\n{GOOD}", "line 1: has the instruction $call rm -rf /, and cpbench executes none"),
    "include": (f"$include /etc/passwd\n{GOOD}", "has the instruction $include /etc/passwd"),
    "execute": (f"execute 'ls';\n{GOOD}", "line 1: has \"'\", which GAMS' CONVERT does not write"),
    "set": (f"Set i / 1*3 /;\n{GOOD}", "line 1: has the statement 'set', which CONVERT does not write"),
    "macro": (GOOD.replace("MCP", "%MCP%"), "line 7: has %mcp%, for which no line above it sets a value"),
    "open comment": (f"$onText\n{GOOD}", r"line 1: begins a comment by $onText that does not end"),
    "integer": (f"Integer Variables i;\n{GOOD}", "line 1: declares i as integer, and cpbench has continuous variables"),
    "no solve": (GOOD.partition("Solve")[0], "has no solve statement"),
    "two solves": (f"{GOOD}Solve m using MCP;", "line 8: has solve after the solve of line 7: cpbench reads one model"),
    "no model": (GOOD.replace("Model m", "Model n"), "line 7: solves m, which is no model"),
    "twice": (GOOD.replace("x, y", "x, y, x"), "line 1: declares the variable x again"),
    "both": (GOOD.replace("e, d;", "e, d, x;"), "line 2: declares x again"),
    "undefined": (GOOD.replace("e, d;", "e, d, f;").replace("d.y", "d.y, f"), "declares f, which the model m has"),
    "undeclared": (GOOD.replace("e, d;", "e;"), "line 4: defines d, which is not declared under Equations"),
    "defined twice": (GOOD.replace("d..", "e.."), "line 4: defines the equation e again"),
    "no variable": (GOOD.replace("d.y", "d.q"), "has d.q, and q is no variable"),
    "pair twice": (GOOD.replace("d.y", "d.x"), "line 4: is the second equation beside x: d"),
    "equation twice": (GOOD.replace("d.y", "e.y"), "has e in the model m, which is in the model twice"),
    "kind": (GOOD.replace("MCP", "MINLP"), "line 7: solves m as MINLP, cpbench reads LP, QCP"),
    "pair in a program": (GOOD.replace("MCP", "NLP minimizing x"), "solves as NLP a model with the pair e.x"),
    "attribute": (
        GOOD.replace("Model", "x.prior = 1;\nModel"),
        "has x.prior, cpbench reads lo, up, fx, l, m and scale",
    ),
    "no number": (GOOD.replace("Model", "x.up = y;\nModel"), "line 6: has 'y', expected a number or inf"),
    "large": (GOOD.replace("Model", "x.up = 1e999;\nModel"), "has a number beyond 1.8e308: infinite is inf"),
    "level": (GOOD.replace("Model", "x.l = inf;\nModel"), "has x.l = inf, expected a finite number"),
    "crossed": (
        GOOD.replace("Model", "x.lo = 2; x.up = 1;\nModel").replace("=E=", "=N="),
        "x: has the bounds 2 and 1: no number is between, there is no solution",
    ),
    "relation": (GOOD.replace("=E=", "=X=", 1), "line 3: has '=X=' in the equation e, expected =E=, =G=, =L= or =N="),
    "bounded": (GOOD.replace("Model", "x.lo = 0;\nModel"), "line 3: has =E= in e.x with 0 <= x <= inf, expected =G="),
    "free": (
        GOOD.replace("=E=", "=G=", 1),
        "line 3: has =G= in e.x with -inf <= x <= inf, expected =G= beside a lower",
    ),
    "says nothing": (model("o.. x =E= y;\nn.. x + y =N= 1;", kind="NLP minimizing x"), "line 4: has =N= in n, which"),
    "semicolon": (GOOD.replace("= 0;", "= 0", 1), "in the equation e of line 3, expected ';'"),
    "byte": (GOOD.replace("x + y", "x \x07 y"), r"line 3: has '\x07', which GAMS"),
    "binary": (GOOD.replace("x + y", "x \0 y"), "is not a text file"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_read_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    text, words = REFUSED[case]
    with pytest.raises(FormatError) as refusal:
        read(tmp_path, text)
    assert words in _one_line(refusal.value)
    assert str(refusal.value).startswith(str(tmp_path / "m.gms"))


def test_no_beginning_of_a_file_is_a_model(tmp_path: Path) -> None:
    text = GOOD.rstrip("\n")
    for end in range(1, len(text)):
        with pytest.raises(FormatError):
            read(tmp_path, text[:end])


def test_depth_and_length_end_in_no_error_of_python(tmp_path: Path) -> None:
    deep = f"{'(' * 5_000}x{')' * 5_000}"
    long = " + ".join(["x*y"] * 5_000)
    for term in (deep, long, f"{'exp(' * 5_000}x{')' * 5_000}"):
        problem = read(tmp_path, model(f"e.. {term} =E= 0;\nd.. x - exp(y) =E= 0;", pairs="e.x, d.y"))
        assert problem.node == "micp"
    with pytest.raises(FormatError, match=r"expected '\)' of the bracket of line 3"):
        read(tmp_path, model(f"e.. {'(' * 5_000}x =E= 0;\nd.. x - y =E= 0;", pairs="e.x, d.y"))


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "m.gms"
    with open(path, "wb") as file:
        file.write(GOOD.encode())
        file.truncate(1 << 33)
    with pytest.raises(FormatError, match="has 8590 MB, at most 67 are read"):
        storage.load(path)
