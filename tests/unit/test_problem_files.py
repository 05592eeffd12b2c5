"""Problem files that changed after a run: named by `report` and `compare`, in the same words in all that they write."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from command_line import cpbench
from synthetic_results import results_file, row, table

import cpbench as cp
from cpbench import storage
from cpbench.api import reports
from cpbench.api.results import Results
from cpbench.bench.results import problem_files
from cpbench.bench.results.merge import merge
from cpbench.bench.results.store import Store
from cpbench.formulations.base import Info

M, Q = [[5.0, 1.0], [2.0, 3.0]], [-1.5, -7.0]
WORDS = "changed after the run read them: "


def _h5(folder: Path) -> list[str]:
    cp.save(cp.LCP(M=M, q=Q), folder / "p.h5")
    return ["p.h5"]


def _two_texts(folder: Path) -> list[str]:
    (folder / "p-M.txt").write_text("2\n2\n5 1\n2 3\n")
    (folder / "p-q.txt").write_text("2\n-1.5\n-7\n")
    return ["p-M.txt", "p-q.txt"]


def _ran(folder: Path, address: str) -> None:
    with Store(folder / "r.sqlite", create=True) as store:
        store.set_meta(files=problem_files.digests({address: None}))


def _changed(results: Path) -> list[str]:
    with Store(results) as store:
        return problem_files.changed(store)


@pytest.mark.parametrize("write", [_h5, _two_texts])
def test_a_change_of_any_file_of_a_problem_is_named(
    write: Callable[[Path], list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the same length, and of another; what is written again as it was, or is gone, did not change."""
    monkeypatch.chdir(tmp_path)
    names = write(tmp_path)
    assert storage.files(names[0])
    _ran(tmp_path, names[0])
    assert _changed(tmp_path / "r.sqlite") == []
    for name in (name for name in names if (tmp_path / name).is_file()):
        file = tmp_path / name
        whole = file.read_bytes()
        for other in (whole[:-1] + bytes([whole[-1] ^ 1]), whole + b" ", b""):
            file.write_bytes(other)
            [line] = _changed(tmp_path / "r.sqlite")
            assert f"{WORDS}{name};" in line
        file.write_bytes(whole)
        os.utime(file, ns=(0, 0))
        assert _changed(tmp_path / "r.sqlite") == []
        file.unlink()
        assert _changed(tmp_path / "r.sqlite") == []


def test_relative_paths_are_also_those_beside_the_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file of that name in the current folder is not taken for it where the one beside the results is as it was."""
    away, here = tmp_path / "away", tmp_path / "here"
    for folder in (away, here):
        folder.mkdir()
        _h5(folder)
    monkeypatch.chdir(away)
    _ran(away, "p.h5")
    monkeypatch.chdir(here)
    cp.save(cp.LCP(M=M, q=[-4.0, 2.0]), here / "p.h5", force=True)
    assert _changed(away / "r.sqlite") == []
    shutil.copyfile(here / "p.h5", away / "p.h5")
    assert len(_changed(away / "r.sqlite")) == 1


def test_a_merge_keeps_what_was_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    _h5(tmp_path)
    _ran(tmp_path, "p.h5")
    merge(["r.sqlite"], "m.sqlite")
    (tmp_path / "p.h5").write_bytes(b"other")
    assert WORDS in _changed(tmp_path / "m.sqlite")[0]


@pytest.mark.needs("cpbench_solvers")
def test_report_and_compare_name_it_and_the_rest_goes_on(tmp_path: Path) -> None:
    _h5(tmp_path)
    done = cpbench(tmp_path, "run", "p.h5", "-s", "lemke", "-o", "r.sqlite", "--no-report", "-q", "--repeats", "1")
    assert done.returncode == 0, done.stderr
    words = f"{WORDS}p.h5;"
    for named in (False, True):
        report = cpbench(tmp_path, "report", "r.sqlite", "-o", "out")
        compared = cpbench(tmp_path, "compare", "r.sqlite", "r.sqlite", "-o", "c.md", "-o", "c.json")
        Results(tmp_path / "r.sqlite").report(tmp_path / "api")
        assert (report.returncode, compared.returncode) == (0, 0), report.stderr
        texts = [report.stderr, compared.stdout, *(_text(tmp_path / name) for name in WRITTEN)]
        assert [words in text for text in texts] == [named] * len(texts)
        cp.save(cp.LCP(M=M, q=[-4.0, 2.0]), tmp_path / "p.h5", force=True)


WRITTEN = ("out/report.md", "api/report.md", "out/report.html", "c.md", "c.json")


def _text(path: Path) -> str:
    text = path.read_text("utf-8")
    return "\n".join(json.loads(text)["notes"]) if path.suffix == ".json" else text


def test_a_report_says_where_problems_are_from(tmp_path: Path) -> None:
    """As unchanged files at hand say it, beside the results too; others, and what is no file, are passed over."""
    problems = {name: cp.LCP(M=M, q=[-1.0, float(k)]) for k, name in enumerate(("good", "changed", "cut", "gone"))}
    about = Info(source="a lecture", citation="Acary 2024", licence="CC0-1.0")
    for name, problem in problems.items():
        cp.save(replace(problem, info=about), tmp_path / f"{name}.h5")
    (tmp_path / "cut.h5").write_bytes((tmp_path / "good.h5").read_bytes()[:2000])
    cp.save(cp.LCP(M=M, q=[3.0, 3.0]), tmp_path / "changed.h5", force=True)
    (tmp_path / "gone.h5").unlink()
    os.mkfifo(tmp_path / "gone.h5")
    rows = [
        row(f"{name}/1", "lemke", "solved", 0.1, family=name, address=f"{name}.h5", fingerprint=problem.fingerprint)
        for name, problem in problems.items()
    ]
    path = results_file(tmp_path / "r.sqlite", table(*rows))
    reports.report_file(path, tmp_path / "out", "t", None)
    text = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert re.findall(r"<td>a lecture; Acary 2024</td>\s*<td>CC0-1.0</td>", text)
    assert text.count("<td>not given</td>") == 2 * 3
