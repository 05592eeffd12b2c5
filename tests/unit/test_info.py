"""`cpbench info` of sequences, starting points, expressions and folders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import cpbench as command

import cpbench
from cpbench import storage
from cpbench.formulations import LCP, NCP, QP, FrictionContact, NCPPoint
from cpbench.formulations.expressions.recording import recorded


def record(folder: Path, counts: list[int], ids: list[bool]) -> None:
    recorder = cpbench.Recorder("slide", dt=0.005)
    for nc, known in zip(counts, ids, strict=True):
        problem = FrictionContact(W=np.eye(3 * nc), q=np.zeros(3 * nc), mu=np.full(nc, 0.5))
        recorder.add(problem, ids=np.arange(nc) if known else None)
    recorder.save(folder / "slide.h5")


@pytest.mark.parametrize(
    ("ids", "words"), [([True] * 5, "ids in all"), ([False] * 5, "no ids"), ([True, *[False] * 3, True], "ids in 2")]
)
def test_a_sequence_has_a_line_of_its_own(tmp_path: Path, ids: list[bool], words: str) -> None:
    record(tmp_path, [2, 3, 7, 3, 2], ids)
    shown = command(tmp_path, "info", "slide.h5").stdout.splitlines()
    assert shown[1] == f"sequence slide: 5 steps, dt = 0.005 s, to 0.02 s, 2 to 7 contacts, {words}"
    assert len(shown) == 8


def test_a_step_says_where_it_stands(tmp_path: Path) -> None:
    record(tmp_path, [2, 3], [True, True])
    shown = command(tmp_path, "info", "slide.h5::step-001", "--no-facts").stdout
    assert "  sequence     slide: step 1, at 0.005 s, dt = 0.005 s\n  contacts     ids known\n" in shown


def test_expressions_and_starts(tmp_path: Path) -> None:
    """F = (2x + 3y, x² − y + z, z + 1): 2 + 3 + 1 entries that may be other than 0, two affine rows, and
    an affine part with 2, 3, −1, 1 and 1."""
    F = recorded(3, lambda v: np.array([2 * v[0] + 3 * v[1], v[0] ** 2 - v[1] + v[2], v[2] + 1]))
    problem = NCP(F=F)
    guesses = [NCPPoint(z=np.full(3, float(k))) for k in range(20)]
    storage.save_pack({"mine": problem}, tmp_path / "mine.h5", guesses={"mine": guesses})
    shown = command(tmp_path, "info", "mine.h5", "--no-facts").stdout
    assert "Jacobian of 6 entries, 2 of 3 rows affine, affine part of 5 entries" in shown
    assert "  starts       20 guesses in the file" in shown


def box_qp(n: int) -> QP:
    none, free = np.zeros((0, n)), np.full(n, np.inf)
    return QP(Q=np.eye(n), p=np.ones(n), A=none, b=np.zeros(0), C=none, d=np.zeros(0), lb=-free, ub=free)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """70 LCPs of order 3 to 9, two QPs, one more LCP, a broken file, and two that are no problems."""
    inside = tmp_path / "many"
    (inside / "deep").mkdir(parents=True)
    for k in range(70):
        n = 3 + k % 7
        storage.save(LCP(M=(2.0 + k) * np.eye(n), q=-np.ones(n), name=f"p{k}"), inside / f"p{k:02d}.h5")
    for n in (2, 5):
        storage.save(box_qp(n), inside / "deep" / f"q{n}.h5")
    storage.save(LCP(M=6.0 * np.eye(7), q=-np.ones(7), name="again"), inside / "deep" / "z.h5")
    (inside / "broken.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(64))
    (inside / "notes.md").write_text("notes")
    (inside / "make.py").write_text("x = 1")
    return tmp_path


def test_a_folder_has_a_line_for_each_class(folder: Path) -> None:
    done = command(folder, "info", "many")
    assert done.returncode == 2
    first, *others = done.stdout.splitlines()
    assert first == "73 problems: 71 lcp, 2 qp; 1 file could not be read"
    assert [" ".join(line.split()) for line in others[:2]] == [
        "lcp 71 n = 3 to 9, 3 to 9 nonzeros",
        "qp 2 n = 2 to 5, m = 0, k = 0, 2 to 5 nonzeros",
    ]
    assert "refused: many/broken.h5: " in done.stderr
    assert done.stderr.count("refused: ") == 1


def test_a_small_folder_has_a_line_for_each_problem(folder: Path) -> None:
    for path in folder.glob("many/p[1-6]*.h5"):
        path.unlink()
    (folder / "many" / "broken.h5").unlink()
    done = command(folder, "info", "many")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == "13 problems: 11 lcp, 2 qp"
    assert sum("nonzeros" in line for line in lines) == 13
