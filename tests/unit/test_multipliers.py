"""Answers without multipliers: completed where multipliers exist, marked, and measured as any other answer."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import planted
import planted_conic
import planted_contact
import planted_nonlinear
import pytest
import scipy.sparse as sp
from command_line import cpbench as command
from planted_nonlinear import graph as formula
from tiers import some_by_day

import cpbench
from cpbench import storage
from cpbench.bench.multipliers import COMPLETED, completed
from cpbench.errors import PointError
from cpbench.formulations import NLP, QP, VI, ConeQP, Point, Problem
from cpbench.formulations.primal import Primal
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.verification import judge

LINEAR = ProductCone.of((Cone.NONNEGATIVE, 1, 4), (Cone.ZERO, 1, 2), (Cone.FREE, 1, 1))


def cases() -> dict[str, tuple[Problem, Point]]:
    """Planted answers to every formulation with multipliers."""
    found: dict[str, tuple[Problem, Point]] = {}
    for seed in range(2):
        for sparse in (False, True):
            rng = np.random.default_rng(seed)
            name = f"{seed}{'-sparse' if sparse else ''}"
            found[f"qp-{name}"] = planted.qp(rng, 7, 4, 2, sparse=sparse)
            found[f"coneqp-{name}"] = planted_conic.coneqp(rng, 6, LINEAR, sparse=sparse)
            found[f"avi-{name}"] = planted_conic.avi(rng, 6, 3, 2, sparse=sparse)
            found[f"vi-{name}"] = planted_nonlinear.vi(rng, 6, m=2, k=1, p=2, sparse=sparse)
        found[f"nlp-{seed}"] = planted_nonlinear.nlp(np.random.default_rng(seed), 6, 3, 1)
    return found


CASES = cases()


def alone(problem: Problem, point: Point) -> Primal:
    return Primal(problem.primal, getattr(point, problem.primal))


@pytest.mark.parametrize("name", CASES)
def test_the_unknowns_of_a_right_answer_get_multipliers_and_those_of_a_wrong_one_do_not(name: str) -> None:
    problem, point = CASES[name]
    whole = completed(problem, alone(problem, point))
    assert judge(problem, whole, 1e-10).within, judge(problem, whole, 1e-10)
    x = getattr(point, problem.primal)
    for j in range(x.size):
        moved = x.copy()
        moved[j] += 0.01 * max(abs(x[j]), 0.1)
        assert not judge(problem, completed(problem, Primal(problem.primal, moved)), 1e-6).within, f"component {j}"


def test_multipliers_that_are_unique_are_found_with_their_signs() -> None:
    """min ½|z|² − 3z₃ with z₁ ≥ 1, z₁ + z₂ = 3, z₃ ≤ 2, z₄ = −1: λ = 0 at z = (1.5, 1.5, 2, −1), by hand."""
    problem = QP.build(
        Q=np.eye(4), p=[0.0, 0.0, -3.0, 0.0], A=[[1.0, 0.0, 0.0, 0.0]], b=[1.0], C=[[1.0, 1.0, 0.0, 0.0]], d=[3.0],
        lb=[-np.inf, -np.inf, 0.0, -1.0], ub=[np.inf, np.inf, 2.0, -1.0],
    )  # fmt: skip
    found = completed(problem, Primal("z", np.array([1.5, 1.5, 2.0, -1.0])))
    np.testing.assert_allclose(found.lam, [0.0], atol=1e-14)
    np.testing.assert_allclose(found.mu, [1.5], atol=1e-14)
    np.testing.assert_allclose(found.nu, [0.0, 0.0, -1.0, -1.0], atol=1e-14)


def test_rows_that_say_the_same_share_a_multiplier() -> None:
    """A vertex of the plane at which five rows meet, two of them equal, and an equality that is stated twice."""
    A = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 1.0]])
    problem = QP.build(Q=np.zeros((2, 2)), p=[1.0, 2.0], A=A, b=A @ np.ones(2))
    assert judge(problem, completed(problem, Primal("z", np.ones(2))), 1e-12).within
    twice = QP.build(Q=np.eye(2), p=[0.0, 0.0], C=[[1.0, 1.0], [2.0, 2.0]], d=[2.0, 4.0])
    assert judge(twice, completed(twice, Primal("z", np.ones(2))), 1e-12).within


def test_where_no_multipliers_exist_none_are_found() -> None:
    """min z₁ on the point z₁² ≤ 0: the minimum 0 has no multipliers; and a saddle gets those of a stationary point."""
    point = NLP(f=formula(1, lambda z: z[0]), g=formula(1, lambda z: -z * z), convex=True)
    assert not judge(point, completed(point, Primal("z", np.zeros(1))), 1e-3).within
    saddle = QP.build(Q=np.diag([1.0, -1.0]), p=np.zeros(2), lb=[-1, -1], ub=[1, 1])
    verdict = cpbench.verify(saddle, [0.0, 0.0])
    assert verdict.flags == ("stationary", COMPLETED)
    assert not verdict


@pytest.mark.parametrize("seed", range(3))
def test_units_of_the_unknowns_and_of_the_rows_do_not_matter(seed: int) -> None:
    """Columns and rows times powers of two, which round nothing: still right to 1e-10."""
    problem, point = planted.qp(np.random.default_rng(seed), 7, 4, 2)
    rng = np.random.default_rng(seed)
    D, E, G = (2.0 ** rng.integers(-20, 21, n) for n in (7, 4, 2))
    other = QP(
        Q=D[:, None] * problem.Q * D, p=D * problem.p, A=E[:, None] * problem.A * D, b=E * problem.b,
        C=G[:, None] * problem.C * D, d=G * problem.d, lb=problem.lb / D, ub=problem.ub / D,
    )  # fmt: skip
    assert judge(other, completed(other, Primal("z", point.z / D)), 1e-10).within


def test_what_cannot_be_completed_is_refused_in_one_line() -> None:
    ball = ConeQP.over(np.eye(3), np.ones(3), ProductCone.of((Cone.SECOND_ORDER, 1, 3, 1.0)))
    with pytest.raises(PointError, match="give y too"):
        cpbench.verify(ball, np.zeros(3))
    inside = VI(F=formula(3, lambda z: z), A=np.ones((1, 3)), b=[0.0], **cpbench_cone())
    with pytest.raises(PointError, match="give all of z, lam, mu"):
        cpbench.verify(inside, np.zeros(3))
    large = QP.build(Q=sp.eye_array(4000, format="csr"), p=np.zeros(4000), lb=np.zeros(4000), ub=np.ones(4000))
    with pytest.raises(PointError, match="8000 multipliers of 4000 unknowns are too many"):
        cpbench.verify(large, np.zeros(4000))
    with pytest.raises(PointError, match="has 5 numbers, expected 7"):
        cpbench.verify(CASES["qp-0"][0], np.zeros(5))
    contact, _ = planted_contact.gfc(np.random.default_rng(0), 2, 1, 0, 3)
    with pytest.raises(PointError, match="expected"):
        cpbench.verify(contact, np.zeros(contact.f.size))


def cpbench_cone() -> dict[str, list[float]]:
    return {"cone_kind": [float(Cone.SECOND_ORDER)], "cone_size": [3.0], "cone_mu": [1.0], "cone_mu_r": [0.0]}


# ------------------------------------------------------------------------------------------------- files


@pytest.fixture
def asked(tmp_path: Path) -> Path:
    storage.save_pack({name: CASES[name][0] for name in ("qp-0", "qp-1", "avi-0", "nlp-0")}, tmp_path / "asked.h5")
    return tmp_path / "asked.h5"


@pytest.mark.parametrize("form", ["z.npy", "z.csv", "z.txt", "one.npz", "named.npz", "z.h5"])
def test_verify_takes_the_unknowns_alone_and_says_so(tmp_path: Path, asked: Path, form: str) -> None:
    point = CASES["qp-0"][1]
    for z, code in ((point.z, 0), (1.01 * point.z, 1)):
        file = tmp_path / form
        if form.endswith(".npy"):
            np.save(file, z)
        elif form.endswith(".npz"):
            np.savez(file, **{"z" if form == "named.npz" else "x": z})
        elif form.endswith(".h5"):
            with h5py.File(file, "w") as root:
                root.create_dataset("solution/z", data=z)
        else:
            np.savetxt(file, z, fmt="%.17g")
        done = command(tmp_path, "verify", f"{asked}::qp-0", "--answer", form)
        assert done.returncode == code, done.stderr
        assert "the answer is z alone: its multipliers (lam, mu, nu) were computed by cpbench" in done.stdout
        assert f"flags   {COMPLETED}" in done.stdout


def test_a_part_of_the_wrong_length_is_one_line(tmp_path: Path, asked: Path) -> None:
    np.savez(tmp_path / "z.npz", z=np.zeros(6))
    with h5py.File(tmp_path / "z.h5", "w") as root:
        root.create_dataset("solution/z", data=np.zeros(6))
    for file in ("z.npz", "z.h5"):
        done = command(tmp_path, "verify", f"{asked}::qp-0", "--answer", file)
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
        assert "z has 6 numbers, expected 7" in done.stderr


# -------------------------------------------------------------------------------------------- real files

SMALL = ("HS118", "QAFIRO", "QSC205", "QSHARE2B", "QADLITTL", "QPCBLEND", "PRIMALC1", "DUALC2", "QBRANDY", "QBORE3D")


@pytest.mark.parametrize("name", some_by_day(SMALL, 4))
def test_real_programs(shared_data: Path, name: str) -> None:
    """z of Clarabel at 1e-10 gets multipliers that are as good as its own, and a coordinate 1 % off gets none.

    Clarabel compares the gap with at least 1, which the objective of QSC205, −0.0058, is not.
    """
    pytest.importorskip("clarabel")
    problem = storage.load(shared_data / "qp" / f"{name}.mat")
    found = cpbench.solve(problem, "clarabel", tolerance=1e-10)
    assert found.error < 1e-7, found
    assert cpbench.verify(problem, found.point.z).error <= max(found.error, 1e-10)
    z = found.point.z.copy()
    z[int(np.argmax(np.abs(z)))] *= 1.01
    assert not cpbench.verify(problem, z).within
