"""Files of results in which another program changed something beside single rows: refused, or said by all readers."""

from __future__ import annotations

import json
import math
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from cpbench.bench.planning.plan import Entry, Limits, Pair, Request
from cpbench.bench.results import file_seal, schema, seals
from cpbench.bench.results.merge import merge
from cpbench.bench.results.rows import Outcome, stored
from cpbench.bench.results.seal_key import Key
from cpbench.bench.results.store import Store
from cpbench.cli import cli
from cpbench.errors import SealError

PAIRS = [
    Pair(
        address=f"q{k}.h5", problem=f"q{k}", fingerprint=f"{k + 7:064x}", node="lcp", family="own", sizes={"n": 5},
        request=Request("exact"), entry=Entry(label), target="lcp", tolerance=1e-5, limits=Limits(20.0, 2**30, 2, 2),
    )
    for k in range(3) for label in ("bpp", "pgs")
]  # fmt: skip
ADDED = [
    *(
        f"CREATE TRIGGER t{k} {when} {event} ON {table} BEGIN {act}; END"
        for k, (when, event, table, act) in enumerate(
            [
                ("AFTER", "UPDATE", "rows", "UPDATE rows SET solve = 2e-9 WHERE key = new.key"),
                ("AFTER", "INSERT", "rows", "UPDATE rows SET solve = 2e-9 WHERE key = new.key"),
                ("BEFORE", "UPDATE", "rows", "SELECT RAISE(IGNORE)"),
                (
                    "AFTER",
                    "UPDATE OF status",
                    "rows",
                    "UPDATE rows SET status = 'solved', error = 0 WHERE key = new.key",
                ),
                ("AFTER", "INSERT", "answers", "UPDATE answers SET answer = x'00' WHERE key = new.key"),
                ("AFTER", "INSERT", "seals", "DELETE FROM rows WHERE key <> new.key"),
                ("AFTER", "DELETE", "histories", "UPDATE rows SET solve_min = 1e-9"),
                ("AFTER", "INSERT", "reference", "UPDATE reference SET seconds = 1e-9"),
                ("AFTER", "INSERT", "meta", "DELETE FROM machines"),
                ("AFTER", "INSERT", "file_seal", "DELETE FROM seals WHERE rowid = 1"),
            ]
        )
    ),
    "CREATE VIEW quick AS SELECT key, 1e-9 AS solve FROM rows",
    "CREATE VIEW endless AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i FROM n",
    "CREATE TABLE notes (text TEXT)",
    "CREATE VIRTUAL TABLE words USING fts5(text)",
    "CREATE INDEX rows_solve ON rows(solve)",
    "CREATE UNIQUE INDEX one_status ON rows(status, key)",
    "CREATE INDEX partial ON rows(error) WHERE error > 0",
    "CREATE INDEX computed ON rows(error * 2)",
]
EXCHANGED = [
    ("ALTER TABLE machines RENAME TO m0", "CREATE VIEW machines AS SELECT host, '{}' AS description FROM m0"),
    ("ALTER TABLE seals RENAME TO s0", "CREATE VIEW seals AS SELECT key, seal FROM s0"),
    ("ALTER TABLE reference RENAME TO r0", "CREATE VIEW reference AS SELECT at, pairs, 1e-9 seconds, loadavg FROM r0"),
    ("DROP INDEX rows_status", "CREATE UNIQUE INDEX rows_status ON rows(status, key)"),
    ("DROP INDEX answers_bytes",),
    ('ALTER TABLE rows ADD COLUMN "more" REAL',),
    ("DROP TABLE proved_problems", "CREATE TABLE proved_problems (fingerprint TEXT, data BLOB)"),
]


def _fill(store: Store, count: int = len(PAIRS)) -> None:
    for k, pair in enumerate(PAIRS[:count]):
        store.finish(pair.key, Outcome(status="solved", error=3e-7, solve=0.02 * (k + 1), answer=bytes([k]) * 9))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "r.sqlite"
    with Store(path, create=True) as store:
        store.plan(PAIRS)
        store.set_meta(command="cpbench run q", seed=4, machine={"cpu": "one"})
        store.note_machine("here", {"cpu": "one"})
        store.note_features({PAIRS[0].fingerprint: {"n": 5.0}})
        store.add_reference(0, 0.25, 0.5)
        store.note_files([], [("x.h5", "no HDF5 file")])
        _fill(store)
        store.end()
        store.settle()
    return path


@pytest.fixture
def copy(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copyfile(whole, tmp_path / "r.sqlite"))


def _execute(path: Path, *statements: str) -> None:
    with closing(sqlite3.connect(path, isolation_level=None)) as db:
        for statement in statements:
            db.execute(statement)


# --------------------------------------------------------------------------------- what no run makes (A1)


@pytest.mark.parametrize("statements", [*((one,) for one in ADDED), *EXCHANGED], ids=lambda s: s[-1][:40])
def test_what_no_run_makes_is_refused_by_readers_and_runs(copy: Path, statements: tuple[str, ...]) -> None:
    _execute(copy, *statements)
    for create in (False, True):
        with pytest.raises(SealError, match=r"is made by no run|is not as a run makes it"):
            Store(copy, create=create)


@pytest.mark.parametrize("statement", ADDED[:12:3], ids=lambda s: s[:40])
def test_what_is_added_while_a_run_writes_ends_it_before_anything_is_sealed(copy: Path, statement: str) -> None:
    with Store(copy, create=True) as store:
        store.reset(keys=[PAIRS[1].key, PAIRS[3].key])
        store.finish(PAIRS[1].key, Outcome(status="solved", error=2e-6, solve=0.5))
        _execute(copy, statement)
        for write in (
            lambda: store.finish(PAIRS[3].key, Outcome(status="wrong", error=0.5, solve=0.7)),
            lambda: store.set_meta(seed=9),
            lambda: store.add_reference(100, 0.5),
            store.end,
        ):
            with pytest.raises(SealError, match="another program changed the file"):
                write()
        (kind, name) = statement.split()[1:3]
        _execute(copy, f"DROP {kind} {name}")
        assert store.row(PAIRS[3].key).status == "not_run"
        store.require_unchanged()


def test_a_file_of_an_older_version_with_a_trigger_is_refused(copy: Path) -> None:
    older = ("DROP TABLE file_seal", "ALTER TABLE rows DROP COLUMN sealed_by", "PRAGMA user_version = 8")
    _execute(copy, *older, ADDED[0])
    for create in (False, True):
        with pytest.raises(SealError, match="its trigger t0 is made by no run"):
            Store(copy, create=create)
    _execute(copy, "DROP TRIGGER t0")
    with Store(copy) as store:
        [note] = store.audit().notes
    assert "was made by an older cpbench, and only its rows have seals" in note


def test_seals_are_of_the_values_in_memory(copy: Path) -> None:
    """A value that another program puts in while a row waits is in no seal."""
    with Store(copy, create=True) as store:
        store.reset(keys=[PAIRS[2].key])
        _execute(copy, f"UPDATE rows SET attempts = 90 WHERE key = '{PAIRS[2].key}'")
        store.finish(PAIRS[2].key, Outcome(status="solved", error=1e-6, solve=0.5))
        assert store.row(PAIRS[2].key).attempts == 2
        _execute(copy, f"UPDATE rows SET solve = 1e-9 WHERE key = '{PAIRS[2].key}'")
        with pytest.raises(SealError, match="bpp on q1: its result changed"):
            store.require_unchanged()


def test_values_are_sealed_as_sqlite_hands_them_back() -> None:
    values = [None, 0, 7, -0.0, 0.1, math.nan, math.inf, 5e-324, 2.0**60, 2**62, True, "", "täxt", "a\ud800b"]
    with closing(sqlite3.connect(":memory:")) as db:
        for kind in ("REAL", "INTEGER", "TEXT"):
            db.execute(f"CREATE TABLE t{kind} (v {kind})")
            fit = [v for v in values if kind == "TEXT" or not isinstance(v, str)]
            fit = [v for v in fit if kind != "TEXT" or not isinstance(v, float)]
            for value in fit:
                text = stored(value, "TEXT") if isinstance(value, str) else value
                db.execute(f"INSERT INTO t{kind} VALUES (?)", (text,))
            back = [v for (v,) in db.execute(f"SELECT v FROM t{kind} ORDER BY rowid")]
            ours = [stored(v, kind) for v in fit]
            assert list(map(repr, ours)) == list(map(repr, back)), kind
    assert stored(np.float64(0.5), "REAL") == 0.5


# ------------------------------------------------------------------------------- the file as a whole (A5)

EDITS = {
    "its facts": "UPDATE meta SET value = replace(value, 'run q', 'run other')",
    "its machines": 'UPDATE machines SET description = \'{"cpu": "two"}\'',
    "the features": "UPDATE problems SET features = replace(features, '5.0', '50.0')",
    "its list of refused files": "DELETE FROM refused",
    "its reference solves": "UPDATE reference SET seconds = 3e-9",
    "which rows it has": f"DELETE FROM rows WHERE key = '{PAIRS[4].key}'",
    "its seal over the whole file is missing": "DELETE FROM file_seal",
    "its seal over the whole file is not valid": "UPDATE file_seal SET seal = 'a.b.c'",
}


def _edit(path: Path, statement: str) -> None:
    _execute(path, statement)
    for table in ("seals", "answers"):
        _execute(path, f"DELETE FROM {table} WHERE key NOT IN (SELECT key FROM rows)")


@pytest.mark.parametrize("words", EDITS)
def test_what_is_changed_after_a_run_ended_is_named(
    words: str, whole: Path, copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    _edit(copy, EDITS[words])
    commands = (
        ["report", "r.sqlite", "-o", "report"],
        ["compare", str(whole), "r.sqlite"],
        ["merge", "r.sqlite", "-o", "m.sqlite"],
        ["info", "r.sqlite"],
        ["export", "r.sqlite", "--rows", "rows.csv"],
    )
    for command in commands:
        done = CliRunner().invoke(cli, command)
        assert isinstance(done.exception, SealError), (command, done.output)
        assert words in str(done.exception), command
    assert {path.name for path in tmp_path.iterdir()} == {"r.sqlite"}


def test_an_older_version_of_a_row_with_its_seal_is_named(whole: Path, copy: Path) -> None:
    with Store(copy, create=True) as store:
        store.reset(keys=[PAIRS[0].key])
        store.finish(PAIRS[0].key, Outcome(status="solved", error=4e-7, solve=9.0))
    key = PAIRS[0].key
    tables = ("rows", "answers", "seals")
    with closing(sqlite3.connect(copy, isolation_level=None)) as db:
        db.execute("ATTACH ? AS old", (str(whole),))
        for table in tables:
            db.execute(f"DELETE FROM main.{table} WHERE key = ?", (key,))
            db.execute(f"INSERT INTO main.{table} SELECT * FROM old.{table} WHERE key = ?", (key,))
    with (
        Store(copy) as store,
        pytest.raises(SealError, match="which rows it has, or their seals changed after the run"),
    ):
        store.audit().require()


def _interrupted(path: Path) -> None:
    with Store(path, create=True) as store:
        store.reset(keys=[PAIRS[0].key])
        raise KeyboardInterrupt


def test_a_run_that_did_not_end_is_named_and_goes_on(copy: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        _interrupted(copy)
    with Store(copy) as store:
        found = store.audit()
        assert "did not end" in store.meta()["seals"][0]
    assert not found.broken
    assert not found.changed
    assert "the run that writes it did not end" in found.notes[0]
    with Store(copy, create=True) as store:
        _fill(store, 1)
    with Store(copy) as store:
        assert not store.audit().notes


def test_facts_are_sealed_while_the_run_goes_on(copy: Path) -> None:
    with Store(copy, create=True) as store:
        store.reset(keys=[PAIRS[0].key])
        _execute(copy, "UPDATE machines SET description = '{}'")
        store.add_reference(100, 0.5)
        with pytest.raises(SealError, match="its machines changed after it was sealed"):
            store.require_unchanged()
    with Store(copy) as store, pytest.raises(SealError, match="its machines changed after it was sealed"):
        store.audit().require()


def test_a_run_that_goes_on_with_a_changed_file_keeps_that_for_all_readers(copy: Path, tmp_path: Path) -> None:
    _execute(copy, EDITS["its machines"])
    for _ in range(3):
        with Store(copy, create=True, expel=True) as store:
            store.plan(PAIRS)
    with Store(copy) as store:
        store.audit().require()
        assert ["its machines changed" in line for line in store.meta()["seals"]] == [True]
    merge([copy], tmp_path / "m.sqlite")
    with Store(tmp_path / "m.sqlite") as store:
        assert "its machines changed" in store.meta()["seals"][0]


# ----------------------------------------------------------------------------------- whose key it was (A4)


def _by_another(path: Path) -> None:
    """Seal everything again with a key that is not this user's, as a forger does."""
    other = Key(b"another's key, of 32 bytes, made up")
    with closing(sqlite3.connect(path, isolation_level=None)) as db:
        rows = db.execute(seals.READ).fetchall()
        db.executemany("UPDATE seals SET seal = ? WHERE key = ?", [(seals.sealed(r, other), r[0]) for r in rows])
        [(whole,)] = db.execute("SELECT seal FROM file_seal").fetchall()
        digests = whole.split(".")[1:-1]
        there = db.execute("SELECT key, seal FROM seals ORDER BY key").fetchall()
        seal = file_seal.sealed(digests[:-1], file_seal.digest_of_rows(there), other)
        db.execute("UPDATE file_seal SET seal = ?", (seal,))


def _unsealed(path: Path) -> None:
    tables = ("seals", "certificates", "proved_problems", "file_seal")
    _execute(path, *(f"DROP TABLE {name}" for name in tables), "PRAGMA user_version = 3")


@pytest.mark.parametrize(("change", "whose"), [(_by_another, "key of another user"), (_unsealed, "none")])
def test_whose_key_sealed_a_row_stays_known(
    change: Callable[[Path], None], whose: str, copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Through a run, a merge and a bundle of rows; a row that is run again is this user's."""
    monkeypatch.chdir(tmp_path)
    with Store(copy) as store:
        assert set(store.table()["sealed_by"]) == {"you"}
    change(copy)
    with Store(copy) as store:
        store.audit().require()
        assert set(store.table()["sealed_by"]) == {whose}
    with Store(copy, create=True, expel=True) as store:
        store.reset(keys=[PAIRS[0].key])
        _fill(store, 1)
    merge([copy], tmp_path / "m.sqlite")
    for path in (copy, tmp_path / "m.sqlite"):
        with Store(path) as store:
            assert not store.audit().broken
            told = store.table().set_index("key")["sealed_by"]
        assert told.pop(PAIRS[0].key) == "you"
        assert set(told) == {whose}
        done = CliRunner().invoke(cli, ["report", str(path), "-o", "report"])
        assert done.exit_code == 0, done.output
        text = (tmp_path / "report" / "report.md").read_text()
        assert f"{whose} ({len(PAIRS) - 1})" in text
        told_rows = "rows had no seal" if whose == "none" else "rows were sealed by the key of another user"
        assert f"{len(PAIRS) - 1} {told_rows}" in text
        rows = json.loads((tmp_path / "report" / "results.json").read_text())
        assert sum(row["sealed_by"] == whose for row in rows) == len(PAIRS) - 1


def test_a_file_seal_of_another_key_than_the_rows_is_not_valid(copy: Path) -> None:
    with closing(sqlite3.connect(copy)) as db:
        (seal,) = db.execute("SELECT seal FROM file_seal").fetchone()
    name, rest = seal.split(".", 1)
    other = f"{int(name, 16) ^ 1:08x}"
    _execute(copy, f"UPDATE file_seal SET seal = '{other}.{rest}'")
    with Store(copy) as store:
        assert store.audit().changed == ["its seal over the whole file is not valid"]


def test_an_older_file_gets_its_new_table_and_column(copy: Path) -> None:
    older = ("DROP TABLE file_seal", "ALTER TABLE rows DROP COLUMN sealed_by", "PRAGMA user_version = 8")
    _execute(copy, *older)
    with Store(copy, create=True) as store:
        assert {row.sealed_by for row in store.rows()} == {None}
        assert "its facts beside the rows had no seal" in store.meta()["seals"][0]
    with closing(sqlite3.connect(copy)) as db:
        assert db.execute("PRAGMA user_version").fetchone() == (schema.SCHEMA,)
