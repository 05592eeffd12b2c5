"""Files and texts of others: what kills a reader, never ends, is larger than it looks, or would be obeyed."""

from __future__ import annotations

import csv
import os
import resource
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import scipy.io
import scipy.sparse as sp
from command_line import exit_code
from tiers import some_by_day

from cpbench import storage
from cpbench.bench.planning import plan_file, quantities
from cpbench.bench.processes import guard
from cpbench.errors import CpbenchError, FormatError
from cpbench.formulations import LCP
from cpbench.report import row_files
from cpbench_problems.formats.trial import require_survivor

ESC = "\x1b]0;owned\x07"


@pytest.mark.parametrize("number", [signal.SIGSEGV, signal.SIGBUS, signal.SIGKILL])
def test_a_killed_reader_is_reported(tmp_path: Path, number: signal.Signals) -> None:
    with pytest.raises(FormatError, match=f"its reader was killed by {number.name}"):
        require_survivor(tmp_path / "x.mat", lambda: os.kill(os.getpid(), number), "its reader")


def test_indices_that_point_outside_their_matrix_are_refused(tmp_path: Path) -> None:
    """SciPy reads them as they stand; a conversion of such a matrix killed the command line."""
    square, one = sp.csc_matrix(np.eye(4)), np.ones((4, 1))
    path, ends = tmp_path / "damaged.mat", np.array([0, 1, 2, 3, 4], np.int32)
    scipy.io.savemat(path, {"P": square, "A": square, "q": one, "l": one, "u": one, "r": 0.0})
    whole = path.read_bytes()
    assert whole.count(ends.tobytes()) == 2
    ends[2] = 1_000_000
    before, _, after = whole.rpartition(np.arange(5, dtype=np.int32).tobytes())
    path.write_bytes(before + ends.tobytes() + after)
    with pytest.raises(FormatError, match="A: is a damaged sparse matrix"):
        storage.load(path)


@pytest.mark.parametrize("command", some_by_day(["info", "convert", "solve", "verify"], 2))
def test_pipes_and_devices_are_refused(monkeypatch, capsys, tmp_path, command) -> None:
    """At once: opening a pipe that nobody writes waits for ever, /dev/zero has no end."""
    os.mkfifo(tmp_path / "f.h5")
    (tmp_path / "z.dat").symlink_to("/dev/zero")
    more: dict[str, list[Any]] = {"convert": [tmp_path / "o.h5"], "solve": ["-s", "lemke"]}
    for name in ("f.h5", "z.dat"):
        assert exit_code(monkeypatch, command, tmp_path / name, *more.get(command, [])) == 2
        err = capsys.readouterr().err
        assert f"{tmp_path / name}: is not a regular file" in err
        assert err.count("\n") == 1


def test_a_long_file_of_zeros_is_refused_at_once(tmp_path: Path) -> None:
    (tmp_path / "zeros.dat").write_text("0 " * 10_000_000)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    with pytest.raises(FormatError, match="more than 1 numbers after the last one"):
        storage.load(tmp_path / "zeros.dat")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_utime - before < 5.0, "it was 17 s"


def test_an_archive_that_grows_is_refused_by_its_headers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No array is read: the headers already say that P does not fit to q."""
    np.savez_compressed(tmp_path / "bomb.npz", P=np.zeros((3000, 3000)), q=np.zeros(3))
    monkeypatch.setattr("zipfile.ZipFile.read", lambda *_: pytest.fail("an array was read"))
    with pytest.raises(FormatError, match="P: is 3000x3000, expected 3x3"):
        storage.load(tmp_path / "bomb.npz")


def test_no_cell_is_a_formula_and_no_control_character_is_left(tmp_path: Path) -> None:
    """What a spreadsheet, and Python's own reader of CSV, find in the cells; numbers stay numbers."""
    texts = [
        "=1+1",
        "+1",
        "-1",
        "@SUM(A1)",
        "\t=1",
        f"a{ESC}b",
        "half \ud800",
        "two\rlines",
        "a-b",
        "x=1",
        'say "=1"',
        "a,b",
    ]
    for cells in (texts, texts * 200, [f"{text}{k}" for k, text in enumerate(texts * 50)]):
        made = pd.DataFrame({"text": pd.Series(cells, dtype=object), "number": -1.5})
        row_files.write(made, tmp_path / "cells.csv")
        with (tmp_path / "cells.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))[1:]
        assert [row[1] for row in rows] == ["-1.5"] * len(cells)
        for cell, text in zip((row[0] for row in rows), cells, strict=True):
            assert not cell.startswith(("=", "+", "-", "@", "\t"))
            assert cell.replace("\t", "").isprintable()
            if text.isprintable():
                assert cell in (text, f"'{text}")


def test_names_in_files_and_of_files_are_spelled_out(monkeypatch, capsys, tmp_path) -> None:
    storage.save(LCP(M=np.eye(2), q=[-1.0, 1.0], name=f"x{ESC}"), tmp_path / "p.h5")
    assert exit_code(monkeypatch, "info", tmp_path / "p.h5") == 0
    assert exit_code(monkeypatch, "info", tmp_path / f"no{ESC}.h5") == 2
    said = capsys.readouterr()
    assert "\x1b" not in said.out + said.err
    assert r"x\x1b]0;owned\x07" in said.out


@pytest.mark.parametrize("text", ["99999999999999999999G", "9" * 400, "9" * 5000])
def test_sizes_that_nothing_holds(text: str) -> None:
    for read in (quantities.size, quantities.seconds):
        with pytest.raises(CpbenchError, match=r"too large|too long|is no") as refusal:
            read(text)
        assert len(str(refusal.value)) < 6000


@pytest.mark.parametrize("digits", [20, 4000, 100_000])
def test_numbers_of_plans_that_nothing_holds(monkeypatch, capsys, tmp_path, digits) -> None:
    for key in ("seed", "memory", "repeats", "jobs"):
        (tmp_path / "plan.toml").write_text(f"{key} = 1{'0' * digits}\n")
        with pytest.raises(CpbenchError, match=r"too large|is not valid TOML") as refusal:
            plan_file.read(tmp_path / "plan.toml")
        assert "\n" not in str(refusal.value)
        assert len(str(refusal.value)) < 400
    assert exit_code(monkeypatch, "run", tmp_path, "--memory", "99999999999999999999G") == 2
    assert exit_code(monkeypatch, "run", tmp_path, "--seed", f"1{'0' * digits}") == 2
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize("code", [0, 1, 7, 255])
def test_a_process_ends_with_the_code_of_its_program(code: int) -> None:
    pid = os.fork()
    if pid == 0:
        guard.end_like(code)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == code
