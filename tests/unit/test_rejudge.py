"""Rows that were changed by hand: `cpbench verify RESULTS` names each, with problem and solver."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from command_line import cpbench
from judged_again import judged_again

from cpbench import storage
from cpbench.bench.results.rows import unpack_answer
from cpbench.bench.results.store import Store
from cpbench.formulations import LCP

pytestmark = pytest.mark.needs("cpbench_solvers")
SIZES = (3, 4, 5, 6)
SOLVERS = ("lemke", "bpp", "psor", "pgs")
OF = "(SELECT key FROM rows WHERE problem = 'p{}' AND label = '{}')"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four solvers on four problems, which all of them solve, and rows without an answer."""
    folder = tmp_path_factory.mktemp("made")
    for n in SIZES:
        M = 4.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
        storage.save(LCP(M=M, q=-(M @ np.linspace(1.0, 2.0, n)), name=f"p{n}"), folder / f"p{n}.h5")
    storage.save(LCP(M=[[-1.0]], q=[-1.0], name="none"), folder / "none.h5")
    chosen = [part for name in SOLVERS for part in ("-s", name)]
    done = cpbench(folder, "run", ".", *chosen, "--no-report", "-q", "-o", "r.sqlite")
    assert done.returncode == 0, done.stderr
    return folder / "r.sqlite"


@pytest.fixture
def copy(made: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(made.parent)
    path = made.with_name("copy.sqlite")
    path.write_bytes(made.read_bytes())
    yield path
    path.unlink()


def change(path: Path, *statements: str) -> None:
    with closing(sqlite3.connect(path)) as db, db:
        for statement in statements:
            assert db.execute(statement).rowcount > 0, statement


def test_a_file_as_it_was_run(copy: Path) -> None:
    follows, lines = judged_again(copy)
    assert follows
    assert len(lines) == 2
    assert lines[0].endswith("judged again: no change")
    assert "no answer to judge" in lines[1]
    done = cpbench(copy.parent, "verify", copy.name)
    assert (done.returncode, done.stderr) == (0, "")


def test_each_of_eleven_rows_that_were_changed_by_hand_is_named(copy: Path) -> None:
    with Store(copy) as store:
        answers = {key: unpack_answer(blob) for key, blob in store.answers()}
        keys = {(row.problem, row.label): row.key for row in store.rows()}
    assert not np.array_equal(answers[keys["p6", "psor"]], answers[keys["p6", "pgs"]])
    swapped = "UPDATE answers SET answer = (SELECT answer FROM other WHERE other.key = {}) WHERE key = {}"
    change(
        copy,
        "UPDATE rows SET status = 'wrong' WHERE problem = 'p3' AND label = 'lemke'",
        "UPDATE rows SET status = 'timeout' WHERE problem = 'p3' AND label = 'bpp'",
        "UPDATE rows SET status = 'infeasible' WHERE problem = 'p3' AND label = 'psor'",
        "UPDATE rows SET status = 'solved', error = 1e-9 WHERE status = 'unsupported' AND label = 'psor'",
        "UPDATE rows SET error = 1e-9 WHERE problem = 'p4' AND label = 'lemke'",
        "UPDATE rows SET error = NULL WHERE problem = 'p4' AND label = 'bpp'",
        "UPDATE rows SET error = error * 1.01 WHERE problem = 'p4' AND label = 'psor'",
        f"UPDATE answers SET answer = x'00' WHERE key = {OF.format(5, 'lemke')}",
    )
    with closing(sqlite3.connect(copy)) as db, db:
        db.execute("CREATE TEMP TABLE other AS SELECT key, answer FROM answers")
        for one, another in (("psor", "pgs"), ("pgs", "psor")):
            db.execute(swapped.format(OF.format(6, another), OF.format(6, one)))
        # that of another problem with as many unknowns has other numbers, that of p3 has fewer
        db.execute(swapped.format(OF.format(3, "lemke"), OF.format(6, "lemke")))
    follows, lines = judged_again(copy)
    assert not follows
    *named, summary, _ = lines
    expected = {
        ("p3", "lemke"), ("p3", "bpp"), ("p3", "psor"), ("p4", "lemke"), ("p4", "bpp"), ("p4", "psor"),
        ("p5", "lemke"), ("p6", "psor"), ("p6", "pgs"), ("p6", "lemke"), ("none", "psor"),
    }  # fmt: skip
    assert {tuple(line.partition(":")[0].split()) for line in named} == expected
    assert len(named) == len(expected)
    assert "no change" not in summary
    assert cpbench(copy.parent, "verify", copy.name).returncode == 1


def test_rows_of_a_run_that_kept_no_answers_are_not_accused(copy: Path) -> None:
    for words in (["lemke", "--keep", "none"], ["bpp"]):
        done = cpbench(copy.parent, "run", ".", "-s", *words, "--no-report", "-q", "-o", "kept.sqlite")
        assert done.returncode == 0, done.stderr
    follows, lines = judged_again(copy.with_name("kept.sqlite"))
    assert follows
    assert "no answer to judge" in lines[1]


def test_an_error_that_another_machine_rounds_otherwise_is_none(copy: Path) -> None:
    change(copy, "UPDATE rows SET error = error * (1 + 1e-9) + 1e-16 WHERE error IS NOT NULL")
    assert judged_again(copy)[0]


def test_changes_by_another_tolerance_are_no_fault(copy: Path) -> None:
    follows, lines = judged_again(copy, tolerance=1e-13)
    assert follows
    assert any("solved -> " in line for line in lines)


def test_a_damaged_file_is_one_line(copy: Path) -> None:
    whole = bytearray(copy.read_bytes())
    whole[3 * 4096 : 4 * 4096] = b"\xff" * 4096
    copy.write_bytes(whole)
    done = cpbench(copy.parent, "verify", copy.name)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert f"{copy.name}: is damaged" in done.stderr
