"""Exchanges by files of known formats: HDF5, FCLIB, Matrix Market, MathOptFormat; there and back, and refusals."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from tiers import by_night, some_by_day

sys.path.insert(0, str(Path(__file__).parent))
from storage_cases import cases, same

from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import AVI, LCP, MLCP, QP, FrictionContact, LCPPoint
from cpbench.formulations.exchange import exchanges

CASES = {name: problem for name, problem in cases().items() if not name.endswith("-large")}
MINE = ("hdf5", "fclib", "mtx", "mof", "nl")
PAIRS = [
    pytest.param(name, case, id=f"{name}-{case}")
    for name in MINE
    for case, problem in CASES.items()
    if exchanges.get(name).nodes is None or problem.node in (exchanges.get(name).nodes or ())
    if not (name == "mof" and problem.node == "avi" and "set" in case)
]


def _path(folder: Path, name: str, what: str = "problem") -> Path:
    return folder / f"{what}{exchanges.get(name).suffix}"


@pytest.mark.parametrize(("name", "case"), some_by_day(PAIRS, 80))
def test_a_problem_comes_back(name: str, case: str, tmp_path: Path) -> None:
    problem, path = CASES[case], _path(tmp_path, name)
    exchanges.get(name).write_problem(problem, path)
    again = exchanges.get(name).read_problem(path)
    assert again.node == problem.node
    assert again.fingerprint == problem.fingerprint
    assert not again.provenance
    for part, value in problem.data().items():
        if name not in ("mof", "nl"):  # they have no dense matrices
            assert sp.issparse(again.data()[part]) == sp.issparse(value)
        if value.ndim == 1:
            assert same(again.data()[part], value), f"{part}: a sign of a zero changed"


@pytest.mark.parametrize(("name", "case"), some_by_day(PAIRS, 80))
def test_an_answer_comes_back(name: str, case: str, tmp_path: Path, rng: np.random.Generator) -> None:
    problem, path = CASES[case], _path(tmp_path, name, "answer")
    point = problem.point_from_vector(rng.standard_normal(sum(problem.point_sizes.values())))
    exchanges.get(name).write_answer(point, path)
    assert same(exchanges.get(name).read_answer(path, problem), point)
    spoilt = problem.point_type(**{part: np.full(value.size, np.nan) for part, value in point.arrays().items()})
    exchanges.get(name).write_answer(spoilt, path)  # in place of the first
    found = exchanges.get(name).read_answer(path, problem)
    assert all(np.isnan(value).all() for value in found.arrays().values())


@pytest.mark.parametrize("name", MINE)
def test_a_problem_replaces_the_one_before(name: str, tmp_path: Path) -> None:
    case = {"fclib": "fc3", "nl": "qp"}.get(name, "mlcp")
    exchange, path = exchanges.get(name), _path(tmp_path, name)
    old, new = [p for n, p in CASES.items() if n.startswith(f"{case}-")][:2]
    exchange.write_problem(old, path)
    exchange.write_problem(new, path)
    assert exchange.read_problem(path).fingerprint == new.fingerprint


@pytest.mark.parametrize("name", ["hdf5", "mtx"])
def test_everything_is_dense_where_that_is_environment(name: str, tmp_path: Path) -> None:
    problem, path = CASES["qp-sparse-7-4"], _path(tmp_path, name)
    exchanges.get(name).write_problem(problem, path, dense=True)
    again = exchanges.get(name).read_problem(path)
    assert again.fingerprint == problem.fingerprint
    assert not any(sp.issparse(value) for value in again.data().values())


@pytest.mark.parametrize("name", MINE)
def test_an_answer_of_a_wrong_size_is_refused(name: str, tmp_path: Path) -> None:
    small, large = CASES["fc3-dense-1"], CASES["fc3-dense-5"]
    if name == "mof":
        small, large = CASES["lcp-dense-2"], CASES["lcp-dense-11"]
    if name == "nl":
        small, large = CASES["qp-dense-1-0"], CASES["qp-dense-7-4"]
    path = _path(tmp_path, name, "answer")
    exchanges.get(name).write_answer(small.zero_point(), path)
    with pytest.raises(FormatError, match="numbers, expected") as refusal:
        exchanges.get(name).read_answer(path, large)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("name", MINE)
def test_what_is_not_there_is_refused(name: str, tmp_path: Path) -> None:
    exchange, path = exchanges.get(name), _path(tmp_path, name)
    for read in (exchange.read_problem, lambda p: exchange.read_answer(p, CASES["fc3-dense-1"])):
        with pytest.raises(FormatError, match=r"no such file|No such file|no such folder") as refusal:
            read(path)
        assert str(path) in str(refusal.value)


@pytest.mark.parametrize("name", ["fclib", "mof", "nl"])
def test_a_problem_that_it_cannot_carry_is_refused(name: str, tmp_path: Path) -> None:
    problem = CASES["lcp-dense-2" if name == "fclib" else "fc3-dense-1"]
    with pytest.raises(FormatError, match=f"not a problem of type {problem.node}"):
        exchanges.get(name).write_problem(problem, _path(tmp_path, name))
    assert not _path(tmp_path, name).exists()


@pytest.mark.parametrize("name", [*(n for n in exchanges.names() if n != "hdf5"), *by_night(["hdf5"])])
def test_what_an_exchange_refuses_is_known_before(name: str, tmp_path: Path) -> None:
    """Met only when it is written it would be an error of the solver's row."""
    exchange = exchanges.get(name)
    for case, problem in CASES.items():
        try:
            exchange.write_problem(problem, _path(tmp_path, name))
            refused = False
        except FormatError:
            refused = True
        if exchange.nodes is not None:
            assert (exchange.obstacle(problem) is not None) == refused, case


# ------------------------------------------------------------------------------------------- HDF5 and FCLIB


def test_an_answer_of_fclib_has_its_names(tmp_path: Path) -> None:
    problem = CASES["gfc2-sparse-5-2"]
    with h5py.File(tmp_path / "a.hdf5", "w") as file:  # as its C library writes it: with u, and in any order
        for name, size in (("v", 6), ("u", 10), ("r", 10), ("l", 2)):
            file[f"solution/{name}"] = np.arange(size, dtype=float)
    point = exchanges.get("fclib").read_answer(tmp_path / "a.hdf5", problem)
    np.testing.assert_array_equal(point.lam, [0.0, 1.0])
    exchanges.get("fclib").write_answer(point, tmp_path / "b.hdf5")
    with h5py.File(tmp_path / "b.hdf5") as file:
        assert set(file["solution"]) == {"v", "r", "l"}


def test_an_answer_may_stand_in_a_copy_of_its_problem(tmp_path: Path) -> None:
    problem, path = CASES["fc3-dense-1"], tmp_path / "p.hdf5"
    exchanges.get("fclib").write_problem(problem, path)
    with pytest.raises(FormatError, match="holds no answer"):
        exchanges.get("fclib").read_answer(path, problem)
    with h5py.File(path, "a") as file:
        file["solution/r"] = np.ones(3)
    np.testing.assert_array_equal(exchanges.get("fclib").read_answer(path, problem).r, np.ones(3))
    with pytest.raises(FormatError, match="another problem"):
        exchanges.get("fclib").read_answer(path, CASES["fc3-sparse-1"])


def test_fclib_reads_a_file_without_our_group(tmp_path: Path) -> None:
    problem = CASES["fc3-sparse-5"]
    exchanges.get("fclib").write_problem(problem, tmp_path / "p.hdf5")
    with h5py.File(tmp_path / "p.hdf5", "a") as file:
        del file["cpbench"]
    assert exchanges.get("fclib").read_problem(tmp_path / "p.hdf5").fingerprint == problem.fingerprint


# -------------------------------------------------------------------------------------------- Matrix Market


def test_others_read_our_matrix_market(tmp_path: Path) -> None:
    problem = CASES["qp-sparse-7-4"]
    exchanges.get("mtx").write_problem(problem, tmp_path / "p")
    for name, value in problem.data().items():
        found: Any = scipy.io.mmread(tmp_path / "p" / f"{name}.mtx", spmatrix=False)
        if value.ndim == 2:
            np.testing.assert_array_equal(found.toarray(), value.toarray())
        else:
            np.testing.assert_array_equal(found.ravel(), value)


def test_we_read_the_matrix_market_of_others(tmp_path: Path, rng: np.random.Generator) -> None:
    folder = tmp_path / "p"
    folder.mkdir()
    M, q = rng.standard_normal((4, 4)), rng.standard_normal(4)
    M = M + M.T
    (folder / "problem.json").write_text('{"node": "lcp"}')
    scipy.io.mmwrite(folder / "M.mtx", M, precision=17, symmetry="symmetric")
    scipy.io.mmwrite(folder / "q.mtx", sp.coo_array(q.reshape(1, -1)), precision=17)  # a row, and sparse
    again = exchanges.get("mtx").read_problem(folder)
    assert again.fingerprint == LCP(M=M, q=q).fingerprint


def test_a_folder_of_matrix_market_is_a_problem_file(tmp_path: Path) -> None:
    problem = CASES["mlcp-sparse-7-4"]
    exchanges.get("mtx").write_problem(problem, tmp_path / "p")
    exchanges.get("npy-dir").write_problem(problem, tmp_path / "q")  # has a problem.json too, and is no format
    assert storage.problem_files([tmp_path]) == [str(tmp_path / "p" / "problem.json")]
    assert storage.load(tmp_path / "p" / "problem.json").fingerprint == problem.fingerprint
    assert {file.name for file in storage.files(tmp_path / "p" / "problem.json")} == {
        "problem.json", *(f"{name}.mtx" for name in problem.data())
    }  # fmt: skip


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("array real general\n0 4\n", "shape"),
        ("array real general\n4 1\n1\n2\n3\n", "has 3 numbers, expected 4 of a general array of 4x1"),
        ("array real general\n4 1\n1\n2\n3\nx\n", "could not convert"),
        ("array real general\n900000000 1\n1\n", "has 1 numbers, expected 900000000"),
        ("array complex general\n1 1\n1 2\n", "complex"),
        ("coordinate real general\n9000000 9000000 0\n", "shape"),
        ("coordinate real general\n4 1 1\n5 1 1.0\n", "has the index 5 in a matrix of 4x1"),
        ("array real general\n-4 1\n1\n", "has the sizes '-4 1', expected rows columns"),
        ("array real general\n3 1\n1\n2\n3\n", "has 3 numbers, expected 4"),
        ("nonsense", "not a readable"),
    ],
)
def test_broken_matrix_market_is_one_line(content: str, says: str, tmp_path: Path) -> None:
    folder = tmp_path / "a"
    folder.mkdir()
    (folder / "z.mtx").write_text(f"%%MatrixMarket matrix {content}")
    with pytest.raises(FormatError, match=says) as refusal:
        exchanges.get("mtx").read_answer(folder, LCP(M=np.eye(4), q=np.ones(4)))
    assert "\n" not in str(refusal.value)


@pytest.mark.nightly
def test_an_array_without_rows_is_read(tmp_path: Path) -> None:
    """SciPy 1.17 divides by zero: the process is gone, and no `except` sees it."""
    (tmp_path / "z.mtx").write_text("%%MatrixMarket matrix array real general\n0 1\n")
    told = f"from cpbench import storage; print(storage.read_vector(r'{tmp_path / 'z.mtx'}').size)"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, timeout=600)
    assert (done.returncode, done.stdout.strip()) == (0, "0"), done.stderr


@pytest.mark.parametrize(
    ("header", "says"),
    [
        ("{", "names no problem"),
        ("[]", "names no problem"),
        ('{"node": "nope"}', "nope"),
        ('{"node": "lcp", "x": 1}', "x"),
    ],
)
def test_a_broken_header_is_one_line(header: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "problem.json").write_text(header)
    with pytest.raises(FormatError, match=says):
        exchanges.get("mtx").read_problem(tmp_path)


def test_a_problem_without_a_matrix_is_refused(tmp_path: Path) -> None:
    exchanges.get("mtx").write_problem(CASES["lcp-dense-2"], tmp_path / "p")
    (tmp_path / "p" / "M.mtx").unlink()
    with pytest.raises(FormatError, match="M"):
        exchanges.get("mtx").read_problem(tmp_path / "p")


# ------------------------------------------------------------------------------------------- MathOptFormat


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
    with pytest.raises(FormatError):
        exchanges.get("mof").read_answer(path, CASES["lcp-dense-2"])


def test_a_hessian_that_rounding_made_asymmetric_has_the_same_objective(tmp_path: Path) -> None:
    Q = np.array([[2.0, 1.0], [1.0 + 2e-16, 3.0]])
    problem = QP.build(Q, np.zeros(2))
    exchanges.get("mof").write_problem(problem, tmp_path / "p.mof.json")
    told = json.loads((tmp_path / "p.mof.json").read_text())["objective"]["function"]["quadratic_terms"]
    z = {"z[1]": 0.3, "z[2]": -0.7}
    value = 0.0
    for term in told:  # as the schema says: ½zᵀQz, one of two mirrored entries is enough, duplicates add up
        i, j, c = term["variable_1"], term["variable_2"], term["coefficient"]
        value += 0.5 * c * z[i] ** 2 if i == j else c * z[i] * z[j]
    assert value == pytest.approx(problem.objective(np.array(list(z.values()))), rel=1e-14)


def test_the_answer_of_a_qp_by_name(tmp_path: Path) -> None:
    """min ½‖z‖² - 3z₁ with z₁ + z₂ ≥ 2, z₁ = z₂, z₂ ≤ 1.2: without the bound z = (1.5, 1.5), with it (1.2, 1.2)."""
    problem = QP(
        Q=np.eye(2), p=[-3.0, 0.0], A=[[1.0, 1.0]], b=[2.0], C=[[1.0, -1.0]], d=[0.0], lb=[-9.0, -9.0], ub=[9.0, 1.2]
    )
    # stationarity: z + p - Aᵀλ - Cᵀμ - ν = 0 with λ = 0, so μ = 1.2 - 3 and ν₂ = 1.2 + μ
    told = {"primal": {"z[1]": 1.2, "z[2]": 1.2}, "dual": {"C[1]": -1.8}, "reduced_cost": {"z[2]": -0.6}}
    path = tmp_path / "a.json"
    path.write_text(json.dumps(told))
    point = exchanges.get("mof").read_answer(path, problem)
    assert problem.residuals(point).error < 1e-12


@pytest.mark.parametrize(
    ("told", "says"),
    [
        ({"primal": {"z[1]": 0.0}}, "has 1 of the 2 variables"),
        ({"primal": {"z[1]": 0.0, "z[3]": 0.0}}, "none of"),
        ({"primal": [0.0, 0.0]}, "is a list"),
        ({"z": [0.0, "a"]}, "z/1"),
        ({"z": 1.0}, "is not a list"),
        ({"x": [0.0, 0.0]}, "the file holds x"),
        ({"z": [0.0, True]}, "z/1"),
    ],
)
def test_an_answer_that_is_none_is_one_line(told: dict[str, Any], says: str, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(told))
    with pytest.raises(FormatError, match=says) as refusal:
        exchanges.get("mof").read_answer(path, LCP(M=np.eye(2), q=np.ones(2)))
    assert "\n" not in str(refusal.value)


def test_numbers_that_are_none_are_still_an_answer(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text('{"z": [null, NaN, 1' + "0" * 400 + "]}")
    point = exchanges.get("mof").read_answer(tmp_path / "a.json", LCP(M=np.eye(3), q=np.ones(3)))
    assert isinstance(point, LCPPoint)
    assert not np.isfinite(point.z).any()


def test_a_contact_problem_is_none_of_mathoptformats(tmp_path: Path) -> None:
    problem = FrictionContact(W=np.eye(3), q=np.ones(3), mu=np.ones(1))
    with pytest.raises(FormatError, match="no"):
        storage.save(problem, tmp_path / "p.mof.json")
