"""The results file: rows and answers together, other versions, limits that do not mix."""

from __future__ import annotations

import io
import sqlite3
import threading
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from synthetic_results import pair

from cpbench.bench.planning.plan import Limits, Pair
from cpbench.bench.results.database import SCHEMA
from cpbench.bench.results.rows import MEASURED, Outcome, pack_answer, unpack_answer
from cpbench.bench.results.store import Store
from cpbench.errors import StoreError
from cpbench.formulations import MLCPPoint

ROW = {"status": "solved", "error": 1e-9, "solve": 1e-3, "samples": "[0.001, 0.002]", "repeats": 2}


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store(tmp_path / "r.sqlite", create=True) as made:
        yield made


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
    for other in (pair(limits=limits), pair(1, limits=limits)):
        with pytest.raises(StoreError, match=f"was made with {told}; .* use another file with -o"):
            store.plan([pair(2), other])
    assert len(list(store.rows())) == 1, "nothing is written of a plan that is refused"
    store.plan([pair(1, limits=limits, set="hard")])
    with pytest.raises(StoreError, match="set 'hard' was made with"):
        store.plan([pair(3, set="hard")])


def test_one_plan_has_one_set_of_limits_a_set(store: Store) -> None:
    with pytest.raises(StoreError, match="timeout 10, now 20"):
        store.plan([pair(0), pair(1, limits=Limits(seconds=20.0))])
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
    assert all(getattr(row, c) is None for c in MEASURED if c not in ("status", "attempts"))
    assert store.ending(planned[1].key) == ("not_run", None)
    assert {key for key, _ in store.histories()} == {planned[k].key for k in (0, 3, 4)}
    for p in planned[1:3]:
        store.finish(p.key, Outcome(status="timeout"))
    assert store.row(planned[1].key).attempts == 2
    assert store.reset() == 5
    assert store.counts() == {"not_run": 5}


def test_kept_bytes_follow_what_is_kept(store: Store, tmp_path: Path) -> None:
    planned = [pair(i) for i in range(3)]
    store.plan(planned)
    for p in planned:
        store.finish(p.key, Outcome(**ROW, answer=b"x" * 100))
    store.reset(keys=[planned[0].key])
    assert store._kept == 200
    plan = store.read("EXPLAIN QUERY PLAN SELECT coalesce(sum(bytes), 0) FROM answers")
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

            made.connection.set_progress_handler(step, 1)
            for p in planned[count // 2 : count // 2 + 10]:
                made.finish(p.key, Outcome(**ROW, answer=b"answer"))
            costs[count] = steps
    assert costs[100] == costs[10_000]


# ------------------------------------------------------------------------------------------- versions


@pytest.mark.parametrize("create", [True, False])
@pytest.mark.parametrize("version", [SCHEMA + 1, 9])
def test_a_file_of_another_version_is_left_alone(tmp_path: Path, create: bool, version: int) -> None:
    path = tmp_path / "other.sqlite"
    with Store(path, create=True) as store:
        store.plan([pair()])
        store.connection.execute(f"PRAGMA user_version={version}")
    before = path.read_bytes()
    with pytest.raises(
        StoreError, match=f"has results schema {version}, this cpbench knows {SCHEMA} only; use the cpbench that made"
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


def test_an_answer_is_a_npy_file() -> None:
    point = MLCPPoint(u=np.array([1.5, -0.0]), v=np.array([np.nan, np.inf, 3.0]))
    blob = pack_answer(point)
    expected = io.BytesIO()
    np.save(expected, np.concatenate([point.u, point.v]), allow_pickle=False)
    assert zlib.decompress(blob) == expected.getvalue()
    assert unpack_answer(blob).tobytes() == np.concatenate([point.u, point.v]).tobytes()
