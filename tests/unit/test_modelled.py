"""Games, least squares, and programs of qpsolvers and CVXPY as problems of cpbench, and the way back."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from command_line import cpbench as command
from scipy.optimize import lsq_linear

import cpbench
from cpbench.errors import CpbenchError, FormatError, PointError, ProblemError

THREE = [[3, 3], [2, 5], [0, 6]], [[3, 2], [2, 6], [3, 1]]
"""The game of B. von Stengel, Equilibrium computation for two-player games (Algorithmic Game Theory, 2007, ch. 3)."""
THREE_EQUILIBRIA = {
    ("1", "0", "0", "1", "0"),
    ("4/5", "1/5", "0", "2/3", "1/3"),
    ("0", "1/3", "2/3", "1/3", "2/3"),
}


def solved_exactly(rows: list[list[Fraction]]) -> list[Fraction] | None:
    """Return the one solution of a square system [M | b] over the rationals, None where there is no single one."""
    n = len(rows)
    rows = [row[:] for row in rows]
    for k in range(n):
        pivot = next((i for i in range(k, n) if rows[i][k]), None)
        if pivot is None:
            return None
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [value / rows[k][k] for value in rows[k]]
        for i in range(n):
            if i != k and rows[i][k]:
                rows[i] = [a - rows[i][k] * b for a, b in zip(rows[i], rows[k], strict=True)]
    return [row[n] for row in rows]


def vertices(payoff: list[list[Fraction]]) -> Iterator[tuple[list[Fraction], Fraction]]:
    """Yield the vertices (y, v) of {y ≥ 0, Σy = 1, payoff y ≤ v}, the best-response polyhedron of the other player."""
    m, n = len(payoff), len(payoff[0])
    one, none = Fraction(1), Fraction(0)
    limits = [[*row, -one, none] for row in payoff]
    limits += [[one if i == j else none for j in range(n)] + [none, none] for i in range(n)]
    seen = set()
    for active in itertools.combinations(range(m + n), n):
        found = solved_exactly([[one] * n + [none, one], *(limits[i] for i in active)])
        if found is None or tuple(found) in seen or any(y < 0 for y in found[:n]):
            continue
        if all(sum(a * y for a, y in zip(row, found[:n], strict=True)) <= found[n] for row in payoff):
            seen.add(tuple(found))
            yield found[:n], found[n]


def extreme_equilibria(A: Any, B: Any) -> set[tuple[str, ...]]:
    """Return the extreme equilibria of a game by comparing all pairs of vertices (Mangasarian 1964), over the
    rationals."""
    A, B = ([[Fraction(value) for value in row] for row in np.asarray(given).tolist()] for given in (A, B))
    columns = [list(column) for column in zip(*B, strict=True)]
    found = set()
    for (x, w), (y, v) in itertools.product(vertices(columns), vertices(A)):
        gains = [v - sum(a * b for a, b in zip(row, y, strict=True)) for row in A]
        losses = [w - sum(a * b for a, b in zip(column, x, strict=True)) for column in columns]
        if not any(a * b for a, b in zip(x, gains, strict=True)) and not any(
            a * b for a, b in zip(y, losses, strict=True)
        ):
            found.add(tuple(map(str, [*x, *y])))
    return found


def as_fractions(game: cpbench.Modelled, points: Any) -> set[tuple[str, ...]]:
    lifted = (np.concatenate(game.lift(point)) for point in points)
    return {tuple(str(Fraction(value).limit_denominator(10**6)) for value in vector.tolist()) for vector in lifted}


@pytest.mark.needs("cpbench_solvers", "cpbench_lab")
def test_all_three_equilibria_of_a_published_game() -> None:
    pytest.importorskip("flint", reason="all solutions need python-flint")
    game = cpbench.from_game(*THREE)
    assert as_fractions(game, cpbench.every_solution(game.problem).points) == THREE_EQUILIBRIA
    assert extreme_equilibria(*THREE) == THREE_EQUILIBRIA


@pytest.mark.needs("cpbench_solvers", "cpbench_lab")
@pytest.mark.parametrize(("case", "rows", "count"), [("c09a", 3, 3), ("c09b", 3, 8)])
def test_all_equilibria_of_the_games_that_people_asked_about(shared_data: Path, case, rows, count) -> None:
    """Two games of public reports (Nashpy 64 and 82), whose LCPs hold costs; the second is degenerate."""
    pytest.importorskip("flint", reason="all solutions need python-flint")
    file = shared_data.parent / "reviews" / "cases" / "opt" / f"{case}-M.csv"
    if not file.exists():
        pytest.skip(f"needs the folder of real files: {file.name}")
    M = np.loadtxt(file, delimiter=",")
    A, B = -M[:rows, rows:], -M[rows:, :rows].T
    game = cpbench.from_game(A, B)
    found = cpbench.every_solution(game.problem)
    assert len(found.points) == count
    assert as_fractions(game, found.points) == extreme_equilibria(A, B)


@pytest.mark.parametrize(
    ("A", "B", "cause"),
    [
        ([[1.0, 2.0]], [[1.0], [2.0]], "game.B: is 2 x 1, expected 1 x 2 as A is"),
        (np.zeros((0, 2)), np.zeros((0, 2)), "game.A: is 0 x 2, expected a choice for each player"),
        ([[np.inf]], [[1.0]], "game.A: has 1 non-finite"),
    ],
)
def test_what_is_no_game_is_refused(A, B, cause) -> None:
    with pytest.raises(ProblemError, match=cause):
        cpbench.from_game(A, B)


@pytest.mark.parametrize("z", [np.zeros(5), [-1.0, -1.0, -1.0, 1.0, 0.0], [np.inf, 0, 0, 1, 1]])
def test_what_has_no_probabilities_is_no_equilibrium(z) -> None:
    with pytest.raises(PointError, match="x are no probabilities"):
        cpbench.from_game(*THREE).lift(z)


@pytest.mark.needs("cpbench_solvers")
def test_a_game_is_packed_and_its_equilibria_are_written(tmp_path: Path) -> None:
    pytest.importorskip("flint", reason="all solutions need python-flint")
    for name, payoff in zip("AB", THREE, strict=True):
        np.savetxt(tmp_path / f"{name}.csv", payoff, delimiter=",")
    assert command(tmp_path, "pack", "A.csv", "B.csv", "-o", "game.h5", "--as", "game").returncode == 0
    shown = command(tmp_path, "solve", "game.h5", "--all", "-o", "equilibria.csv").stdout
    assert "x = (0.8, 0.2, 0); y = (0.666666667, 0.333333333)" in shown
    rows = np.loadtxt(tmp_path / "equilibria.csv", delimiter=",")
    assert {tuple(str(Fraction(v).limit_denominator(100)) for v in row) for row in rows} == THREE_EQUILIBRIA
    assert "y[1]" in command(tmp_path, "solve", "game.h5").stdout


# ------------------------------------------------------------------------------------------- least squares


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("shape", [(9, 4), (4, 4), (3, 6)])
def test_least_squares_as_scipy_solves_them(shape, sparse) -> None:
    rng = np.random.default_rng(sum(shape))
    A, b = rng.standard_normal(shape), rng.standard_normal(shape[0])
    lb, ub = np.full(shape[1], -0.3), np.full(shape[1], 0.2)
    model = cpbench.from_least_squares(sp.csc_array(A) if sparse else A, b, lb, ub)
    solution = cpbench.solve(model.problem, tolerance=1e-10)
    x = model.lift(solution)
    expected = lsq_linear(A, b, (lb, ub), method="bvls", tol=1e-14)
    assert solution
    assert 0.5 * np.sum((A @ x - b) ** 2) == pytest.approx(expected.cost, rel=1e-8)
    assert (x >= lb - 1e-9).all()
    assert (x <= ub + 1e-9).all()


@pytest.mark.needs("cpbench_solvers")
def test_least_squares_do_not_square_the_condition_number() -> None:
    """A planted x comes back where A has the condition number 1e7; by AᵀA no digit of it does.

    b is off the columns of A by 1e-6, so that the prices, and with them the gradient, are no rounding.
    """
    rng = np.random.default_rng(0)
    U, V = (np.linalg.qr(rng.standard_normal(shape))[0] for shape in ((30, 8), (8, 8)))
    A, x, off = U @ np.diag(np.logspace(0, -7, 8)) @ V, rng.standard_normal(8), rng.standard_normal(30)
    b = A @ x + 1e-6 * (off - U @ (U.T @ off))
    model = cpbench.from_least_squares(A, b)
    normal = cpbench.QP.build(Q=A.T @ A, p=-A.T @ b)
    assert model.lift(cpbench.solve(model.problem, tolerance=1e-9)) == pytest.approx(x, abs=1e-3)
    assert abs(cpbench.solve(normal, tolerance=1e-9).point.z - x).max() > 0.1


@pytest.mark.parametrize(
    ("given", "cause"),
    [
        ({"A": [[1.0, 2.0]], "b": [1.0, 2.0]}, "least_squares.b: has 2 numbers, expected 1, the rows of A"),
        ({"A": [[1.0, 2.0]], "b": [1.0], "lb": [0.0]}, "least_squares.lb: has 1 numbers, expected 2, the columns of A"),
        ({"A": [[np.nan]], "b": [1.0]}, "least_squares.A: has 1 non-finite"),
        ({"A": [[1.0]], "b": [1.0], "lb": 2.0, "ub": 1.0}, "lb"),
    ],
)
def test_least_squares_that_do_not_fit_are_refused(given, cause) -> None:
    with pytest.raises(ProblemError, match=cause):
        cpbench.from_least_squares(**given)


# ------------------------------------------------------------------------------------------- qpsolvers


def planted(rng: np.random.Generator) -> dict[str, Any]:
    """A strictly convex QP in the form of qpsolvers."""
    H = rng.standard_normal((5, 5))
    G, A = rng.standard_normal((4, 5)), rng.standard_normal((1, 5))
    inside = rng.standard_normal(5)
    bounds = {"lb": inside - 0.1, "ub": np.full(5, np.inf)}
    return {"P": H @ H.T, "q": rng.standard_normal(5), "G": G, "h": G @ inside + 0.1, "A": A, "b": A @ inside, **bounds}


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("sparse", [False, True])
def test_a_problem_of_qpsolvers(sparse: bool) -> None:
    qpsolvers = pytest.importorskip("qpsolvers", reason="needs qpsolvers: pip install qpsolvers")
    given = planted(np.random.default_rng(1))
    if sparse:
        given |= {name: sp.csc_matrix(given[name]) for name in "PGA"}
    given["h"][1] = np.inf  # no row
    problem = qpsolvers.Problem(**given)
    model = cpbench.from_qpsolvers(problem, name="mine")
    x = model.lift(cpbench.solve(model.problem, tolerance=1e-10))
    expected = qpsolvers.solve_problem(problem, solver="quadprog" if not sparse else "clarabel").x
    assert x == pytest.approx(expected, abs=1e-6)
    assert model.problem.name == "mine"
    assert model.problem.sizes()["m"] == 3


def test_what_is_no_whole_problem_of_qpsolvers_is_refused() -> None:
    qpsolvers = pytest.importorskip("qpsolvers", reason="needs qpsolvers: pip install qpsolvers")
    with pytest.raises(FormatError, match="P: is not symmetric: the lower triangle is empty"):
        cpbench.from_qpsolvers(qpsolvers.Problem(np.array([[1.0, 1.0], [0.0, 2.0]]), np.zeros(2)))
    with pytest.raises(FormatError, match="h: is missing beside G"):
        cpbench.from_qpsolvers(qpsolvers.Problem(np.eye(2), np.zeros(2), G=np.eye(2)))
    with pytest.raises(ProblemError, match="is a list, expected"):
        cpbench.from_qpsolvers([1.0])


# ------------------------------------------------------------------------------------------- CVXPY


def programs() -> dict[str, Any]:
    """Programs of several kinds, none with a solution that is 0."""
    cvxpy = pytest.importorskip("cvxpy", reason="needs CVXPY: pip install cvxpy")
    rng = np.random.default_rng(4)
    F, g = rng.standard_normal((6, 3)), rng.standard_normal(6)
    x, y, X = cvxpy.Variable(3, name="x"), cvxpy.Variable(name="y"), cvxpy.Variable((2, 2), symmetric=True)
    p = cvxpy.Parameter(nonneg=True, value=2.0)
    quadratic = cvxpy.sum_squares(F @ x - g)
    return {
        "qp": cvxpy.Problem(cvxpy.Minimize(quadratic + y + 7), [x >= 0, cvxpy.sum(x) == 1, y >= x[0] - 1]),
        "maximum": cvxpy.Problem(cvxpy.Maximize(3 - quadratic), [cvxpy.abs(x) <= 0.1]),
        "lp": cvxpy.Problem(cvxpy.Minimize(cvxpy.norm1(F @ x - g)), [x <= 1]),
        "parameter": cvxpy.Problem(cvxpy.Minimize(p * quadratic), [x[0] + x[1] == p]),
        "soc": cvxpy.Problem(cvxpy.Minimize(y), [cvxpy.norm(F @ x - g) <= y, x >= 0]),
        "qp and soc": cvxpy.Problem(cvxpy.Minimize(quadratic), [cvxpy.norm(x) <= 0.3, cvxpy.sum(x) == 0.2]),
        "symmetric": cvxpy.Problem(
            cvxpy.Minimize(cvxpy.sum_squares(X - np.array([[1.0, 2.0], [3.0, 4.0]]))), [X[0, 1] <= 2]
        ),
        "portfolio": cvxpy.Problem(cvxpy.Maximize(g[:3] @ x - cvxpy.quad_form(x, F.T @ F)), [cvxpy.sum(x) == 1]),
    }


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("kind", "node"),
    [("qp", "qp"), ("maximum", "qp"), ("lp", "qp"), ("parameter", "qp"), ("soc", "coneqp"), ("qp and soc", "coneqp"),
     ("symmetric", "qp"), ("portfolio", "qp")],
)  # fmt: skip
def test_programs_of_cvxpy_have_its_optimum(kind: str, node: str) -> None:
    from cpbench.api.solution import objective_of

    program = programs()[kind]
    model = cpbench.from_cvxpy(program)
    assert model.problem.node == node
    solution = cpbench.solve(model.problem, tolerance=1e-9)
    values = model.lift(solution)
    assert all(variable.value is None for variable in program.variables())
    assert objective_of(model.problem, solution.point) == pytest.approx(
        program.solve(solver="CLARABEL"), rel=1e-6, abs=1e-7
    )
    for variable in program.variables():
        assert values[variable] == pytest.approx(variable.value, abs=2e-4)
        variable.value = values[variable]
    assert program.objective.value == pytest.approx(objective_of(model.problem, solution.point), rel=1e-6, abs=1e-7)


def test_programs_that_no_formulation_has_are_refused_by_name() -> None:
    cvxpy = pytest.importorskip("cvxpy", reason="needs CVXPY: pip install cvxpy")
    x, whole, S = cvxpy.Variable(2), cvxpy.Variable(integer=True, name="crates"), cvxpy.Variable((2, 2), PSD=True)
    unset = cvxpy.Parameter()
    refused = {
        "integers \\(crates\\)": cvxpy.Problem(cvxpy.Minimize(whole), [whole >= 0.5]),
        "exponential cones": cvxpy.Problem(cvxpy.Minimize(cvxpy.sum(cvxpy.exp(x)))),
        "semidefinite cones": cvxpy.Problem(cvxpy.Minimize(cvxpy.trace(S)), [S[0, 1] == 1]),
        "power cones": cvxpy.Problem(
            cvxpy.Maximize(x[0]), [cvxpy.PowCone3D(x[0], x[1], cvxpy.Constant(1.0), 0.3), x[1] <= 1]
        ),
        "DCP": cvxpy.Problem(cvxpy.Minimize(-cvxpy.sum_squares(x))),
        "(?i)parameter": cvxpy.Problem(cvxpy.Minimize(unset * x[0])),
    }
    for cause, program in refused.items():
        with pytest.raises(CpbenchError, match=cause) as caught:
            cpbench.from_cvxpy(program)
        assert "\n" not in str(caught.value)
    with pytest.raises(ProblemError, match="is a Variable, expected"):
        cpbench.from_cvxpy(x)


@pytest.mark.parametrize(
    ("rows", "note"),
    [
        (("p + 2*q - 1", "sqr(p) - q", "p*q - 0.5", "x + s - p"),
         "structurally singular: 3 equations (beside p, q, s) with 2 variables between them (p, q)"),
        (("p + x", "q + exp(x)", "x - 1", "x + p + q"),
         "structurally singular: 1 free variable (s) with 0 functions between them"),
        (("p + 2*q - 1 + s", "sqr(p) - q", "p*q - 0.5 + x", "x + s - p"), ""),
        (("p + s - 1", "q + x", "s - p", "2*x + p"), ""),
    ],
)  # fmt: skip
def test_equations_that_no_variables_match_are_named(rows: tuple[str, ...], note: str, tmp_path: Path) -> None:
    """Drawn by hand: which equations have too few variables between them is seen at once."""
    lines = [f"e{k}.. {row} ={'g' if k == 4 else 'e'}= 0;" for k, row in enumerate(rows, 1)]
    head = "Variables p, q, s; Positive Variables x; Equations e1, e2, e3, e4;\n"
    text = head + "\n".join(lines) + "\nModel m / e1.p, e2.q, e3.s, e4.x /; Solve m using mcp;\n"
    (tmp_path / "m.gms").write_text(text)
    problem = cpbench.load(tmp_path / "m.gms")
    assert problem.info.properties.get("note", "").startswith(note)
    assert bool(problem.info.properties.get("note")) == bool(note)
