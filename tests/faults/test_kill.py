"""The runner is killed: nobody outlives it, and the same command goes on where it was."""

from __future__ import annotations

import os
import subprocess
import time

import pytest

from cpbench.bench.results.store import Store


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("problems", [12, pytest.param(40, marks=pytest.mark.nightly)])
def test_kill_and_resume(bench, problems: int) -> None:
    """kill -9 half way; the same command goes on; each pair is there once, with its answer.

    One solver waits after ten problems, so that the run is half way when it is killed, however late that is.
    """
    for n in range(problems):
        bench.problem(f"p{n:02}", n + 2)
    (bench.folder / "hold").touch()
    command = bench.command(["."], ["lemke", "bpp", "pgs", "faulty-turnstile"], "--timeout", "600s")
    running = subprocess.Popen(command, cwd=bench.folder, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 600
    done_before = 0
    while time.monotonic() < deadline and running.poll() is None and done_before < 40:
        time.sleep(0.02)
        if (bench.folder / "r.sqlite").exists():
            try:
                store = bench.store()
                counts = store.counts()
                store.close()
            except Exception:  # the file is being made
                continue
            done_before = sum(counts.values()) - counts.get("not_run", 0)
    running.kill()
    running.wait()
    (bench.folder / "hold").unlink()
    assert done_before >= 40
    store = bench.store()
    after_kill = store.table()
    finished = after_kill[after_kill.status != "not_run"].set_index("key")
    assert 0 < len(finished) < 4 * problems
    assert {key for key, _ in store.answers()} == set(finished.index)
    store.close()

    again = subprocess.run(command, cwd=bench.folder, capture_output=True, text=True, timeout=600)
    assert again.returncode == 0, again.stderr
    store = bench.store()
    table = store.table().set_index("key")
    assert len(table) == 4 * problems
    assert table.index.is_unique
    assert (table.status == "solved").all()
    assert {key for key, _ in store.answers()} == set(table.index)
    assert (table.loc[finished.index].finished == finished.finished).all(), "finished rows are not run again"
    assert store.connection.execute("PRAGMA integrity_check").fetchone()[0] == "ok"
    store.close()


def test_no_process_outlives_the_runner(bench) -> None:
    """kill -9 while a solver has children, and daemons with sessions of their own."""
    command = bench.command([bench.problem("p", 3)], ["faulty-crowd"], "--timeout", "600s")
    running = subprocess.Popen(command, cwd=bench.folder, stdout=subprocess.DEVNULL)
    _wait(lambda: len(bench.living()) > 18)
    running.kill()
    running.wait()
    _wait(lambda: bench.living() == [])
    assert bench.living() == []


def _wait(condition) -> None:
    deadline = time.monotonic() + 600.0
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.1)


@pytest.mark.nightly
def test_a_killed_run_leaves_no_folder_for_ever(bench) -> None:
    """Its temporary files are removed by the next run."""
    environment = {**os.environ, "TMPDIR": str(bench.folder)}
    command = bench.command([bench.problem("p", 3)], ["faulty-hang"], "--timeout", "600s")
    running = subprocess.Popen(command, cwd=bench.folder, env=environment)
    _wait(lambda: list(bench.folder.glob("cpbench-run-*/problem-*")) != [])
    running.kill()
    running.wait()
    left = {path for prefix in ("cpbench-run-", "pymp-") for path in bench.folder.glob(f"{prefix}*")}
    assert len(left) == 4, "two folders, each with its lock"
    assert bench.run([bench.problem("q", 3)], ["lemke"], "-o", "other.sqlite", **environment).returncode == 0
    assert not left & set(bench.folder.iterdir())
    with Store(bench.folder / "other.sqlite") as store:
        assert len(store.table()) == 1
