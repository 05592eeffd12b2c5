"""Bundles: what is in them, what an anonymous one does not tell, and running them again, with real small runs."""

from __future__ import annotations

import base64
import gzip
import hashlib
import importlib
import io
import json
import os
import re
import shutil
import sqlite3
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import with_plugins
from edited_results import seal_anew

from cpbench import storage
from cpbench.bench.results import seal_key
from cpbench.bench.results.store import Store
from cpbench.bundle import archive, leaks, problems, reproduction
from cpbench.bundle.archive import BundleError
from cpbench.bundle.identity import Identity
from cpbench.bundle.making import BundleOptions
from cpbench.bundle.making import make as make_bundle
from cpbench.bundle.results import identity
from cpbench.bundle.scrub import Scrub
from cpbench.cli.bundle_command import command as bundle_command
from cpbench.conversions.base import make
from cpbench.errors import CpbenchError
from cpbench.formulations import LCP, FrictionContact, LCPPoint
from cpbench.formulations.base import Info, Sequence
from cpbench.generators.collection import builtin_folder

HOST, USER, FOLDER, TOKEN, REMOTE = "zqhost7", "zquser7", "zqfolder7", "zqtoken7", "zqremote7"
PLANTED = (HOST, USER, FOLDER, TOKEN, REMOTE)
MINE = """
# written by {user} on {host}, see https://example.org/{remote}/mine
import os
import re
import numpy as np

from cpbench.formulations import LCPPoint
from cpbench.solvers import Claim, Solver, SolverOutput, SolverSpec, register

HERE = "{folder}"


@register
class Mine(Solver):
    spec = SolverSpec(name="mine", node="lcp", summary="by {user}", method="mine", citation="{user} 2026")

    def solve(self, prepared, budget, options, start=None, record=None):
        z = np.linalg.solve(prepared.M, -prepared.q)
        told = "mine in " + HERE + " with " + os.environ.get("SECRET", "")
        if prepared.q.size == 3:
            raise RuntimeError(told)
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=z), message=told)
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
    """The folder of a run that tells who made it wherever a run can."""
    folder = tmp_path_factory.mktemp("home") / USER / FOLDER
    folder.mkdir(parents=True)
    for n in (2, 3):
        info = Info(
            source=f"{folder}/make.py on {HOST}", description=f"made by {USER}", licence="CC0-1.0", family="eye"
        )
        storage.save(LCP(M=2.0 * np.eye(n), q=-np.ones(n), name=f"p{n}", info=info), folder / f"p{n}.h5")
    converted = make("lcp-mlcp").step(LCP(M=3.0 * np.eye(4), q=-np.ones(4), name="p4"))
    storage.save(converted, folder / "p4.h5")
    with h5py.File(folder / "p4.h5", "r+") as file:
        file["provenance/0"].attrs["parameters"] = json.dumps({})
        file["provenance/0/trace"].attrs["scalars"] = json.dumps({"made": str(folder)})
        file.attrs["author"] = USER
    answer = LCPPoint(z=np.full(2, 0.5))
    problem = storage.load(folder / "p2.h5")
    storage.save_answer(
        folder / "p2.h5", problem, answer, {"solver": str(folder)}, with_problem=True, guesses=[answer], force=True
    )
    (folder / "mine.py").write_text(MINE.format(user=USER, host=HOST, remote=REMOTE, folder=folder), encoding="utf-8")
    for command in (
        ["init", "-q"],
        ["remote", "add", "origin", f"git@example.org:{REMOTE}/mine.git"],
        ["config", "user.name", f"{USER} the First"],
    ):
        subprocess.run(["git", *command], cwd=folder, check=True, capture_output=True)
    command = [
        sys.executable, "-m", "cpbench", "--plugin", "mine.py", "run", "p2.h5", "p3.h5", "p4.h5",
        "builtin/lcp/american-put.h5", "-s", "mine", "-s", "lemke", "-s", "psor[omega=1.2]", "--plan", "none", "-q",
        "-o", "run.sqlite", "--no-report",
    ]  # fmt: skip
    # in a process of its own: its workers have its variables
    subprocess.run(command, cwd=folder, check=True, capture_output=True, env={**os.environ, "SECRET": TOKEN})
    with closing(sqlite3.connect(folder / "run.sqlite")) as db:  # as a machine of that name leaves it
        db.execute("UPDATE rows SET host = ? WHERE host IS NOT NULL", (HOST,))
        db.execute("UPDATE machines SET host = ?", (HOST,))
        db.execute("INSERT INTO refused VALUES (?, ?)", (f"{folder}/broken.h5", f"{folder}/broken.h5: is empty"))
        db.execute("CREATE TABLE old AS SELECT * FROM rows")
        db.commit()
        db.execute("DROP TABLE old")  # its pages stay in the file
        db.commit()
    seal_anew(folder / "run.sqlite")
    return folder


@pytest.fixture(scope="module")
def plain(told: Path) -> Path:
    cpbench(told, "bundle", "run.sqlite", "-o", "plain.zip", "--no-report")
    return told / "plain.zip"


@pytest.fixture(scope="module")
def anonymous(told: Path) -> Path:
    cpbench(
        told, "bundle", "run.sqlite", "-o", "blind.zip", "--anonymous", "--report", "--rename", "mine=A",
        "--rename", "Mine=SolverA", USER=USER, LOGNAME=USER, SECRET=TOKEN,
    )  # fmt: skip
    return told / "blind.zip"


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
    done = cpbench(tmp_path, "reproduce", str(plain), "-o", "x", "--yes-run-plugins", "-q", SECRET=TOKEN)
    with Store(tmp_path / "x/results.sqlite") as before, Store(tmp_path / "x/again.sqlite") as again:
        there, here = ({row.key: row.status for row in store.rows()} for store in (before, again))
    assert there == here
    assert f"{len(there)} of {len(there)} statuses agree" in done.stdout
    assert "sha256" in done.stdout
    assert "time here over there" in done.stdout


@pytest.mark.nightly
def test_nobody_runs_plugins_unasked(plain: Path, tmp_path: Path) -> None:
    done = cpbench(tmp_path, "reproduce", str(plain), "-o", "x", "-q", rc=2)
    assert "--yes-run-plugins" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert "plugins/mine.py" in done.stdout
    assert not (tmp_path / "x/again.sqlite").exists()


@pytest.mark.nightly
def test_seals_tell_whose_a_bundle_is_only_where_it_is_not_anonymous(
    told: Path, plain: Path, anonymous: Path, tmp_path: Path
) -> None:
    """The name of a key is the same in all results of a user: an anonymous bundle has a key of its own."""
    names: dict[str, str] = {}
    for name, bundle in (("plain", plain), ("anonymous", anonymous)):
        archive.unpack(bundle, tmp_path / name)
        with Store(tmp_path / name / "results.sqlite") as store:
            audit = store.audit()
            assert not audit.broken
            assert ("of another user" in audit.note) == (name == "anonymous")
            (names[name],) = {key[:8] for (key,) in store._database.read("SELECT seal FROM seals")}
    known = seal_key.find()
    assert known is not None
    assert names["plain"] == known.name != names["anonymous"]


@pytest.mark.nightly
def test_other_statuses_end_with_1(plain: Path, tmp_path: Path) -> None:
    """The plugin raises for three unknowns; a bundle that says it solved that problem is contradicted."""
    folder = tmp_path / "made"
    archive.unpack(plain, folder)
    with closing(sqlite3.connect(folder / "results.sqlite")) as db:
        db.execute("UPDATE rows SET status = 'solved', error = 0 WHERE status = 'error' AND problem = 'p3'")
        db.commit()
    seal_anew(folder / "results.sqlite")
    repacked(folder, tmp_path / "other.zip")
    done = cpbench(tmp_path, "reproduce", "other.zip", "-o", "x", "--yes", "-q", rc=1)
    assert "differs: p3, mine: solved → error" in done.stdout


@pytest.mark.nightly
def test_a_missing_solver_is_told_and_not_compared(plain: Path, tmp_path: Path) -> None:
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


# ------------------------------------------------------------------------------------------------ anonymous


def everything(folder: Path) -> Iterator[tuple[str, bytes]]:
    """Every byte below a folder: as it is, and unpacked."""
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        name = path.relative_to(folder).as_posix()
        yield name, name.encode()
        raw = path.read_bytes()
        yield name, raw
        yield from inside(name, raw)
        if path.suffix == ".sqlite":
            with closing(sqlite3.connect(path)) as db:
                yield name, "\n".join(db.iterdump()).encode()
                for (table,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall():
                    for row in db.execute(f"SELECT * FROM {table}"):
                        for value in row:
                            if isinstance(value, bytes):
                                yield f"{name} {table}", value
                                yield from inside(f"{name} {table}", value)
        if path.suffix == ".html":  # the data of the page are gzip in base64
            for packed in re.findall(rb"H4sI[A-Za-z0-9+/]+=*", raw):
                yield name, gzip.decompress(base64.b64decode(packed))
        if path.suffix == ".h5":
            yield from in_hdf5(path)


def in_hdf5(path: Path) -> Iterator[tuple[str, bytes]]:
    with h5py.File(path) as file:
        places: list[str] = []
        file.visit(places.append)
        for place in ["/", *places]:
            item = file[place]
            yield f"{path.name} {place}", repr(dict(item.attrs)).encode()
            if isinstance(item, h5py.Dataset):
                yield f"{path.name} {place}", repr(item[()]).encode()


def inside(name: str, raw: bytes) -> Iterator[tuple[str, bytes]]:
    for unpack in (zlib.decompress, gzip.decompress):
        try:
            content = unpack(raw)
        except (zlib.error, OSError, EOFError):
            continue
        yield name, content
        if content.startswith(b"\x93NUMPY"):
            yield name, repr(np.load(io.BytesIO(content), allow_pickle=False)).encode()


def test_what_is_planted_is_in_a_plain_bundle(plain: Path, tmp_path: Path) -> None:
    """The search finds each of the words where nobody took them out."""
    archive.unpack(plain, tmp_path / "x")
    found = {word for _, content in everything(tmp_path / "x") for word in PLANTED if word.encode() in content}
    assert found == set(PLANTED)


def test_an_anonymous_bundle_tells_nobody(anonymous: Path, tmp_path: Path) -> None:
    archive.unpack(anonymous, tmp_path / "x")
    raw = anonymous.read_bytes()
    for word in PLANTED:
        assert word.encode() not in raw
    for name, content in everything(tmp_path / "x"):
        for word in PLANTED:
            assert word.lower().encode() not in content.lower(), f"{word} in {name}"
    assert any(b"lemke" in content for name, content in everything(tmp_path / "x") if name == "report/report.html")
    with Store(tmp_path / "x/results.sqlite") as store:
        assert set(store.machines()) == {"machine-1"}
        assert {row.host for row in store.rows()} == {"machine-1"}
        assert {row.solver for row in store.rows()} == {"A", "lemke", "psor"}
        assert "A" in store.meta()["solvers"]


def test_a_renamed_solver_has_its_old_name_nowhere(anonymous: Path, tmp_path: Path) -> None:
    archive.unpack(anonymous, tmp_path / "x")
    texts = [p for p in (tmp_path / "x").rglob("*") if p.suffix in (".py", ".md", ".toml", ".json", ".csv", ".txt")]
    assert any("plugins/A.py" in p.as_posix() for p in texts)
    assert any("report/report.md" in p.as_posix() for p in texts)
    for path in texts:
        words = path.read_text().replace("_", " ").replace(".", " ").replace('"', " ").split()
        assert "mine" not in words, path
        assert "Mine" not in words, path


@pytest.mark.nightly
def test_an_anonymous_bundle_runs_again(anonymous: Path, tmp_path: Path) -> None:
    done = cpbench(tmp_path, "reproduce", str(anonymous), "-o", "x", "--yes", "-q")
    with Store(tmp_path / "x/results.sqlite") as store:
        count = len(list(store.rows()))
    assert f"{count} of {count} statuses agree" in done.stdout


def test_another_person_may_bundle_what_was_run(told: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The words are found in the results and beside them, not only in the variables of who bundles."""
    for name in ("USER", "LOGNAME", "SECRET"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)
    make_bundle(told / "run.sqlite", tmp_path / "x.zip", BundleOptions(anonymous=True, builtin=builtin_folder()))
    archive.unpack(tmp_path / "x.zip", tmp_path / "x")
    for name, content in everything(tmp_path / "x"):
        for word in (HOST, FOLDER, TOKEN, REMOTE):
            assert word.encode() not in content, f"{word} in {name}"


def test_what_would_still_tell_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("by ann, in planned work")
    with pytest.raises(CpbenchError, match=r"a\.txt: its content still tells a user, 'ann'"):
        leaks.require_none(tmp_path, {"ann": "a user"})
    leaks.require_none(tmp_path, {"plan": "a user"})
    page = tmp_path / "page.html"
    page.write_bytes(b"<script>" + base64.b64encode(gzip.compress(b"by zquser7")) + b"</script>")
    with pytest.raises(CpbenchError, match=r"page\.html: what is packed in it still tells a user, 'zquser7'"):
        leaks.require_none(tmp_path, {USER: "a user"})
    page.unlink()
    with gzip.open(tmp_path / "b.gz", "wb") as file:
        file.write(b"\0zqhost7\0")
    with pytest.raises(CpbenchError, match=r"b\.gz: what is packed in it still tells a host"):
        leaks.require_none(tmp_path, {HOST: "a host"})


def test_words_are_replaced_whole() -> None:
    who = Identity(hosts=("box-1",), people=("ann",), paths=("/home/ann/x",), remotes=("git@here.org:ann/mine.git",))
    scrub = Scrub(who, {"mine": "A"})
    assert scrub.name("mine@head[omega=1], mine-fast, determined") == "A@head[omega=1], mine-fast, determined"
    assert (
        scrub.text("in /home/ann/x/deep/f.h5: ann planned it on BOX-1")
        == "in <path>: anonymous planned it on machine-1"
    )
    assert scrub.text("max|M-Mᵀ|/max|M| = 1e-3, 2/3, lcp/qp") == "max|M-Mᵀ|/max|M| = 1e-3, 2/3, lcp/qp"
    assert scrub.text("no /opt/x/lib.so, C:\\Users\\bob\\f") == "no <path>, <path>"
    assert scrub.code("x = a / b / c  # git@here.org:ann/mine.git, ann@here.org") == (
        "x = a / b / c  # <remote>, anonymous"
    )


@pytest.mark.parametrize(
    ("renames", "said"),
    [
        (("lemke=B",), "lemke is cpbench's own"),
        (("nobody=B",), "unknown name for --rename"),
        (("mine=psor",), "is not a free name"),
        (("mine",), "write OLD=NEW"),
    ],
)
def test_renames_that_cannot_be(told: Path, tmp_path: Path, renames: tuple[str, ...], said: str) -> None:
    options = [part for rename in renames for part in ("--rename", rename)]
    with pytest.raises(CpbenchError, match=said):
        bundle_command.main(
            [str(told / "run.sqlite"), "-o", str(tmp_path / "x.zip"), "--anonymous", *options], standalone_mode=False
        )
    assert not (tmp_path / "x.zip").exists()


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
        name, *rest = arguments
        importlib.import_module(f"cpbench.cli.{name}_command").command.main(rest, standalone_mode=False)
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
        f'env = {{SECRET = "{TOKEN}", OMP_NUM_THREADS = "1"}}\n'
        '[solver.other]\nnode = "lcp"\nserve = "./other"\n'
    )
    apart(own, "run", "--plan", "night.toml", "-q", "--no-report")
    with Store(own / "night.sqlite") as store:
        assert {row.status for row in store.rows()} == {"solved"}, list(store.rows())
    here(own, "bundle", "night.sqlite", "-o", "../x.zip")
    here(own, "bundle", "night.sqlite", "-o", "../blind.zip", "--anonymous")
    done = apart(tmp_path, "reproduce", "x.zip", "-q", "--yes")
    assert "plugins/night/answer.py" in done.stdout
    assert "answer.py {problem} {answer}" in done.stdout
    assert "2 of 2 statuses agree" in done.stdout
    with zipfile.ZipFile(tmp_path / "blind.zip") as zipped:
        table = zipped.read("plugins/night/night.toml").decode()
        assert "1 variables that script is started with" in zipped.read("REPRODUCE.md").decode()
    assert 'OMP_NUM_THREADS" = "1"' in table
    assert TOKEN not in table
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
    here(own, "run", "c.h5", "-s", "lemke", "--routes", "facets", "--facets", "4", *common)
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


def test_what_is_no_bundle_is_told_in_a_line(plain: Path, tmp_path: Path, told: Path, here: Callable[..., str]) -> None:
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
        ('[[set]]\nproblems = ["p.h5"]\nsolvers = ["lemke@x={interpreter=\\"./evil\\"}"]', "starts a program"),
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
    with pytest.raises(CpbenchError, match="--rename is for --anonymous"):
        here(told, "bundle", "run.sqlite", "-o", "y.zip", "--rename", "mine=A")


def test_keys_are_those_of_the_runner(told: Path) -> None:
    with Store(told / "run.sqlite") as store:
        for row in store.rows():
            assert identity(row) == (row.key, row.label)
