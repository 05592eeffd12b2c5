"""The command line: what it says, what it writes, how it ends."""

from __future__ import annotations

import csv
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command_line import cpbench as in_process
from command_line import exit_code as cpbench
from command_line import with_plugins
from tiers import by_night

from cpbench import storage
from cpbench.bench.results.store import Store
from cpbench.cli import COMMANDS
from cpbench.formulations import LCP, FrictionContact


@pytest.fixture
def lcp(tmp_path: Path) -> Path:
    """z = (4/3, 7/3) solves it: deudeu of the Siconos collection."""
    path = tmp_path / "deudeu.h5"
    storage.save(LCP(M=np.array([[2.0, 1], [1, 2]]), q=[-5.0, -6.0], name="deudeu"), path)
    return path


@pytest.fixture
def contact(tmp_path: Path) -> Path:
    """Two contacts in 3D, one sliding, one open; W = I."""
    path = tmp_path / "contact.hdf5"
    q = np.array([-1.0, 3, 4, 2, 0, 0])
    storage.save(FrictionContact(W=np.eye(6), q=q, mu=[0.5, 0.3], dimension=3, name="contact"), path)
    return path


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(monkeypatch, capsys, name) -> None:
    assert cpbench(monkeypatch, name, "--help") == 0
    assert "Usage" in capsys.readouterr().out


def test_the_help_has_the_sentence_of_every_command(monkeypatch, capsys) -> None:
    """The first of its module's docstring."""
    assert cpbench(monkeypatch, "--help") == 0
    told = " ".join(capsys.readouterr().out.split())
    for name in COMMANDS:
        sentence, _, _ = (import_module(f"cpbench.cli.{name}_command").__doc__ or "").partition("\n\n")
        assert f" {name} {' '.join(sentence.split())}" in told


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("text", "options", "word"),
    [
        ("this is not HDF5", [], "is not an HDF5 file"),
        (None, [], "bad.hdf5"),
        ("2 2 1 1 2", ["--format", "siconos-fc4d"], "siconos-fc3d"),
    ],
    ids=["damaged", "missing", "unknown format"],
)
@pytest.mark.parametrize("command", ["info", "convert", "solve"])
def test_bad_input_is_one_line(monkeypatch, capsys, tmp_path, text, options, word, command) -> None:
    bad = tmp_path / "bad.hdf5"
    if text is not None:
        bad.write_text(text)
    before = set(tmp_path.iterdir())
    extra = {"info": [], "convert": [tmp_path / "out.h5", "--to", "lcp"], "solve": ["-s", "nsgs"]}[command]
    assert cpbench(monkeypatch, command, bad, *extra, *options) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1, said.err
    assert word in said.err
    assert said.out == ""
    assert set(tmp_path.iterdir()) == before, "nothing is written"


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["convert", "{lcp}", "out.h5", "--to", "mclp"], "mlcp"),
        (["solve", "{lcp}", "-s", "lemka"], "lemke"),
        (["solve", "{lcp}", "-s", "psor[omga=1.2]"], "omega"),
        (["convret", "{lcp}"], "convert"),
        (["convert", "{contact}", "out.h5", "--to", "lcp", "--via", "inne"], "inner"),
        (["convert", "{contact}", "out.h5", "--to", "lcp", "--via", "outer"], "fc-lcp-outer or fc-mlcp-outer"),
    ],
)
def test_unknown_names_offer_the_nearest(monkeypatch, capsys, lcp, contact, arguments, word) -> None:
    monkeypatch.chdir(lcp.parent)
    before = set(lcp.parent.iterdir())
    assert cpbench(monkeypatch, *[a.format(lcp=lcp, contact=contact) for a in arguments]) == 2
    said = capsys.readouterr().err
    assert word in said
    assert len(said.splitlines()) == 1
    assert set(lcp.parent.iterdir()) == before


@pytest.mark.needs("cpbench_solvers")
def test_solve_and_verify_end_with_what_was_measured(monkeypatch, capsys, lcp, tmp_path) -> None:
    """1 unless the answer is verified; the answer is written all the same, and never over another."""
    out = tmp_path / "z.npy"
    assert cpbench(monkeypatch, "solve", lcp, "-s", "lemke[max_pivots=1]", "-o", out) == 1
    assert cpbench(monkeypatch, "verify", lcp, "--answer", out) == 1
    before = out.read_bytes()
    capsys.readouterr()
    assert cpbench(monkeypatch, "solve", lcp, "-s", "lemke", "-o", out) == 2
    told = capsys.readouterr()
    assert (told.out, out.read_bytes()) == ("", before), "it is refused before anything is solved"
    assert "exists already" in told.err
    assert cpbench(monkeypatch, "solve", lcp, "-s", "lemke", "-o", out, "--force") == 0
    assert cpbench(monkeypatch, "verify", lcp, "--answer", out) == 0


def test_existing_output_needs_force(monkeypatch, capsys, lcp, tmp_path) -> None:
    out = tmp_path / "out.h5"
    assert cpbench(monkeypatch, "convert", lcp, out, "--to", "mlcp") == 0
    before = out.read_bytes()
    assert cpbench(monkeypatch, "convert", lcp, out, "--to", "qp") == 2
    assert "--force" in capsys.readouterr().err
    assert out.read_bytes() == before
    assert cpbench(monkeypatch, "convert", lcp, out, "--to", "qp", "--force") == 0
    assert storage.load(out).node == "qp"


@pytest.mark.needs("cpbench_solvers")
def test_run_writes_results_and_report(monkeypatch, capsys, lcp, contact) -> None:
    """A small run, its rows as CSV, its answers again under another measure."""
    folder = lcp.parent
    command = ["run", "deudeu.h5", "contact.hdf5", "-s", "lemke", "-s", "nsgs"]
    done = in_process(folder, *command, "--routes", "all", "-o", "r.sqlite")
    assert done.returncode == 0, done.stderr
    assert (folder / "reports" / "r" / "report.md").exists()
    assert (folder / "reports" / "r" / "report.html").exists()
    monkeypatch.chdir(folder)
    assert cpbench(monkeypatch, "results", "export", "r.sqlite", "--rows", "rows.csv", "--answers", "answers.h5") == 0
    rows = {(r["problem"], r["label"]): r for r in csv.DictReader((folder / "rows.csv").read_text().splitlines())}
    assert rows["deudeu", "lemke"]["status"] == "solved"
    assert rows["contact", "nsgs"]["status"] == "solved"
    facets = rows["contact", "lemke@inner8"]
    assert facets["kind"] == "approximate"
    assert facets["status"] != "solved", "eight facets do not meet 1e-6 on the exact law"
    with h5py.File(folder / "answers.h5") as file:
        assert sum(len(group) for group in file.values()) == len(rows)
    capsys.readouterr()
    assert cpbench(monkeypatch, "verify", "r.sqlite", "-t", "0.2") == 0
    assert "lemke@inner8: approximate -> solved" in capsys.readouterr().out


def _meta(path: Path) -> dict[str, Any]:
    store = Store(path)
    try:
        return store.meta()
    finally:
        store.close()


@pytest.mark.needs("cpbench_solvers")
def test_a_resumed_run_keeps_what_the_results_know_of_other_solvers(lcp) -> None:
    """Another solver, then the first again, with nothing left to do: both have their sheets, with versions."""
    for solver in ("lemke", "bpp", "lemke"):
        done = in_process(lcp.parent, "run", lcp.name, "-s", solver, "--no-report", "-o", "r.sqlite")
        assert done.returncode == 0, done.stderr
    sheets = _meta(lcp.parent / "r.sqlite")["solvers"]
    assert set(sheets) == {"lemke", "bpp"}
    assert all(sheet["version"] for sheet in sheets.values())


@pytest.mark.needs("cpbench_solvers")
def test_a_refused_file_that_was_mended_is_refused_no_longer(lcp) -> None:
    folder = lcp.parent
    (folder / "bad.h5").write_bytes(lcp.read_bytes()[:100])
    (folder / "worse.h5").write_bytes(b"no problem")
    command = ["run", lcp.name, "bad.h5", "worse.h5", "-s", "lemke", "--no-report"]
    found = []
    for _ in range(2):
        done = in_process(folder, *command, "-o", "r.sqlite")
        assert done.returncode == 1, done.stderr
        assert "named and not read: " in done.stderr
        found.append([Path(address).name for address, _ in _meta(folder / "r.sqlite")["refused"]])
        storage.save(LCP(M=np.eye(2), q=[-1.0, -1.0], name="bad"), folder / "bad.h5", force=True)
    assert found == [["bad.h5", "worse.h5"], ["worse.h5"]]


@pytest.mark.needs("cpbench_solvers")
def test_rejudging_reads_files_by_the_format_of_their_run(monkeypatch, capsys, lcp) -> None:
    """A text file whose name tells nothing, in one results file with one that needs no `--format`."""
    folder = lcp.parent
    monkeypatch.chdir(folder)
    storage.save(storage.load(lcp), folder / "plain.dat")
    (folder / "plain.dat").rename(folder / "plain.txt")
    storage.save(LCP(M=np.eye(2), q=[-1.0, -1.0], name="other"), folder / "other.h5")
    (folder / "plain.toml").write_text('problems = "plain.txt"\nformat = "siconos-lcp"\n')
    for arguments in (["--plan", "plain.toml"], ["other.h5"]):
        done = in_process(folder, "run", *arguments, "-s", "lemke", "--no-report", "-o", "r.sqlite")
        assert done.returncode == 0, done.stderr
    assert cpbench(monkeypatch, "verify", "r.sqlite") == 0
    assert "2 answers judged again: no change" in capsys.readouterr().out


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["run", "nowhere.h5", "-s", "lemke"], "nowhere.h5: no such file"),
        (["run", "{lcp}", "-s", "nsgs"], "no route leads from"),
        (["run", "{lcp}", "-s", "nsgs", "--dry-run"], "no route leads from"),
        (["solve", "{lcp}", "-s", "nsgs"], "no exact route"),
    ],
)
def test_nothing_to_run_is_bad_input(monkeypatch, capsys, lcp, arguments, word) -> None:
    monkeypatch.chdir(lcp.parent)
    before = set(lcp.parent.iterdir())
    assert cpbench(monkeypatch, *[a.format(lcp=lcp) for a in arguments]) == 2
    said = capsys.readouterr().err
    assert word in said
    assert len(said.splitlines()) == 1
    assert set(lcp.parent.iterdir()) == before


def test_without_a_command_it_says_what_there_is(monkeypatch, capsys) -> None:
    assert cpbench(monkeypatch) == 0
    assert capsys.readouterr().out.startswith("Usage: cpbench")


GATED = """
import time
from pathlib import Path

import numpy as np

from cpbench.formulations import LCPPoint
from cpbench.solvers import Claim, Solver, SolverOutput, SolverSpec, register


@register
class Gated(Solver):
    spec = SolverSpec(name="gated", node="lcp", summary="waits for the file `go` where n = 6", method="a linear solve")

    def solve(self, prepared, budget, options, start=None, record=None):
        while prepared.q.size == 6 and not Path("go").exists():
            Path("waiting").touch()
            time.sleep(0.01)
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=np.linalg.solve(prepared.M, -prepared.q)))
"""


@pytest.mark.needs("cpbench_solvers")
def test_an_interrupted_run_goes_on(lcp) -> None:
    """Ctrl-C: exit code 130, what was done is kept, the same command finishes.

    On one problem, which is not the first in the order of the seed, a solver waits for a file, so that the first run is
    under way when the signal comes, however late that is.
    """
    import signal
    import time

    folder = lcp.parent
    (folder / "gated.py").write_text(GATED)
    for n in range(2, 7):
        storage.save(LCP(M=2.0 * np.eye(n), q=-np.ones(n), name=f"p{n}"), folder / f"p{n}.h5")
    command = [sys.executable, "-m", "cpbench", "--plugin", "gated.py", "run", ".", "-s", "lemke", "-s", "gated"]
    command += ["--timeout", "120s", "--no-report", "-o", "r.sqlite"]
    with (folder / "stderr").open("w") as stderr:
        running = subprocess.Popen(command, cwd=folder, stderr=stderr)
        while not (folder / "waiting").exists() and running.poll() is None:
            time.sleep(0.02)
        running.send_signal(signal.SIGINT)
        running.wait(timeout=600)
    said = (folder / "stderr").read_text()
    assert running.returncode == 130, said
    assert "the same command goes on" in said
    (folder / "go").touch()
    again = with_plugins(folder, *command[3:])
    assert again.returncode == 0, again.stderr
    assert re.search(r"^12 pairs, [1-9]\d* done before", again.stderr, re.MULTILINE), again.stderr
    assert "12 pairs: 12 solved" in again.stdout


def test_what_is_built_in_goes_for_a_file_everywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cpbench(monkeypatch, "list", "problems") == 0
    address = "builtin/lcp/lcp-classics.h5::murty-10"
    assert address in capsys.readouterr().out.splitlines()
    for command in (["info", "--no-facts"], ["info", "--data"], ["graph", "--to", "qp"], ["convert", "--to", "mlcp"]):
        name, *options = command
        out = ["out.h5"] if name == "convert" else []
        assert cpbench(monkeypatch, name, address, *out, *options) == 0
    np.save("z.npy", np.eye(10)[0])
    assert cpbench(monkeypatch, "verify", address, "--answer", "z.npy") == 0


@pytest.mark.needs("cpbench_solvers")
def test_answers_from_two_starts_are_exported(monkeypatch, tmp_path) -> None:
    """Each with the start of its row."""
    monkeypatch.chdir(tmp_path)
    problem = LCP(M=np.array([[2.0, 1], [1, 2]]), q=[-5.0, -6.0], name="deudeu")
    points = [problem.point_from_vector(x) for x in ([4 / 3, 7 / 3], [1.0, 1.0])]
    storage.save_answer(tmp_path / "p.h5", problem, points[0], {}, with_problem=True, guesses=points)
    run = ["run", "p.h5", "-s", "psor", "--repeats", 1, "-q", "--no-report", "-o", "r.sqlite"]
    assert cpbench(monkeypatch, *run, "--start", "cold,file,file:2") == 0
    assert cpbench(monkeypatch, "results", "export", "r.sqlite", "--answers", "a.h5") == 0
    with h5py.File(tmp_path / "a.h5") as file:
        (group,) = file.values()
        assert {answer.attrs["start"] for answer in group.values()} == {"cold", "file", "file:2"}
        for name, answer in group.items():
            assert name.startswith("psor ")
            np.testing.assert_allclose(answer[:], [4 / 3, 7 / 3], rtol=1e-5)


def test_outputs_are_environment_before_the_work(monkeypatch, capsys, lcp, tmp_path) -> None:
    """What is there, a folder that is not there, and one that cannot be made: one line, exit code 2, nothing done."""
    monkeypatch.chdir(tmp_path)
    there = tmp_path / "there.h5"
    there.write_bytes(b"mine")
    nowhere = tmp_path / "none" / "x.h5"
    for path in (there, nowhere):
        for words in (
            ["solve", "missing.h5", "-s", "lemke", "-o", path],
            ["convert", "missing.h5", path, "--to", "qp"],
            ["convert", "missing.h5", path, "--lift", "missing.h5"],
            ["pack", "missing.npy", "-o", path],
            ["results", "export", "missing.sqlite", "--answers", path],
        ):
            assert cpbench(monkeypatch, *words) == 2
            err = capsys.readouterr().err
            assert str(path) in err, (words, err)
            assert err.count("\n") == 1
    assert there.read_bytes() == b"mine"
    run = ["run", lcp, "-s", "lemke", "--repeats", 1, "-q", "-o", "r.sqlite"]
    (tmp_path / "cpbench.toml").write_text('report = "nowhere"\n')
    (tmp_path / "nowhere").touch()
    assert cpbench(monkeypatch, *run) == 2
    assert not (tmp_path / "r.sqlite").exists()


@pytest.mark.nightly
def test_a_report_tells_what_it_replaces(monkeypatch, capsys, lcp, tmp_path) -> None:
    monkeypatch.chdir(tmp_path)
    run = ["run", lcp, "-s", "lemke", "--repeats", 1, "-q", "-o", "r.sqlite"]
    assert cpbench(monkeypatch, *run, "--no-report") == 0
    capsys.readouterr()
    assert cpbench(monkeypatch, "report", "r.sqlite", "-o", "/proc/nowhere") == 2
    assert "/proc/nowhere: cannot be made a folder" in capsys.readouterr().err
    for again in (False, True):
        assert cpbench(monkeypatch, "report", "r.sqlite", "-o", "r") == 0
        assert cpbench(monkeypatch, "plot", "profile", "r.sqlite", "-o", "n.svg") == 0
        lines = capsys.readouterr().out.splitlines()
        assert len(lines) > 2
        assert all(line.endswith("(replaced)") == again for line in lines), lines


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("report", [False, *by_night([True])])
def test_a_file_that_changed_between_two_runs_is_reported(monkeypatch, capsys, tmp_path, report) -> None:
    """Rows of the former content stay, and the terminal and the report say that they are there."""
    monkeypatch.chdir(tmp_path)
    run = ["run", "p.h5", "-s", "lemke", "--repeats", 1, "-q", "-o", "r.sqlite"]
    run += [] if report else ["--no-report"]
    for q in ([-5.0, -6.0], [-5.0, -7.0]):
        storage.save(LCP(M=np.array([[2.0, 1], [1, 2]]), q=q), tmp_path / "p.h5", force=True)
        capsys.readouterr()
        assert cpbench(monkeypatch, *run) == 0
    said = "p.h5: its 2 rows are of 2 problems: the file changed"
    assert said in capsys.readouterr().out
    if report:
        assert said in "".join((tmp_path / "reports" / "r" / "report.md").read_text().splitlines()[:16])
        assert said in (tmp_path / "reports" / "r" / "report.html").read_text()
