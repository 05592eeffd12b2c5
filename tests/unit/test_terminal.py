"""What a terminal shows fits it, says what was asked for in its first line, and loses nothing; into a pipe a row stays
a line."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import cpbench
from tiers import some_by_day

from cpbench import storage
from cpbench.conversions import conversions
from cpbench.formulations import LCP, FrictionContact
from cpbench.solvers.base import solvers

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    def called(*words: object) -> tuple[int, str, str]:
        done = cpbench(tmp_path, *words)
        return done.returncode, done.stdout, done.stderr

    return called


def contact(path: Path, W: np.ndarray | None = None, mu: float = 0.5) -> Path:
    W = np.eye(3) if W is None else W
    storage.save(FrictionContact(W=W, q=np.array([-1.0, 0.5, 0.0]), mu=np.array([mu]), dimension=3), path)
    return path


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("columns", some_by_day([80, 100], 6))
@pytest.mark.parametrize(
    ("words", "first"),
    [
        ("list solvers", r"solver +node +method"),
        ("list solvers nsgs", r"nsgs "),
        ("list conversions", r"afc-fc +afc +-> +fc "),
        ("list formulations", r"afc +anisotropic"),
        ("list formats", r"\S+ +\."),
        ("graph", r"\d+ formulations, \d+ conversions"),
        ("graph c.h5 --explain", r"c\.h5 \(fc: m = 3"),
        ("graph c.h5 --to lcp --all --explain", r"c\.h5 \(fc: m = 3"),
        ("info .", r"4 problems: 3 fc, 1 lcp$"),
    ],
)
def test_lines_fit(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, columns: int, words: str, first: str
) -> None:
    for name in ("c", "d", "e"):
        contact(tmp_path / f"{name}.h5")
    storage.save(LCP(M=np.eye(2), q=-np.ones(2)), tmp_path / "lcp.h5")
    _, wide, _ = run(*words.split())
    monkeypatch.setenv("COLUMNS", str(columns))
    code, shown, _ = run(*words.split())
    assert code == 0
    assert max(map(len, shown.splitlines())) <= columns
    assert re.match(first, shown.splitlines()[0])
    assert sorted(re.sub(r"\s", "", wide)) == sorted(re.sub(r"\s", "", shown)), "nothing is left out"


def test_a_row_stays_a_line_in_a_pipe(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    rows = run("list", "conversions")[1].splitlines()
    assert [row.split()[0] for row in rows] == sorted(conversions.names())
    assert len({row.index(" -> ") for row in rows}) == 1, "aligned"


@pytest.mark.needs("cpbench_solvers")
def test_a_formulation_is_a_name_for_its_solvers(run: Run) -> None:
    told = run("list", "solvers", "lcp")[1].splitlines()
    rows = [line.split() for line in told if "  lcp  " in line]
    assert {row[1] for row in rows} == {"lcp"}
    assert any(row[0] == "lemke" for row in rows)
    assert "lcp" not in solvers.names()


def test_a_conversion_is_shown_with_its_mathematics(run: Run) -> None:
    told = run("list", "conversions", "mlcp-lcp-schur")[1]
    assert told.startswith("mlcp-lcp-schur: mlcp -> lcp, equivalent or one-way (14)\n")
    assert "q = b − D A⁻¹a" in told
    code, _, err = run("list", "conversions", "mlcp-lcp-shur")
    assert code == 2
    assert "did you mean mlcp-lcp-schur" in err


def test_a_damaged_file_does_not_keep_back_the_others(run: Run, tmp_path: Path) -> None:
    for name in ("a", "b", "c", "d"):
        contact(tmp_path / f"{name}.h5")
    whole = (tmp_path / "b.h5").read_bytes()
    (tmp_path / "b.h5").write_bytes(whole[: len(whole) // 2])
    code, out, err = run("info", ".")
    assert code == 2
    assert out.startswith("3 problems: 3 fc; 1 file could not be read\n")
    assert re.fullmatch(r"refused: b\.h5: .*\n", err)


def test_a_matrix_by_itself_gets_the_command_to_make_a_problem(run: Run, tmp_path: Path) -> None:
    np.save(tmp_path / "W.npy", np.eye(3))
    assert "cpbench pack makes one" in run("info", "W.npy")[2]
