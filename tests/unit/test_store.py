"""The results file: rows and answers together, old and newer versions, limits that do not mix."""

from __future__ import annotations

import json
import sqlite3
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from cpbench.bench.planning.plan import Entry, Limits, Pair, Request
from cpbench.bench.results import schema
from cpbench.bench.results.database import use_journal
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store, read_results
from cpbench.errors import StoreError

GOLDEN = Path(__file__).parents[1] / "golden"
DUMP = GOLDEN / "results_schema1.sql"
ROW = {"status": "solved", "error": 1e-9, "solve": 1e-3, "samples": "[0.001, 0.002]", "repeats": 2}


USUAL = Limits()


def pair(number: int = 0, limits: Limits = USUAL, **more) -> Pair:
    return Pair(
        **{
            "address": f"p{number}.h5",
            "problem": f"p{number}",
            "fingerprint": f"{number:032x}",
            "node": "lcp",
            "family": "",
            "sizes": {"n": 3},
            "request": Request("exact"),
            "entry": Entry("lemke"),
            "target": "lcp",
            "tolerance": 1e-6,
            "limits": limits,
            **more,
        }
    )


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store(tmp_path / "r.sqlite", create=True) as made:
        yield made


@pytest.fixture
def schema1(tmp_path: Path) -> Path:
    path = tmp_path / "old.sqlite"
    db = sqlite3.connect(path)
    db.executescript(DUMP.read_text())
    db.execute("PRAGMA journal_mode=WAL")
    db.close()
    return path


def test_a_row_comes_with_its_answer_and_its_history(store: Store) -> None:
    planned = pair()
    store.plan([planned])
    assert store.pending() == {planned.key}
    store.finish(planned.key, Outcome(**ROW, answer=b"answer", history=b"history"))
    row = store.row(planned.key)
    assert {name: getattr(row, name) for name in ROW} == ROW
    assert (row.seconds, row.memory, row.threads, row.repeats_asked) == (10.0, 4 * 2**30, 1, 3)
    assert row.attempts == 1
    assert store.ending(planned.key) == ("solved", b"answer")
    assert list(store.answers()) == [(planned.key, b"answer")]
    assert list(store.histories()) == [(planned.key, b"history")]
    assert not store.pending()


def test_what_cannot_be_stored_changes_nothing(store: Store) -> None:
    store.plan([pair()])
    for outcome in (Outcome(status=object(), answer=b"answer"), Outcome(code=2**70, answer=b"answer")):
        with pytest.raises(StoreError):
            store.finish(pair().key, outcome)
    with pytest.raises(StoreError, match="no row"):
        store.finish("unplanned", Outcome(**ROW, answer=b"answer"))
    assert store.counts() == {"not_run": 1}
    assert list(store.answers()) == []


def test_text_that_is_no_unicode_is_escaped(store: Store) -> None:
    """Half a character, as broken file names and the exceptions that quote them have it."""
    broken = pair(address="p\udcff.h5")
    store.plan([broken])
    store.finish(broken.key, Outcome(status="error", message="no file 'p\udcff.h5', naïve"))
    assert store.row(broken.key).address == "p\\udcff.h5"
    assert store.row(broken.key).message == "no file 'p\\udcff.h5', naïve"


def test_threads_may_share_a_store(store: Store) -> None:
    planned = [pair(i) for i in range(200)]
    store.plan(planned)

    def work(mine: list[Pair]) -> None:
        for p in mine:
            store.finish(p.key, Outcome(**ROW, answer=p.key.encode()))

    threads = [threading.Thread(target=work, args=(planned[k::4],)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert store.counts() == {"solved": 200}
    assert dict(store.answers()) == {p.key: p.key.encode() for p in planned}


@pytest.mark.parametrize(
    ("limits", "told"),
    [
        (Limits(seconds=20.0), "timeout 10, now 20"),
        (Limits(memory=2**30), "memory 4294967296, now 1073741824"),
        (Limits(threads=2), "threads 1, now 2"),
        (Limits(repeats=5), "repeats 3, now 5"),
    ],
)
def test_other_limits_do_not_mix(store: Store, limits: Limits, told: str) -> None:
    store.plan([pair()])
    store.finish(pair().key, Outcome(**ROW))
    for other in (pair(limits=limits), pair(1, limits)):
        with pytest.raises(StoreError, match=f"was made with {told}; .* use another file with -o"):
            store.plan([pair(2), other])
    assert len(list(store.rows())) == 1, "nothing is written of a plan that is refused"
    store.plan([pair(1, limits, set="hard")])
    with pytest.raises(StoreError, match="set 'hard' was made with"):
        store.plan([pair(3, set="hard")])


def test_one_plan_has_one_set_of_limits_a_set(store: Store) -> None:
    with pytest.raises(StoreError, match="timeout 10, now 20"):
        store.plan([pair(0), pair(1, Limits(seconds=20.0))])
    assert not list(store.rows())


def test_rows_that_are_there_stay(store: Store) -> None:
    store.plan([pair()])
    store.finish(pair().key, Outcome(**ROW))
    before = store.row(pair().key)
    store.plan([pair(), pair(1)])
    assert store.row(pair().key) == before
    assert store.pending() == {pair(1).key}


def test_reset(store: Store) -> None:
    planned = [pair(i) for i in range(5)]
    store.plan(planned)
    for p, status in zip(planned, ("solved", "timeout", "timeout", "crash", "timeout"), strict=True):
        store.finish(p.key, Outcome(**{**ROW, "status": status}, answer=b"answer", history=b"history"))
    assert store.reset(statuses={"timeout"}, keys=[p.key for p in planned[:4]]) == 2
    assert store.pending() == {planned[1].key, planned[2].key}
    row = store.row(planned[1].key)
    assert row.attempts == 1
    assert all(getattr(row, c) is None for c in schema.MEASURED if c not in ("status", "attempts"))
    assert store.ending(planned[1].key) == ("not_run", None)
    assert {key for key, _ in store.histories()} == {planned[k].key for k in (0, 3, 4)}
    for p in planned[1:3]:
        store.finish(p.key, Outcome(status="timeout"))
    assert store.row(planned[1].key).attempts == 2
    assert store.reset(statuses={"timeout"}, attempts=1) == 1, "only the one that was run once"
    assert store.reset() == 4, "those that are not run have nothing to lose"
    assert store.counts() == {"not_run": 5}


def test_kept_bytes_follow_what_is_kept(store: Store, tmp_path: Path) -> None:
    planned = [pair(i) for i in range(3)]
    store.plan(planned)
    for p in planned:
        store.finish(p.key, Outcome(**ROW, answer=b"x" * 100))
    store.reset(keys=[planned[0].key])
    assert store._kept == 200
    plan = store._database.read("EXPLAIN QUERY PLAN SELECT coalesce(sum(bytes), 0) FROM answers")
    assert "COVERING INDEX" in plan[0][-1], "opening a file reads no answers"
    store.close()
    with Store(tmp_path / "r.sqlite") as again:
        assert again._kept == 200


def test_reference_and_machines(store: Store) -> None:
    store.note_machine("node1", {"cpu": "fast"})
    store.note_machine("node1", {"cpu": "faster"})
    store.add_reference(0, 0.5, 0.1)
    store.add_reference(100, float("nan"))
    assert store.machines() == {"node1": {"cpu": "faster"}}
    first, second = store.references()
    assert (first["pairs"], first["seconds"], first["loadavg"]) == (0, 0.5, 0.1)
    assert (second["pairs"], second["seconds"], second["loadavg"]) == (100, None, None)
    assert first["at"] <= second["at"]


@pytest.mark.nightly
def test_a_row_costs_the_same_however_many_there_are(tmp_path: Path) -> None:
    """In steps of SQLite's machine, which unlike times do not depend on the day."""
    costs = {}
    for count in (100, 10_000):
        with Store(tmp_path / f"{count}.sqlite", create=True) as made:
            planned = [pair(i) for i in range(count)]
            made.plan(planned)
            steps = 0

            def step() -> int:
                nonlocal steps
                steps += 1
                return 0

            made._database.connection.set_progress_handler(step, 1)
            for p in planned[count // 2 : count // 2 + 10]:
                made.finish(p.key, Outcome(**ROW, answer=b"answer"))
            costs[count] = steps
    assert costs[100] == costs[10_000]


# ------------------------------------------------------------------------------------------- versions


def test_an_old_file_is_migrated(schema1: Path, tmp_path: Path) -> None:
    """Nothing of it is lost, its limits become columns, and its tables are those of a new file."""
    db = sqlite3.connect(schema1)
    names = [d[0] for d in db.execute("SELECT * FROM rows").description]
    before = {row[0]: dict(zip(names, row, strict=True)) for row in db.execute("SELECT * FROM rows")}
    answers = sorted(db.execute("SELECT * FROM answers"))
    meta = {name: json.loads(value) for name, value in db.execute("SELECT * FROM meta")}
    refused = db.execute("SELECT * FROM refused").fetchall()
    db.close()
    with Store(schema1, create=True) as store:
        after = {row.key: row for row in store.rows()}
        assert len(after) == 12
        for key, row in before.items():
            assert {name: getattr(after[key], name) for name in names} == row
            assert (after[key].seconds, after[key].memory, after[key].repeats_asked) == (5.0, 4 * 2**30, 3)
            assert (after[key].attempts, after[key].started, after[key].jobs) == (1, "cold", 1)
        assert list(store.answers()) == answers
        read = store.meta()
        assert [line.partition(" it was ")[2] for line in read.pop("seals")] == ["made by an older cpbench"]
        assert read == {**meta, "refused": refused, "references": []}
        layout = "SELECT type, name, sql FROM sqlite_master ORDER BY name"
        with Store(tmp_path / "new.sqlite", create=True) as new:
            assert store._database.read(layout) == new._database.read(layout)
    with Store(schema1, create=True) as again:
        assert len(list(again.rows())) == 12


def test_a_file_of_schema_2_is_migrated(tmp_path: Path) -> None:
    """Nothing of it changes; there are tables more, and columns, for what it does not have."""
    path, everything = tmp_path / "old.sqlite", "SELECT * FROM rows ORDER BY rowid"
    db = sqlite3.connect(path)
    db.executescript((GOLDEN / "results_schema2.sql").read_text())
    rows = db.execute(everything).fetchall()
    meta = {name: json.loads(value) for name, value in db.execute("SELECT * FROM meta")}
    kept = [db.execute(f"SELECT * FROM {table} ORDER BY key").fetchall() for table in ("answers", "histories")]
    db.close()
    with Store(path) as reading:
        assert reading.features() == {}
    with Store(path, create=True) as store, Store(tmp_path / "new.sqlite", create=True) as new:
        assert store._database.read(everything) == [(*row, *[None] * 7, "none") for row in rows]
        assert [list(store.answers()), list(store.histories())] == [[(a, c) for a, _, c in kept[0]], kept[1]]
        told = store.meta()
        assert {name: told[name] for name in meta} == meta
        assert len(store.references()) == 2
        assert list(store.machines()) == ["node"]
        layout = "SELECT type, name, sql FROM sqlite_master ORDER BY name"
        assert store._database.read(layout) == new._database.read(layout)
        store.note_features({rows[0][3]: {"node": "lcp", "n": 3.0}})
    with Store(path) as again:
        assert again.features() == {rows[0][3]: {"node": "lcp", "n": 3.0}}


def test_an_old_file_is_resumed(schema1: Path) -> None:
    """Today's keys are those of its rows, so that nothing is run twice; other limits are refused as ever."""
    with Store(schema1, create=True) as store:
        rows = list(store.rows())
        planned = [
            pair(
                fingerprint=row.fingerprint,
                entry=Entry(row.solver, json.loads(row.options)),
                limits=Limits(seconds=5.0),
            )
            for row in rows
        ]
        store.plan(planned)
        assert list(store.rows()) == rows
        with pytest.raises(StoreError, match="was made with timeout 5, now 10"):
            store.plan([pair(1)])


def test_an_old_file_is_read_as_it_is(schema1: Path) -> None:
    before = schema1.read_bytes()
    table = read_results(schema1)
    assert schema1.read_bytes() == before
    assert {p.name for p in schema1.parent.iterdir()} == {schema1.name}, "nothing is left beside it"
    with Store(schema1, create=True) as store:
        assert table.equals(store.table())


def test_a_migration_that_fails_leaves_the_old_file(schema1: Path) -> None:
    """A table that is in the way stops it half way."""
    db = sqlite3.connect(schema1)
    db.execute("CREATE TABLE machines (who TEXT)")
    before = list(db.iterdump())
    db.close()
    with pytest.raises(StoreError, match="machines"):
        Store(schema1, create=True)
    db = sqlite3.connect(schema1)
    assert db.execute("PRAGMA user_version").fetchone() == (1,)
    assert list(db.iterdump()) == before
    db.close()


@pytest.mark.parametrize("create", [True, False])
def test_a_newer_file_is_left_alone(tmp_path: Path, create: bool) -> None:
    path = tmp_path / "newer.sqlite"
    with Store(path, create=True) as store:
        store.plan([pair()])
        store._database.connection.execute(f"PRAGMA user_version={schema.SCHEMA + 1}")
    before = path.read_bytes()
    with pytest.raises(
        StoreError, match=f"has results schema {schema.SCHEMA + 1}, this cpbench knows {schema.SCHEMA}; update"
    ) as told:
        Store(path, create=create)
    assert "\n" not in str(told.value)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("create", [True, False])
def test_a_database_of_something_else_is_left_alone(tmp_path: Path, create: bool) -> None:
    path = tmp_path / "bookmarks.sqlite"
    db = sqlite3.connect(path)
    db.execute("CREATE TABLE bookmarks (address TEXT)")
    db.execute("PRAGMA user_version=2")
    db.commit()
    db.close()
    before = path.read_bytes()
    with pytest.raises(StoreError, match="database of something else"):
        Store(path, create=create)
    assert path.read_bytes() == before


def test_without_shared_memory_there_is_a_rollback_journal(tmp_path: Path) -> None:
    """SQLite's dot-file locking has no shared memory, as some file systems have none."""
    path = tmp_path / "r.sqlite"
    for how, mode in (("?vfs=unix-dotfile", "truncate"), ("", "wal")):
        db = sqlite3.connect(path.as_uri() + how, uri=True, isolation_level=None)
        assert use_journal(db, path) == mode
        db.close()
