"""An LCP in lines of row, column and value: read whole, or refused with the line that is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cpbench import storage
from cpbench.errors import FormatError
from cpbench.foundation import matrices

DRAW = np.random.default_rng(340)
M = np.where(DRAW.random((5, 5)) < 0.5, np.round(DRAW.normal(size=(5, 5)), 3), 0.0) + 3.0 * np.eye(5)
Q = np.round(DRAW.normal(size=5), 3)
OTHERS = ("0 0 1.5\n0 1\nq 0 1\n", "0 0 1.5\nq 0 1\nend\n", "0 -1 2\nq 0 1\n", "0 0 1_0\nq 0 1\n", "0 0.5 1\nq 0 1\n")


def lines(base: int, between: str = "\t") -> tuple[list[str], list[str]]:
    """The lines of M and those of q, rows and columns counted from `base`."""
    entries = [(i + base, j + base, float(M[i, j])) for i, j in zip(*np.nonzero(M), strict=True)]
    own = [between.join(map(str, entry)) for entry in entries]
    return own, [between.join(("q", str(i + base), str(float(value)))) for i, value in enumerate(Q)]


@pytest.mark.parametrize("base", [0, 1])
@pytest.mark.parametrize(("between", "vector_first"), [("\t", False), (" , ", True)])
def test_every_number_is_stored_where_its_indices_say(
    tmp_path: Path, base: int, between: str, vector_first: bool
) -> None:
    own, sides = lines(base, between)
    file = tmp_path / "dump.txt"
    text = "\n".join([*sides, "# M", *own, ""] if vector_first else [*own, "", *sides])
    file.write_text(text)
    problem = storage.load(file)
    assert problem.node == "lcp"
    assert np.array_equal(matrices.dense(problem.data()["M"]), M)
    assert np.array_equal(problem.data()["q"], Q)
    assert storage.problem_files([tmp_path]) == [str(file)]


@pytest.mark.parametrize(
    ("changed", "where", "cause"),
    [
        (lambda own, sides: [*own, own[0], *sides], "line", "is the second one of this place"),
        (lambda own, sides: [*own, *sides, sides[2]], "line", "is the second one of this place"),
        (lambda own, sides: [*own, *sides[:2], *sides[3:]], "q", "has no line for row 2"),
        (lambda own, sides: [*own, *sides[2:]], "q", "has no line for row 1"),
        (lambda own, sides: [*own, *sides[:-1]], "M", "has an entry at row"),
        (lambda own, sides: [*own, "5\t0\t1.0", *sides], "M", "has an entry at row 5, column 0; q has rows 0 to 4"),
        (lambda own, sides: own, "q", "has no line 'q row value'"),
        (lambda own, sides: [*own, *sides, "q\t5\tnan"], "q", "finite"),
    ],
)
def test_what_is_missing_or_too_much_is_refused(tmp_path: Path, changed, where: str, cause: str) -> None:
    file = tmp_path / "dump.txt"
    file.write_text("\n".join(changed(*lines(0))))
    with pytest.raises(FormatError, match=cause) as refusal:
        storage.load(file)
    assert f"{file}: {where}" in str(refusal.value)


@pytest.mark.parametrize("text", OTHERS)
def test_another_line_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "dump.txt"
    file.write_text(text)
    with pytest.raises(FormatError):
        storage.load(file)


def test_three_columns_of_something_else_are_no_problem_of_a_folder(tmp_path: Path) -> None:
    (tmp_path / "faces.txt").write_text("0 1 2\n2 1 3\n")
    assert storage.problem_files([tmp_path]) == []
