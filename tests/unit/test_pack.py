"""`cpbench pack`: whatever has a wrong shape is refused in one line, with its file, before anything is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import cpbench as command
from tiers import some_by_day

from cpbench import storage
from cpbench.formulations import FrictionContact, GlobalFrictionContact

NC, N = 3, 12
SHAPES = {
    "lcp": {"M": (4, 4), "q": (4,)},
    "mlcp": {"A": (4, 4), "B": (3, 3), "C": (4, 3), "D": (3, 4), "a": (4,), "b": (3,)},
    "qp": {"Q": (4, 4), "p": (4,), "A": (2, 4), "b": (2,), "C": (1, 4), "d": (1,), "lb": (4,), "ub": (4,)},
    "fc": {"W": (3 * NC, 3 * NC), "q": (3 * NC,), "mu": (NC,)},
    "gfc": {"M": (N, N), "H": (N, 3 * NC), "f": (N,), "w": (3 * NC,), "mu": (NC,)},
}


def words(folder: Path, node: str, wrong: str = "", shape: tuple[int, ...] = ()) -> list[str]:
    """The words of `pack` for a problem whose array `wrong` has another shape."""
    given: list[str] = []
    for name, right in SHAPES[node].items():
        size = shape if name == wrong else right
        np.save(folder / f"{name}_.npy", np.eye(*size) if len(size) == 2 else np.full(size, 0.25))
        given.append(f"{name}={name}_.npy")
    return ["pack", *given, "-o", "x.h5", "--as", node]


def wrong_shapes() -> list[tuple[str, str, tuple[int, ...]]]:
    """Every array of every formulation one too large in every direction, and transposed."""
    cases = []
    for node, parts in SHAPES.items():
        for name, right in parts.items():
            moved = {tuple(right[i] + (i == axis) for i in range(len(right))) for axis in range(len(right))}
            cases += [(node, name, shape) for shape in sorted((moved | {right[::-1]}) - {right})]
    return cases


@pytest.mark.parametrize("node", SHAPES)
def test_right_shapes_are_packed(tmp_path: Path, node: str) -> None:
    done = command(tmp_path, *words(tmp_path, node))
    assert done.stdout.startswith(f"x.h5 ({node}: ")
    assert storage.load(tmp_path / "x.h5").node == node


@pytest.mark.parametrize(("node", "name", "shape"), some_by_day(wrong_shapes(), 12))
def test_wrong_shapes_are_refused_in_one_line(tmp_path: Path, node: str, name: str, shape: tuple[int, ...]) -> None:
    """The line names a file that does not fit to another."""
    done = command(tmp_path, *words(tmp_path, node, name, shape))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert "_.npy: " in done.stderr
    assert "expected" in done.stderr
    assert not (tmp_path / "x.h5").exists()


def test_a_refusal_has_both_arrays(tmp_path: Path) -> None:
    said = command(tmp_path, *words(tmp_path, "fc", "W", (12, 12))).stderr
    assert said == "cpbench: W_.npy: W: is 12x12, expected 9x9 (q has 9 numbers)\n"


def test_the_form_is_that_of_the_names(tmp_path: Path) -> None:
    """W, q, mu are frictional contact; an array that no form has is refused with its file."""
    given = words(tmp_path, "fc")[:-2]
    assert "(fc: " in command(tmp_path, *given).stdout
    np.save(tmp_path / "nu.npy", np.ones(3))
    said = command(tmp_path, *given, "--force", "nu.npy").stderr
    assert said.startswith("cpbench: nu.npy: nu: is no array of the form fc (W, q, mu")
    assert "two files have the name of one array" in command(tmp_path, *given, "q=W_.npy").stderr
    assert "unknown form 'fcc'" in command(tmp_path, *given, "--as", "fcc", "--force").stderr


@pytest.mark.parametrize("node", ["fc", "gfc"])
def test_axes_put_the_normal_first(tmp_path: Path, node: str) -> None:
    """Rows T, T, N of each contact become N, T, T, in all arrays that have them."""
    rng = np.random.default_rng(3)
    order = np.array([2, 0, 1, 5, 3, 4])
    W, q, mu, H = rng.standard_normal((6, 6)), rng.standard_normal(6), np.array([0.1, 0.2]), rng.standard_normal((4, 6))
    given = {"W": W, "q": q, "mu": mu} if node == "fc" else {"M": np.eye(4), "H": H, "f": q[:4], "w": q, "mu": mu}
    wanted = (
        FrictionContact(W=W[np.ix_(order, order)], q=q[order], mu=mu)
        if node == "fc"
        else GlobalFrictionContact(M=np.eye(4), H=H[:, order], f=q[:4], w=q[order], mu=mu)
    )
    for name, value in given.items():
        np.save(tmp_path / f"{name}.npy", value)
    asked = ["pack", *(f"{name}.npy" for name in given), "-o", "x.h5", "--axes"]
    assert command(tmp_path, *asked, "TTN").returncode == 0
    assert storage.load(tmp_path / "x.h5").fingerprint == wanted.fingerprint
    np.savez(tmp_path / "M.npz", np.eye(4))
    lcp = ["pack", "M.npz", f"q={'f' if node == 'gfc' else 'q'}.npy", "-o", "y.h5", "--axes", "TN"]
    assert "--axes is of contact problems" in command(tmp_path, *lcp).stderr
