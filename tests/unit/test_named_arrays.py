"""Every reader of named arrays, in every form: one array too many and one too few are refused by name."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from damage import read_or_refused
from tiers import some_by_day

from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import ConeQP
from cpbench.foundation.cones import Cone

Arrays = dict[str, Any]
rng = np.random.default_rng(20261127)
N, M, K = 4, 3, 2
P = np.diag([4.0, 5.0, 6.0, 7.0]) + 0.5
G, h, A, b = rng.standard_normal((M, N)), rng.random(M) + 1, rng.standard_normal((K, N)), rng.standard_normal(K)
q, lb, ub = rng.standard_normal(N), -rng.random(N) - 9, rng.random(N) + 9
CSR = sp.csr_array(P)
W = np.eye(6) + 0.1
BOXED_LO, BOXED_HI = np.array([0.0, -0.5, -0.5] * 2), np.array([np.inf, 0.5, 0.5] * 2)
FORMS: dict[str, Arrays] = {
    "qpsolvers": {"P": P, "q": q, "G": G, "h": h, "A": A, "b": b, "lb": lb, "ub": ub},
    "OSQP": {"P": P, "q": q, "A": G, "l": -h, "u": h, "r": np.array([3.0])},
    "quadprog": {"H": P, "f": q, "A": G, "b": h, "Aeq": A, "beq": b, "lb": lb, "ub": ub},
    "CVXOPT": {"P": P, "q": q, "G": G, "h": h, "A": A, "b": b, "dims.l": np.array([1.0]), "dims.q": np.array([2.0])},
    "box QP": {"data": CSR.data, "indices": CSR.indices, "indptr": CSR.indptr, "shape": np.array([N, N]), "q": q,
               "l": lb, "u": ub},
    "ContactBench": {"G": W, "g": -np.ones(6), "mus": np.array([0.3, 0.5])},
    "boxed LCP": {"A": W, "b": np.ones(6), "lo": BOXED_LO, "hi": BOXED_HI, "findex": np.array([-1, 0, 0, -1, 3, 3])},
    "lcp": {"M": P, "q": q},
    "avi": {"M": P, "q": q, "A": G, "b": -h, "C": A, "d": b, "lb": lb, "ub": ub},
    "mlcp": {"A": P, "B": np.eye(M), "C": G.T, "D": G, "a": q, "b": h},
    "qp": {"Q": P, "p": q, "A": G, "b": -h, "C": A, "d": b, "lb": lb, "ub": ub},
    "coneqp": {"Q": P, "p": q, "A": G, "b": h, "cone_kind": np.array([3.0]), "cone_size": np.array([3.0]),
               "cone_mu": np.array([1.0])},
    "soclcp": {"M": P, "q": q, "cone_kind": np.array([3.0, 2]), "cone_size": np.array([3.0, 1]),
               "cone_mu": np.array([0.5, 0])},
    "fc": {"W": W, "q": -np.ones(6), "mu": np.array([0.3, 0.5])},
    "fcm": {"W": W, "V": np.ones((6, 1)), "R": np.eye(1), "q": -np.ones(6), "s": np.ones(1),
            "mu": np.array([0.3, 0.5])},
    "rfc": {"W": np.eye(10), "q": -np.ones(10), "mu": np.array([0.3, 0.5]), "mu_r": np.array([0.1, 0.2])},
    "gfc": {"M": P, "H": np.ones((N, 6)), "f": q, "w": -np.ones(6), "mu": np.array([0.3, 0.5])},
    "grfc": {"M": P, "H": np.ones((N, 10)), "f": q, "w": -np.ones(10), "mu": np.array([0.3, 0.5]),
             "mu_r": np.array([0.1, 0.2])},
    "afc": {"W": W, "q": -np.ones(6), "mu": np.array([[0.3, 0.5], [0.2, 0.4]])},
}  # fmt: skip


def npz(folder: Path, arrays: Arrays) -> Path:
    np.savez(folder / "a.npz", **arrays)
    return folder / "a.npz"


def mat(folder: Path, arrays: Arrays) -> Path:
    nested: Arrays = {name: value for name, value in arrays.items() if "." not in name}
    if len(nested) < len(arrays):
        nested["dims"] = {name.partition(".")[2]: value for name, value in arrays.items() if "." in name}
    scipy.io.savemat(folder / "a.mat", nested)
    return folder / "a.mat"


CONTAINERS: Mapping[str, Callable[[Path, Arrays], Path]] = {"npz": npz, "mat": mat}
CASES = [(form, container) for form in FORMS for container in CONTAINERS]


@pytest.mark.parametrize(("form", "container"), some_by_day(CASES, 24))
def test_one_array_too_many_is_refused_by_name(form: str, container: str, tmp_path: Path) -> None:
    path = CONTAINERS[container](tmp_path, FORMS[form] | {"surplus": np.ones(N)})
    with pytest.raises(
        FormatError, match=rf"surplus: is no array of the form {'fc' if form == 'afc' else form} \("
    ) as refusal:
        storage.load(path)
    assert "\n" not in str(refusal.value)
    assert str(refusal.value).startswith(str(path))


TOO_FEW = {
    "qpsolvers without q": ("qpsolvers", "q", "q: is missing"),
    "qpsolvers without h": ("qpsolvers", "h", "h: is missing beside G"),
    "qpsolvers without A": ("qpsolvers", "A", "A: is missing beside b"),
    "OSQP without A": ("OSQP", "A", "A: is missing"),
    "OSQP without u": ("OSQP", "u", "u: is missing"),
    "quadprog without f": ("quadprog", "f", "f: is missing"),
    "quadprog without beq": ("quadprog", "beq", "beq: is missing beside Aeq"),
    "CVXOPT without G": ("CVXOPT", "G", "G: is missing beside h"),
    "box QP without u": ("box QP", "u", "u: is missing"),
    "ContactBench without mus": ("ContactBench", "mus", "mus: is missing"),
    "boxed LCP without hi": ("boxed LCP", "hi", "hi: is missing"),
    "avi without d": ("avi", "d", "d: is missing beside C"),
    "mlcp without D": ("mlcp", "D", "D: is missing"),
    "qp without p": ("qp", "p", "p: is missing"),
    "qp without b": ("qp", "b", "b: is missing beside A"),
    "coneqp without cone_mu": ("coneqp", "cone_mu", "cone_mu: is missing"),
    "fc without mu": ("fc", "mu", "mu: is missing"),
    "rfc without W": ("rfc", "W", "W: is missing"),
    "gfc without f": ("gfc", "f", "f: is missing"),
    "grfc without H": ("grfc", "H", "H: is missing"),
}


@pytest.mark.parametrize(("case", "container"), some_by_day(itertools.product(TOO_FEW, CONTAINERS), 30))
def test_one_array_too_few_is_refused_by_name(case: str, container: str, tmp_path: Path) -> None:
    form, left_out, expected = TOO_FEW[case]
    path = CONTAINERS[container](tmp_path, {name: value for name, value in FORMS[form].items() if name != left_out})
    with pytest.raises(FormatError, match=expected) as refusal:
        storage.load(path)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("form", FORMS)
def test_any_array_may_be_left_out_where_the_form_does_without(form: str, tmp_path: Path) -> None:
    """What is left is refused, or a problem; in the forms of cpbench its other data are as they were."""
    whole = storage.load(npz(tmp_path, FORMS[form]))
    for left_out in FORMS[form]:
        path = npz(tmp_path, {name: value for name, value in FORMS[form].items() if name != left_out})
        problem = read_or_refused(lambda path=path: storage.load(path))
        if problem is not None and form == whole.node:
            same = [np.array_equal(_dense(problem.data()[name]), _dense(whole.data()[name])) for name in whole.data()]
            assert same.count(False) <= 1, left_out


def _dense(value: Any) -> Any:
    return value.toarray() if sp.issparse(value) else value


def test_contacts_without_given_velocities_have_none(tmp_path: Path) -> None:
    problem = storage.load(npz(tmp_path, {name: value for name, value in FORMS["gfc"].items() if name != "w"}))
    assert not problem.data()["w"].any()
    assert problem.sizes()["nc"] == 2


@pytest.mark.parametrize("container", CONTAINERS)
def test_least_squares_are_read_where_they_are_named(container: str, tmp_path: Path) -> None:
    """The point with x of NumPy's lstsq, r = Ax - b, and r as the multiplier of Ax - r = b has no error."""
    system = {"A": G.T, "b": q}
    path = CONTAINERS[container](tmp_path, system)
    problem: Any = storage.load(path, format="least-squares")
    x = np.linalg.lstsq(G.T, q)[0]
    r = G.T @ x - q
    none = np.zeros(N + M)
    answer = problem.point_type(z=np.concatenate([x, r]), lam=np.zeros(0), mu=-r, nu=none)
    assert problem.residuals(answer).error < 1e-13
    (tmp_path / "more").mkdir()
    more = CONTAINERS[container](tmp_path / "more", {**system, "surplus": q})
    with pytest.raises(FormatError, match="surplus: is no array of the form least squares"):
        storage.load(more, format="least-squares")


def test_bounds_by_other_names_are_refused_with_the_right_ones(tmp_path: Path) -> None:
    """These files were problems without bounds once: OSQP's l and u, and other names, beside qpsolvers' arrays."""
    program = {name: FORMS["qpsolvers"][name] for name in ("P", "q", "G", "h")}
    for lower, upper in (("l", "u"), ("lower", "upper"), ("xl", "xu"), ("lo", "hi")):
        for number, write in enumerate((npz, mat)):
            folder = tmp_path / f"{lower}-{number}"
            folder.mkdir()
            with pytest.raises(FormatError, match=r"the nearest is (lb, ub|ub, lb): rename or remove them"):
                storage.load(write(folder, program | {lower: lb, upper: ub}))
    both = FORMS["OSQP"] | {"lb": lb, "ub": ub}
    with pytest.raises(FormatError, match="lb, ub: are no arrays of the form OSQP"):
        storage.load(mat(tmp_path, both))
    with pytest.raises(FormatError, match="G, h: are no arrays of the form box QP"):
        storage.load(npz(tmp_path, FORMS["box QP"] | {"G": G, "h": h}))


def test_other_names_are_refused_by_the_form_that_the_rest_fits(tmp_path: Path) -> None:
    lcp = {"M": np.eye(2), "q": np.ones(2)}
    with pytest.raises(FormatError, match=r"n, name: are no arrays of the form lcp \(M, q\): rename or remove them"):
        storage.load(npz(tmp_path, lcp | {"n": np.array(2), "name": np.array("mine")}))
    for arrays in ({"arr_0": lcp["M"], "arr_1": lcp["q"]}, {"first": lcp["M"], "second": lcp["q"]}):
        with pytest.raises(FormatError, match=r"have names of no form; an lcp is M, q, a QP P, q, G, h"):
            storage.load(mat(tmp_path, arrays))


def test_cones_of_second_order_make_a_conic_program(tmp_path: Path) -> None:
    cone = storage.load(npz(tmp_path, FORMS["CVXOPT"]))
    assert isinstance(cone, ConeQP)
    x = rng.standard_normal(N)
    assert np.array_equal(cone.A @ x + cone.b, np.r_[A @ x - b, h - G @ x])
    assert cone.cone_kind.tolist() == [Cone.ZERO, Cone.NONNEGATIVE, Cone.SECOND_ORDER]
    with pytest.raises(FormatError, match=r"dims\.s: is a cone of positive semidefinite matrices"):
        storage.load(npz(tmp_path, FORMS["CVXOPT"] | {"dims.s": np.array([2.0])}))
    with pytest.raises(FormatError, match=r"dims\.l: is 2, with 2 rows in other cones, expected 3"):
        storage.load(npz(tmp_path, FORMS["CVXOPT"] | {"dims.l": np.array([2.0])}))


@pytest.mark.parametrize("form", ["quadprog", "OSQP"])
def test_rows_without_a_side_are_left_out_aloud(form: str, tmp_path: Path) -> None:
    """1e20 stands for no side, as infinity does; the last row keeps its own."""
    arrays = dict(FORMS[form])
    none = np.array([1e20, np.inf, 1.0])
    arrays |= {"b": none} if form == "quadprog" else {"l": -none, "u": none}
    np.savez(tmp_path / "p.npz", **arrays)
    problem = storage.load(tmp_path / "p.npz")
    assert problem.info.properties["left_out"] == "2 rows without a side (none, or beyond 1e+19)"
    assert problem.A.shape[0] == (1 if form == "quadprog" else 2)
    np.savez(tmp_path / "p.npz", **FORMS[form])
    assert "left_out" not in storage.load(tmp_path / "p.npz").info.properties


def test_absent_parts_and_starting_points(tmp_path: Path) -> None:
    """MATLAB's [] and NumPy's None stand for no rows; what is no part of the problem is said to be none."""
    empty = np.zeros((0, 0))
    absent = {"A": empty, "b": empty, "lb": empty, "ub": empty, "x0": np.ones(N)}
    problem: Any = storage.load(mat(tmp_path, {"H": P, "f": q, "Aeq": A, "beq": b, **absent}))
    assert (problem.sizes(), problem.has_bounds) == ({"n": N, "m": 0, "k": K}, False)
    form = "quadprog (H, f, A, b, Aeq, beq, lb, ub); x0, a starting point, is no part of it"
    assert problem.info.properties["form"] == form
    none = np.array(None, dtype=object)
    np.savez(tmp_path / "n.npz", P=P, q=q, G=none, h=none, A=A, b=b)
    assert storage.load(tmp_path / "n.npz").sizes() == {"n": N, "m": 0, "k": K}
    with pytest.raises(FormatError, match="A: is 0x0, expected 2x4"):
        storage.load(mat(tmp_path, {"H": P, "f": q, "A": empty, "b": b}))
    for name, size in (("n", N + 1), ("m", M - 1)):
        with pytest.raises(FormatError, match=f"{name}: is {size}, expected {size - 1 if name == 'n' else size + 1}"):
            storage.load(mat(tmp_path, FORMS["OSQP"] | {name: float(size)}))


def test_lcp_names_are_an_lcp_and_bounds_make_it_an_avi(tmp_path: Path) -> None:
    """{M, q} would fit an avi too, whose solution without bounds is another: the text says so."""
    problem = storage.load(npz(tmp_path, FORMS["lcp"]))
    assert (problem.node, problem.info.properties["form"]) == ("lcp", "lcp (M, q), which avi would fit too")
    assert storage.load(npz(tmp_path, FORMS["lcp"] | {"lb": lb, "ub": np.full(N, np.inf)})).node == "avi"


@pytest.mark.parametrize(("triangle", "empty"), [(np.triu, "lower"), (np.tril, "upper")])
def test_half_stored_matrices_are_refused(triangle: Any, empty: str, tmp_path: Path) -> None:
    """As OSQP, Clarabel and SCS take them; the line says what makes a whole one."""
    for write in (npz, mat):
        with pytest.raises(FormatError, match=f"P: is not symmetric: the {empty} triangle is empty; store P"):
            storage.load(write(tmp_path, FORMS["qpsolvers"] | {"P": triangle(P)}))
