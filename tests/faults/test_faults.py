"""Every fault has its row, and the solvers beside it are unharmed."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from cpbench import storage
from cpbench.bench.referee import unblob
from cpbench.bench.store import Store
from cpbench.formulations import LCP

PLUGIN = Path(__file__).with_name("faulty_solvers.py")
LIMIT = 2.0
EXPECTED = {
    "faulty-abort": ("crash", 6),
    "faulty-segfault": ("crash", 11),
    "faulty-exit": ("crash", None),
    "faulty-hang": ("timeout", None),
    "faulty-children": ("timeout", None),
    "faulty-orphan": ("crash", None),
    "faulty-raise": ("error", None),
    "faulty-nan": ("wrong", None),
    "faulty-liar": ("wrong", None),
    "faulty-short": ("error", None),
    "faulty-nothing": ("wrong", None),
    "faulty-eat": ("memout", None),
    "faulty-noise": ("solved", None),
    "faulty-then-abort": ("solved", None),
    "faulty-then-hang": ("solved", None),
    "faulty-then-eat": ("solved", None),
    "faulty-then-raise": ("solved", None),
    "lemke": ("solved", None),
    "bpp": ("solved", None),
}


def _problem(folder: Path, name: str, n: int) -> Path:
    """Strictly diagonally dominant M with the planted solution z = e: q = -Me."""
    M = np.diag(np.full(n, 4.0)) - np.diag(np.ones(n - 1), 1) - np.diag(np.ones(n - 1), -1)
    path = folder / f"{name}.h5"
    storage.save(LCP(M=M, q=-(M @ np.ones(n)), name=name), path)
    return path


def _run(folder: Path, *arguments: str, **kwargs) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "cpbench", "--plugin", str(PLUGIN), "run", *arguments, "--no-report", "-q"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, **kwargs)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Store:
    folder = tmp_path_factory.mktemp("faults")
    problems = [_problem(folder, f"p{n}", n) for n in (3, 8)]
    chosen = [a for name in EXPECTED for a in ("-s", name)]
    done = _run(folder, *map(str, problems), *chosen, "--timeout", f"{LIMIT}s", "--memory", "512M", "-o", "r.sqlite")
    assert done.returncode == 0, done.stderr
    return Store(folder / "r.sqlite")


def test_every_pair_has_its_row(results: Store) -> None:
    table = results.table()
    assert len(table) == 2 * len(EXPECTED)
    assert not (table.status == "not_run").any()


@pytest.mark.parametrize("solver", EXPECTED)
def test_status(results: Store, solver: str) -> None:
    table = results.table()
    rows = table[table.solver == solver]
    status, signal = EXPECTED[solver]
    assert list(rows.status) == [status] * 2, list(rows.message)
    if signal is not None:
        assert list(rows.signal) == [signal] * 2


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("abort", "SIGABRT"),
        ("hang", "killed after 5 s"),
        ("eat", "over 536870912 bytes"),
        ("raise", "division by zero"),
    ],
)
def test_a_repeat_that_fails_costs_no_answer(results: Store, fault: str, told: str) -> None:
    """The row is the first answer's, with its times and a note; the next problem meets a fresh worker."""
    table = results.table()
    rows = table[table.solver == f"faulty-then-{fault}"]
    assert list(rows["flags"]) == ["repeat"] * 2
    assert list(rows.repeats) == [1] * 2
    assert (rows.solve < 1.0).all()
    assert rows.message.str.contains("a repeat failed: ").all()
    assert rows.message.str.contains(told).all()


def test_killed_within_the_limit(results: Store) -> None:
    table = results.table()
    assert (table[table.status == "timeout"].solve <= LIMIT).all()


def test_answers_are_kept_with_their_rows(results: Store) -> None:
    table = results.table().set_index("key")
    kept = {key: unblob(blob) for key, blob in results.answers()}
    answered = table[table.status.isin(["solved", "wrong", "inaccurate"]) & (table.solver != "faulty-nothing")]
    assert set(kept) == set(answered.index)
    for key, row in answered.iterrows():
        assert kept[key].size == json.loads(row["sizes"])["n"]
    lies = table[table.solver == "faulty-liar"].index
    assert all(not kept[key].any() for key in lies)


def test_claims_and_verdicts_are_apart(results: Store) -> None:
    table = results.table()
    lies = table[(table.claim == "solved") & ~table.status.isin(["solved"])]
    assert set(lies.solver) == {"faulty-nan", "faulty-liar", "faulty-short", "faulty-nothing"}


def test_no_process_is_left(tmp_path: Path) -> None:
    """The grandchildren of `faulty-children` die with their group."""
    import psutil

    path = _problem(tmp_path, "p", 3)
    done = _run(tmp_path, str(path), "-s", "faulty-children", "--timeout", "1s", "-o", "r.sqlite")
    assert done.returncode == 0, done.stderr
    time.sleep(0.5)
    mine = [
        p
        for p in psutil.process_iter(["cmdline", "cwd", "status"])
        if p.info["cwd"] == str(tmp_path) and p.info["status"] != psutil.STATUS_ZOMBIE
    ]
    assert mine == []


def test_a_flood_of_output_is_cut(tmp_path: Path) -> None:
    """300 MiB are printed before an abort: the file stays small meanwhile, and the row has both ends."""
    path = _problem(tmp_path, "p", 3)
    command = [sys.executable, "-m", "cpbench", "--plugin", str(PLUGIN), "run", str(path), "-s", "faulty-flood"]
    running = subprocess.Popen(
        [*command, "--timeout", "60s", "--no-report", "-q", "-o", "r.sqlite"],
        cwd=tmp_path,
        env={**os.environ, "TMPDIR": str(tmp_path)},
        stdout=subprocess.DEVNULL,
    )
    largest = 0
    while running.poll() is None:
        for log in tmp_path.glob("cpbench-run-*/*.log"):
            with contextlib.suppress(FileNotFoundError):
                largest = max(largest, log.stat().st_size)
        time.sleep(0.01)
    assert running.returncode == 0
    assert 0 < largest < 2**27
    row = Store(tmp_path / "r.sqlite").table().iloc[0]
    assert (row.status, row.signal) == ("crash", 6)
    assert "first words" in row.message
    assert "last words" in row.message
    assert len(row.message) < 2000


def test_kill_and_resume(tmp_path: Path) -> None:
    """kill -9 half way; the same command goes on; each pair is there once, with its answer.

    One solver waits after ten problems, so that the run is half way when it is killed, however late that is.
    """
    for n in range(2, 42):
        _problem(tmp_path, f"p{n:02}", n)
    (tmp_path / "hold").touch()
    chosen = [a for name in ("lemke", "bpp", "pgs", "faulty-turnstile") for a in ("-s", name)]
    command = [sys.executable, "-m", "cpbench", "--plugin", str(PLUGIN), "run", ".", *chosen]
    command += ["--timeout", "120s", "--no-report", "-q", "-o", "r.sqlite"]
    running = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 240
    done_before = 0
    while time.monotonic() < deadline and running.poll() is None and done_before < 40:
        time.sleep(0.02)
        if (tmp_path / "r.sqlite").exists():
            try:
                store = Store(tmp_path / "r.sqlite")
                counts = store.counts()
                store.close()
            except Exception:  # the file is being made
                continue
            done_before = sum(counts.values()) - counts.get("not_run", 0)
    running.kill()
    running.wait()
    (tmp_path / "hold").unlink()
    assert done_before >= 40
    store = Store(tmp_path / "r.sqlite")
    after_kill = store.table()
    finished = after_kill[after_kill.status != "not_run"].set_index("key")
    assert 0 < len(finished) < 160
    assert {key for key, _ in store.answers()} == set(finished.index)
    store.close()

    again = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert again.returncode == 0, again.stderr
    store = Store(tmp_path / "r.sqlite")
    table = store.table().set_index("key")
    assert len(table) == 160
    assert table.index.is_unique
    assert (table.status == "solved").all()
    assert {key for key, _ in store.answers()} == set(table.index)
    assert (table.loc[finished.index].finished == finished.finished).all(), "finished rows are not run again"
    assert store._db.execute("PRAGMA integrity_check").fetchone()[0] == "ok"
    store.close()


def test_other_limits_do_not_mix(tmp_path: Path) -> None:
    path = _problem(tmp_path, "p", 3)
    assert _run(tmp_path, str(path), "-s", "lemke", "-o", "r.sqlite").returncode == 0
    other = _run(tmp_path, str(path), "-s", "lemke", "-o", "r.sqlite", "--timeout", "20s")
    assert other.returncode == 2
    assert "was made with timeout" in other.stderr
    assert other.stderr.count("\n") == 1
