"""One quadratic program under the argument names of each package that cpbench wraps, with every part and with none; and
the answers that the packages themselves give, in their own names and signs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from command_line import cpbench

from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import QP
from cpbench.proofs import prove
from cpbench.verification import judge
from cpbench_problems.formats.file_rows import file_rows

Arrays = Mapping[str, Any]
rng = np.random.default_rng(20261130)
n = 5
root = rng.standard_normal((n, n))
P, q = root @ root.T + np.eye(n), 3.0 * rng.standard_normal(n)
G, A = rng.standard_normal((3, n)), rng.standard_normal((2, n))
start = rng.uniform(-0.2, 0.2, n)
h, b = G @ start + rng.uniform(0.0, 0.2, 3), A @ start
lb, ub = start - rng.uniform(0.0, 0.4, n), start + rng.uniform(0.0, 0.4, n)
EYE, none, inf = np.eye(n), np.full(3, -np.inf), np.inf
P = (P + P.T) / 2.0
WHOLE = QP(Q=P, p=q, A=-G, b=-h, C=A, d=b, lb=lb, ub=ub)
BARE = QP(Q=P, p=q, A=np.zeros((0, n)), b=np.zeros(0), C=np.zeros((0, n)), d=np.zeros(0), lb=np.full(n, -inf),
          ub=np.full(n, inf))  # fmt: skip
ROWS, SIDES = np.vstack([A, G, -EYE, EYE]), np.concatenate([b, h, -lb, ub])
ABOVE, LEAST = np.vstack([A, -G, EYE, -EYE]), np.concatenate([b, -h, lb, -ub])
CONES = np.array(["ZeroConeT(2)", "NonnegativeConeT(13)"])
NO_ROWS = np.zeros((0, n))
FORMS: Mapping[str, tuple[Arrays, Arrays]] = {
    "qpsolvers": ({"P": P, "q": q, "G": G, "h": h, "A": A, "b": b, "lb": lb, "ub": ub}, {"P": P, "q": q}),
    "OSQP": ({"P": np.triu(P), "q": q, "A": np.vstack([G, A, EYE]), "l": np.r_[none, b, lb], "u": np.r_[h, b, ub]},
             {"P": P, "q": q, "A": NO_ROWS, "l": np.zeros(0), "u": np.zeros(0)}),
    "quadprog": ({"H": P, "f": q, "A": G, "b": h, "Aeq": A, "beq": b, "lb": lb, "ub": ub}, {"H": P, "f": q}),
    "PIQP": ({"P": P, "c": q, "A": A, "b": b, "G": G, "h_u": h, "x_l": lb, "x_u": ub}, {"P": P, "c": q}),
    "PIQP-0.4": ({"P": P, "c": q, "A": A, "b": b, "G": G, "h": h, "x_lb": lb, "x_ub": ub}, {"P": P, "c": q}),
    "ProxQP": ({"H": P, "g": q, "A": A, "b": b, "C": G, "l": none, "u": h, "l_box": lb, "u_box": ub}, {"H": P, "g": q}),
    "qpOASES": ({"H": P, "g": q, "A": np.vstack([G, A]), "lbA": np.r_[none, b], "ubA": np.r_[h, b], "lb": lb, "ub": ub},
             {"H": P, "g": q}),
    "HPIPM": ({"H": P, "g": q, "A": A, "b": b, "C": G, "lg": np.full(3, -1e30), "ug": h, "idxb": np.arange(n),
              "lb": lb, "ub": ub},
              {"H": P, "g": q}),
    "DAQP": ({"H": P, "f": q, "A": np.vstack([EYE, G, A]), "blower": np.r_[lb, none, b], "bupper": np.r_[ub, h, b],
                  "sense": np.r_[np.zeros(8), 5, 5]},
             {"H": P, "f": q, "A": NO_ROWS, "blower": np.zeros(0), "bupper": np.zeros(0)}),
    "DAQP, bounds first": ({"H": P, "f": q, "A": np.vstack([G, A]), "blower": np.r_[lb, none, b],
              "bupper": np.r_[ub, h, b]},
                           {"H": P, "f": q, "A": NO_ROWS, "blower": np.full(n, -inf), "bupper": np.full(n, inf)}),
    "HiGHS": ({"Q": np.tril(P), "col_cost": q, "A": np.vstack([G, A]), "row_lower": np.r_[none, b],
              "row_upper": np.r_[h, b],
                   "col_lower": lb, "col_upper": ub}, {"Q": P, "col_cost": q, "col_lower": np.full(n, -inf)}),
    "quadprog-Python": ({"G": P, "a": -q, "C": ABOVE.T, "b": LEAST, "meq": np.array(2)}, {"G": P, "a": -q}),
    "quadprog-R": ({"Dmat": P, "dvec": -q, "Amat": ABOVE.T, "bvec": LEAST, "meq": np.array(2)},
             {"Dmat": P, "dvec": -q}),
    "CVXOPT": ({"P": P, "q": q, "G": np.vstack([G, -EYE, EYE]), "h": np.r_[h, -lb, ub], "A": A, "b": b,
                "dims.l": np.array(13), "dims.q": np.zeros(0), "dims.s": np.zeros(0)}, {"P": P, "q": q}),
    "SCS": ({"P": sp.csr_array(np.triu(P)), "c": q, "A": sp.csr_array(ROWS), "b": SIDES, "z": np.array(2),
              "l": np.array(13)},
            {"P": P, "c": q, "A": NO_ROWS, "b": np.zeros(0), "l": np.array(0)}),
    "Clarabel": ({"P": np.triu(P), "q": q, "A": ROWS, "b": SIDES, "cones": CONES},
                 {"P": P, "q": q, "A": NO_ROWS, "b": np.zeros(0), "cones": np.zeros(0, "U1")}),
}  # fmt: skip


def saved(path: Path, arrays: Arrays) -> Path:
    parts: dict[str, Any] = {}
    for name, value in arrays.items():
        if sp.issparse(value):
            parts |= {f"{name}.{k}": getattr(value, k) for k in ("data", "indices", "indptr", "shape")}
        else:
            parts[name] = value
    np.savez(path, **parts)
    return path


@pytest.mark.parametrize("form", FORMS)
def test_the_names_of_each_package_are_one_program(form: str, tmp_path: Path) -> None:
    """Of two forms with the same names the reading is the same, so that its name does not matter."""
    for arrays, wanted in zip(FORMS[form], (WHOLE, BARE), strict=True):
        problem: Any = storage.load(saved(tmp_path / "p.npz", arrays))
        assert problem.sizes() == {"n": n, "m": 3 if wanted is WHOLE else 0, "k": 2 if wanted is WHOLE else 0}
        x = rng.standard_normal(n)
        wide: Any = wanted
        assert np.allclose(problem.Q @ x + problem.p, wide.Q @ x + wide.p, rtol=1e-15, atol=1e-14)
        assert problem.fingerprint == wanted.fingerprint


def test_names_that_mean_two_programs_are_refused_with_both(tmp_path: Path) -> None:
    """qpth's A, b are equations, those of cpbench's own QP are inequalities; the option decides."""
    path = saved(tmp_path / "p.npz", {"Q": P, "p": q, "A": A, "b": b})
    with pytest.raises(
        FormatError, match=r"fit qp \(.* A x ≥ b.*\) and qpth \(.* A x = b\), which differ: say which by"
    ):
        storage.load(path)
    equations: Any = storage.load(path, format="qpth")
    inequalities: Any = storage.load(path, format="qp")
    assert (equations.sizes(), inequalities.sizes()) == ({"n": n, "m": 0, "k": 2}, {"n": n, "m": 2, "k": 0})
    system = saved(tmp_path / "s.npz", {"A": G, "b": h, "C": A, "d": b, "lb": lb})
    with pytest.raises(FormatError, match=r"least squares .* and lsqlin .*, which differ"):
        storage.load(system)
    x = rng.standard_normal(n)
    for form, (M, side) in {"least-squares": (G, h), "lsqlin": (A, b)}.items():
        problem: Any = storage.load(system, format=form)
        z = np.concatenate([x, M @ x - side])
        assert 0.5 * z @ problem.Q @ z + problem.p @ z == pytest.approx(0.5 * np.sum((M @ x - side) ** 2), rel=1e-12)
        assert np.array_equal(problem.lb[:n], lb)


CLAIMS: Mapping[str, tuple[str, Arrays]] = {
    "cones without sizes": ("Clarabel", {"cones": np.array(["ZeroConeT", "NonnegativeConeT"])}),
    "exponential cones": ("SCS", {"ep": np.array(1)}),
    "cones that are no rows": ("SCS", {"l": np.array(12)}),
    "binary": ("DAQP", {"sense": np.full(10, 16)}),
    "factorized": ("quadprog-Python", {"factorized": np.array(True)}),
    "more equations than rows": ("quadprog-R", {"meq": np.array(99)}),
    "bounds of other unknowns": ("HPIPM", {"idxb": np.arange(n) + 1}),
}


@pytest.mark.parametrize("case", CLAIMS)
def test_what_a_form_asks_for_and_no_formulation_has_is_refused(case: str, tmp_path: Path) -> None:
    form, more = CLAIMS[case]
    with pytest.raises(FormatError, match=rf"{next(iter(more))}: "):
        storage.load(saved(tmp_path / "p.npz", {**FORMS[form][0], **more}))


def _piqp() -> Arrays:
    piqp = pytest.importorskip("piqp")
    solver = piqp.DenseSolver()
    solver.setup(**FORMS["PIQP"][0])
    solver.solve()
    return {name: getattr(solver.result, name) for name in ("x", "y", "z_l", "z_u", "z_bl", "z_bu")}


def _clarabel() -> Arrays:
    clarabel = pytest.importorskip("clarabel")
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.ZeroConeT(2), clarabel.NonnegativeConeT(13)]
    given = sp.csc_matrix(np.triu(P)), q, sp.csc_matrix(ROWS), SIDES, cones, settings
    solution = clarabel.DefaultSolver(*given).solve()
    return {"x": solution.x, "z": solution.z}


def _osqp() -> Arrays:
    osqp = pytest.importorskip("osqp")
    given, solver = FORMS["OSQP"][0], osqp.OSQP()
    sparse = {name: sp.csc_matrix(given[name]) for name in ("P", "A")}
    solver.setup(**{**given, **sparse}, verbose=False, eps_abs=1e-9, eps_rel=1e-9, max_iter=100000)
    solution = solver.solve(raise_error=True)
    return {"x": solution.x, "y": solution.y}


def _scs() -> Arrays:
    scs = pytest.importorskip("scs")
    data = {"P": sp.csc_matrix(np.triu(P)), "A": sp.csc_matrix(ROWS), "b": SIDES, "c": q}
    solution = scs.solve(data, {"z": 2, "l": 13}, verbose=False, eps_abs=1e-9, eps_rel=1e-9)
    return {"x": solution["x"], "y": solution["y"]}


def _proxqp() -> Arrays:
    proxsuite = pytest.importorskip("proxsuite")
    solver = proxsuite.proxqp.dense.QP(n, 2, 3, True)
    solver.settings.eps_abs = 1e-9
    solver.init(P, q, A, b, G, np.full(3, -1e20), h, lb, ub)
    solver.solve()
    result = solver.results
    return {"x": result.x, "y": result.y, "z": result.z[:3], "z_box": result.z[3:]}


def _daqp() -> Arrays:
    daqp = pytest.importorskip("daqp")
    given = FORMS["DAQP, bounds first"][0]
    sense = np.r_[np.zeros(8), 5, 5].astype(np.int32)
    x, _, _, info = daqp.solve(given["H"], given["f"], given["A"], given["bupper"], given["blower"], sense)
    return {"x": x, "lam": info["lam"]}


def _highs() -> Arrays:
    highspy = pytest.importorskip("highspy")
    model, lower = highspy.HighsModel(), sp.csc_matrix(np.tril(P))
    lp, rows, given = model.lp_, sp.csc_matrix(np.vstack([G, A])), FORMS["HiGHS"][0]
    lp.num_col_, lp.num_row_ = n, 5
    for name in ("col_cost", "col_lower", "col_upper", "row_lower", "row_upper"):
        setattr(lp, f"{name}_", given[name])
    lp.a_matrix_.start_, lp.a_matrix_.index_, lp.a_matrix_.value_ = rows.indptr, rows.indices, rows.data
    model.hessian_.dim_ = n
    model.hessian_.start_, model.hessian_.index_, model.hessian_.value_ = lower.indptr, lower.indices, lower.data
    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.passModel(model)
    solver.run()
    solution = solver.getSolution()
    return {name: np.array(getattr(solution, name)) for name in ("col_value", "col_dual", "row_dual")}


def _cvxopt() -> Arrays:
    cvxopt = pytest.importorskip("cvxopt")
    given = FORMS["CVXOPT"][0]
    matrices = [cvxopt.matrix(given[name]) for name in ("P", "q", "G", "h", "A", "b")]
    solution = cvxopt.solvers.qp(
        *matrices, options={"show_progress": False, "abstol": 1e-10, "reltol": 1e-10, "feastol": 1e-10}
    )
    return {name: np.array(solution[name]).ravel() for name in "xyz"}


def _qpsolvers() -> Arrays:
    qpsolvers = pytest.importorskip("qpsolvers")
    solution = qpsolvers.solve_problem(qpsolvers.Problem(**FORMS["qpsolvers"][0]), solver="piqp")
    return {name: getattr(solution, name) for name in ("x", "y", "z", "z_box")}


ANSWERS = {"PIQP": _piqp, "Clarabel": _clarabel, "OSQP": _osqp, "SCS": _scs, "ProxQP": _proxqp, "HiGHS": _highs,
           "DAQP, bounds first": _daqp, "CVXOPT": _cvxopt, "qpsolvers": _qpsolvers}  # fmt: skip


@pytest.mark.parametrize("form", ANSWERS)
def test_the_answer_of_a_package_is_read_in_its_names_and_signs(form: str, tmp_path: Path) -> None:
    """Multipliers of the other sign would be off by more than 1; what is shown again is what was given."""
    problem: Any = storage.load(saved(tmp_path / "p.npz", FORMS[form][0]))
    answer = {name: np.asarray(array, dtype=float) for name, array in ANSWERS[form]().items()}
    point: Any = storage.load_answer(saved(tmp_path / "a.npz", answer), problem, primal=True)
    assert judge(problem, point, 1e-6).error <= 1e-6
    assert min(np.abs(point.mu).max(), np.abs(point.nu).max(), point.lam.max()) > 0.1
    again = file_rows(problem).shown(point)  # pyright: ignore[reportOptionalMemberAccess]
    assert all(np.allclose(again[name], answer[name], atol=1e-5) for name in answer)


def test_multipliers_of_cones_have_the_rows_of_the_file(tmp_path: Path) -> None:
    """A cone of second order before other rows, and a row without a side: planted x, s and z with sᵀz = 0."""
    cones = np.array(["SecondOrderConeT(3)", "NonnegativeConeT(3)", "ZeroConeT(1)"])
    s, z = np.array([1.0, 0.6, 0.8, 0.0, 2.0, np.inf, 0.0]), np.array([1.0, -0.6, -0.8, 3.0, 0.0, 0.0, -2.0])
    M, x = rng.integers(-3, 4, (7, n)) + 0.5, rng.integers(-3, 4, n) + 0.0
    arrays = {"P": np.triu(P), "q": -(P @ x + M.T @ z), "A": M, "b": M @ x + s, "cones": cones}
    problem: Any = storage.load(saved(tmp_path / "p.npz", arrays))
    point: Any = storage.load_answer(saved(tmp_path / "a.npz", {"x": x, "z": z}), problem, primal=True)
    assert (problem.node, problem.b.size) == ("coneqp", 6)
    assert judge(problem, point, 1e-6).error <= 1e-14
    rows: Any = file_rows(problem)
    assert np.array_equal(rows.shown(point)["z"], z)
    assert judge(problem, rows.point(problem, {"x": x, "z": z[::-1]}), 1e-6).error > 0.01


def test_an_answer_with_other_arrays_is_refused_by_name(tmp_path: Path) -> None:
    problem: Any = storage.load(saved(tmp_path / "p.npz", FORMS["qpsolvers"][0]))
    for more, cause in (
        ({"s": h}, "s: expected"),
        ({"z": h[:2]}, "z has 2 numbers, expected 3"),
        ({"z": h}, "y is missing"),
    ):
        with pytest.raises(FormatError, match=cause):
            storage.load_answer(saved(tmp_path / "a.npz", {"x": start, **more}), problem, primal=True)
    native: Any = WHOLE
    with pytest.raises(FormatError, match="x: is no part of an answer to qp: z, lam, mu, nu"):
        storage.load_answer(saved(tmp_path / "a.npz", {"x": start, "z": h}), native, primal=True)


@pytest.mark.parametrize("make", [sp.csc_matrix, sp.csr_matrix, sp.csc_array, sp.csr_array])
def test_problems_that_qpsolvers_has_saved_are_read(make: Any, tmp_path: Path) -> None:
    """It keeps a sparse matrix as a pickled object and an absent part as None; nothing is unpickled."""
    qpsolvers = pytest.importorskip("qpsolvers")
    given = {**FORMS["qpsolvers"][0], "P": make(P), "G": make(G), "A": None, "b": None}
    qpsolvers.Problem(**given).save(str(tmp_path / "p.npz"))
    problem: Any = storage.load(tmp_path / "p.npz")
    assert problem.fingerprint == QP(Q=P, p=q, A=-G, b=-h, C=np.zeros((0, n)), d=np.zeros(0), lb=lb, ub=ub).fingerprint
    np.savez(tmp_path / "q.npz", P=np.array(Path("code"), dtype=object), q=q)
    with pytest.raises(FormatError, match="P: holds Python objects"):
        storage.load(tmp_path / "q.npz")


def test_a_hessian_that_is_not_symmetric_is_named_with_its_meanings(tmp_path: Path) -> None:
    path = saved(tmp_path / "p.npz", {"P": P + np.triu(EYE[::-1]), "q": q})
    with pytest.raises(
        FormatError, match=r"P: is not symmetric: .* cpbench pack p.npz --symmetric part \(or upper, or lower\)"
    ):
        storage.load(path)
    for how, wanted in (("part", P + (np.triu(EYE[::-1]) + np.triu(EYE[::-1]).T) / 2), ("lower", None)):
        assert cpbench(tmp_path, "pack", path, "--symmetric", how, "-o", f"{how}.h5").returncode == 0
        problem: Any = storage.load(tmp_path / f"{how}.h5")
        lower = np.tril(P + np.triu(EYE[::-1]))
        assert np.allclose(problem.Q, lower + np.tril(lower, -1).T if wanted is None else wanted, rtol=1e-15)


@pytest.mark.parametrize("suffix", ["gms", "nl", "mof.json"])
def test_crossed_bounds_of_a_model_are_a_problem_without_a_solution(suffix: str, tmp_path: Path) -> None:
    """A program with affine rows has a proof; of another one the bounds are named."""
    path = tmp_path / f"p.{suffix}"
    text = "Variables z, a; Equations e;\ne.. z - a*a =E= 0;\na.lo = 4; a.up = 3;\nModel m / all /;\n"
    if suffix == "gms":
        path.write_text(f"{text}Solve m using NLP minimizing z;\n")
    else:
        storage.save(QP(Q=EYE, p=q, lb=np.full(n, 2.25), ub=np.full(n, 3.0)), path)
        path.write_text(path.read_text().replace("2.25", "3.5"))
    assert prove(storage.load(path), "infeasible", seconds=5.0).proof is not None
    if suffix == "gms":
        path.write_text(f"{text.replace('a*a', 'exp(a)')}Solve m using NLP minimizing z;\n")
        with pytest.raises(FormatError, match="a: has the bounds 4 and 3: no number is between, there is no solution"):
            storage.load(path)


def test_crossed_bounds_are_a_problem_without_a_solution(tmp_path: Path) -> None:
    """z ≥ 1e-4 and z ≤ 0: the file is right, and the two add up to 0 ≥ 1e-4."""
    for arrays in (
        {"P": np.eye(2), "q": np.ones(2), "lb": np.array([1e-4, 0.0]), "ub": np.zeros(2)},
        {"Q": np.eye(2), "p": np.ones(2), "lb": np.array([1e-4, 0.0]), "ub": np.zeros(2)},
        {"P": np.eye(2), "q": np.ones(2), "A": np.eye(2), "l": np.array([1e-4, 0.0]), "u": np.zeros(2)},
    ):
        problem: Any = storage.load(saved(tmp_path / "p.npz", arrays))
        assert problem.sizes()["m"] == 1
        assert prove(problem, "infeasible").proof is not None


def test_named_arrays_of_json_are_read(tmp_path: Path) -> None:
    path = tmp_path / "p.json"
    path.write_text(
        json.dumps({name: array.tolist() for name, array in FORMS["qpsolvers"][0].items()} | {"initvals": None})
    )
    assert storage.load(path).fingerprint == WHOLE.fingerprint
    for text, cause in (
        ("[1]", "expected an object of named arrays"),
        ('{"P": ["x"]}', "P: is no number"),
        ("{", "JSON"),
    ):
        path.write_text(text)
        with pytest.raises(FormatError, match=cause):
            storage.load(path)


def test_a_vector_is_one_row_and_a_number_is_one_by_one(tmp_path: Path) -> None:
    one = {"P": P, "q": q, "G": G[0], "h": np.array(h[0]), "A": A[0], "b": b[:1]}
    wanted = QP(Q=P, p=q, A=-G[:1], b=-h[:1], C=A[:1], d=b[:1])
    assert storage.load(saved(tmp_path / "p.npz", one)).fingerprint == wanted.fingerprint
    column = {"G": P, "a": -q, "C": A[0], "b": np.array(b[0]), "meq": np.array(1)}
    assert storage.load(saved(tmp_path / "c.npz", column)).fingerprint == QP(Q=P, p=q, C=A[:1], d=b[:1]).fingerprint
    scalar = {"P": np.array(2.0), "q": np.array(1.0), "lb": np.array(0.0)}
    assert storage.load(saved(tmp_path / "s.npz", scalar)).fingerprint == QP(Q=[[2.0]], p=[1.0], lb=[0.0]).fingerprint


def test_linear_programs_of_scipy_and_matlab_have_their_own_bounds(tmp_path: Path) -> None:
    """Without bounds x ≥ 0 in SciPy, any x in MATLAB; a pair of bounds is that of all unknowns."""
    for arrays, lower in (
        ({"c": q, "A_ub": G, "b_ub": h}, 0.0),
        ({"c": q, "A_ub": G, "b_ub": h, "bounds": np.array([-2.0, np.inf])}, -2.0),
        ({"f": q, "A": G, "b": h}, -inf),
    ):
        problem: Any = storage.load(saved(tmp_path / "p.npz", arrays))
        assert problem.fingerprint == QP(Q=np.zeros((n, n)), p=q, A=-G, b=-h, lb=np.full(n, lower)).fingerprint
        assert ("x ≥ 0" in problem.info.properties["form"]) == (lower == 0.0)
