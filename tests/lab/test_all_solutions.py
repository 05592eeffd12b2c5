"""All solutions of small problems, over the rationals, and the program that counts them again without cpbench."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from certificate_checks import REFUSALS, check, reseal, save_and_check
from command_line import cpbench as command

import cpbench
from cpbench.formulations import LCP, MLCP
from cpbench.formulations.base import Problem

flint = pytest.importorskip("flint", reason="certificates need python-flint")
from cpbench_lab.certificate_text import summary  # noqa: E402
from cpbench_lab.certificates.all_solutions import all_solutions, nonnegative  # noqa: E402
from cpbench_lab.certifying import save_certificate  # noqa: E402

HAND: dict[str, tuple[Problem, float]] = {
    "every pair either way": (LCP(M=-np.eye(3), q=np.ones(3)), 8),
    "none": (LCP(M=[[-1.0, 0.0], [0.0, 1.0]], q=[-1.0, 1.0]), 0),
    "only 0, of singular bases": (LCP(M=np.zeros((3, 3)), q=np.ones(3)), 1),
    "a ray": (LCP(M=np.zeros((2, 2)), q=[0.0, 1.0]), math.inf),
    "a segment": (LCP(M=np.ones((2, 2)), q=[-1.0, -1.0]), math.inf),
    "rays from a point of no basis": (LCP(M=[[0.0, 0.0], [1.0, 0.0]], q=[0.0, -1.0]), math.inf),
    "a point of a singular basis": (LCP(M=[[0.0, -1.0], [0.0, 0.0]], q=[0.0, 0.0]), math.inf),
    "three, two apart by the last bit": (LCP(M=[[1.0, 2.0], [2.0, 1.0]], q=[-1.0 - 2.0**-52, -2.0]), 3),
    "one, as many bits on the other side": (LCP(M=[[1.0, 2.0], [2.0, 1.0]], q=[-1.0 + 2.0**-52, -2.0]), 1),
    "three": (LCP(M=[[1.0, 2.0], [2.0, 1.0]], q=[-3.0, -3.0]), 3),
    "a line of what is free": (MLCP(A=[[0.0]], B=[[1.0]], C=[[0.0]], D=[[0.0]], a=[0.0], b=[1.0]), math.inf),
    "a ray of what is free": (MLCP(A=[[0.0]], B=[[1.0]], C=[[0.0]], D=[[1.0]], a=[0.0], b=[1.0]), math.inf),
    "a free row that contradicts": (MLCP(A=[[0.0]], B=[[1.0]], C=[[0.0]], D=[[1.0]], a=[1.0], b=[1.0]), 0),
    "two with what is free": (MLCP(A=[[1.0]], B=[[0.0]], C=[[1.0]], D=[[1.0]], a=[-2.0], b=[-2.0 + 2.0]), 2),
}


@pytest.mark.parametrize("name", HAND)
def test_counts_by_hand(name: str, tmp_path: Path) -> None:
    problem, count = HAND[name]
    found = all_solutions(problem)
    assert found is not None
    assert found.count == count
    certificate = cpbench.certify(problem, np.zeros(sum(problem.point_sizes.values())))
    said = save_and_check(certificate, problem, tmp_path)
    if not certificate.unique:
        assert certificate.solutions == count
        assert ("a continuum" if math.isinf(count) else f"{count:.0f} solutions") in said


def test_an_answer_far_from_all_names_the_nearest(tmp_path: Path) -> None:
    """(1, 2; 2, 1)z + q with q = −(3, 3): the solutions are (3, 0), (0, 3) and (1, 1), by hand."""
    problem = LCP(M=[[1.0, 2.0], [2.0, 1.0]], q=[-3.0, -3.0])
    certificate = cpbench.certify(problem, [1.25, 1.25])
    assert (certificate.level, certificate.solutions) == ("distant", 3)
    assert certificate.distance == pytest.approx(0.25)
    assert {tuple(x) for x in certificate.evidence["solutions"].tolist()} == {(3.0, 0.0), (0.0, 3.0), (1.0, 1.0)}
    cpbench.save(problem, tmp_path / "p.h5")
    shown = command(tmp_path, "certify", "p.h5")
    assert "3 solutions, all listed" in shown.stdout
    assert "(3, 0)" in shown.stdout


def test_no_solution_is_a_refutation() -> None:
    certificate = cpbench.certify(LCP(M=[[-1.0]], q=[-1.0]), [0.5])
    assert (certificate.level, certificate.solutions) == ("refuted", 0)
    assert summary(certificate).startswith("there is no solution")
    assert not certificate


def test_nonnegative_solutions_are_found_by_pivots_that_end() -> None:
    """y₁ − y₂ = −1, y₁ + y₂ + y₃ = 3: (1, 2, 0) and (0, 1, 2) are its vertices; with −3 for −1, (0, 3, 0) is the only
    point; with −4 there is none."""
    columns = [[1, 1], [-1, 1], [0, 1]]
    for right, some in {(-1, 3): {(1, 2, 0), (0, 1, 2)}, (-3, 3): {(0, 3, 0)}, (-4, 3): {None}}.items():
        found = nonnegative(columns, list(right), set())
        assert (None if found is None else tuple(int(v.p) for v in found)) in some


@pytest.mark.parametrize("kind", ["more", "fewer", "other", "continuum", "only one", "none"])
def test_forged_numbers_are_caught(kind: str, tmp_path: Path) -> None:
    problem = LCP(M=[[1.0, 2.0], [2.0, 1.0]], q=[-3.0, -3.0])
    path = tmp_path / "c.h5"
    save_certificate(cpbench.certify(problem, [1.0, 1.0]), problem, path)
    assert "3 solutions" in check(path)
    with h5py.File(path, "r+") as file:
        own: Any = file["certificate"]
        listed = own["evidence/solutions"][()]
        own.attrs["solutions"] = {"more": 4.0, "fewer": 2.0, "continuum": math.inf, "only one": 1.0, "none": 0.0}.get(
            kind, 3.0
        )
        if kind in ("fewer", "more", "only one", "other"):
            del own["evidence/solutions"]
            changed = {"more": [*listed, listed[0] + 1], "fewer": listed[:2], "only one": listed[:1]}
            own["evidence/solutions"] = np.array(changed.get(kind, listed * (1 + 2.0**-52)))
        if kind == "continuum":
            own["evidence/endless"] = np.zeros(2, dtype=np.int8)
        if kind == "only one":
            own.attrs["unique"] = "enumeration"
        reseal(own)
    with pytest.raises(REFUSALS):
        check(path)


def game(count: int) -> LCP:
    """Costs of a bimatrix game in which both pay 1 where they choose the same of `count`, else 2: for each set of
    choices that both take equally often there is one equilibrium, 2^count − 1 of them.

    z = (x, y) without the scale of x and y: Ay ≥ 1 ⟂ x ≥ 0, Aᵀx ≥ 1 ⟂ y ≥ 0 (Lemke and Howson, 1964).
    """
    A, none = 2.0 - np.eye(count), np.zeros((count, count))
    return LCP(M=np.block([[none, A], [A.T, none]]), q=-np.ones(2 * count), name=f"game-{count}")


def equilibria(x: np.ndarray, count: int) -> set[tuple[tuple[float, ...], ...]]:
    """The strategies of both players, as shares."""
    return {tuple(tuple(np.round(part / part.sum(), 12).tolist()) for part in np.split(row, [count])) for row in x}


@pytest.mark.parametrize("count", [2, 3])
def test_all_equilibria_of_a_game_are_listed_shown_and_written(count: int, tmp_path: Path) -> None:
    shares = [np.array([number >> k & 1 for k in range(count)], dtype=float) for number in range(1, 2**count)]
    wanted = {(tuple(np.round(s / s.sum(), 12).tolist()),) * 2 for s in shares}
    found = cpbench.every_solution(game(count))
    assert (found.count, equilibria(found.x, count)) == (2**count - 1, wanted)
    cpbench.save(game(count), tmp_path / "game.h5")
    done = command(tmp_path, "solve", "game.h5", "--all", "-o", "z.npy")
    assert done.stdout.startswith(f"game-{count} (lcp): {2**count - 1} solutions, all there are\n  1: z = (")
    assert done.returncode == 0
    np.testing.assert_array_equal(np.load(tmp_path / "z.npy"), found.x)


def test_of_a_continuum_the_ends_are_listed() -> None:
    """z₁ + z₂ = 1: a segment from (1, 0) to (0, 1)."""
    found = cpbench.every_solution(LCP(M=np.ones((2, 2)), q=[-1.0, -1.0]))
    assert found.endless
    assert math.isinf(found.count)
    assert sorted(found.x.tolist()) == [[0.0, 1.0], [1.0, 0.0]]


def test_all_solutions_of_what_is_equivalent_are_carried_back() -> None:
    """−x ∈ N_[−1,1](x) has the solutions −1, 0 and 1."""
    relay = cpbench.Relay(M=[[-1.0]], q=[0.0], lb=[-1.0], ub=[1.0])
    found = cpbench.every_solution(relay)
    assert sorted(found.x[:, 0].tolist()) == [-1.0, 0.0, 1.0]
    assert found.route != "direct"


def test_what_cannot_be_counted_is_refused_in_one_line(tmp_path: Path) -> None:
    cpbench.save(LCP(M=np.eye(30), q=-np.ones(30)), tmp_path / "large.h5")
    done = command(tmp_path, "solve", "large.h5", "--all", "-o", "z.npy")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "lcp with n = 30: too large" in done.stderr
    assert not (tmp_path / "z.npy").exists()
    assert "all solutions are written as rows" in command(tmp_path, "solve", "large.h5", "--all", "-o", "z.h5").stderr


@pytest.mark.parametrize("high", [3, 50])
def test_equilibria_by_vertices_are_those_of_all_bases(high: int) -> None:
    """Two ways to the same sets: payoffs of 0, 1, 2 make most games degenerate, larger ones few."""
    rng = np.random.default_rng(high)
    for _ in range(12):
        shape = rng.integers(1, 5, 2)
        problem = cpbench.from_game(rng.integers(0, high, shape), rng.integers(0, high, shape)).problem
        bases, vertices = all_solutions(problem), cpbench.every_solution(problem)
        assert bases is not None
        assert vertices.endless == (bases.endless is not None)
        if bases.endless is None:
            wanted = {tuple(round(float(Fraction(int(v.p), int(v.q))), 9) for v in x) for x, _ in bases.points}
            assert {tuple(point.arrays()["z"].round(9).tolist()) for point in vertices.points} == wanted


def test_a_degenerate_game_has_its_connected_sets(tmp_path: Path) -> None:
    """The row player is indifferent where the column player takes the first column: x is any, and y = (1, 0) where x
    puts at least 1/2 on the first row, against which the first column is best."""
    np.savez(tmp_path / "game.npz", A=[[1.0, 0.0], [1.0, 2.0]], B=[[1.0, 0.0], [0.0, 1.0]])
    done = command(tmp_path, "solve", "game.npz", "--format", "game", "--all")
    assert done.stdout.splitlines()[0] == "game (lcp): a continuum of solutions, of which 3 corners are listed"
    assert done.stdout.splitlines()[-1] == "  one connected set of equilibria has the corners 1, 2"
