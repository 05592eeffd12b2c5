"""Siconos text: column-major matrices, both MLCP layouts, detection and its limits; compared with Siconos itself."""

from __future__ import annotations

import dataclasses
import json
import logging
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import (
    AVI,
    LCP,
    MLCP,
    SOCLCP,
    FrictionContact,
    GlobalFrictionContact,
    GlobalRollingFrictionContact,
    Relay,
    RollingFrictionContact,
)
from cpbench.formulations.conic import cone_fields
from cpbench.foundation.cones import Cone, ProductCone
from cpbench_problems.formats import siconos_matrix

SYSTEM_PYTHON = "/usr/bin/python3"


def siconos(*pairs: str | Path) -> list[dict[str, Any]]:
    """What Debian's Siconos reads in `kind, file` pairs."""
    if (
        not Path(SYSTEM_PYTHON).exists()
        or subprocess.run([SYSTEM_PYTHON, "-c", "import siconos.numerics"], capture_output=True).returncode
    ):
        pytest.skip("needs Siconos in the system's Python: apt-get install python3-siconos")
    script = Path(__file__).with_name("siconos_read.py")
    done = subprocess.run(
        [SYSTEM_PYTHON, str(script), *map(str, pairs)], capture_output=True, text=True, check=True, timeout=120
    )
    return json.loads(done.stdout.rpartition("VALUES")[2])


def dense(A: Any) -> np.ndarray:
    return A.toarray() if sp.issparse(A) else np.asarray(A)


def ours(problem: Any) -> dict[str, Any]:
    if isinstance(problem, LCP | AVI):
        return {"q": problem.q, "entries": dense(problem.M)}
    if isinstance(problem, Relay):
        return {"q": problem.q, "lb": problem.lb, "ub": problem.ub, "entries": dense(problem.M)}
    if isinstance(problem, SOCLCP):
        ends = np.concatenate([[0], np.cumsum(problem.cone_size)])
        return {"q": problem.q, "mu": problem.cone_mu, "entries": dense(problem.M), "ends": ends}
    if isinstance(problem, MLCP):
        M = np.block([[dense(problem.A), dense(problem.C)], [dense(problem.D), dense(problem.B)]])
        return {"q": np.concatenate([problem.a, problem.b]), "entries": M}
    rolling = {"mu_r": problem.mu_r} if hasattr(problem, "mu_r") else {}
    if isinstance(problem, FrictionContact | RollingFrictionContact):
        return {"q": problem.q, "mu": problem.mu, "entries": dense(problem.W), **rolling}
    assert isinstance(problem, GlobalFrictionContact | GlobalRollingFrictionContact)
    rows = [*dense(problem.M).tolist(), *dense(problem.H).tolist()]
    return {"q": np.concatenate([problem.f, problem.w]), "mu": problem.mu, "entries": rows, **rolling}


def agree(problem: Any, theirs: dict[str, Any]) -> None:
    mine = ours(problem)
    assert mine.keys() == theirs.keys() - {"answer"}
    for key, value in theirs.items():
        if key == "entries":
            assert [list(map(float, row)) for row in mine[key]] == value
        elif key == "answer":
            assert problem.residuals(problem.point_from_vector(value)).measured["natural"] < 1e-9
        else:
            assert mine[key].tolist() == value


REAL = [
    ("lcp", "lcp/lcp_CPS_2.dat"),
    ("lcp", "lcp/lcp_CPS_3.dat"),
    ("lcp", "lcp/lcp_ortiz_block.dat"),
    ("lcp", "lcp/lcp_mmc.dat"),
    ("mlcp", "mlcp/m3n2_mlcp.dat"),
    ("mlcp", "mlcp/diodeBridge_mlcp.dat"),
    ("mlcp", "mlcp/relay3_mlcp.dat"),
    ("fc", "fc2d_local/FC2D_SliderCrankLagrangian00001.dat"),
    ("fc", "fc2d_local/FrictionContactProblem00394.dat"),
    ("fc", "fc3d_local/Rover1040.dat"),
    ("fc", "fc3d_local/Confeti-ex13-4contact-Fc3D-SBM.dat"),
    ("fc", "fc3d_local/OneObject-i1028-138.hdf5.dat"),
    ("gfc", "fc3d_global/GFC3D_Example0_SBM.dat"),
    ("gfc", "fc3d_global/GFC3D_TwoRods1.dat"),
    ("rfc", "rolling_local/RFC3D_sphere_1.dat"),
    ("rfc", "rolling_local/RFC3D_cube_1.dat"),
    ("rfc", "rolling_local/rfc3d_sphere_from_grfc3d_dense.dat"),
    ("relay", "relay/step_1x1.dat"),
    ("relay", "relay/relay_4x4.dat"),
    ("soclcp", "soclcp/Example1_SOCLCP_SBM.dat"),
]


@pytest.mark.nightly
def test_siconos_reads_the_same_numbers(shared_data: Path) -> None:
    theirs = siconos(*(part for kind, file in REAL for part in (kind, shared_data / file)))
    for (_, file), read in zip(REAL, theirs, strict=True):
        agree(storage.load(shared_data / file), read)


def test_siconos_reads_what_we_write(tmp_path: Path, rng: np.random.Generator) -> None:
    n, m = 4, 3
    sparse = sp.csr_array(sp.random_array((6, 6), density=0.4, rng=rng) + sp.eye_array(6) / 3)
    problems: list[tuple[str, Any]] = [
        ("lcp", LCP(M=rng.standard_normal((n, n)), q=rng.standard_normal(n))),
        (
            "mlcp",
            MLCP(
                A=rng.random((n, n)),
                B=rng.random((m, m)),
                C=rng.random((n, m)),
                D=rng.random((m, n)),
                a=rng.random(n),
                b=rng.random(m),
            ),
        ),
        ("fc", FrictionContact(W=rng.random((6, 6)), q=rng.random(6), mu=np.array([0.3, 1 / 3]))),
        ("fc", FrictionContact(W=rng.random((6, 6)), q=rng.random(6), mu=rng.random(3), dimension=2)),
        ("fc", FrictionContact(W=sparse, q=rng.random(6), mu=np.array([0.3, 1 / 3]))),
        (
            "gfc",
            GlobalFrictionContact(
                M=rng.random((5, 5)), H=rng.random((5, 3)), f=rng.random(5), w=rng.random(3), mu=np.array([0.7])
            ),
        ),
        ("avi", AVI(M=rng.random((n, n)), q=rng.random(n))),
        ("relay", Relay(M=rng.random((n, n)), q=rng.random(n), lb=-rng.random(n), ub=rng.random(n))),
        ("relay", Relay(M=sparse, q=rng.random(6), lb=-rng.random(6), ub=rng.random(6))),
    ]
    for d, nc in ((3, 2), (5, 3)):
        size = d * nc
        friction: dict[str, Any] = {"mu": rng.random(nc), "mu_r": rng.random(nc), "dimension": d}
        W = rng.random((size, size))
        problems.append(("rfc", RollingFrictionContact(W=W, q=rng.random(size), **friction)))
        dynamics = {"M": rng.random((6, 6)), "H": rng.random((6, size)), "f": rng.random(6), "w": rng.random(size)}
        problems.append(("grfc", GlobalRollingFrictionContact(**dynamics, **friction)))
    B = rng.standard_normal((9, 9))
    K = ProductCone.of((Cone.SECOND_ORDER, 3, 3, np.array([0.3, 0.7, 2.0])))
    q = 3 * rng.standard_normal(9)
    problems.append(("soclcp", SOCLCP(M=B @ B.T + np.eye(9), q=q, **cone_fields(K))))  # pyright: ignore
    pairs: list[Any] = []
    for k, (kind, problem) in enumerate(problems):
        storage.save(problem, tmp_path / f"{k}.dat")
        pairs += [kind, tmp_path / f"{k}.dat"]
    for (_, problem), read in zip(problems, siconos(*pairs), strict=True):
        agree(problem, read)


@pytest.mark.nightly
def test_tau_is_the_slope_of_the_cone(tmp_path: Path, rng: np.random.Generator) -> None:
    """‖x_T‖ ≤ tau x_N, not ‖x_T‖ ≤ x_N/tau: what Siconos' own solver says of our file."""
    B = rng.standard_normal((6, 6))
    K = ProductCone.of((Cone.SECOND_ORDER, 2, 3, np.array([0.3, 2.0])))
    q = np.array([-1.0, 2, 1, -1, 3, 1])
    problem = SOCLCP(M=B @ B.T + np.eye(6), q=q, **cone_fields(K))  # pyright: ignore
    storage.save(problem, tmp_path / "a.dat")
    (read,) = siconos("soclcp", tmp_path / "a.dat")
    point = problem.point_from_vector(read["answer"])
    assert problem.residuals(point).error < 1e-9
    assert dataclasses.replace(problem, cone_mu=1 / problem.cone_mu).residuals(point).error > 0.01


def test_our_files_say_what_they_are(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Kinds that no layout tells apart come back as what they are, and as anything else that fits when asked."""
    rolling = RollingFrictionContact(W=np.eye(3), q=np.ones(3), mu=np.ones(1), mu_r=np.ones(1), dimension=3)
    none = dataclasses.replace(rolling, W=np.zeros((0, 0)), q=[], mu=[], mu_r=[])
    free = AVI(M=np.eye(2), q=np.ones(2))
    for k, problem in enumerate((rolling, none, free)):
        path = tmp_path / f"{k}.dat"
        storage.save(problem, path)
        assert storage.load(path).fingerprint == problem.fingerprint
    assert not caplog.records
    assert storage.load(tmp_path / "2.dat", format="siconos-lcp").node == "lcp"
    unsigned = (tmp_path / "2.dat").read_text().rpartition("cpbench")[0]
    (tmp_path / "3.dat").write_text(unsigned)
    assert storage.load(tmp_path / "3.dat").node == "lcp"
    assert storage.load(tmp_path / "3.dat", format="siconos-avi").node == "avi"
    assert "no place for the set X of an AVI" in caplog.text
    (tmp_path / "4.dat").write_text(f"{unsigned}cpbench siconos-relay\n")
    with pytest.raises(FormatError, match="lb: holds something that is not a number"):
        storage.load(tmp_path / "4.dat")


def test_a_guess_of_few_numbers_is_on_the_side_of_plain_friction(tmp_path: Path) -> None:
    (tmp_path / "none.dat").write_text("3 0 0 0 0 0 0\n")
    assert storage.load(tmp_path / "none.dat").node == "fc"
    assert storage.load(tmp_path / "none.dat", format="siconos-rfc2d").node == "rfc"
    (tmp_path / "global.dat").write_text("3 0 0 1 1 1 1 2.0 0 1 0 1 0 5.0\n")
    assert storage.load(tmp_path / "global.dat").node == "gfc"
    (tmp_path / "flag.dat").write_text(f"{FC}0.3 1\n")
    assert storage.load(tmp_path / "flag.dat").node == "fc"
    assert storage.load(tmp_path / "flag.dat", format="siconos-rfc2d").node == "rfc"
    (tmp_path / "rolling.dat").write_text("3 1 0 1 1 1 1 2.0 0 1 3 1 3 1. 2. 3. 5. 0. 0. 0. 0.3 0.1\n")
    problem: Any = storage.load(tmp_path / "rolling.dat")
    assert (problem.node, problem.dimension, problem.mu_r.tolist()) == ("grfc", 3, [0.1])


def test_dense_matrices_are_column_major(shared_data: Path) -> None:
    """Cottle, Pang and Stone, example 4.4.7."""
    problem = storage.load(shared_data / "lcp" / "lcp_CPS_2.dat")
    assert isinstance(problem, LCP)
    assert dense(problem.M).tolist() == [[0, -1, 2], [2, 0, -2], [-1, 1, 0]]
    assert problem.q.tolist() == [-3, 6, -1]


def test_both_mlcp_layouts_say_the_same(tmp_path: Path, shared_data: Path) -> None:
    tokens = (shared_data / "mlcp" / "m3n2_mlcp.dat").read_text().split()
    n, m = 2, 3
    blocks, matrix = 3 + 2, 5 + 25 + 5
    abcd = tokens[4 + blocks + matrix :][: 25 + 5]
    (tmp_path / "abcd.dat").write_text(" ".join(["0", "1", "2", "3", *abcd]))
    (tmp_path / "m.dat").write_text(" ".join(["1", "0", *tokens[2 : 4 + blocks + matrix]]))
    (tmp_path / "old.dat").write_text(" ".join([str(n), str(m), str(n + m), *abcd]))
    found = [storage.load(tmp_path / name) for name in ("abcd.dat", "m.dat", "old.dat")]
    reference = storage.load(shared_data / "mlcp" / "m3n2_mlcp.dat")
    assert [p.node for p in found] == ["mlcp"] * 3
    assert {p.fingerprint for p in found} == {reference.fingerprint}


def test_mlcp_blocks_in_any_order(tmp_path: Path) -> None:
    """Complementarity rows first: rows and columns are sorted into equalities and complementarities."""
    M = np.arange(9.0).reshape(3, 3)
    text = "1 0\n1 2\n0 2 3\n1 0\n0\n3\n3\n3 3\n" + " ".join(map(str, M.T.ravel())) + "\n10 20 30\n"
    (tmp_path / "a.dat").write_text(text)
    p = storage.load(tmp_path / "a.dat")
    assert isinstance(p, MLCP)
    assert dense(p.A).tolist() == [[8]]
    assert dense(p.B).tolist() == [[0, 1], [3, 4]]
    assert dense(p.C).tolist() == [[6, 7]]
    assert dense(p.D).tolist() == [[2], [5]]
    assert (p.a.tolist(), p.b.tolist()) == ([30], [10, 20])


FC = "3\n1\n0\n3\n3\n3 3\n1 0 0 0 2 0 0 0 3\n-1 0.5 0\n"


@pytest.mark.parametrize("end", ["", "0", "1\n", "\nsome text with 3 numbers 4 5", "0 solved in 1999"])
def test_what_may_follow_the_last_number(end: str, tmp_path: Path) -> None:
    (tmp_path / "a.dat").write_text(f"{FC}0.3\n{end}")
    assert storage.load(tmp_path / "a.dat").node == "fc"


@pytest.mark.parametrize(
    ("end", "reason"),
    [
        ("0.5", "fits the layouts of plasticity as older files have it and siconos-rfc2d: say which with --format"),
        ("1.0", "fits the layouts of plasticity as older files have it and siconos-rfc2d"),
        ("2", "fits the layouts of plasticity as older files have it and siconos-rfc2d"),
        ("0.1 0.2 0.3", "has more than 1 numbers after the last one .*, nearest siconos-rfc2d"),
    ],
)
def test_other_numbers_after_the_last_are_refused(end: str, reason: str, tmp_path: Path) -> None:
    """A file of 2D rolling friction is one of FC3D with mu_r behind it, and like one of plasticity of old."""
    (tmp_path / "a.dat").write_text(f"{FC}0.3\n{end}\n")
    with pytest.raises(FormatError, match=reason):
        storage.load(tmp_path / "a.dat")
    if " " not in end:
        rolling: Any = storage.load(tmp_path / "a.dat", format="siconos-rfc2d")
        assert (rolling.node, rolling.dimension, rolling.mu_r.tolist()) == ("rfc", 3, [float(end)])
    with pytest.raises(
        FormatError, match=r"end: has (more than )?[13] (more )?numbers after the last one of this layout"
    ):
        storage.load(tmp_path / "a.dat", format="siconos-fc3d")


def test_a_name_is_no_evidence_and_a_format_is_strict(tmp_path: Path) -> None:
    (tmp_path / "lcp_one.dat").write_text(f"{FC}0.3\n")
    assert storage.load(tmp_path / "lcp_one.dat").node == "fc"
    with pytest.raises(FormatError, match="M: is 0x3, expected 3x3"):
        storage.load(tmp_path / "lcp_one.dat", format="siconos-lcp")
    with pytest.raises(FormatError, match="d: is 3, expected 2"):
        storage.load(tmp_path / "lcp_one.dat", format="siconos-fc2d")


def test_bad_data_in_a_layout_that_fits(tmp_path: Path) -> None:
    for text, reason in (
        (f"{FC}-0.3", r"mu: is negative at contact 0: -0\.3$"),
        (FC.replace("0.5", "nan") + "0.3", "q: "),
    ):
        (tmp_path / "a.dat").write_text(text)
        with pytest.raises(FormatError, match=reason):
            storage.load(tmp_path / "a.dat")


def test_sparse_text_warns_of_six_digits_once(
    tmp_path: Path, shared_data: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file = shared_data / "fc2d_global" / "gfc2d_granularflowonwall_00069_00350.dat"
    siconos_matrix._warned.clear()
    with caplog.at_level(logging.WARNING, "cpbench.storage"):
        first = storage.load(file)
        storage.load(file)
    assert sum("6 digits" in r.getMessage() for r in caplog.records) == 1
    caplog.clear()
    storage.save(first, tmp_path / "again.dat")  # its numbers have 6 digits, ours are written with all they have
    assert storage.load(tmp_path / "again.dat").fingerprint == first.fingerprint


def test_compressed_and_half_sparse_text(tmp_path: Path) -> None:
    """CSC and CSR as CSparse prints them, and half of a symmetric triplet."""
    heading = "CSparse Version 3.1.9, May 4, 2016.  Copyright (c) Timothy A. Davis, 2006-2016\n"
    lines = "    {0} 0 : locations 0 to 0\n      0 : 2\n    {0} 1 : locations 1 to 2\n      0 : 5\n      1 : 3\n"
    matrices = {
        "2\n" + heading + "2-by-2, nzmax: 3 nnz: 3, 1-norm: 8\n" + lines.format("col"): [[2, 5], [0, 3]],
        "3\n" + heading + "csr: 2-by-2, nzmax: 3 nnz: 3, 1-norm: 8\n" + lines.format("row"): [[2, 0], [5, 3]],
        "4\n" + heading + "triplet: 2-by-2, nzmax: 3 nnz: 3\n    0 0 : 2\n    0 1 : 5\n    1 1 : 3\n": [[2, 5], [5, 3]],
    }
    for text, M in matrices.items():
        (tmp_path / "a.dat").write_text(f"2\n2\n2\n2\n{text} -1 -2\n")
        problem = storage.load(tmp_path / "a.dat")
        assert isinstance(problem, LCP)
        assert dense(problem.M).tolist() == M
        assert sp.issparse(problem.M)
