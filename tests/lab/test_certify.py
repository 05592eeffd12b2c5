"""Certificates of answers: exact solutions, and the program that proves them again without cpbench."""

from __future__ import annotations

import ast
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from certificate_checks import CHECKER, REFUSALS, SEEDS, check, checked, reseal, save_and_check
from command_line import cpbench as command

import cpbench
from cpbench.errors import PointError
from cpbench.formulations import AVI, LCP, MLCP, QP, Relay
from cpbench.formulations.base import Problem
from cpbench.formulations.local_contact import FrictionContact

flint = pytest.importorskip("flint", reason="certificates need python-flint")
from cpbench_lab.certificates.exact_rows import ExactRows, blocks, rational, solve  # noqa: E402
from cpbench_lab.certifying import save_certificate  # noqa: E402


def planted(node: str, seed: int) -> tuple[Problem, np.ndarray]:
    """A problem of whole numbers over powers of two with a planted answer, which is exact: no rounding anywhere."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 12)), int(rng.integers(1, 5))
    z = rng.integers(1, 9, n) / 8.0 * (rng.random(n) < 0.6)
    z[0] = 0.5
    w = rng.integers(1, 9, n) / 4.0 * (z == 0) * (rng.random(n) < 0.8)  # some pairs are both 0
    A = rng.integers(-4, 5, (n, n)).astype(float)
    M = A @ A.T + np.eye(n)
    if node == "lcp":
        return LCP(M=M, q=w - M @ z), z
    if node == "relay":
        return Relay(M=M, q=w - M @ z, lb=np.zeros(n), ub=np.full(n, 2.0)), z
    if node == "mlcp":
        u, C = rng.integers(-4, 5, m) / 2.0, rng.integers(-3, 4, (m, n)).astype(float)
        E = 8.0 * np.eye(m)
        return MLCP(A=E, B=M, C=C, D=-C.T, a=-E @ u - C @ z, b=w + C.T @ u - M @ z), np.concatenate([u, z])
    G = rng.integers(-3, 4, (m, n)).astype(float)
    lam = rng.integers(0, 4, m) / 2.0
    b = G @ z - (lam == 0)
    p = w + G.T @ lam - M @ z
    bounds = {"lb": np.zeros(n), "ub": np.full(n, np.inf)}
    if node == "avi":
        none = {"C": np.zeros((0, n)), "d": np.zeros(0)}
        return AVI(M=M, q=p, A=G, b=b, **none, **bounds), np.concatenate([z, lam])
    return QP.build(M, p, G, b, **bounds), np.concatenate([z, lam, w])


NODES = pytest.mark.parametrize("node", ["lcp", "relay", "mlcp", "avi", "qp"])


@NODES
@SEEDS
def test_a_planted_answer_is_proved_and_proved_again(node: str, seed: int, tmp_path: Path) -> None:
    problem, x = planted(node, seed)
    rng = np.random.default_rng(seed)
    certificate = cpbench.certify(problem, x + 1e-9 * rng.standard_normal(x.size) * (x != 0))
    assert certificate.level == "proved", certificate.reason
    assert 0 < certificate.distance < 1e-7
    assert certificate.unique in ("P-matrix", "positive definite")
    save_and_check(certificate, problem, tmp_path)


def plane(seed: int) -> tuple[FrictionContact, np.ndarray]:
    """Contacts in the plane, open, sticking and sliding both ways, by powers of two; W is dominant."""
    rng = np.random.default_rng(seed)
    states = rng.integers(0, 4, int(rng.integers(1, 7)))
    nc = states.size
    A = rng.integers(-2, 3, (2 * nc, 2 * nc)).astype(float)
    W = A @ A.T + 4 * np.eye(2 * nc)
    mu = np.full(nc, 0.5)
    r, u = np.zeros((nc, 2)), np.zeros((nc, 2))
    r[states > 0, 0] = 4.0
    r[states == 1, 1] = 1.0
    r[states == 2, 1], u[states == 2, 1] = 2.0, -1.0
    r[states == 3, 1], u[states == 3, 1] = -2.0, 3.0
    u[states == 0] = [2.0, -1.0]
    return FrictionContact(W=W, q=u.ravel() - W @ r.ravel(), mu=mu, dimension=2), r.ravel()


@SEEDS
@pytest.mark.parametrize("sparse", [False, True], ids=["dense", "sparse"])
def test_contacts_in_the_plane_are_proved(seed: int, sparse: bool, tmp_path: Path) -> None:
    problem, r = plane(seed)
    if sparse:
        problem = FrictionContact(W=sp.csr_array(problem.W), q=problem.q, mu=problem.mu, dimension=2)
    certificate = cpbench.certify(problem, r)
    assert (certificate.level, certificate.distance) == ("proved", 0.0)
    save_and_check(certificate, problem, tmp_path)


def test_the_exact_solution_is_not_the_nearest_double() -> None:
    """M = (1+ε, −1; −1, 1) is nearly singular: the answer (2, 3), off in its residual by ε = 1e-12 of the constants, is
    50 % off the solution (1, 2). By constants that are ε themselves it is no answer."""
    M = np.array([[1.0 + 2.0**-40, -1.0], [-1.0, 1.0]])
    problem = LCP(M=M, q=np.array([1.0 - 2.0**-40, -1.0]))
    certificate = cpbench.certify(problem, [2.0, 3.0])
    assert certificate.level == "distant"
    assert certificate.distance == pytest.approx(0.5, abs=1e-12)  # exact arithmetic by hand
    assert cpbench.verify(problem, [2.0, 3.0], tolerance=1e-9).solved
    small = LCP(M=M, q=np.array([-(2.0**-40), 0.0]))  # its solution is (1, 1)
    assert cpbench.certify(small, [2.0, 2.0]).distance == pytest.approx(1.0, abs=1e-12)
    assert not cpbench.verify(small, [2.0, 2.0], tolerance=1e-9).solved


def test_wrong_pairs_are_pivoted_right() -> None:
    problem, z = planted("lcp", 3)
    wrong = np.where(z > 0, z, 1e-3)  # every unknown is said to be positive
    certificate = cpbench.certify(problem, wrong)
    assert certificate.level == "distant"
    assert certificate.distance == pytest.approx(np.abs(wrong - z).max() / z.max())


def test_a_singular_active_set_is_proved_on_its_face(tmp_path: Path) -> None:
    """z₁ + z₂ = 1, a segment of solutions: what is redundant stays where the answer has it."""
    problem = LCP(M=np.ones((2, 2)), q=[-1.0, -1.0])
    certificate = cpbench.certify(problem, [0.3, 0.7])
    assert certificate.level == "proved"
    assert certificate.distance < 1e-15
    assert certificate.unique == ""
    save_and_check(certificate, problem, tmp_path)


def test_a_p_matrix_says_nothing_over_a_polyhedron() -> None:
    """M = (1, −4; 0, 1) is a P-matrix; on z₁ = z₂ ≥ 0, z·Mz = −2z₁², and (0, 0) and (½, ½) both solve it."""
    M, q = np.array([[1.0, -4.0], [0.0, 1.0]]), np.array([0.5, 0.5])
    problem = AVI(
        M=M, q=q, A=np.zeros((0, 2)), b=np.zeros(0), C=np.array([[1.0, -1.0]]), d=np.zeros(1), lb=np.zeros(2),
        ub=np.full(2, np.inf),
    )  # fmt: skip
    for z, mu in ((0.0, 0.5), (0.5, -1.0)):
        certificate = cpbench.certify(problem, [z, z, mu])
        assert (certificate.level, certificate.unique) == ("proved", "")


def test_an_answer_of_the_wrong_size_is_refused() -> None:
    with pytest.raises(PointError):
        cpbench.certify(LCP(M=[[1.0]], q=[-1.0]), [1.0, 2.0])


@SEEDS
def test_exact_systems_are_solved(seed: int) -> None:
    """Sparse systems in any order of their blocks, against products over the rationals."""
    rng = np.random.default_rng(seed)
    n = 20
    dense = np.triu(rng.standard_normal((n, n)) * (rng.random((n, n)) < 0.3), 1) + np.diag(rng.standard_normal(n))
    dense[:4, :4] = rng.standard_normal((4, 4)) * 10.0 ** rng.integers(-200, 200)
    K = sp.csr_array(dense[rng.permutation(n)][:, rng.permutation(n)])
    exact, x, b = ExactRows.of(K), [rational(0.0)] * n, [rational(v) for v in rng.standard_normal(n).tolist()]
    found = blocks(K, np.arange(n))
    assert len(found) > 1
    whole = [[rational(float(v)) for v in row] for row in K.toarray()]
    for rows, columns in found:
        sides = [b[i] - sum((whole[i][j] * x[j] for j in range(n)), rational(0.0)) for i in rows]
        part = solve(exact, rows, columns, sides)
        assert part is not None
        for j, value in zip(columns, part, strict=True):
            x[j] = value
    products = [sum((a * v for a, v in zip(row, x, strict=True)), rational(0.0)) for row in whole]
    assert products == b


# ------------------------------------------------------------------------------------------ tampering


def _forge(own: Any, rng: np.random.Generator) -> str:
    """Change one thing that the proof rests on; returns which."""
    kind = str(rng.choice(["held", "rows", "distance", "data", "fingerprint", "answer", "unique", "node"]))
    print(kind)  # of a forgery that passes, the last
    if kind == "held":
        held = own["evidence/held"][()]
        at = rng.integers(held.size)
        held[at] = 0.0 if np.isnan(held[at]) else rng.choice([np.nan, held[at] + 1.0])
        own["evidence/held"][...] = held
    elif kind == "rows":
        rows = own["evidence/rows"][()]
        rows[rng.integers(rows.size)] += rng.choice([-1, 1, 100])
        own["evidence/rows"][...] = rows
    elif kind == "distance":
        own.attrs["distance"] = own.attrs["distance"] * 0.9
    elif kind == "data":
        vector = own["data/q"][()]
        vector[rng.integers(vector.size)] += 2.0 ** -int(rng.integers(0, 40))
        own["data/q"][...] = vector
    elif kind == "fingerprint":
        own.attrs["fingerprint"] = own.attrs["fingerprint"][::-1]
    elif kind == "answer":
        answer = own["answer"][()]
        answer[rng.integers(answer.size)] += 0.5
        own["answer"][...] = answer
    elif kind == "unique":
        own.attrs["unique"] = "P-matrix"
    else:
        own.attrs["node"] = "relay"
    return kind


@pytest.mark.parametrize("count", [60, pytest.param(1000, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("sealed", [True, False], ids=["sealed again", "as it was"])
def test_every_forgery_is_caught(count: int, sealed: bool, tmp_path: Path) -> None:
    """The problem is M = (1, 2; 2, 1), no P-matrix and not definite, in blocks: only the true certificate passes."""
    rng = np.random.default_rng(count)
    M = np.kron(np.eye(3), [[1.0, 2.0], [2.0, 1.0]])
    z = np.array([3.0, 0.0, 2.0, 0.0, 1.0, 1.0])
    problem = LCP(M=M, q=np.array([-3.0, -5.0, -2.0, -3.0, -3.0, -3.0]))
    certificate = cpbench.certify(problem, z + 1e-9)
    path, forged = tmp_path / "c.h5", tmp_path / "forged.h5"
    save_certificate(certificate, problem, path)
    check(path)
    kinds = set[str]()
    for _ in range(count):
        forged.write_bytes(path.read_bytes())
        with h5py.File(forged, "r+") as file:
            kind = _forge(file["certificate"], rng)
            if sealed:
                reseal(file["certificate"])
        kinds.add(kind)
        with pytest.raises(REFUSALS):
            check(forged)
    assert len(kinds) == 8


def test_the_checker_is_small_and_needs_nothing_of_cpbench() -> None:
    files = list(CHECKER.glob("*.py"))
    imported: set[str] = set()
    for path in files:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                imported |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                imported.add((node.module or "").split(".")[0])
        assert path.read_text().count("\n") <= 200
    own = {path.stem for path in files}
    assert imported - own - set(sys.stdlib_module_names) == {"numpy", "scipy", "h5py", "flint"}


# ---------------------------------------------------------------------------------------- the command


def test_the_command_writes_a_certificate_that_its_program_accepts(tmp_path: Path) -> None:
    name = "builtin/lcp/lcp-planted.h5::spd-20"
    done = command(tmp_path, "certify", name, "-o", "c.h5")
    assert done.returncode == 0, done.stderr
    assert "proved" in done.stdout
    code, told = checked(tmp_path / "c.h5")
    assert (code, "the only one" in told) == (0, True), told
    (tmp_path / "bad.h5").write_bytes((tmp_path / "c.h5").read_bytes())
    with h5py.File(tmp_path / "bad.h5", "r+") as file:
        file["certificate/data/q"][0] += 1.0
    code, told = checked(tmp_path / "bad.h5")
    assert (code, "NOT PROVED" in told) == (1, True), told


def test_the_command_says_what_stops_a_proof(tmp_path: Path) -> None:
    n = 14  # more bases than are looked at
    cpbench.save(LCP(M=-np.eye(n), q=-np.ones(n)), tmp_path / "none.h5")
    np.save(tmp_path / "z.npy", np.full(n, 0.5))
    done = command(tmp_path, "certify", "none.h5", "--answer", "z.npy")
    assert done.returncode == 1
    assert "no proof" in done.stdout


# --------------------------------------------------------------------------------- degenerate systems


def crossing(extra: float) -> QP:
    """min ½‖z‖² over z₁ ≥ 1, z₂ ≥ 1, z₁ + z₂ ≥ 2 + extra: three sides through (nearly) one point."""
    A = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    return QP.build(np.eye(2), np.zeros(2), A, np.array([1.0, 1.0, 2.0 + extra]))


@pytest.mark.parametrize("extra", [0.0, 2.0**-51, -(2.0**-51)])
def test_sides_that_nearly_meet_in_a_point_are_told_apart(extra: float, tmp_path: Path) -> None:
    """All three multipliers are positive in the answer; exactly, only those of sides that bind are."""
    problem = crossing(extra)
    certificate = cpbench.certify(problem, np.array([1.0, 1.0, 0.3, 0.3, 0.7, 0.0, 0.0]))
    assert certificate.level == "proved", certificate.reason
    assert certificate.distance <= 2.0**-51
    save_and_check(certificate, problem, tmp_path)
