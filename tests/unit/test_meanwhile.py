"""A task that a copy of the process does: it is done when its block is left, whatever becomes of the copy."""

from __future__ import annotations

import os
import signal
import time
from contextlib import nullcontext
from pathlib import Path
from typing import BinaryIO

import pytest
from synthetic_results import meta, suite

from cpbench.report import conditions
from cpbench.report.folder import write_folder
from cpbench.report.meanwhile import meanwhile
from cpbench.storage.base import write_atomic

needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="does not apply: this system copies no process")


@pytest.mark.parametrize("copied", [False, pytest.param(True, marks=needs_fork)])
def test_both_are_done(tmp_path: Path, copied: bool) -> None:
    with meanwhile(lambda: (tmp_path / "who").write_text(str(os.getpid())) and None, copied=copied):
        pass
    assert (int((tmp_path / "who").read_text()) != os.getpid()) == copied


@needs_fork
@pytest.mark.parametrize("how", ["killed", "raises"])
def test_what_a_copy_did_not_finish_is_done_here(tmp_path: Path, how: str) -> None:
    here = os.getpid()

    def task() -> None:
        if os.getpid() != here:
            if how == "raises":
                raise OSError("no room")
            os.kill(os.getpid(), signal.SIGKILL)
        (tmp_path / "done").touch()

    with meanwhile(task, copied=True):
        pass
    assert (tmp_path / "done").exists()


@needs_fork
def test_what_fails_here_too_is_raised() -> None:
    with pytest.raises(ZeroDivisionError), meanwhile(lambda: 1 // 0 and None, copied=True):
        pass


@needs_fork
def test_an_error_within_ends_the_copy(tmp_path: Path) -> None:
    def task() -> None:
        (tmp_path / "begun").touch()
        time.sleep(3600)
        (tmp_path / "done").touch()

    def fail() -> None:
        with meanwhile(task, copied=True):
            while not (tmp_path / "begun").exists():
                time.sleep(0.01)
            raise KeyError("a section")

    begun = time.monotonic()
    with pytest.raises(KeyError):
        fail()
    assert time.monotonic() - begun < 600, "it was not waited for"
    assert not (tmp_path / "done").exists()


@needs_fork
def test_a_copy_that_is_ended_leaves_no_file_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even where the system knows no files without a name."""
    monkeypatch.setattr("cpbench.storage.base._nameless", lambda _: nullcontext(None))

    def put(_: BinaryIO) -> None:
        (tmp_path / "begun").touch()
        time.sleep(3600)

    def fail() -> None:
        with meanwhile(lambda: write_atomic(tmp_path / "results.csv", put, force=True), copied=True):
            while not (tmp_path / "begun").exists():
                time.sleep(0.01)
            raise KeyError("a section")

    with pytest.raises(KeyError):
        fail()
    assert [path.name for path in tmp_path.iterdir()] == ["begun"]


@pytest.mark.nightly
def test_a_report_of_many_rows_is_the_same_but_for_what_it_says_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Drawn and written by other processes as soon as rows are many."""
    rows = suite(problems=8, labels=5)
    write_folder(rows, meta(), tmp_path / "few", "t")
    monkeypatch.setattr("cpbench.report.markdown.WHOLE", 10)
    monkeypatch.setattr("cpbench.report.conditions.WHOLE", 10)
    monkeypatch.setattr("cpbench.report.markdown.cores", lambda: 2)
    monkeypatch.setattr("cpbench.report.easel.cores", lambda: 2)
    write_folder(rows, meta(), tmp_path / "many", "t")
    few, many = ({path.name: path.read_bytes() for path in (tmp_path / name).iterdir()} for name in ("few", "many"))
    assert few.keys() == many.keys()
    assert {name for name in few if few[name] != many[name]} == {"report.md"}
    told = many["report.md"].decode().splitlines()
    assert [line for line in told if line not in few["report.md"].decode()] == [f"- many rows: {conditions.MANY}"]
