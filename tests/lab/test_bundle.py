"""Bundles: what is in them, and running them again, with real small runs."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import sqlite3
import subprocess
import sys
import zipfile
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from command_line import with_plugins

from cpbench import storage
from cpbench.bench.results.store import Store
from cpbench.cli import cli
from cpbench.conversions.base import make
from cpbench.errors import CpbenchError
from cpbench.formulations import LCP, FrictionContact, LCPPoint
from cpbench.formulations.base import Info, Sequence
from cpbench.storage.collections import added
from cpbench_lab.bundle import archive, problems, reproduction
from cpbench_lab.bundle.archive import BundleError
from cpbench_lab.bundle.results import identity

MINE = """
import numpy as np

from cpbench.formulations import LCPPoint
from cpbench.solvers import Claim, Solver, SolverOutput, SolverSpec, register


@register
class Mine(Solver):
    spec = SolverSpec(name="mine", node="lcp", summary="solves Mz = -q", method="mine")

    def solve(self, prepared, budget, options, start=None, record=None):
        if prepared.q.size == 3:
            raise RuntimeError("three unknowns")
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=np.linalg.solve(prepared.M, -prepared.q)))
"""


def cpbench(folder: Path, *arguments: str, rc: int = 0, **variables: str) -> subprocess.CompletedProcess[str]:
    done = with_plugins(folder, *arguments, **variables)
    assert done.returncode == rc, f"{done.returncode}: {done.stderr}\n{done.stdout}"
    assert "Traceback" not in done.stderr
    return done


def apart(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The same in a process of its own: its workers know the solvers that its plan declares."""
    words = [sys.executable, "-m", "cpbench", *arguments]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, check=True, stdin=subprocess.DEVNULL)


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run with a plugin, a converted problem, an answer and a built-in problem."""
    folder = tmp_path_factory.mktemp("home")
    for n in (2, 3):
        info = Info(source=f"{folder}/make.py", licence="CC0-1.0", family="eye")
        storage.save(LCP(M=2.0 * np.eye(n), q=-np.ones(n), name=f"p{n}", info=info), folder / f"p{n}.h5")
    storage.save(make("lcp-mlcp").step(LCP(M=3.0 * np.eye(4), q=-np.ones(4), name="p4")), folder / "p4.h5")
    answer = LCPPoint(z=np.full(2, 0.5))
    problem = storage.load(folder / "p2.h5")
    storage.save_answer(
        folder / "p2.h5", problem, answer, {"solver": "by hand"}, with_problem=True, guesses=[answer], force=True
    )
    (folder / "mine.py").write_text(MINE, encoding="utf-8")
    command = [
        sys.executable, "-m", "cpbench", "--plugin", "mine.py", "run", "p2.h5", "p3.h5", "p4.h5",
        "builtin/lcp/american-put.h5", "-s", "mine", "-s", "lemke", "-s", "psor[omega=1.2]", "--plan", "none", "-q",
        "-o", "run.sqlite", "--no-report",
    ]  # fmt: skip
    # in a process of its own: its workers load the plugin
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return folder


@pytest.fixture(scope="module")
def plain(told: Path) -> Path:
    cpbench(told, "bundle", "run.sqlite", "-o", "plain.zip", "--no-report")
    return told / "plain.zip"


# ------------------------------------------------------------------------------------------ what is in it


def test_a_bundle_holds_the_run(plain: Path, told: Path) -> None:
    with zipfile.ZipFile(plain) as zipped:
        names = zipped.namelist()
        manifest = json.loads(zipped.read("BUNDLE.json"))
        assert {entry.date_time for entry in zipped.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert zipped.read("plugins/mine.py") == (told / "mine.py").read_bytes()
        assert "numpy==" in zipped.read("versions.txt").decode()
        assert "Python 3" in zipped.read("versions.txt").decode()
        guide = zipped.read("REPRODUCE.md").decode()
        assert json.loads(zipped.read("machine.json"))["machine"]["cores"] >= 1
    assert names == sorted(names)
    assert {"problems/lcp/p2.h5", "problems/lcp/p3.h5", "problems/mlcp/p4.h5", "plan.toml", "results.sqlite"} <= {
        *names
    }
    assert manifest["statuses"]["error"] >= 1
    assert "cpbench reproduce" in guide
    assert {place["address"].partition("::")[0] for place in manifest["problems"]} == {
        "builtin/lcp/american-put.h5", "problems/lcp/p2.h5", "problems/lcp/p3.h5", "problems/mlcp/p4.h5",
    }  # fmt: skip


def test_the_same_run_gives_the_same_bytes(plain: Path, told: Path, here: Callable[..., str]) -> None:
    here(told, "bundle", "run.sqlite", "-o", "twice.zip", "--no-report")
    assert (told / "twice.zip").read_bytes() == plain.read_bytes()


def test_starting_points_and_solutions_come_along(plain: Path, tmp_path: Path) -> None:
    archive.unpack(plain, tmp_path / "x")
    found = storage.solution(tmp_path / "x/problems/lcp/p2.h5")
    assert found is not None
    assert np.allclose(found[0].z, 0.5)
    assert len(storage.guesses(tmp_path / "x/problems/lcp/p2.h5")) == 1


def test_the_plan_is_one_that_run_takes(plain: Path, tmp_path: Path) -> None:
    archive.unpack(plain, tmp_path / "x")
    done = cpbench(
        tmp_path / "x", "--plugin", "plugins/mine.py", "run", "--plan", "plan.toml", "--dry-run", "-o", "again.sqlite"
    )
    with Store(tmp_path / "x/results.sqlite") as store:
        assert f"{len(list(store.rows()))} pairs" in done.stdout


# -------------------------------------------------------------------------------------------- running again


def test_reproduce_gives_the_same_statuses(plain: Path, tmp_path: Path) -> None:
    done = cpbench(tmp_path, "reproduce", str(plain), "-o", "x", "--yes-run-plugins", "-q")
    with Store(tmp_path / "x/results.sqlite") as before, Store(tmp_path / "x/again.sqlite") as again:
        there, here = ({row.key: row.status for row in store.rows()} for store in (before, again))
    assert there == here
    assert f"{len(there)} of {len(there)} statuses agree" in done.stdout
    assert "sha256" in done.stdout
    assert "time here over there" in done.stdout


@pytest.mark.nightly
def test_plugins_run_only_when_asked(plain: Path, tmp_path: Path) -> None:
    done = cpbench(tmp_path, "reproduce", str(plain), "-o", "x", "-q", rc=2)
    assert "--yes-run-plugins" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert "plugins/mine.py" in done.stdout
    assert not (tmp_path / "x/again.sqlite").exists()


@pytest.mark.nightly
def test_other_statuses_end_with_1(plain: Path, tmp_path: Path) -> None:
    """The plugin raises for three unknowns; a bundle that says it solved that problem is contradicted."""
    folder = tmp_path / "made"
    archive.unpack(plain, folder)
    with closing(sqlite3.connect(folder / "results.sqlite")) as db:
        db.execute("UPDATE rows SET status = 'solved', error = 0 WHERE status = 'error' AND problem = 'p3'")
        db.commit()
    repacked(folder, tmp_path / "other.zip")
    done = cpbench(tmp_path, "reproduce", "other.zip", "-o", "x", "--yes", "-q", rc=1)
    assert "differs: p3, mine: solved → error" in done.stdout


@pytest.mark.nightly
def test_a_missing_solver_is_named_and_not_compared(plain: Path, tmp_path: Path) -> None:
    folder = tmp_path / "made"
    archive.unpack(plain, folder)
    shutil.rmtree(folder / "plugins")
    repacked(folder, tmp_path / "less.zip", plugins=[])
    done = cpbench(tmp_path, "reproduce", "less.zip", "-o", "x", "-q")
    assert "not here: mine" in done.stderr
    assert "solver is missing here: mine" in done.stdout


def repacked(folder: Path, target: Path, **changed: object) -> None:
    """Somebody's own zip of what was unpacked: as `cpbench bundle` would have written it."""
    about = json.loads((folder / archive.MANIFEST).read_text())
    (folder / archive.MANIFEST).unlink()
    archive.pack(folder, target, {**about, **changed})


# ---------------------------------------------------------------------------------------- problems, plugins


@pytest.mark.parametrize(
    ("licence", "free"),
    [
        ("CC0-1.0", True),
        ("CC BY-NC-ND 4.0", True),
        ("", True),
        ("use, copy, modify, publish, distribute without restriction", True),
        ("no redistribution", False),
        ("not for redistribution", False),
        ("Redistribution is not permitted", False),
        ("proprietary, ask the author", False),
        ("All rights reserved", False),
        ("do not share", False),
    ],
)
def test_licences_that_forbid(licence: str, free: bool) -> None:
    assert (problems.FORBIDS.search(licence) is None) == free


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Runs a command in this process and a folder, for what loads no plugin; all that it says."""

    def run(folder: Path, *arguments: str) -> str:
        monkeypatch.chdir(folder)
        cli.main(list(arguments), standalone_mode=False)
        told = capsys.readouterr()
        return told.out + told.err

    return run


@pytest.mark.nightly
def test_a_problem_that_may_not_be_handed_on_stays(tmp_path: Path, here: Callable[..., str]) -> None:
    """It is told by fingerprint and source, and found again in a folder of whoever has it."""
    own = tmp_path / "own"
    own.mkdir()
    for name, licence in (("free", "CC0-1.0"), ("kept", "no redistribution"), ("dear", "")):
        info = Info(licence=licence, source=f"the {name} archive", citation="Doe 1999")
        n = len(name)
        problem = LCP(M=np.diag(np.arange(1.0, n + 1) + len(licence)), q=-np.ones(n), name=name, info=info)
        storage.save(problem, own / f"{name}.h5")
    here(own, "run", ".", "-s", "lemke", "--plan", "none", "-q", "-o", "run.sqlite", "--no-report")
    done = here(own, "bundle", "run.sqlite", "-o", "../x.zip", "--withhold", "d*r")
    assert "1 problems: its licence does not let it be handed on: no redistribution" in done
    with zipfile.ZipFile(tmp_path / "x.zip") as zipped:
        assert {n for n in zipped.namelist() if n.endswith(".h5")} == {"problems/lcp/free.h5"}
        guide = zipped.read("REPRODUCE.md").decode()
    fingerprint = storage.load(own / "kept.h5").fingerprint
    assert fingerprint in guide
    assert "from the kept archive; Doe 1999" in guide
    done = here(tmp_path, "reproduce", "x.zip", "-o", "x", "-q")
    assert "2 pairs whose problem is not here: dear (1), kept (1)" in done
    assert "1 of 1 statuses agree" in done
    done = here(tmp_path, "reproduce", "x.zip", "-o", "x", "-q", "--problems", "own")
    assert "3 of 3 statuses agree" in done


def test_the_collection_of_a_problem_is_known_by_its_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    found = problems._collection_of(f"{added.home()}/diphasic/sub/a.h5::name")
    assert found is not None
    assert (found.name, found.licence) == ("diphasic", "QPL-1.0")
    for other in (f"{tmp_path}/diphasic/a.h5", f"{added.home()}/of-nowhere/a.h5", f"{added.home()}/../a.h5::name"):
        assert problems._collection_of(other) is None


@pytest.mark.nightly
def test_files_of_collections_of_others_stay(
    tmp_path: Path, here: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A problem in the copy of an added collection is named with its source; one of the user's own is included."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    (added.home() / "diphasic").mkdir(parents=True)
    for path, n in ((added.home() / "diphasic" / "theirs.h5", 2), (tmp_path / "own.h5", 3)):
        storage.save(LCP(M=np.eye(n), q=-np.ones(n), name=path.stem), path)
    problems_of_both = ("collection/diphasic/theirs.h5", "own.h5")
    here(tmp_path, "run", *problems_of_both, "-s", "lemke", "--plan", "none", "-q", "-o", "run.sqlite", "--no-report")
    done = here(tmp_path, "bundle", "run.sqlite", "-o", "x.zip")
    assert "not in the bundle: 1 problems: its file is one of the collection diphasic of others (QPL-1.0)" in done
    with zipfile.ZipFile(tmp_path / "x.zip") as zipped:
        assert [name for name in zipped.namelist() if name.endswith(".h5")] == ["problems/lcp/own.h5"]
        guide = zipped.read("REPRODUCE.md").decode()
    assert storage.load(added.home() / "diphasic" / "theirs.h5").fingerprint in guide
    assert "from https://github.com/gilbert-jch/hnm4lcp" in guide
    done = here(tmp_path, "reproduce", "x.zip", "-o", "x", "-q", "--problems", str(added.home() / "diphasic"))
    assert "2 of 2 statuses agree" in done


@pytest.mark.nightly
def test_programs_that_are_scripts_come_along(tmp_path: Path, here: Callable[..., str]) -> None:
    """A solver of tables: the tables of the plan that the rows need, and the script that they start."""
    own = tmp_path / "own"
    own.mkdir()
    storage.save(LCP(M=2.0 * np.eye(2), q=-np.ones(2), name="p"), own / "p.h5")
    (own / "answer.py").write_text(
        "import sys, pathlib, numpy as np\nfolder = pathlib.Path(sys.argv[1])\n"
        "M, q = np.load(folder / 'M.npy'), np.load(folder / 'q.npy')\n"
        "np.save(sys.argv[2] + '/z.npy', np.linalg.solve(M, -q))\n"
    )
    (own / "night.toml").write_text(
        f'problems = "p.h5"\nsolvers = ["script", "lemke"]\n[solver.script]\nnode = "lcp"\nmatrices = "dense"\n'
        f'command = "{sys.executable} answer.py {{problem}} {{answer}}"\n'
        f'env = {{OMP_NUM_THREADS = "1"}}\n'
        '[solver.other]\nnode = "lcp"\nserve = "./other"\n'
    )
    apart(own, "run", "--plan", "night.toml", "-q", "--no-report")
    with Store(own / "night.sqlite") as store:
        assert {row.status for row in store.rows()} == {"solved"}, list(store.rows())
    here(own, "bundle", "night.sqlite", "-o", "../x.zip")
    done = apart(tmp_path, "reproduce", "x.zip", "-q", "--yes")
    assert "plugins/night/answer.py" in done.stdout
    assert "answer.py {problem} {answer}" in done.stdout
    assert "2 of 2 statuses agree" in done.stdout
    with zipfile.ZipFile(tmp_path / "x.zip") as zipped:
        table = zipped.read("plugins/night/night.toml").decode()
    assert 'OMP_NUM_THREADS" = "1"' in table
    assert "other" not in table


@pytest.mark.nightly
def test_steps_of_a_scene_stay_together(tmp_path: Path, here: Callable[..., str]) -> None:
    own = tmp_path / "own"
    own.mkdir()
    steps: dict[str, FrictionContact] = {}
    for k in range(3):
        q = np.array([-1.0 - k, 0.3, 0.0])
        place = Sequence(name="slide", step=k, time=0.1 * k, dt=0.1)
        steps[f"s{k}"] = FrictionContact(W=np.eye(3), q=q, mu=[0.5], dimension=3, name=f"s{k}", sequence=place)
    storage.save_pack(steps, own / "slide.h5")
    here(
        own, "run", "slide.h5", "-s", "nsgs", "--start", "previous", "--plan", "none", "-q", "-o", "run.sqlite",
        "--no-report",
    )  # fmt: skip
    here(own, "bundle", "run.sqlite", "-o", "../x.zip")
    done = here(tmp_path, "reproduce", "x.zip", "-q")
    assert "3 of 3 statuses agree" in done
    with Store(tmp_path / "x/again.sqlite") as store:
        assert [row.started for row in store.rows()][1:] == ["previous, contacts matched by order"] * 2


@pytest.mark.nightly
def test_the_plan_holds_pins_and_grids(tmp_path: Path, here: Callable[..., str]) -> None:
    """A file that grew by several commands: pinned routes, facets, grids, two tolerances, a named set."""
    own = tmp_path / "own"
    own.mkdir()
    q = np.array([-1.0, 0.3, 0.1, -2.0, 0.0, 0.5])
    storage.save(FrictionContact(W=np.eye(6), q=q, mu=[0.5, 0.3], dimension=3, name="c"), own / "c.h5")
    storage.save(LCP(M=2.0 * np.eye(2), q=-np.ones(2), name="p"), own / "p.h5")
    common = ["--plan", "none", "-q", "-o", "run.sqlite", "--no-report"]
    here(own, "run", "p.h5", "-s", "psor[omega=1:1.4:0.2]", "-t", "1e-4,1e-6", *common)
    here(own, "run", "c.h5", "-s", "lemke", "--routes", "facets", *common)
    here(own, "run", "c.h5", "-s", "lemke", "--via", "fc-lcp-inner[facets=12]", *common)
    here(own, "run", "c.h5", "-s", "nsgs[shuffle=true]", *common)
    here(own, "bundle", "run.sqlite", "-o", "../x.zip")
    done = here(tmp_path, "reproduce", "x.zip", "-q")
    with Store(tmp_path / "x/results.sqlite") as store:
        rows = list(store.rows())
    assert len({row.request for row in rows}) >= 3
    assert f"{len(rows)} of {len(rows)} statuses agree" in done


# --------------------------------------------------------------------------------------------------- refused


def zipped(path: Path, files: dict[str, bytes], **about: object) -> Path:
    """A zip with a list that fits its files."""
    sheets = {name: {"sha256": hashlib.sha256(raw).hexdigest(), "bytes": len(raw)} for name, raw in files.items()}
    manifest = {"format": archive.FORMAT, "version": 1, "plugins": [], "problems": [], "files": sheets, **about}
    manifest["files"] = about.get("listed", sheets)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as out:
        out.writestr("BUNDLE.json", json.dumps(manifest))
        for name, raw in files.items():
            out.writestr(name, raw)
    return path


@pytest.mark.parametrize(
    "name", ["../evil.txt", "/tmp/evil.txt", "a/../../evil.txt", "C:evil.txt", "a\\..\\evil.txt", "a//b", "nul\n"]
)
def test_names_that_lead_out_are_refused(tmp_path: Path, name: str) -> None:
    path = zipped(tmp_path / "x.zip", {name: b"evil"})
    with pytest.raises(BundleError, match="nothing was unpacked"):
        archive.unpack(path, tmp_path / "deep" / "x")
    assert not list(tmp_path.rglob("evil*"))


def test_a_file_that_is_not_a_bundle_is_refused_in_a_line(
    plain: Path, tmp_path: Path, told: Path, here: Callable[..., str]
) -> None:
    (tmp_path / "no.zip").write_bytes(b"PK nothing")
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as out:
        out.writestr("a.txt", "a")
    cases = {
        "gone.zip": "no such file",
        "no.zip": "is not a bundle of cpbench",
        "other.zip": "it has no BUNDLE.json",
        str(zipped(tmp_path / "newer.zip", {}, version=99)): "of version 99, this cpbench knows 1",
        str(zipped(tmp_path / "none.zip", {})): "has no results",
        str(zipped(tmp_path / "format.zip", {}, format="x")): "does not say so",
        str(zipped(tmp_path / "bad.zip", {"results.sqlite": b"no", "plan.toml": b""})): "not a results file",
        str(zipped(tmp_path / "list.zip", {"a.txt": b"a"}, listed={})): "a.txt is not listed in it",
    }
    for path, said in cases.items():
        with pytest.raises(CpbenchError, match=re.escape(said)) as refused:
            here(tmp_path, "reproduce", path, "-o", f"out-{len(said)}")
        assert "\n" not in str(refused.value)
    with pytest.raises(CpbenchError, match="has something else in it"):
        here(told, "reproduce", str(plain), "-o", ".")


def test_a_changed_file_is_found(plain: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(plain) as old, zipfile.ZipFile(tmp_path / "x.zip", "w") as new:
        for entry in old.infolist():
            raw = old.read(entry)
            new.writestr(entry, raw.replace(b"np.linalg.solve", b"np.linalg.s0lve"))
    with pytest.raises(BundleError, match=r"was changed: plugins/mine\.py is not what was bundled"):
        archive.unpack(tmp_path / "x.zip", tmp_path / "x")


def test_links_doubles_and_bombs_are_refused(tmp_path: Path) -> None:
    path = zipped(tmp_path / "link.zip", {})
    with zipfile.ZipFile(path, "a") as out:
        link = zipfile.ZipInfo("a")
        link.external_attr = 0o120777 << 16
        out.writestr(link, "/etc/passwd")
    with pytest.raises(BundleError, match="encrypted or a link"):
        archive.unpack(path, tmp_path / "x")
    path = zipped(tmp_path / "double.zip", {"a": b"1", "A": b"2"})
    with pytest.raises(BundleError, match="is there twice"):
        archive.unpack(path, tmp_path / "x")
    sheet = {"sha256": "0" * 64, "bytes": 2**45}
    path = zipped(tmp_path / "bomb.zip", {"a": b"1"}, listed={"a": sheet})
    with pytest.raises(BundleError, match="has 1 bytes, not"):
        archive.unpack(path, tmp_path / "x")
    raw = bytearray(
        zipped(tmp_path / "claim.zip", {"a": b"1"}, listed={"a": {"sha256": "", "bytes": 2**31}}).read_bytes()
    )
    at = raw.index(b"PK\x01\x02", raw.index(b"PK\x01\x02") + 1)
    raw[at + 24 : at + 28] = (2**31).to_bytes(4, "little")
    (tmp_path / "claim.zip").write_bytes(raw)
    with pytest.raises(BundleError, match="claims 2147483648 bytes in a file of"):
        archive.unpack(tmp_path / "claim.zip", tmp_path / "x")


@pytest.mark.parametrize(
    ("plan", "said"),
    [
        ('[solver.x]\nnode = "lcp"\nserve = "touch evil"', "plan.toml: solver: no bundle has that"),
        ('output = "../evil"', "plan.toml: output: no bundle has that"),
        ('cluster = "evil.toml"', "plan.toml: cluster: no bundle has that"),
        ('[[set]]\nproblems = ["../evil.h5"]\nsolvers = ["lemke"]', "is not in the bundle"),
        ('[[set]]\nproblems = ["/etc"]\nsolvers = ["lemke"]', "is not in the bundle"),
        ('[[set]]\nproblems = ["p.h5"]', "solvers: is not a list of names"),
        ("[[set", "is not valid TOML"),
    ],
)
def test_a_plan_does_no_more_than_it_should(plain: Path, tmp_path: Path, plan: str, said: str) -> None:
    archive.unpack(plain, tmp_path / "x")
    (tmp_path / "x/plan.toml").write_text(plan)
    about = json.loads((tmp_path / "x/BUNDLE.json").read_text())
    with pytest.raises(BundleError, match=said):
        reproduction.plan(reproduction.Bundle(plain, tmp_path / "x", about))
    assert not list(tmp_path.rglob("evil*"))


def test_results_without_a_row_are_no_bundle(told: Path, tmp_path: Path, here: Callable[..., str]) -> None:
    with Store(tmp_path / "none.sqlite", create=True):
        pass
    with pytest.raises(CpbenchError, match="has no results; make some with"):
        here(tmp_path, "bundle", "none.sqlite", "-o", "x.zip")
    with pytest.raises(CpbenchError, match="--force replaces it"):
        here(told, "bundle", "run.sqlite", "-o", "run.sqlite")


def test_keys_are_those_of_the_runner(told: Path) -> None:
    with Store(told / "run.sqlite") as store:
        for row in store.rows():
            assert identity(row) == (row.key, row.label)
