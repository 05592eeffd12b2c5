"""What may befall a results file: no room, no permission, two writers, kill -9, bytes that are not ours.

Each ends in one line with the file, the cause and what to do, and exit code 2; finished rows stay readable, and the
same command goes on once the cause is gone.
"""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import signal
import sqlite3
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import command_line
import numpy as np
import pytest
from synthetic_results import pair

from cpbench import storage
from cpbench.bench.planning import plan
from cpbench.bench.planning.plan import Entry, Pair
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store, read_results
from cpbench.bench.slot import Slot
from cpbench.errors import StoreError
from cpbench.formulations import LCP

ROW = {"status": "solved", "error": 1e-9, "message": "", "solve": 1e-3}


PLANNED = [pair(i) for i in range(200)]


def cpbench(*arguments: str | Path, **kwargs) -> subprocess.CompletedProcess[str]:
    """The command line in this process; in one of its own where that is to have something of its own."""
    words = list(map(str, arguments))
    if not kwargs:
        return command_line.cpbench(Path.cwd(), *words)
    return subprocess.run(
        [sys.executable, "-m", "cpbench", *words], capture_output=True, text=True, timeout=600, **kwargs
    )


def run(folder: Path, output: Path, **kwargs) -> subprocess.CompletedProcess[str]:
    """`cpbench run` of two solvers on one problem in `folder`."""
    path = folder / "p.h5"
    if not path.exists():
        storage.save(LCP(M=4.0 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1), q=-np.ones(4), name="p"), path)
    return cpbench("run", path, "-s", "lemke", "-s", "bpp", "--no-report", "-q", "-o", output, **kwargs)


def assert_refused(done: subprocess.CompletedProcess[str], path: Path, *words: str) -> None:
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith(f"cpbench: {path}: "), done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    for word in words:
        assert word in done.stderr


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 1 MiB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(folder)], capture_output=True)
    if mounted.returncode:
        pytest.skip("does not apply: only root may mount a file system")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.fixture
def unwritable(tmp_path: Path) -> Iterator[Path]:
    """A folder, writable until it is given to `make_unwritable`."""
    folder = tmp_path / "unwritable"
    folder.mkdir()
    if os.geteuid() == 0:  # whom no permission binds
        if subprocess.run(["mount", "-t", "tmpfs", "tmpfs", str(folder)], capture_output=True).returncode:
            pytest.skip("does not apply: root in a container that may not mount")
        try:
            yield folder
        finally:
            subprocess.run(["umount", "-l", str(folder)], check=True)
    else:
        try:
            yield folder
        finally:
            folder.chmod(0o755)


def make_unwritable(folder: Path) -> None:
    if os.geteuid() == 0:
        subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True)
    else:
        for path in folder.iterdir():
            path.chmod(0o444)
        folder.chmod(0o555)


def fill(path: Path) -> int:
    """Finish rows with incompressible answers until there is no room left; how many were."""
    rng = np.random.default_rng(0)

    def finish(pairs: list[Pair]) -> None:
        for p in pairs:
            store.finish(p.key, Outcome(**ROW, answer=rng.bytes(20_000)))

    with Store(path, create=True) as store:
        store.plan(PLANNED)
        with pytest.raises(StoreError, match="what was finished is kept, and the same command goes on") as told:
            finish(PLANNED)
        assert str(told.value).startswith(f"{path}: ")
        done = store.counts()["solved"]
        with pytest.raises(StoreError):  # once more, with the connection as the failure left it
            finish(PLANNED[done:])
    return done


def assert_intact(path: Path, done: int) -> None:
    """The finished rows are readable, each with its answer, and no other has one."""
    with Store(path) as store:
        finished = {row.key for row in store.rows() if row.status != "not_run"}
        assert len(finished) == done
        assert {key for key, blob in store.answers() if len(blob) == 20_000} == finished
        assert store.read("PRAGMA integrity_check") == [("ok",)]


# ------------------------------------------------------------------------------------------------ room


def test_a_file_that_may_not_grow_loses_nothing(tmp_path: Path) -> None:
    """The same by a limit on the size of files, which every user can set, in a process of its own."""
    path = tmp_path / "r.sqlite"
    code = f"""
        import importlib.util, pathlib, resource, sys
        sys.path[:0] = {[folder for folder in sys.path if folder.endswith("unit")]!r}
        resource.setrlimit(resource.RLIMIT_FSIZE, (600_000, 600_000))
        spec = importlib.util.spec_from_file_location("faults", {__file__!r})
        faults = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(faults)
        print(faults.fill(pathlib.Path({str(path)!r})))
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 5
    assert_intact(path, int(done.stdout))
    with Store(path, create=True) as store:
        for p in PLANNED[int(done.stdout) :]:
            store.finish(p.key, Outcome(**ROW, answer=bytes(20_000)))
    assert_intact(path, 200)


@pytest.mark.needs("cpbench_solvers")
def test_a_run_without_room_goes_on_when_there_is(disk: Path, tmp_path: Path) -> None:
    path, ballast = disk / "r.sqlite", disk / "ballast"
    with contextlib.suppress(OSError), ballast.open("wb") as file:
        while True:
            file.write(bytes(4096))
            file.flush()
    assert_refused(run(tmp_path, path), path, "no room", "make room")
    ballast.unlink()
    done = run(tmp_path, path)
    assert done.returncode == 0, done.stderr
    assert list(read_results(path).status) == ["solved", "solved"]


@pytest.mark.needs("cpbench_solvers")
def test_temporary_files_that_cannot_be_written_are_nobodys_refusal(tmp_path: Path) -> None:
    """The folder of a run's temporary files vanishes: an error, where `unsupported` would be said of the solver."""
    path = tmp_path / "p.h5"
    storage.save(LCP(M=np.eye(3), q=-np.ones(3), name="p"), path)
    with Slot() as slot:
        survey = slot.survey(str(path), [plan.exact()])
        (planned,) = plan.pairs([survey], [Entry("lemke")], [plan.exact()], 1e-6)
        slot._scratch.remove()
        outcome = slot.run(planned, slot.prepare(planned))
    assert outcome.status == "error"
    assert "cannot be written" in str(outcome.message)


# ------------------------------------------------------------------------------------------ permission


@pytest.mark.needs("cpbench_solvers")
def test_a_folder_that_cannot_be_written(unwritable: Path, tmp_path: Path) -> None:
    """Nothing can be run into it; what is in it can be read."""
    path = unwritable / "r.sqlite"
    with Store(path, create=True) as store:
        store.plan(PLANNED)
        store.finish(PLANNED[0].key, Outcome(**ROW, answer=b"answer"))
    make_unwritable(unwritable)
    assert_refused(run(tmp_path, unwritable / "new.sqlite"), unwritable / "new.sqlite", "cannot be written", "-o")
    assert_refused(run(tmp_path, path), path, "cannot be written", "-o")
    assert read_results(path).status.value_counts()["solved"] == 1
    assert cpbench("results", "export", path, "--rows", tmp_path / "rows.csv").returncode == 0


def test_a_log_that_a_killed_run_left_in_a_folder_that_cannot_be_written(unwritable: Path, tmp_path: Path) -> None:
    path = unwritable / "r.sqlite"
    child = os.fork()
    if child == 0:
        store = Store(path, create=True)
        store.plan(PLANNED)
        store.finish(PLANNED[0].key, Outcome(**ROW, answer=b"answer"))
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)
    assert (unwritable / "r.sqlite-wal").stat().st_size > 0
    (unwritable / "r.sqlite-shm").unlink()
    make_unwritable(unwritable)
    with pytest.raises(StoreError, match=r"copy it and r\.sqlite-wal into another folder"):
        read_results(path)
    for name in ("r.sqlite", "r.sqlite-wal"):
        shutil.copyfile(unwritable / name, tmp_path / name)
    assert read_results(tmp_path / "r.sqlite").status.value_counts()["solved"] == 1


@pytest.mark.needs("cpbench_solvers")
def test_a_folder_of_the_kernel(tmp_path: Path) -> None:
    path = Path("/proc/self/r.sqlite")
    assert_refused(run(tmp_path, path), path, "cannot be written", "another folder")


# ----------------------------------------------------------------------------------------- two writers


@pytest.mark.needs("cpbench_solvers")
def test_two_runs_on_one_file(tmp_path: Path) -> None:
    """The second is told who is at it; readers are let in; kill -9 of the first leaves no lock behind."""
    path = tmp_path / "r.sqlite"
    assert run(tmp_path, path).returncode == 0
    code = "import sys, time; from cpbench.bench.results.store import Store; s = Store(sys.argv[1], create=True)"
    code += "; s.connection.execute('BEGIN IMMEDIATE'); print('held', flush=True); time.sleep(600)"
    command = [sys.executable, "-c", code, str(path)]
    holder = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        before = path.read_bytes()
        assert_refused(run(tmp_path, path), path, f"process {holder.pid} on ", "writing it since 20", "-o")
        assert path.read_bytes() == before
        assert list(read_results(path).status) == ["solved", "solved"]
        assert cpbench("results", "export", path, "--rows", tmp_path / "rows.csv").returncode == 0
    finally:
        holder.kill()
        holder.communicate()
    again = run(tmp_path, path)
    assert again.returncode == 0, again.stderr
    assert {p.name for p in tmp_path.iterdir()} == {"p.h5", "r.sqlite", "rows.csv"}, "nothing is left beside it"


def test_a_link_is_the_file_that_it_leads_to(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    path, link = tmp_path / "elsewhere" / "r.sqlite", tmp_path / "link.sqlite"
    link.symlink_to(path)
    with Store(link, create=True) as store:
        store.plan(PLANNED)
        with pytest.raises(StoreError, match=f"process {os.getpid()} on "):
            Store(path, create=True)
        assert len(read_results(path)) == len(PLANNED)
    assert [p.name for p in path.parent.iterdir()] == ["r.sqlite"]


def test_another_program_that_holds_the_database(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cpbench.bench.results.database.PATIENCE", 0.1)
    path = tmp_path / "r.sqlite"
    with Store(path, create=True) as store:
        store.plan(PLANNED)
    other = sqlite3.connect(path, isolation_level=None)
    with Store(path, create=True) as store:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(StoreError, match="held by another program"):
            store.finish(PLANNED[0].key, Outcome(**ROW))
        other.execute("ROLLBACK")
        store.finish(PLANNED[0].key, Outcome(**ROW))
    other.close()


# ------------------------------------------------------------------------------------- bytes not ours


def _whole(path: Path) -> bytes:
    with Store(path, create=True) as store:
        store.plan(PLANNED)
        for p in PLANNED:
            store.finish(p.key, Outcome(**ROW, answer=p.key.encode() * 20))
    return path.read_bytes()


BROKEN = {
    "empty": (lambda whole: b"", "not a results file"),
    "text": (lambda whole: b"no database\n" * 1000, "not a results file"),
    "first bytes": (lambda whole: whole[:50], "damaged"),
    "one page": (lambda whole: whole[:4096], "damaged"),
    "half": (lambda whole: whole[: len(whole) // 2], "damaged"),
    "noise": (lambda whole: whole[:4096] + np.random.default_rng(0).bytes(len(whole) - 4096), "damaged"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_a_file_that_is_broken(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "r.sqlite"
    spoil, told = BROKEN[kind]
    path.write_bytes(spoil(_whole(path)))
    before = path.read_bytes()
    with pytest.raises(StoreError) as refusal:
        read_results(path)
    assert str(refusal.value).startswith(f"{path}: ")
    assert told in str(refusal.value)
    assert "\n" not in str(refusal.value)
    if kind != "empty":  # which a run may fill
        with pytest.raises(StoreError, match=told), Store(path, create=True) as store:
            store.plan(PLANNED)
    assert path.read_bytes() == before


def test_a_noisy_page_costs_no_more_than_its_rows(tmp_path: Path) -> None:
    """Where pages of answers are spoilt, the rows are still read, and the answers told damaged."""
    path = tmp_path / "r.sqlite"
    whole = bytearray(_whole(path))
    at = whole.index(PLANNED[100].key.encode() * 20) // 4096 * 4096
    whole[at : at + 4096] = b"\xff" * 4096
    path.write_bytes(whole)
    with Store(path) as store:
        assert store.counts() == {"solved": 200}
        assert len(store.table()) == 200
        with pytest.raises(StoreError, match="damaged"):
            list(store.answers())


@pytest.mark.needs("cpbench_solvers")
def test_through_the_command_line(tmp_path: Path) -> None:
    text = tmp_path / "text.sqlite"
    text.write_text("no database\n" * 1000)
    for path, word in ((text, "not a results file"), (tmp_path, "is a folder"), (tmp_path / "no" / "r", "no folder")):
        if path != tmp_path:
            assert_refused(run(tmp_path, path), path, word)
        if path.exists():
            assert_refused(cpbench("results", "export", path, "--rows", tmp_path / "rows.csv"), path, word)


@pytest.mark.nightly
def test_a_limit_that_is_set_from_outside_is_no_crash(tmp_path: Path) -> None:
    """`ulimit -f` over a whole run: one line, whatever it was that could not grow."""
    path = tmp_path / "r.sqlite"
    limit = (40_960, 40_960)
    done = run(tmp_path, path, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, limit))
    assert_refused(done, path)
    done = run(tmp_path, path)
    assert done.returncode == 0, done.stderr
    assert list(read_results(path).status) == ["solved", "solved"]
