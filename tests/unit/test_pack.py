"""`cpbench pack`: whatever has a wrong shape is refused in one line, with both files, before anything is written."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from tiers import some_by_day

from cpbench import storage
from cpbench.cli import main

NC, N = 3, 12
SHAPES = {
    "lcp": {"M": (4, 4), "q": (4,)},
    "mlcp": {"A": (4, 4), "B": (3, 3), "C": (4, 3), "D": (3, 4), "a": (4,), "b": (3,)},
    "qp": {"Q": (4, 4), "p": (4,)},
    "fc": {"W": (3 * NC, 3 * NC), "q": (3 * NC,), "mu": (NC,)},
    "gfc": {"M": (N, N), "H": (N, 3 * NC), "f": (N,), "w": (3 * NC,), "mu": (NC,)},
}
EXTRA = {
    "inequality": {"A": (2, 4), "b": (2,)},
    "equality": {"C": (1, 4), "d": (1,)},
    "bounds": {"lb": (4,), "ub": (4,)},
}


def pack(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["cpbench", "pack", *map(str, arguments)])
    try:
        main()
    except SystemExit as leave:
        return int(leave.code or 0)
    return 0


def values(shape: tuple[int, ...]) -> np.ndarray:
    return np.eye(*shape) if len(shape) == 2 else np.full(shape, 0.25)


def command_of(folder: Path, node: str, wrong: str = "", shape: tuple[int, ...] = ()) -> list[object]:
    """The options of `pack` for a problem whose part `wrong` has another shape."""
    options: list[object] = []
    for option, parts in {node: SHAPES[node], **(EXTRA if node == "qp" else {})}.items():
        options.append(f"--{option}")
        for name, right in parts.items():
            file = folder / f"{name}_.npy"
            np.save(file, values(shape if name == wrong else right))
            options.append(file)
    return options


def wrong_shapes() -> list[tuple[str, str, tuple[int, ...]]]:
    """Every part of every formulation once too large and once too small in every direction, transposed, and empty."""
    cases = []
    for node, parts in SHAPES.items():
        every = parts | ({k: v for more in EXTRA.values() for k, v in more.items()} if node == "qp" else {})
        for name, right in every.items():
            moved = {
                tuple(right[i] + by * (i == axis) for i in range(len(right)))
                for axis in range(len(right))
                for by in (1, -1)
            }
            moved |= {tuple(s + by for s in right) for by in (3, -1)} | {right[::-1], (0,) * len(right)}
            cases += [(node, name, shape) for shape in sorted(moved - {right})]
    return cases


@pytest.mark.parametrize("node", SHAPES)
def test_right_shapes_are_packed(monkeypatch, tmp_path, node) -> None:
    assert pack(monkeypatch, tmp_path / "x.h5", *command_of(tmp_path, node)) == 0
    assert storage.load(tmp_path / "x.h5").node == node


@pytest.mark.parametrize(("node", "name", "shape"), some_by_day(wrong_shapes(), 60))
def test_wrong_shapes_are_refused_in_one_line(monkeypatch, capsys, tmp_path, node, name, shape) -> None:
    """The line names the file and what it has, or the file that does not fit to it."""
    out = tmp_path / "x.h5"
    assert pack(monkeypatch, out, *command_of(tmp_path, node, name, shape)) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1, said
    assert str(tmp_path / f"{name}_.npy") in said, said
    assert "expected" in said or "must be square" in said, said
    assert not out.exists()


def test_a_matrix_of_another_step_is_not_cut(monkeypatch, capsys, tmp_path) -> None:
    """The message has both shapes and both files."""
    command = command_of(tmp_path, "fc", "W", (12, 12))
    assert pack(monkeypatch, tmp_path / "x.h5", *command) == 2
    W, q = tmp_path / "W_.npy", tmp_path / "q_.npy"
    assert capsys.readouterr().err == f"cpbench: {W}: W: is 12 x 12, expected 9 x 9 (9 from q in {q})\n"


def test_a_transposed_matrix_is_called_so(monkeypatch, capsys, tmp_path) -> None:
    assert pack(monkeypatch, tmp_path / "x.h5", *command_of(tmp_path, "gfc", "H", (9, 12))) == 2
    assert "is 9 x 12, expected 12 x 9, which its transpose is" in capsys.readouterr().err


def test_options_of_another_kind_are_refused(monkeypatch, capsys, tmp_path) -> None:
    command = command_of(tmp_path, "lcp")
    assert pack(monkeypatch, tmp_path / "x.h5", *command, "--axes", "TTN") == 2
    assert pack(monkeypatch, tmp_path / "x.h5", *command, "--bounds", tmp_path / "q_.npy", tmp_path / "q_.npy") == 2
    assert "--bounds goes with --qp, not with --lcp" in capsys.readouterr().err
    assert not (tmp_path / "x.h5").exists()


def test_the_file_is_named_by_the_argument_or_by_an_option(monkeypatch, capsys, tmp_path) -> None:
    command, out = command_of(tmp_path, "lcp"), tmp_path / "y.h5"
    assert pack(monkeypatch, *command, "-o", out) == 0
    assert storage.load(out).name == "y"
    for both in ((tmp_path / "z.h5", "--output", tmp_path / "w.h5"), ()):
        assert pack(monkeypatch, *both, *command) == 2
        assert "cpbench pack OUTPUT ..., or -o OUTPUT" in capsys.readouterr().err
    assert not (tmp_path / "z.h5").exists()
    assert not (tmp_path / "w.h5").exists()
