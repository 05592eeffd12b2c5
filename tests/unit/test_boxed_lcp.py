"""Boxed LCPs of physics engines: bounds and bounds by friction against the law itself, and against the
conversion of frictional contact whose polygon is a square."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
from command_line import cpbench as command

import cpbench
from cpbench.errors import FormatError, ProblemError
from cpbench.formulations import FrictionContact

INF = float("inf")


def constant(seed: int) -> dict[str, Any]:
    """A boxed LCP with joints (no bounds), contacts (one bound) and motors (two)."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 13))
    H = rng.standard_normal((n, n + 2))
    kind = rng.integers(0, 3, n)
    lo = np.choose(kind, [np.full(n, -INF), np.zeros(n), -rng.uniform(0, 1, n)])
    hi = np.choose(kind, [np.full(n, INF), np.full(n, INF), rng.uniform(0, 1, n)])
    return {"A": H @ H.T, "b": 3 * rng.standard_normal(n), "lo": lo, "hi": hi}


def scene(seed: int, contacts: int = 3) -> dict[str, Any]:
    """Contacts with a row of a normal and two of friction each, in the order of ODE: all normals first."""
    rng = np.random.default_rng(seed)
    n = 3 * contacts
    H = rng.standard_normal((n, n + 1))
    mu = np.repeat(rng.uniform(0.2, 0.9, contacts), 2)
    b = rng.standard_normal(n)
    b[:contacts] = np.abs(b[:contacts]) + 0.5
    none = np.full(contacts, -1)
    return {
        "A": H @ H.T,
        "b": b,
        "lo": np.concatenate([np.zeros(contacts), -mu]),
        "hi": np.concatenate([np.full(contacts, INF), mu]),
        "findex": np.concatenate([none, np.repeat(np.arange(contacts), 2)]),
    }


def broken(given: dict[str, Any], x: Any) -> float:
    """How far x is from the law, by its definition: w = Ax − b, x at the end of its interval that w pushes to."""
    w = given["A"] @ x - given["b"]
    lo, hi, findex = given["lo"].copy(), given["hi"].copy(), given.get("findex", np.full(len(x), -1))
    friction = findex >= 0
    hi[friction] = given["hi"][friction] * np.maximum(x[findex[friction]], 0.0)
    lo[friction] = -hi[friction]
    return float(np.abs(x - np.clip(x - w, lo, hi)).max())


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("seed", range(25))
def test_constant_bounds_are_an_avi(seed: int) -> None:
    given = constant(seed)
    model = cpbench.from_boxed_lcp(**given)
    assert (model.problem.node, model.problem.q.size) == ("avi", given["b"].size)
    assert broken(given, model.lift(cpbench.solve(model.problem, tolerance=1e-10))) < 1e-7


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("seed", range(10))
def test_friction_rows_follow_their_normal_rows(seed: int) -> None:
    given = scene(seed)
    model = cpbench.from_boxed_lcp(**given)
    solution = cpbench.solve(model.problem, tolerance=1e-9)
    assert solution
    assert broken(given, model.lift(solution)) < 1e-6


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("seed", range(6))
def test_the_law_is_that_of_four_facets_at_angle_0(seed: int) -> None:
    """A point of either problem is one of the other: the square |t₁| ≤ μn, |t₂| ≤ μn is what fc-mlcp-outer makes."""
    given = scene(seed)
    nc = given["b"].size // 3
    order = np.column_stack([np.arange(nc), nc + 2 * np.arange(nc), nc + 2 * np.arange(nc) + 1]).ravel()
    mu = given["hi"][nc::2]
    fc = FrictionContact(W=given["A"][np.ix_(order, order)], q=-given["b"][order], mu=mu)
    square = cpbench.convert(fc, via="fc-mlcp-outer[facets=4,angle=0]")
    r = square.lift(cpbench.solve(square.problem, tolerance=1e-10)).r
    x = np.zeros(3 * nc)
    x[order] = r
    assert broken(given, x) < 1e-6
    lcp = cpbench.convert(fc, via="fc-lcp-outer[facets=4,angle=0]")
    x[order] = lcp.lift(cpbench.solve(lcp.problem, tolerance=1e-10)).r
    assert broken(given, x) < 1e-6


@pytest.mark.needs("cpbench_solvers")
def test_a_sliding_box_by_hand() -> None:
    """Weight 2 on a plane, pushed by 3 along t₁ and 0.4 along t₂, μ = 0.5: n = 2, t₁ at its bound 1, t₂ sticks; under
    Coulomb's law the force would be along the slip."""
    given = {
        "A": np.eye(3),
        "b": np.array([2.0, -3.0, -0.4]),
        "lo": np.array([0.0, -0.5, -0.5]),
        "hi": np.array([INF, 0.5, 0.5]),
        "findex": np.array([-1, 0, 0]),
    }
    model = cpbench.from_boxed_lcp(**given)
    assert model.lift(cpbench.solve(model.problem, tolerance=1e-10)) == pytest.approx([2.0, -1.0, -0.4], abs=1e-8)


def write(kind: str, folder: Path, given: dict[str, Any]) -> Path:
    path = folder / f"step.{kind}"
    if kind == "npz":
        np.savez(path, **given)
    else:
        scipy.io.savemat(path, given)
    return path


@pytest.mark.parametrize("kind", ["npz", "mat"])
def test_files_of_named_arrays(tmp_path: Path, kind: str) -> None:
    given = scene(1)
    problem = cpbench.load(write(kind, tmp_path, given))
    assert problem.fingerprint == cpbench.from_boxed_lcp(**given).problem.fingerprint
    assert problem.info.math_info.startswith("Ax = b + w")
    assert problem.info.properties["form"] == "boxed LCP (A, b, lo, hi, findex)"


@pytest.mark.needs("cpbench_solvers")
def test_a_boxed_problem_is_packed(tmp_path: Path) -> None:
    given = scene(2)
    for name, value in given.items():
        np.save(tmp_path / f"{name}.npy", value)
    files = [f"{name}.npy" for name in given]
    assert command(tmp_path, "pack", *files, "-o", "step.h5").returncode == 0
    assert cpbench.load(tmp_path / "step.h5").fingerprint == cpbench.from_boxed_lcp(**given).problem.fingerprint
    shown = command(tmp_path, "solve", "step.h5").stdout
    assert "x[8]" in shown
    assert "z[" not in shown


def test_pack_names_the_file_that_the_law_has_not(tmp_path: Path) -> None:
    given = {**scene(2), "findex": np.full(9, 0.5)}
    for name, value in given.items():
        np.save(tmp_path / f"{name}.npy", value)
    said = command(tmp_path, "pack", *(f"{name}.npy" for name in given), "-o", "step.h5")
    assert said.returncode == 2
    assert said.stderr == "cpbench: findex.npy: findex: is 0.5 at row 0, expected -1 or a row from 0 to 8\n"


CHANGES: list[tuple[str, int, float, str]] = [
    ("findex", 3, 0.5, "findex: is 0.5 at row 3, expected -1 or a row from 0 to 8"),
    ("findex", 3, 9, "findex: is 9 at row 3"),
    ("findex", 3, -2, "findex: is -2 at row 3"),
    ("findex", 3, 4, "findex: is 4 at row 3, and row 4 has a friction index itself"),
    ("findex", 0, 0, "findex: is 0 at row 0, and row 0 has a friction index itself"),
    ("hi", 3, INF, "hi: is inf at row 3 with a friction index"),
    ("hi", 3, -0.1, "hi: is -0.1 at row 3 with a friction index"),
    ("lo", 3, 0.0, "lo: is 0 at row 3 with a friction index, expected -hi"),
    ("lo", 0, -1.0, "lo: is -1 at row 0, the normal row of row 3, expected at least 0"),
]


@pytest.mark.parametrize(("name", "row", "value", "cause"), CHANGES)
def test_what_the_law_has_not_is_refused(tmp_path: Path, name: str, row: int, value: float, cause: str) -> None:
    given = {key: np.array(part, float) for key, part in scene(3).items()}
    given[name][row] = value
    with pytest.raises(ProblemError, match=f"boxed.{cause}"):
        cpbench.from_boxed_lcp(**given)
    with pytest.raises(FormatError, match=cause) as caught:
        cpbench.load(write("npz", tmp_path, given))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["A", "b", "lo", "hi", "findex"])
def test_wrong_sizes_are_refused(name: str) -> None:
    given = scene(3)
    with pytest.raises(ProblemError, match=r"boxed\.\w+: (is|has)"):
        cpbench.from_boxed_lcp(**{**given, name: given[name][:-1]})
