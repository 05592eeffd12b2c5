"""`cpbench info FOLDER`: what is in it, and what cannot be read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import cpbench as command

from cpbench import storage
from cpbench.formulations import LCP, QP


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
