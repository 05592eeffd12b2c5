"""AMPL's .nl: there and back bit for bit, CasADi's reader as oracle, hostile and damaged files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from drawn_cases import NUMBERS, maps
from hypothesis import given, settings
from nl_files import binary, text
from tiers import some_by_day

import cpbench
from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import NCP, NLP, QP, MiCP
from cpbench.formulations.expressions import Builder, Map, Operator
from cpbench_problems.formats.nl_operators import UNWRITTEN

NODES = ("nlp", "ncp", "micp", "qp")
BUILTIN = [
    address
    for node in NODES
    for address in storage.problem_files([Path(cpbench.__file__).parents[1] / "problems" / node])
]


def written(problem: Any, tmp_path: Path) -> Path:
    path = tmp_path / "p.nl"
    storage.save(problem, path, force=True)
    return path


# ------------------------------------------------------------------------------------------- there and back


KNOWN = sorted(set(Operator) - UNWRITTEN)
KNOWN += 5 * [Operator.ADD, Operator.LT, Operator.EQ, Operator.NOT, Operator.AND, Operator.CHOOSE]


@settings(max_examples=60, deadline=None, derandomize=True)
@given(maps(KNOWN, (1, 3), NUMBERS, 30, None))
def test_a_map_comes_back_bit_for_bit(tmp_path_factory: pytest.TempPathFactory, F: Map) -> None:
    assert storage.load(written(NCP(F=F), tmp_path_factory.mktemp("map"))).maps()["F"] == F


def test_what_the_format_has_no_number_for_is_refused(tmp_path: Path) -> None:
    build = Builder(1)
    problem = NCP(F=build.finish([build.apply(Operator.EXPM1, 0)]))
    with pytest.raises(FormatError, match=r"F has the operator expm1, for which \.nl has no number"):
        written(problem, tmp_path)
    assert not (tmp_path / "p.nl").exists()
    qp = QP.build(np.array([[5e-324]]), np.zeros(1))
    with pytest.raises(FormatError, match=r"Q\[0,0\]: is 5e-324, half of which is no number of a file"):
        written(qp, tmp_path)


def test_deep_and_shared_maps_are_written_in_proportion(tmp_path: Path) -> None:
    """Each operation once, though a tree of this map would have 2^60 leaves, and no more than 200 in one another."""
    build = Builder(1)
    value = 0
    for _ in range(60):
        value = build.apply(Operator.MUL, value, value)
    deep = 0
    for _ in range(5_000):
        deep = build.apply(Operator.SIN, deep)
    problem = NCP(F=build.finish([build.apply(Operator.SUB, deep, value)]))
    path = written(problem, tmp_path)
    assert path.stat().st_size < 60_000
    assert storage.load(path).fingerprint == problem.fingerprint


# --------------------------------------------------------------------------------------------- other readers


@pytest.mark.parametrize(
    "address",
    some_by_day([a for a in BUILTIN if "/nlp/" in a or "/qp/" in a], 12),
    ids=lambda address: Path(address).name,
)
def test_casadi_reads_the_values_that_the_problem_has(address: str, tmp_path: Path, rng: np.random.Generator) -> None:
    problem: Any = storage.load(address)
    nlp = ca.NlpBuilder()
    nlp.import_nl(str(written(problem, tmp_path)))
    n = problem.point_sizes["z"]
    read = ca.Function("read", [ca.vertcat(*nlp.x)], [nlp.f, ca.vertcat(*nlp.g)])
    z = rng.uniform(0.5, 1.5, n)
    f, g = (np.array(value, float).ravel() for value in read(z))
    if problem.node == "qp":
        rows = np.concatenate([problem.A @ z - problem.b, problem.C @ z - problem.d])
    else:
        rows = np.concatenate([problem.g(z), problem.h(z)])
    sides = np.array(nlp.g_lb, float).ravel()
    np.testing.assert_allclose(f, [problem.objective(z)], rtol=1e-12, atol=1e-12)
    # sums of up to 60 terms of size 1 and their side
    np.testing.assert_allclose(g - sides, rows, rtol=1e-12, atol=1e-11)
    np.testing.assert_array_equal(np.array(nlp.x_lb).ravel(), problem.lb)
    np.testing.assert_array_equal(np.array(nlp.x_ub).ravel(), problem.ub)


# ---------------------------------------------------------------------------------------- written by hand


def load(tmp_path: Path, content: str | bytes) -> Any:
    path = tmp_path / "p.nl"
    path.write_bytes(content if isinstance(content, bytes) else content.encode("latin-1"))
    return storage.load(path)


OPERATORS: dict[str, tuple[str, float]] = {
    "sum": ("o54 3 v0 v1 n2", 1.5 + 0.25 + 2),
    "plus": ("o0 v0 v1", 1.75),
    "minus": ("o1 v0 v1", 1.25),
    "times": ("o2 v0 v1", 0.375),
    "over": ("o3 v0 v1", 6.0),
    "power": ("o5 v0 v1", 1.5**0.25),
    "less": ("o6 v0 v1", 1.25),
    "less, 0": ("o6 v1 v0", 0.0),
    "min": ("o11 3 v0 v1 n-1", -1.0),
    "max": ("o12 2 v0 v1", 1.5),
    "floor": ("o13 v0", 1.0),
    "ceil": ("o14 v0", 2.0),
    "abs": ("o15 n-3", 3.0),
    "negative": ("o16 v0", -1.5),
    "if": ("o35 o22 v0 v1 n5 v0", 1.5),
    "if, yes": ("o35 o29 v0 v1 n5 v0", 5.0),
    "if, at least": ("o35 o28 v1 v1 n5 v0", 5.0),
    "if, not equal": ("o35 o30 v0 v1 n5 v0", 5.0),
    "if, not 0": ("o35 o30 v0 n0 n5 v0", 5.0),
    "if, and, or, not": ("o35 o21 o20 o23 v0 v1 o24 v0 v0 o34 o22 v0 v1 n5 v0", 5.0),
    "tanh": ("o37 v0", math.tanh(1.5)),
    "tan": ("o38 v0", math.tan(1.5)),
    "sqrt": ("o39 v0", math.sqrt(1.5)),
    "sinh": ("o40 v0", math.sinh(1.5)),
    "sin": ("o41 v0", math.sin(1.5)),
    "log10": ("o42 v0", math.log10(1.5)),
    "log": ("o43 v0", math.log(1.5)),
    "exp": ("o44 v0", math.exp(1.5)),
    "cosh": ("o45 v0", math.cosh(1.5)),
    "cos": ("o46 v0", math.cos(1.5)),
    "atanh": ("o47 v1", math.atanh(0.25)),
    "atan2": ("o48 v0 v1", math.atan2(1.5, 0.25)),
    "atan": ("o49 v0", math.atan(1.5)),
    "asinh": ("o50 v0", math.asinh(1.5)),
    "asin": ("o51 v1", math.asin(0.25)),
    "acosh": ("o52 v0", math.acosh(1.5)),
    "acos": ("o53 v1", math.acos(0.25)),
    "power of a number": ("o76 v0 n3", 1.5**3),
    "square": ("o77 v0", 2.25),
    "number to a power": ("o78 n2 v0", 2.0**1.5),
    "short": ("o0 s-7 l70000", 69993.0),
    "defined": ("v2", 1.5 * 0.25 + 4 * 0.25),
}


@pytest.mark.parametrize("case", OPERATORS)
def test_operators_have_their_value_in_text_and_binary(case: str, tmp_path: Path) -> None:
    words, value = OPERATORS[case]
    body = ["V2 1 0", "1 4", "o2", "v0", "v1", "C0", *words.split(), "r", "4 0", "b", "3", "3", "J0 2", "0 0", "1 0"]
    for content in (text(*body, jacobian=2), binary(body, jacobian=2)):
        problem = load(tmp_path, content)
        assert isinstance(problem, NLP)
        assert problem.h(np.array([1.5, 0.25]))[0] == pytest.approx(value, rel=1e-15)


def test_big_endian_files_are_read(tmp_path: Path) -> None:
    body = ["C0", "o2", "v0", "v1", "r", "4 0", "b", "3", "3", "J0 2", "0 0", "1 1.5"]
    assert (
        load(tmp_path, binary(body, ">", jacobian=2)).fingerprint == load(tmp_path, text(*body, jacobian=2)).fingerprint
    )


QUADRATIC = (
    "C0", "n0", "O0 1", "o54", "3", "o2", "n-0.5", "o5", "v0", "n2", "o2", "v0", "v1", "n7", "x1", "0 3", "r",
    "0 -1 4", "b", "0 -1 2", "3", "k1", "1", "J0 2", "0 3", "1 -1", "G0 2", "0 0.3", "1 0",
)  # fmt: skip
SIZES = {"objectives": 1, "jacobian": 2, "gradient": 2}


@pytest.mark.needs("cpbench_solvers")
def test_a_quadratic_program_has_the_numbers_of_the_file(tmp_path: Path) -> None:
    problem = load(tmp_path, text(*QUADRATIC, **SIZES))
    assert isinstance(problem, QP)
    assert problem.name == "by-hand"
    assert cpbench.foundation.matrices.dense(problem.Q).tolist() == [[1.0, -1.0], [-1.0, 0.0]]
    assert problem.p.tolist() == [-0.3, 0.0]
    assert cpbench.foundation.matrices.dense(problem.A).tolist() == [[3.0, -1.0], [-3.0, 1.0]]
    assert problem.b.tolist() == [-1.0, -4.0]
    assert (problem.lb.tolist(), problem.ub.tolist()) == ([-1.0, -np.inf], [2.0, np.inf])
    # of a maximum that of the opposite
    assert problem.info.properties == {"objective_offset": -7.0, "objective_sense": "max"}


PAIRS = ("C0", "o44", "v1", "C1", "n-5", "r", "5 1 1", "5 2 2", "b", "2 1", "1 4", "J0 1", "1 0", "J1 1", "0 2")


def test_pairs_have_the_signs_of_a_micp(tmp_path: Path) -> None:
    problem = load(tmp_path, text(*PAIRS, m=2, pairs=2, jacobian=2))
    assert isinstance(problem, MiCP)
    assert (problem.lb.tolist(), problem.ub.tolist()) == ([1.0, -np.inf], [np.inf, 4.0])
    np.testing.assert_allclose(problem.F(np.array([1.0, 4.0])), [math.exp(4.0), -3.0], rtol=1e-15)


def test_an_objective_beside_pairs_is_left_out_aloud(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    plain = load(tmp_path, text(*PAIRS, m=2, pairs=2, jacobian=2))
    segments = (*PAIRS, "O0 0", "v0", "G0 1", "0 0")
    problem = load(tmp_path, text(*segments, m=2, pairs=2, jacobian=2, objectives=1, gradient=1))
    assert problem.fingerprint == plain.fingerprint
    assert "the objective (minimized) is left out" in problem.info.description
    assert "the objective (minimized) is left out" in caplog.text


# ------------------------------------------------------------------------------------------------- hostile

GOOD = text(*QUADRATIC, **SIZES)
REFUSED: dict[str, tuple[str, str]] = {
    "letter": ("h" + GOOD[1:], "line 1: begins with neither g (text) nor b (binary)"),
    "header": (GOOD.replace(" 2 1 1 0 0", " 2 1 x 0 0"), "line 2: has ' 2 1 x 0 0"),
    "short header": ("\n".join(GOOD.split("\n")[:5]), "line 5: does not end"),
    "integers": (GOOD.replace(" 0 0 0 0 0\n", " 1 0 0 0 0\n", 1), "line 7: has 1 binary and integer variables"),
    "functions": (GOOD.replace(" 0 0 0 1\n", " 0 1 0 1\n", 1), "line 6: has 1 imported functions"),
    "objectives": (GOOD.replace(" 2 1 1 0 0", " 2 1 3 0 0"), "line 2: has 2 objectives more than one"),
    "logical": (GOOD.replace(" 2 1 1 0 0", " 2 1 1 0 0 4"), "line 2: has 4 logical constraints"),
    "variables": (GOOD.replace(" 2 1 1 0 0", " 999999999 1 1 0 0"), "declares 999999999 variables in a file of"),
    "entries": (GOOD.replace("\n 2 2\n", "\n 99999 2\n"), "line 8: declares 99999 entries of the Jacobian in a file"),
    "operator": (GOOD.replace("o5\n", "o64\n"), "line 18: has the operator o64, which cannot be expressed"),
    "imported": (GOOD.replace("n7", "f0 1"), "line 24: calls an imported function, and cpbench runs none"),
    "variable": (GOOD.replace("v1\n", "v2\n"), "has v2, which is no variable (0 to 1), and none defined above"),
    "nan": (GOOD.replace("n7", "nnan"), "has 'nan', expected a number"),
    "infinite": (GOOD.replace("n7", "n1e999"), "has inf, expected a finite number"),
    "underscore": (GOOD.replace("n7", "n1_0"), "has '1_0', expected a number"),
    "more": (GOOD.replace("n7", "n7 8"), "line 24: has '8' behind what belongs there"),
    "segment": (GOOD.replace("x1\n", "q1\n"), "line 25: has a segment 'q', cpbench reads C, O, V, J, G"),
    "twice": (GOOD + "r\n3\n", "has a second segment r"),
    "row": (GOOD.replace("C0", "C1"), "has constraint 1, expected one of 0 to 0"),
    "no row": (GOOD.replace("C0\nn0\n", ""), "has no segment C0: the file is not complete"),
    "no sides": (GOOD.replace("r\n0 -1 4\n", ""), "has no segment r"),
    "no bounds": (GOOD.replace("b\n0 -1 2\n3\n", ""), "has no segment b"),
    "no terms": (GOOD.replace("J0 2\n0 3\n1 -1\n", ""), "has 0 linear terms of constraints (J), its header says 2"),
    "no gradient": (GOOD.replace("G0 2\n0 0.3\n1 0\n", ""), "has 0 linear terms of the objective (G), its header says"),
    "columns": (GOOD.replace("k1\n1\n", "k1\n2\n"), "has other lengths of columns in k than its terms in J have"),
    "sides": (GOOD.replace("0 -1 4", "2 Infinity"), "has the interval from inf to inf, which no number is in"),
    "interval": (GOOD.replace("0 -1 4", "7 -1 4"), "line 28: has '7', expected the kind of an interval, 0 to 5"),
    "term twice": (GOOD.replace("1 -1", "0 -1"), "has a variable twice in the linear terms of a row"),
    "sets": (GOOD + "S0 1 sosno\n0 1\n", "has the suffix sosno of special ordered sets"),
    "empty sum": (GOOD.replace("o54\n3\n", "o54\n0\n"), "has the operator o54 without an argument"),
    "flags": (text(*PAIRS, m=2, pairs=2, jacobian=2).replace("5 2 2", "5 1 2"), "is complementary to v1 by 1, and"),
    "beside": (text(*PAIRS, m=2, pairs=2, jacobian=2).replace("5 2 2", "5 2 3"), "to variable 3, expected one of 1"),
    "both": (text(*PAIRS, m=2, pairs=2, jacobian=2).replace("5 2 2", "5 2 1"), "to variable 1, as row 1 is"),
    "pairs": (text(*PAIRS, m=2, pairs=1, jacobian=2), "has 2 complementarity conditions, its header says 1"),
    "MPCC": (text(*PAIRS, m=2, pairs=1, jacobian=2).replace("5 2 2", "2 0"), "is an MPCC (a mathematical program with"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_read_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    content, words = REFUSED[case]
    with pytest.raises(FormatError) as refusal:
        load(tmp_path, content)
    assert words in _one_line(refusal.value)


def _one_line(refusal: FormatError) -> str:
    line = str(refusal)
    assert "\n" not in line
    return line


def test_depth_ends_in_no_error_of_python(tmp_path: Path) -> None:
    deep = ["o41"] * 10_000
    assert load(tmp_path, text("C0", *deep, "v0", "r", "4 0", "b", "3", "3", "J0 1", "0 0", jacobian=1)).node == "nlp"
    with pytest.raises(FormatError, match="ends here, in the middle of an expression"):
        load(tmp_path, text("C0", *deep, jacobian=1))
