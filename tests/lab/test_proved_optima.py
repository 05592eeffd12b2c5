"""Exact solutions of large systems, and the table of what is proved of all problems in a folder."""

from __future__ import annotations

import math
import time
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.sparse as sp
from certificate_checks import CHECKER, REFUSALS, check, checked, reseal
from command_line import cpbench as command

import cpbench as cp
from cpbench.bench import judging

pytest.importorskip("flint", reason="certificates need python-flint")
from cpbench_lab.certificates.basic_points import refined
from cpbench_lab.certificates.certify import convexity, objective_bounds
from cpbench_lab.certificates.exact_rows import ExactRows, rational, solve

GAP = judging.verification.OPTIMALITY_GAP
PUBLISHED = "# of nobody\nproblem,value\nPLAIN,-2.5e+00\nsum,-1.002\n"
"""That of `plain` is right; that of `sum` is off by 2 units of its last digit."""


def _sparse(n: int, seed: int, digits: int) -> sp.csr_array:
    """Return a sparse matrix of decimals, whose rows and columns have very different sizes."""
    rng = np.random.default_rng(seed)
    A = sp.random_array((n, n), density=3 / n, rng=rng, data_sampler=rng.standard_normal) + 2 * sp.eye_array(n)
    sizes = 10.0 ** rng.integers(-3, 4, (2, n))
    A = sp.csr_array(sp.diags_array(sizes[0]) @ sp.csr_array(A) @ sp.diags_array(sizes[1]))
    A.data = np.round(A.data, digits)
    A.eliminate_zeros()
    return A


@pytest.mark.parametrize("digits", [0, 3, 17])
def test_refinement_ends_at_the_solution_that_flint_finds(digits: int) -> None:
    A = _sparse(60, digits, 17) if digits == 17 else sp.csr_array(_sparse(60, 7, digits) + sp.eye_array(60))
    right = [rational(v) / 3 for v in np.random.default_rng(1).standard_normal(60).tolist()]
    everything = np.arange(60)
    expected = solve(ExactRows.of(A), everything, everything, right)
    assert expected is not None
    assert refined(A, right, math.inf) == expected


def test_refinement_gives_up_where_doubles_do_not_tell() -> None:
    hilbert = sp.csr_array(1.0 / (np.arange(30)[:, None] + np.arange(1, 31)))
    assert refined(hilbert, [rational(1.0)] * 30, math.inf) is None
    assert refined(sp.csr_array(np.ones((3, 3))), [rational(1.0)] * 3, math.inf) is None
    assert refined(_sparse(300, 3, 17), [rational(1.0)] * 300, time.perf_counter()) is None


def test_convexity_is_decided_exactly() -> None:
    rng = np.random.default_rng(5)
    G = rng.integers(-4, 5, (3, 6)).astype(float)
    half = np.kron(np.eye(2), G.T @ G)
    assert convexity(sp.csr_array(half)) == "positive semidefinite"
    assert convexity(sp.csr_array(half + np.eye(12))) == "positive definite"
    less = half.copy()
    less[0, 0] = np.nextafter(less[0, 0], 0.0)
    assert convexity(sp.csr_array(less)) == ""
    assert convexity(sp.csr_array((3, 3))) == "positive semidefinite"


def test_a_value_is_between_the_doubles_around_it() -> None:
    third = rational(1.0) / 3
    low, high = objective_bounds(sp.csr_array([[2.0]]), np.array([0.0]), [third])  # 1/9
    assert rational(low) < third * third < rational(high)
    assert high == math.nextafter(low, 1.0)
    assert objective_bounds(sp.csr_array([[2.0]]), np.array([-3.0]), [rational(1.5)]) == (-2.25, -2.25)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of problems, beside a file that is none: ½|z|² − z₁ − 2z₂ over z₁ + z₂ ≥ 3, z ≥ 0 is −5/2 at (1, 2);
    s² − 2s, s = z₁ + z₂ ≤ 2, is −1 on a segment; no z ≤ −1 has z₁ + z₂ ≥ −1."""
    root = tmp_path_factory.mktemp("optima")
    (root / "files").mkdir()
    one, pair = np.ones((1, 2)), np.array([[2.0, 2.0], [2.0, 2.0]])
    bounds = {"lb": np.zeros(2)}
    cp.save(cp.QP.build(np.eye(2), np.array([-1.0, -2.0]), one, [3.0], lb=np.zeros(2)), root / "files" / "plain.h5")
    cp.save(cp.QP.build(pair, np.array([-2.0, -2.0]), -one, [-2.0], **bounds), root / "files" / "sum.h5")
    cp.save(cp.QP.build(np.zeros((2, 2)), np.ones(2), one, [-1.0], ub=[-1.0, -1.0]), root / "files" / "none.h5")
    cp.save(cp.LCP(M=[[2.0, 1.0], [1.0, 2.0]], q=[-5.0, -6.0]), root / "files" / "two.h5")
    (root / "files" / "broken.h5").write_bytes(b"\x89HDF\r\n\x1a\nno more")
    (root / "published.csv").write_text(PUBLISHED)
    return root


@pytest.fixture(scope="module")
def table(folder: Path) -> pd.DataFrame:
    done = command(folder, "certify", "--all", "files", "-o", "out", "--published", "published.csv", "--timeout", "20s")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[-2:] == [
        "5 problems: 3 proved, 1 unreadable, 1 infeasible",
        "  sum.h5: published -1.002, proved -1",
    ] or sorted(lines[-2].split(": ")[1].split(", ")) == ["1 infeasible", "1 unreadable", "3 proved"]
    return pd.read_csv(folder / "out" / "table.csv").set_index("problem")


def test_the_table_has_what_is_proved_of_each_problem(table: pd.DataFrame) -> None:
    assert table.index[0] == "sum.h5"  # what differs from what is published comes first
    assert table["level"].to_dict() == {
        "sum.h5": "proved", "broken.h5": "unreadable", "none.h5": "infeasible",
        "plain.h5": "proved", "two.h5": "proved",
    }  # fmt: skip
    values = table.loc[["plain.h5", "sum.h5"], ["low", "high", "off"]].to_numpy().tolist()
    assert values == [[-2.5, -2.5, 0.0], [-1.0, -1.0, 2.0]]
    facts = table[["convex", "unique"]].fillna("").T.to_dict("list")
    assert facts["plain.h5"] == ["positive definite", "positive definite"]
    assert facts["sum.h5"] == ["positive semidefinite", ""]
    assert facts["two.h5"] == ["", "P-matrix"]


def test_answers_stand_beside_the_proved_optimum(
    table: pd.DataFrame, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At (0.5, 0.5) ½|z|² − z₁ − 2z₂ is −1.25, half of 2.5 from the optimum; without a table there is nothing."""
    monkeypatch.setattr(judging, "TABLES", (folder / "none.csv", folder / "out" / "table.csv"))
    monkeypatch.setattr(judging, "proved_optima", judging.proved_optima.__wrapped__)
    problem = cp.load(folder / "files" / "plain.h5")
    gaps = [judging.optimality_gap(problem, point)[GAP]
            for point in (cp.solve(problem).point, problem.point_from_vector([0.5, 0.5, 0.0, 0.0, 0.0]))]  # fmt: skip
    assert (gaps[0] < 1e-12, gaps[1]) == (True, 0.5)
    monkeypatch.setattr(judging, "TABLES", ())
    assert GAP not in judging.optimality_gap(problem, cp.solve(problem).point)


def test_its_certificates_prove_it_without_cpbench(table: pd.DataFrame, folder: Path, tmp_path: Path) -> None:
    files = sorted((folder / "out" / "certificates").iterdir())
    code, told = checked(*files)
    assert (code, len(files), told.count(": infeasible"), told.count("optimal value")) == (0, 4, 1, 2), told
    for name, change in (("value_high", -1.5), ("value_low", 0.5), ("convex", "positive definite")):
        forged = tmp_path / "forged.h5"
        forged.write_bytes((folder / "out" / "certificates" / f"{table.loc['sum.h5', 'fingerprint']}.h5").read_bytes())
        with h5py.File(forged, "r+") as file:
            own = file["certificate"]
            if name == "convex":
                own["data/Q"][0, 0] -= 2.0**-52
            else:
                own.attrs[name] = change
            reseal(own)
        with pytest.raises(REFUSALS):
            check(forged)


def test_what_is_in_the_table_is_not_looked_at_again(table: pd.DataFrame, folder: Path) -> None:
    times = {path: path.stat().st_mtime_ns for path in (folder / "out" / "certificates").iterdir()}
    again = command(folder, "certify", "--all", "files", "-o", "out")
    assert (again.returncode, again.stdout.count("\n")) == (0, 2), again.stdout
    assert {path: path.stat().st_mtime_ns for path in times} == times
    assert command(folder, "certify", "--all", "files").returncode == 2
    assert command(folder, "certify", "files/two.h5", "--published", "published.csv").returncode == 2
    assert command(folder, "certify", "--all", "out", "-o", "more").returncode in (0, 2)


def test_the_checker_solves_large_systems_by_itself() -> None:
    """Without its own LU and digits, 300 unknowns would be a dense system over the rationals."""
    from certificate_checks import part

    A = _sparse(300, 11, 17)
    rows = [
        {int(j): float(v) for j, v in zip(A.indices[a:b], A.data[a:b], strict=True)}
        for a, b in zip(A.indptr, A.indptr[1:], strict=False)
    ]
    right = [rational(v) for v in np.random.default_rng(2).standard_normal(300).tolist()]
    x = part("large_systems").large_system(rows, right)
    assert ExactRows.of(A).products(x) == right
    assert (CHECKER / "large_systems.py").is_file()
