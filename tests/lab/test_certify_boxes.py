"""Boxes that hold a solution: contact in space, nonlinear problems, and the program that checks them again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from certificate_checks import REFUSALS, SEEDS, check, part, reseal, save_and_check

import cpbench
from cpbench.formulations import NCP, Equation, MiCP
from cpbench.formulations.base import Problem
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.map import Builder
from cpbench.formulations.expressions.operators import NUMPY, Operator
from cpbench.formulations.global_contact import GlobalFrictionContact
from cpbench.formulations.local_contact import FrictionContact

flint = pytest.importorskip("flint", reason="certificates need python-flint")
from cpbench_lab.certificates import krawczyk, map_balls  # noqa: E402
from cpbench_lab.certificates.affine_parts import dependent_rows  # noqa: E402
from cpbench_lab.certificates.redundant import implied  # noqa: E402
from cpbench_lab.certifying import save_certificate  # noqa: E402


def space(seed: int, *, touching: bool = False) -> tuple[FrictionContact, np.ndarray]:
    """Contacts in space with planted states, Pythagorean directions, so that the answer is exact in doubles."""
    rng = np.random.default_rng(seed)
    nc = int(rng.integers(1, 8))
    A = rng.integers(-2, 3, (3 * nc, 3 * nc)).astype(float)
    W, mu = A @ A.T + 4 * np.eye(3 * nc), np.full(nc, 0.5)
    r, u = np.zeros((nc, 3)), np.zeros((nc, 3))
    for c, state in enumerate(rng.integers(0, 3, nc)):
        if state == 0:
            u[c] = [2.0, 1.0, -3.0]
        elif state == 1:
            r[c] = [8.0, 1.0, -2.0]
        else:
            r[c], u[c] = [10.0, 3.0, 4.0], [0.0, -0.75, -1.0]
    if touching:
        r[0] = u[0] = 0.0
    return FrictionContact(W=W, q=u.ravel() - W @ r.ravel(), mu=mu), r.ravel()


@SEEDS
def test_planted_contacts_are_enclosed_and_checked_again(seed: int, tmp_path: Path) -> None:
    problem, r = space(seed)
    noise = 1e-8 * np.random.default_rng(seed).standard_normal(r.size) * (r != 0)
    certificate = cpbench.certify(problem, r + noise)
    assert certificate.level == "enclosed", certificate.reason
    off = np.abs(noise).max() / (np.abs(r).max() or 1.0)
    assert certificate.distance == pytest.approx(off, abs=1e-14)
    centre, radius = certificate.evidence["centre"], certificate.evidence["radius"]
    assert (np.abs(centre.sum(axis=1) - r) <= 1.5 * radius + 1e-20).all()  # the planted answer is within
    save_and_check(certificate, problem, tmp_path)


@SEEDS
def test_a_touching_contact_is_proved_by_the_exact_point(seed: int, tmp_path: Path) -> None:
    """r = 0 and u = 0: no box can tell which state it has, unless all contacts are open."""
    problem, r = space(seed, touching=True)
    certificate = cpbench.certify(problem, r + 1e-9)
    if r.any():
        assert (certificate.level, list(certificate.evidence)) == ("proved", ["point"])
        assert (certificate.evidence["point"] == r).all()
    assert certificate
    save_and_check(certificate, problem, tmp_path)


def test_wrong_states_are_changed() -> None:
    """A single contact on which q presses: the answer says that it is open."""
    problem = FrictionContact(W=2 * np.eye(3), q=np.array([-2.0, 1.0, 0.0]), mu=np.array([0.25]))
    certificate = cpbench.certify(problem, [0.0, 0.0, 0.0])
    assert certificate.level == "distant"
    # r_N = 1, r_T = −¼ e₁, u_T = ½ e₁ by hand
    assert certificate.evidence["centre"][:, 0] == pytest.approx([1.0, -0.25, 0.0])
    assert certificate.distance == pytest.approx(1.0)


def stack(supports: int) -> tuple[GlobalFrictionContact, np.ndarray]:
    """A body of mass 2 on so many points with gravity along the normal: hyperstatic from two on."""
    M = 2.0 * np.eye(3)
    H = np.hstack([np.eye(3)] * supports)
    problem = GlobalFrictionContact(
        M=sp.csr_array(M), H=sp.csr_array(H), G=sp.csr_array((3, 0)), f=np.array([-4.0, 0.5, 0.0]),
        w=np.zeros(3 * supports), b=np.zeros(0), mu=np.full(supports, 0.5),
    )  # fmt: skip
    share = np.tile([4.0 / supports, -0.5 / supports, 0.0], supports)
    return problem, np.concatenate([np.zeros(3), share])


@pytest.mark.parametrize("supports", [1, 2, 5])
def test_hyperstatic_supports_are_proved_with_forces_held(supports: int, tmp_path: Path) -> None:
    problem, x = stack(supports)
    certificate = cpbench.certify(problem, x + 1e-10)
    assert certificate.level == "enclosed", certificate.reason
    assert certificate.evidence["dropped"].size == 3 * (supports - 1)
    save_and_check(certificate, problem, tmp_path)
    with h5py.File(tmp_path / "c.h5", "r+") as file:
        own: Any = file["certificate"]
        if not certificate.evidence["dropped"].size:
            return
        own["evidence/dropped"][0] = own["evidence/dropped"][0] - 3
        reseal(own)
    check(tmp_path / "c.h5")  # another one of the same equations: still implied, still proved
    with h5py.File(tmp_path / "c.h5", "r+") as file:
        own = file["certificate"]
        own["data/w"][0] = 1.0  # now the supports contradict each other
        reseal(own)
    with pytest.raises(REFUSALS):
        check(tmp_path / "c.h5")


def test_rows_are_implied_exactly_or_not_at_all() -> None:
    rows = sp.csr_array(np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 1.0], [1.0, 3.0, 1.0]]))
    assert len(implied(rows, np.array([1.0, 1.0, 2.0]))) == 1
    assert implied(rows, np.array([1.0, 1.0, 2.0 + 2.0**-51])) == []
    assert implied(sp.csr_array(np.array([[1.0, 0.0], [1.0, 2.0**-60]])), np.zeros(2)) == []


# ------------------------------------------------------------------------------------- nonlinear maps


def chain(operator: Operator) -> Map:
    """F(z) = operator(z₁²·¼ + ½) or operator of it and z₂, and z₂·F for a derivative by both."""
    build = Builder(2)
    square = build.apply(Operator.MUL, 0, 0)
    inner = build.apply(Operator.ADD, build.apply(Operator.MUL, square, build.constant(0.25)), build.constant(0.5))
    if operator is Operator.ACOSH:
        inner = build.apply(Operator.ADD, inner, build.constant(1.0))
    end = build.apply(operator, inner, 1) if operator.binary else build.apply(operator, inner)
    return build.finish([end, build.apply(Operator.MUL, end, 1)])


@pytest.mark.parametrize("operator", list(Operator), ids=lambda operator: operator.name)
def test_balls_hold_what_numpy_computes(operator: Operator) -> None:
    """Values and, by difference quotients in 256 bits, derivatives; the checker's own rules beside ours."""
    map_values = part("map_values")
    F, z = chain(operator), [0.75, 0.3125]
    with krawczyk.digits():
        x = [flint.arb(v) for v in z]
        values = map_balls.values(F, x)
        assert [float(v) for v in values] == pytest.approx(F.evaluate(np.array(z)), rel=1e-13)
        known = np.asarray(NUMPY[operator](0.640625, 0.3125) if operator.binary else None, dtype=float)
        if operator.binary:
            assert float(values[0]) == pytest.approx(float(known), rel=1e-13)
        centre, spread = map_balls.jacobian(F, x, [0, 1])
        step = flint.arb(2) ** -90
        for j in range(2):
            there = map_balls.values(F, [v + step if k == j else v for k, v in enumerate(x)])
            back = map_balls.values(F, [v - step if k == j else v for k, v in enumerate(x)])
            slopes = [float((a - b) / (2 * step)) for a, b in zip(there, back, strict=True)]
            assert centre[:, j] == pytest.approx(slopes, rel=1e-12, abs=1e-14)
        assert (spread <= 1e-14 * np.maximum(np.abs(centre), 1e-3)).all()
        own = {"inputs": np.array(F.inputs), **F.arrays()}
        other = map_values.duals(own, [map_values.DualBall.of(v, k) for k, v in enumerate(x)])
        assert [float(d.v) for d in other] == pytest.approx([float(v) for v in values], rel=1e-15)
        slopes = [[float(d.d.get(j, flint.arb(0))) for j in range(2)] for d in other]
        assert np.array(slopes) == pytest.approx(centre, rel=1e-13, abs=1e-15)


@pytest.mark.parametrize("operator", [Operator.ABS, Operator.MIN, Operator.FLOOR, Operator.LT], ids=lambda op: op.name)
def test_a_kink_or_a_jump_in_the_box_is_not_smooth(operator: Operator) -> None:
    build = Builder(1)
    end = build.apply(operator, 0, build.constant(1.0)) if operator.binary else build.apply(operator, 0)
    F = build.finish([end])
    at = 0.0 if operator is Operator.ABS else 1.0
    _, spread = map_balls.jacobian(F, [flint.arb(at, 1e-9)], [0])
    assert not np.isfinite(spread).all()


def affine(M: np.ndarray, q: np.ndarray) -> Map:
    """Mz + q with z₁³ added to the first row."""
    build = Builder(q.size)
    ends: list[int] = []
    for i, row in enumerate(M):
        end = build.constant(q[i])
        for j, value in enumerate(row):
            end = build.apply(Operator.ADD, end, build.apply(Operator.MUL, build.constant(value), j))
        ends.append(end)
    cube = build.apply(Operator.MUL, 0, build.apply(Operator.MUL, 0, 0))
    ends[0] = build.apply(Operator.ADD, ends[0], cube)
    return build.finish(ends)


def nonlinear(node: str, seed: int) -> tuple[Problem, np.ndarray]:
    """A problem whose answer is of whole halves, exact in doubles; M is definite, so that it is the only one."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8))
    A = rng.integers(-2, 3, (n, n)).astype(float)
    M = A @ A.T + np.eye(n)
    z = rng.integers(1, 5, n) / 2.0 * (rng.random(n) < 0.7)
    z[0] = 1.5
    w = np.where(z == 0, 1.5, 0.0)
    z = z if node == "ncp" else np.where(z == 0, -0.5, z)
    if node == "equation":
        w[:] = 0.0
    q = w - M @ z
    q[0] -= z[0] ** 3
    F = affine(M, q)
    if node == "ncp":
        return NCP(F=F), z
    if node == "equation":
        return Equation(F=F), z
    return MiCP(F=F, lb=np.full(n, -0.5), ub=np.full(n, np.inf)), z


@pytest.mark.parametrize("node", ["ncp", "micp", "equation"])
@SEEDS
def test_nonlinear_answers_are_enclosed_and_checked_again(node: str, seed: int, tmp_path: Path) -> None:
    problem, z = nonlinear(node, seed)
    certificate = cpbench.certify(problem, z + 1e-7)
    assert certificate, certificate.reason
    assert certificate.distance == pytest.approx(1e-7 / np.abs(z).max(), rel=1e-6)
    save_and_check(certificate, problem, tmp_path)


def test_a_double_root_is_proved_where_it_is_exact_only() -> None:
    """(z − 1)² = 0 and (z − 1)² = 2⁻⁴⁰: the first has an exact root, the second two, which a box tells apart."""
    build = Builder(1)
    gap = build.apply(Operator.SUB, 0, build.constant(1.0))
    square = build.apply(Operator.MUL, gap, gap)
    exact = cpbench.certify(Equation(F=build.finish([square])), [1.0 + 1e-6])
    assert (exact.level, exact.distance) == ("proved", pytest.approx(1e-6))
    shifted = build.finish([build.apply(Operator.SUB, square, build.constant(2.0**-40))])
    assert cpbench.certify(Equation(F=shifted), [1.0 + 2.0**-20]).level == "enclosed"
    none = build.finish([build.apply(Operator.ADD, square, build.constant(2.0**-40))])
    refused = cpbench.certify(Equation(F=none), [1.0])
    assert not refused


def test_the_box_of_a_transcendental_equation_holds_its_root() -> None:
    """z = cos z: the Dottie number 0.7390851332151606416553120876738734…, OEIS A003957."""
    build = Builder(1)
    F = build.finish([build.apply(Operator.SUB, 0, build.apply(Operator.COS, 0))])
    certificate = cpbench.certify(Equation(F=F), [0.74])
    with krawczyk.digits():
        (box,) = krawczyk.balls(certificate.evidence["centre"], certificate.evidence["radius"])
        assert box.contains(flint.arb("0.73908513321516064165531208767387340401341175890076"))
    assert certificate.evidence["radius"][0] < 1e-22


def test_rows_of_a_map_depend_on_each_other_exactly() -> None:
    """F₁ = e^z₁ − z₂, F₂ = z₂ − z₃, F₃ = 2e^z₁ − 2z₃ = 2F₁ + 2F₂."""
    build = Builder(3)
    power, two = build.apply(Operator.EXP, 0), build.constant(2.0)
    first = build.apply(Operator.SUB, power, 1)
    second = build.apply(Operator.SUB, 1, 2)
    third = build.apply(Operator.SUB, build.apply(Operator.MUL, two, power), build.apply(Operator.MUL, two, 2))
    F = build.finish([first, second, third])
    assert dependent_rows(F, [0, 1, 2], {}).tolist() == [2]
    assert dependent_rows(F, [0, 1], {}).size == 0
    assert dependent_rows(F, [1, 2], {0: 0.0}).size == 0  # F₃ = 2 − 2z₃ then


# ------------------------------------------------------------------------------------------ tampering


def _forge(own: Any, rng: np.random.Generator, kind: str) -> None:
    """Make a box that cannot be true."""
    if kind == "centre":
        radius, centre = own["evidence/radius"][()], own["evidence/centre"][()]
        at = rng.choice(np.flatnonzero(radius > 0))
        centre[at, 0] += 1e-3 * rng.choice([-1.0, 1.0])
        own["evidence/centre"][...] = centre
    elif kind == "radius":
        radius = own["evidence/radius"][()]
        own["evidence/radius"][...] = radius * rng.choice([0.0, 1e-30, -1.0])
    elif kind == "states":
        states = own["evidence/states"][()]
        at = rng.integers(states.size)
        first = 0 if own.attrs["node"] == b"fc" else -1
        states[at] = (states[at] - first + rng.integers(1, 3)) % 3 + first
        own["evidence/states"][...] = states
    elif kind == "dropped":
        own["evidence"].__delitem__("dropped")
        own["evidence"].create_dataset("dropped", data=np.array([0]))
    elif kind == "distance":
        own.attrs["distance"] = own.attrs["distance"] * 0.5
    elif kind == "constant":
        place = "data/q" if "q" in own["data"] else "data/F/constants"
        own[place][int(rng.integers(own[place].size))] += 0.01
    elif kind == "level":
        del own["evidence/states"]
    else:
        answer = own["answer"][()]
        answer[rng.integers(answer.size)] += 0.25
        own["answer"][...] = answer


KINDS = ("centre", "radius", "states", "dropped", "distance", "constant", "level", "answer")


@pytest.mark.parametrize("count", [3, pytest.param(60, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("node", ["fc", "ncp"])
def test_every_forged_box_is_caught(node: str, kind: str, count: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(count)
    problem, x = space(3) if node == "fc" else nonlinear("ncp", 3)
    certificate = cpbench.certify(problem, x + 1e-6 * (x != 0))
    assert certificate.level == "enclosed"
    path, forged = tmp_path / "c.h5", tmp_path / "forged.h5"
    save_certificate(certificate, problem, path)
    check(path)
    for _ in range(count):
        forged.write_bytes(path.read_bytes())
        with h5py.File(forged, "r+") as file:
            _forge(file["certificate"], rng, kind)
            reseal(file["certificate"])
        with pytest.raises(REFUSALS):
            check(forged)
