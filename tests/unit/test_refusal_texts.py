"""Refusals of files: in one line whatever the file holds, and in the words of what is there."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cpbench import storage
from cpbench.errors import FormatError


@pytest.mark.parametrize(
    ("name", "text", "quoted"),
    [
        ("p.nl", "g3 1 1 0\n 2 1 1 0 \x00\x07 0\n" + " 0 0\n" * 8, r"\x00\x07"),
    ],
)
def test_control_characters_of_a_file_are_spelled_out(tmp_path: Path, name: str, text: str, quoted: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(FormatError) as refusal:
        storage.load(path)
    assert quoted in str(refusal.value)
    assert str(refusal.value).isprintable()


@pytest.mark.parametrize("bounds", [{}, {"lb": np.zeros(3)}])
def test_two_arrays_alone_are_least_squares_where_named(tmp_path: Path, bounds: dict[str, np.ndarray]) -> None:
    path = tmp_path / "fit.npz"
    np.savez(path, A=np.ones((5, 3)), b=np.ones(5), **bounds)
    with pytest.raises(FormatError, match=r"holds a matrix A and b alone: --format least-squares"):
        storage.load(path)
    assert storage.load(path, format="least-squares").sizes() == {"n": 8, "m": 0, "k": 5}


def test_an_objective_beside_pairs_is_called_an_mpcc(tmp_path: Path) -> None:
    variable = {"type": "Variable", "name": "x"}
    model = {
        "version": {"major": 1, "minor": 7},
        "variables": [{"name": "x"}, {"name": "y"}],
        "objective": {"sense": "min", "function": variable},
        "constraints": [
            {
                "function": {
                    "type": "VectorOfVariables",
                    "variables": ["y", "x"],
                },
                "set": {"type": "Complements", "dimension": 2},
            },
            {"function": variable, "set": {"type": "GreaterThan", "lower": 0.0}},
        ],
    }
    path = tmp_path / "m.mof.json"
    path.write_text(json.dumps(model))
    with pytest.raises(FormatError, match=r"objective: is min beside Complements: .*\(MPCC\)"):
        storage.load(path)
