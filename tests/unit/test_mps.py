"""MPS, QPS, SIF and LP files: twins, formulas and HiGHS agree with what is read, and what cannot be kept is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from tiers import some_by_day

import cpbench as cp
from cpbench import storage
from cpbench.errors import FormatError
from cpbench.foundation import matrices
from cpbench.storage.arrays import read_array

highspy = pytest.importorskip("highspy", reason="needs HiGHS: pip install highspy")

TWINS = ("DUALC2", "HS118", "HS35", "HS76", "QAFIRO", "QBORE3D", "QPCBLEND", "QSC205", "QSHARE2B", "TAME")


def rows_and_bounds(problem: Any) -> dict[str, Any]:
    """The rows, sorted, with those of one variable and coefficient ±1 as bounds, for OSQP keeps bounds as rows."""
    found: dict[str, Any] = {"lb": problem.lb.copy(), "ub": problem.ub.copy(), "A": [], "C": []}
    for name, M, side in (("A", problem.A, problem.b), ("C", problem.C, problem.d)):
        dense = matrices.dense(M)
        for row, value in zip(dense, side, strict=True):
            at = np.flatnonzero(row)
            if at.size == 1 and abs(row[at[0]]) == 1.0:
                j, bound = at[0], value * row[at[0]]
                if name == "C" or row[j] > 0:
                    found["lb"][j] = max(found["lb"][j], bound)
                if name == "C" or row[j] < 0:
                    found["ub"][j] = min(found["ub"][j], bound)
            else:
                found[name].append([*map(float, row), float(value)])
    return {name: sorted(value) if name in "AC" else value for name, value in found.items()}


@pytest.mark.parametrize("name", some_by_day(TWINS, 4))
def test_published_files_are_their_twins(name: str, shared_data: Path) -> None:
    """Maros and Meszaros by QPS and by OSQP's .mat: right sides there are differences, 1e-12 for QPS's 0."""
    ours, twin = (storage.load(shared_data / f"{kind}/{name}.{end}") for kind, end in (("qps", "SIF"), ("qp", "mat")))
    assert abs(matrices.sparse(ours.Q) - matrices.sparse(twin.Q)).max() == 0.0
    assert np.allclose(ours.p, twin.p, rtol=2e-13, atol=2e-12)
    mine, theirs = rows_and_bounds(ours), rows_and_bounds(twin)
    for part in ("lb", "ub", "A", "C"):
        assert np.allclose(mine[part], theirs[part], rtol=2e-13, atol=2e-12), part
    offsets = [problem.info.properties.get("objective_offset", 0.0) for problem in (ours, twin)]
    assert offsets[0] == offsets[1]


# ------------------------------------------------------------------------------------------ against HiGHS


def random_model(seed: int) -> Any:
    """A convex quadratic or linear program of HiGHS with all kinds of rows, bounds and a constant."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 8)), int(rng.integers(0, 7))
    at = rng.standard_normal(n)
    A = np.where(rng.random((m, n)) < 0.7, rng.standard_normal((m, n)), 0.0)
    value = A @ at
    kind = rng.integers(0, 4, m)
    below, above = value - rng.random(m), value + rng.random(m)
    model = highspy.HighsModel()
    lp = model.lp_
    lp.num_col_, lp.num_row_ = n, m
    factor = rng.standard_normal((n, n))
    quadratic, maximize = seed % 3 > 0, seed % 2 == 1
    sign = -1.0 if maximize else 1.0
    Q = factor @ factor.T + 0.1 * np.eye(n)
    lp.sense_ = highspy.ObjSense.kMaximize if maximize else highspy.ObjSense.kMinimize
    lp.offset_ = float(rng.standard_normal())
    lp.col_cost_ = sign * rng.standard_normal(n)
    free = rng.random(n) < (0.4 if quadratic else 0.0)
    lp.col_lower_ = np.where(free, -np.inf, at - rng.random(n))
    lp.col_upper_ = np.where(rng.random(n) < (0.4 if quadratic else 0.0), np.inf, at + rng.random(n))
    lp.row_lower_ = np.where(kind == 0, -np.inf, np.where(kind == 3, value, below))
    lp.row_upper_ = np.where(kind == 1, np.inf, np.where(kind == 3, value, above))
    columns = sp.csc_array(A)
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_, lp.a_matrix_.index_, lp.a_matrix_.value_ = columns.indptr, columns.indices, columns.data
    lp.col_names_, lp.row_names_ = [f"x_{j}" for j in range(n)], [f"row_{i}" for i in range(m)]
    if quadratic:
        lower = sp.csc_array(np.tril(sign * Q))
        hessian = model.hessian_
        hessian.dim_, hessian.format_ = n, highspy.HessianFormat.kTriangular
        hessian.start_, hessian.index_, hessian.value_ = lower.indptr, lower.indices, lower.data
    return model


def solver_with(model: Any = None) -> Any:
    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    if model is not None:
        assert solver.passModel(model) != highspy.HighsStatus.kError
    return solver


def objective(problem: Any, z: Any) -> float:
    """The objective of the file at z."""
    known = problem.info.properties
    value = problem.objective(z) + known.get("objective_offset", 0.0)
    return -value if known.get("objective_sense") == "max" else value


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(("seed", "suffix"), some_by_day([(s, e) for s in range(20) for e in (".mps", ".lp")], 6))
def test_files_of_highs_have_its_optimum(seed: int, suffix: str, tmp_path: Path) -> None:
    """HiGHS writes and solves; we read, solve by our own method and have its objective, which at its own point is the
    same number."""
    solver = solver_with(random_model(seed))
    path = tmp_path / f"model{suffix}"
    assert solver.writeModel(str(path)) != highspy.HighsStatus.kError
    again = solver_with()
    assert again.readModel(str(path)) == highspy.HighsStatus.kOk
    again.run()
    assert again.getModelStatus() == highspy.HighsModelStatus.kOptimal
    problem: Any = storage.load(path)
    assert list(problem.info.properties["unknowns"]) == [f"x_{j}" for j in range(problem.p.size)]
    theirs, z = again.getInfo().objective_function_value, np.array(again.getSolution().col_value)
    assert objective(problem, z) == pytest.approx(theirs, rel=1e-9, abs=1e-9)
    solved = cp.solve(problem, tolerance=1e-9)
    assert solved, (solved.status, solved.message)
    assert objective(problem, solved.point.z) == pytest.approx(theirs, rel=1e-6, abs=1e-6)


# ------------------------------------------------------------------------------------------ by hand

HEAD = """* comment
NAME          HAND
ROWS
 N  COST
 G  LOW
 L  UP
 E  EQ
COLUMNS
    X  COST  1.0  LOW  1.0
    X  UP  1.0
    Y  COST  -2.0D0  LOW  1.0
    Y  EQ  -1.0
    Z  UP  2.0  EQ  1.0
RHS
    RHS  COST  -3.0  LOW  1.0
    RHS  UP  8.0  EQ  0.5
"""
MPS = f"{HEAD}ENDATA\n"
Z = np.array([0.3, -0.7, 1.9])
HAND: dict[str, tuple[str, float]] = {
    "plain": ("", 0.3 + 1.4 + 3.0),
    "max": ("OBJSENSE\n    MAX\n", 4.7),
    "QUADOBJ": ("QUADOBJ\n    Y X 0.5\n    X X 2.0\n", 4.7 + 0.5 * (2 * 0.09 + 2 * 0.5 * -0.21)),
    "QUADOBJ, upper": ("QUADOBJ\n    X X 2.0\n    X Y 0.5\n", 4.7 + 0.5 * (2 * 0.09 + 2 * 0.5 * -0.21)),
    "QSECTION": ("QSECTION      COST\n    X Y 0.5\n", 4.7 - 0.5 * 0.21),
    "QMATRIX": ("QMATRIX\n    X Y 0.5\n    Y X 0.5\n    Z Z 3\n", 4.7 - 0.105 + 1.5 * 3.61),
}


@pytest.mark.parametrize("name", HAND)
def test_objectives_by_hand(name: str, tmp_path: Path) -> None:
    """cᵀz minus the right side of the objective, and ½zᵀQz, at a point."""
    sections, value = HAND[name]
    (tmp_path / "a.mps").write_text(f"{HEAD}{sections}ENDATA\n")
    problem: Any = storage.load(tmp_path / "a.mps")
    assert objective(problem, Z) == pytest.approx(value, rel=1e-15)
    assert (problem.name, list(problem.info.properties["unknowns"])) == ("HAND", ["X", "Y", "Z"])


@pytest.mark.parametrize(("width", "expected"), [(4.0, (0.5, 4.5)), (-4.0, (-3.5, 0.5))])
def test_ranges_and_bounds_by_hand(width: float, expected: tuple[float, float], tmp_path: Path) -> None:
    """R of G and L counts by its size, of E by its sign: [b, b + R] or [b + R, b]."""
    text = f"""{HEAD}RANGES
    RNG  LOW  {width}  UP  5.0
    RNG  EQ  {width}
BOUNDS
 UP BND  X  -1
 MI BND  X
 FX BND  Y  2.5
ENDATA
"""
    (tmp_path / "a.qps").write_text(text)
    problem: Any = storage.load(tmp_path / "a.qps")
    assert problem.C.shape == (0, 3)
    between = dict(zip(("LOW", "UP", "EQ"), ((1.0, 5.0), (3.0, 8.0), expected), strict=True))
    A = np.array([[1.0, 1, 0], [1, 0, 2], [0, -1, 1]])
    assert np.array_equal(matrices.dense(problem.A), np.vstack([A, -A]))
    assert problem.b.tolist() == [b for b, _ in between.values()] + [-u for _, u in between.values()]
    assert (problem.lb.tolist(), problem.ub.tolist()) == ([-np.inf, 2.5, 0.0], [-1.0, 2.5, np.inf])


LP = (
    "min\n obj: 2 x - y + [ x^2 + 2 x * y + 3 y^2 ] / 2 + 7\nst\n c: x + y >= 1\n d: x - y <= 3\nbounds\n x free\nend\n"
)
REFUSED = {
    "no number": (".mps", "RHS\n", "    X  EQ\nRHS\n", "No coefficient given"),
    "infinite": (".mps", "Z  UP  2.0", "Z  UP  1e999", "inf"),
    "column apart": (".mps", "RHS\n", "    X  EQ  1\nRHS\n", "have the same name"),
    "unknown row": (".mps", "UP  8.0", "UPP  8.0", "not defined"),
    "side twice": (".mps", "UP  8.0  EQ  0.5", "UP  8.0  UP  0.5", "duplicate value"),
    "integers": (
        ".mps",
        "    X  COST",
        "    M  'MARKER'  'INTORG'\n    X  COST",
        "kind integer: no formulation has them",
    ),
    "semi-continuous": (".mps", "ENDATA", "BOUNDS\n SC B X 2\nENDATA", "semi-continuous: no formulation has them"),
    "bound twice": (".mps", "ENDATA", "BOUNDS\n UP B X 2\n FX B X 2\nENDATA", "duplicate lower bound"),
    "doubtful bound": (
        ".mps",
        "ENDATA",
        "BOUNDS\n UP B X -2\nENDATA",
        "X: has the bounds 0 and -2: an upper bound below 0 alone",
    ),
    "sets": (".mps", "ENDATA", "SOS\n S1 SOS A\nENDATA", "SOS not supported"),
    "quadratic constraint": (".mps", "ENDATA", "QCMATRIX LOW\n    X X 1\nENDATA", "Quadratic rows not supported"),
    "both triangles": (".mps", "ENDATA", "QUADOBJ\n    X Y 1\n    Y X 1\nENDATA", "both triangles: expected one"),
    "product twice": (".mps", "ENDATA", "QSECTION\n    X X 1\n    X X 1\nENDATA", "a product twice"),
    "no end": (".mps", "ENDATA\n", "", "Parser error"),
    "no program": (".mps", HEAD, "once upon a time\n", "has no unknowns"),
    "integer": (".lp", "end\n", "general\n x\nend\n", "x: is an unknown of the kind integer"),
    "sos": (".lp", "end\n", "sos\n s: S1:: x:1 y:2\nend\n", "SOS"),
    "product in a row": (".lp", "c: x + y", "c: [ x^2 ] + y", "quadratic"),
    "constant": (".lp", "c: x + y", "c: x + y + 3", "ignored"),
    "tiny": (".lp", "c: x + y", "c: 1e-13 x + y", "ignored"),
    "no program, LP": (".lp", LP, "once upon a time\n", "expected a section keyword"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_files_are_refused_in_the_words_of_highs(name: str, tmp_path: Path, capfd: Any) -> None:
    suffix, old, new, expected = REFUSED[name]
    path = tmp_path / f"a{suffix}"
    path.write_text((MPS if suffix == ".mps" else LP).replace(old, new, 1))
    with pytest.raises(FormatError, match=expected) as refusal:
        storage.load(path)
    assert "\n" not in str(refusal.value)
    assert capfd.readouterr().out == ""


def test_free_rows_are_left_out(tmp_path: Path) -> None:
    free = MPS.replace(" E  EQ", " N  OTHER\n E  EQ").replace("X  UP  1.0", "X  OTHER  1.0\n    X  UP  1.0")
    (tmp_path / "a.mps").write_text(free)
    (tmp_path / "b.mps").write_text(MPS)
    assert storage.load(tmp_path / "a.mps").fingerprint == storage.load(tmp_path / "b.mps").fingerprint


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_names_are_those_of_the_file_in_both_encodings(encoding: str, tmp_path: Path) -> None:
    """à and Å have the bytes A0 and 85 in UTF-8, which in Latin-1 are a blank and the end of a line to Python."""
    names = ["là\xa0bas", "Åse", "théta"]
    text = HEAD
    for plain, name in zip("XYZ", names, strict=True):
        text = text.replace(f"    {plain}  ", f"    {name}  ")
    (tmp_path / "a.mps").write_text(f"{text}ENDATA\n", encoding=encoding)
    problem: Any = storage.load(tmp_path / "a.mps")
    assert list(problem.info.properties["unknowns"]) == names
    (tmp_path / "b.mps").write_text(MPS)
    plain: Any = storage.load(tmp_path / "b.mps")
    assert all(
        np.array_equal(matrices.dense(a), matrices.dense(b)) for a, b in ((problem.A, plain.A), (problem.C, plain.C))
    )
    program = f"min\n obj: 3 {names[2]} - 2 y\nst\n c: {names[2]} + y >= 1\nend\n"
    (tmp_path / "c.lp").write_text(program, encoding=encoding)
    assert list(storage.load(tmp_path / "c.lp").info.properties["unknowns"]) == [names[2], "y"]


def test_a_blank_that_does_not_break_splits_no_number(tmp_path: Path) -> None:
    """1 000 with a narrow blank is refused, and is no row of two numbers."""
    (tmp_path / "M.csv").write_text("1\xa0000;2\n3\xa0000;4\n", encoding="utf-8")
    with pytest.raises(FormatError, match="holds something that is not a number"):
        read_array(tmp_path / "M.csv")
