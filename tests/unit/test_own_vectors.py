"""The way back of games, least squares and boxed LCPs in files: the answer to what the user has, which verify takes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import cpbench as command

from cpbench import storage
from cpbench.formulations.applications import (
    boxed_problem,
    from_own_vector,
    game_problem,
    least_squares_problem,
    own_vector,
)


def game() -> object:
    """Matching pennies with a price: one equilibrium, x = (2/3, 1/3), y = (1/4, 3/4), by indifference: the columns give
    the row player 3·y₁ = y₂, the rows the column player x₁ = 2·x₂."""
    return game_problem([[3.0, 0.0], [0.0, 1.0]], [[0.0, 1.0], [2.0, 0.0]], name="pennies")


def squares() -> object:
    """A has orthogonal columns of lengths √5 and √5: x = Aᵀb/5 = (1, 2/5); both are within the bounds."""
    return least_squares_problem([[1.0, 2.0], [2.0, -1.0]], [1.8, 1.6], lb=-1.0, ub=3.0, name="fit")


def boxed() -> object:
    """A = 2I: the normal force is 4/2; friction wants 7/2 and is held at 0.5·2, so that w = 2·1 − 7 = −5."""
    return boxed_problem(2.0 * np.eye(2), [4.0, 7.0], [0.0, -0.5], [np.inf, 0.5], findex=[-1, 0], name="box")


CASES = [(game, [2 / 3, 1 / 3, 1 / 4, 3 / 4]), (squares, [1.0, 0.4]), (boxed, [2.0, 1.0])]


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(("make", "expected"), CASES)
@pytest.mark.parametrize("suffix", ["npy", "csv"])
def test_solve_writes_the_unknowns_of_the_file_and_verify_takes_them(
    tmp_path: Path, make: object, expected: list[float], suffix: str
) -> None:
    problem = make()  # type: ignore[operator]
    storage.save(problem, tmp_path / "p.h5")
    done = command(tmp_path, "solve", "p.h5", "-t", "1e-9", "-o", f"x.{suffix}")
    assert done.returncode == 0, done.stdout + done.stderr
    path = tmp_path / f"x.{suffix}"
    x = np.load(path) if suffix == "npy" else np.loadtxt(path)
    assert x == pytest.approx(expected, abs=1e-7)
    good = command(tmp_path, "verify", "p.h5", "--answer", path.name)
    assert good.returncode == 0, good.stdout + good.stderr
    wrong = x + np.array([0.05, -0.05, *[0.0] * (x.size - 2)])
    np.save(tmp_path / "wrong.npy", wrong)
    assert command(tmp_path, "verify", "p.h5", "--answer", "wrong.npy").returncode == 1


def test_own_unknowns_there_and_back() -> None:
    """z = (x, r) and z = (x, κ, κ') by hand; a whole answer stays as it is."""
    fit = squares()
    z = from_own_vector(fit, np.array([2.0, 0.5]))  # type: ignore[arg-type]
    assert z.tolist() == pytest.approx([2.0, 0.5, 1.2, 1.9])
    assert from_own_vector(fit, z) is z  # type: ignore[arg-type]
    box = boxed()
    z = from_own_vector(box, np.array([2.0, 1.0]))  # type: ignore[arg-type]
    assert z.tolist() == pytest.approx([2.0, 1.0, 0.0, 5.0])
    one = game()
    z = from_own_vector(one, np.array([2 / 3, 1 / 3, 1 / 4, 3 / 4]))  # type: ignore[arg-type]
    w = one.M @ z + one.q  # type: ignore[attr-defined]
    assert w == pytest.approx(np.zeros(4), abs=1e-12)
    assert own_vector(one, one.point_from_vector(z)) == pytest.approx([2 / 3, 1 / 3, 1 / 4, 3 / 4])  # type: ignore
    assert from_own_vector(one, 2.0 * z) == pytest.approx(2.0 * z)  # type: ignore[arg-type]
