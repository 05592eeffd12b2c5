"""Seals: whatever is changed in a results file behind the back of the run is found; honest files pass."""

from __future__ import annotations

import json
import random
import re
import shutil
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from cpbench.bench.planning.plan import Entry, Limits, Pair, Request
from cpbench.bench.results import seal_key, seals
from cpbench.bench.results.merge import merge
from cpbench.bench.results.rows import Outcome, Row
from cpbench.bench.results.schema import MEASURED, PLANNED
from cpbench.bench.results.seal_key import Key
from cpbench.bench.results.store import Store
from cpbench.cli import cli
from cpbench.errors import SealError, StoreError

LABELS = ("lemke", "bpp", "pgs")
PAIRS = [
    Pair(
        address=f"p{k}.h5", problem=f"p{k}", fingerprint=f"{k:064x}", node="lcp", family="made", sizes={"n": k},
        request=Request("exact"), entry=Entry(label), target="lcp", tolerance=1e-6, limits=Limits(60.0, 2**30, 1, 3),
    )
    for k in range(8) for label in LABELS
]  # fmt: skip
OURS = PAIRS[0].key
TRIES = 100


def _result(k: int) -> dict[str, Any]:
    """What is measured of pair k: every third is wrong."""
    status, error = ("wrong", 0.5 + k) if k % 3 == 2 else ("solved", 1e-9 * (k + 1))
    return {
        "status": status, "claim": "solved", "error": error, "route": "direct", "solve": 0.01 * k, "repeats": 3,
        "message": "größer" if k % 5 == 0 else "", "parts": json.dumps({"natural": error}), "peak": 2**40 + k,
        "finished": "2026-11-23T12:00:00", "host": "here",
    }  # fmt: skip


def _write(path: Path, results: Callable[[int], dict[str, Any]] = _result) -> Path:
    with Store(path, create=True) as store:
        store.plan(PAIRS)
        for k, pair in enumerate(PAIRS[:-2]):
            history = bytes([k]) * 40 if k % 4 == 0 else None
            kept = {"answer": random.Random(k).randbytes(60), "history": history}
            store.finish(pair.key, Outcome(**results(k), **kept))
        store.settle()
    return path


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _write(tmp_path_factory.mktemp("sealed") / "r.sqlite")


def _change(path: Path, *statements: tuple[str, tuple[Any, ...]]) -> None:
    with closing(sqlite3.connect(path, isolation_level=None)) as db:
        for statement, given in statements:
            db.execute(statement, given)


# ---------------------------------------------------------------------------------------------- forgeries


def _forged_text(draw: random.Random, value: Any) -> Any:
    """Another value of the same kind."""
    if isinstance(value, float):
        return value * draw.choice([0.0, 1e-8, 1.0 + 2**-52, -1.0]) + draw.choice([0.0, 1e-12]) + 1e-300
    if isinstance(value, int):
        return value ^ (1 << draw.randrange(16))
    text = str(value or "x")
    place = draw.randrange(len(text))
    return text[:place] + chr(ord(text[place]) ^ 1) + text[place + 1 :]


def _any_column(draw: random.Random, key: str, path: Path) -> None:
    """Another value in some column of some row."""
    column = draw.choice([name for name in (*PLANNED, *MEASURED) if name != "key"])
    with closing(sqlite3.connect(path)) as db:
        (value,) = db.execute(f'SELECT "{column}" FROM rows WHERE key = ?', (key,)).fetchone()
    forged = value
    while forged == value:
        forged = _forged_text(draw, value)
    _change(path, (f'UPDATE rows SET "{column}" = ? WHERE key = ?', (forged, key)))


def _verdict(draw: random.Random, key: str, path: Path) -> None:
    """A verdict that does not contradict itself."""
    _change(
        path,
        ("UPDATE rows SET status = 'solved', error = ?, claim = 'solved' WHERE key = ?", (draw.random() * 1e-7, key)),
    )


def _answer(draw: random.Random, key: str, path: Path) -> None:
    blob = draw.randbytes(60)
    _change(path, ("INSERT OR REPLACE INTO answers VALUES (?, ?, ?)", (key, len(blob), blob)))


def _history(draw: random.Random, key: str, path: Path) -> None:
    _change(path, ("INSERT OR REPLACE INTO histories VALUES (?, ?)", (key, draw.randbytes(40))))


def _proof(draw: random.Random, key: str, path: Path) -> None:
    _change(path, ("INSERT OR REPLACE INTO certificates VALUES (?, 'infeasible', ?)", (key, draw.randbytes(8))))


def _removed(_: random.Random, key: str, path: Path) -> None:
    _change(path, ("DELETE FROM rows WHERE key = ?", (key,)))


def _unsealed(_: random.Random, key: str, path: Path) -> None:
    _change(path, ("DELETE FROM seals WHERE key = ?", (key,)))


def _scribbled(draw: random.Random, key: str, path: Path) -> None:
    """In place of the seal something that is none."""
    _change(path, ("UPDATE seals SET seal = ? WHERE key = ?", (draw.choice(["", "x", "....", "ein.siegel"]), key)))


def _exchanged(draw: random.Random, key: str, path: Path) -> None:
    """The results of two rows change places, seals and all."""
    other = draw.choice([pair.key for pair in PAIRS[:-2] if pair.key != key])
    with closing(sqlite3.connect(path)) as db:
        seal = [db.execute("SELECT seal FROM seals WHERE key = ?", (k,)).fetchone()[0] for k in (key, other)]
    _change(path, *(("UPDATE seals SET seal = ? WHERE key = ?", pair) for pair in ((seal[0], other), (seal[1], key))))


def _resealed(draw: random.Random, key: str, path: Path) -> None:
    """A forger who knows how seals are made, and has a key of his own; half of the time he gives it our key's name."""
    _verdict(draw, key, path)
    known = seal_key.find()
    assert known is not None
    with closing(sqlite3.connect(path)) as db:
        values = db.execute(f"{seals.READ} WHERE rows.key = ?", (key,)).fetchone()
    own = Key(draw.randbytes(32))
    seal = seals.sealed(values, own)
    if draw.random() < 0.5:
        digests = ".".join(seals._digests(values, known.name))
        seal = f"{known.name}.{digests}.{seals._signed(digests, own)}"
    _change(path, ("UPDATE seals SET seal = ? WHERE key = ?", (seal, key)))


FORGERS = (_any_column, _verdict, _answer, _history, _proof, _removed, _unsealed, _scribbled, _exchanged, _resealed)


def _forge(seed: int, path: Path) -> str:
    """Change one thing, every second time in the row of the first solver; how."""
    draw = random.Random(seed)
    forger = FORGERS[seed % len(FORGERS)]
    forger(draw, OURS if seed // len(FORGERS) % 2 else draw.choice([pair.key for pair in PAIRS[1:-2]]), path)
    return forger.__name__


def test_a_hundred_forgeries_are_found_by_later_readers(honest: Path, tmp_path: Path) -> None:
    missed: list[str] = []
    for seed in range(TRIES):
        path = tmp_path / f"{seed}.sqlite"
        shutil.copyfile(honest, path)
        how = _forge(seed, path)
        with Store(path) as store:
            found = store.audit().broken
        if not found:
            missed.append(f"{seed} {how}")
    assert not missed


@pytest.mark.nightly
def test_a_hundred_forgeries_are_found_by_the_run_whose_key_the_forger_has(honest: Path, tmp_path: Path) -> None:
    """He seals what he writes as the run would; the run remembers what it wrote, and marks it for later readers."""
    for seed in range(TRIES):
        path = tmp_path / f"{seed}.sqlite"
        shutil.copyfile(honest, path)
        with Store(path, create=True) as store:
            how = _forge(seed, path)
            key = seal_key.find()
            with closing(sqlite3.connect(path, isolation_level=None)) as db:
                rows = db.execute(seals.READ).fetchall()
                db.executemany(
                    "INSERT OR REPLACE INTO seals VALUES (?, ?)", [(r[0], seals.sealed(r, key)) for r in rows]
                )
            if how in ("_exchanged", "_scribbled", "_unsealed"):  # with new seals he has put everything right himself
                continue
            with pytest.raises(SealError):
                store.require_unchanged()
        with Store(path) as store, pytest.raises(SealError):
            store.audit().require()


def _flips(size: int) -> Iterator[tuple[int, int]]:
    draw = random.Random(20261123)
    for _ in range(TRIES):
        yield draw.randrange(size), 1 << draw.randrange(8)


def test_flipped_bits_are_found_or_change_nothing(honest: Path, tmp_path: Path) -> None:
    """One bit anywhere in the file: refused, or named, or what is read of rows, answers and histories is the same."""
    whole = honest.read_bytes()
    with Store(honest) as store:
        before = (list(store.rows()), list(store.answers()), list(store.histories()))
    path, counts = tmp_path / "r.sqlite", {"found": 0, "same": 0}
    for place, bit in _flips(len(whole)):
        spoiled = bytearray(whole)
        spoiled[place] ^= bit
        path.write_bytes(spoiled)
        try:
            with Store(path) as store:
                store.audit().require()
                assert (list(store.rows()), list(store.answers()), list(store.histories())) == before, (place, bit)
            counts["same"] += 1
        except StoreError:
            counts["found"] += 1
    assert counts["found"] >= 10


def test_a_flipped_bit_in_a_name_of_the_schema_is_found(honest: Path, tmp_path: Path) -> None:
    spoiled = bytearray(honest.read_bytes())
    spoiled[spoiled.index(b"CREATE TABLE") + 8] ^= 0x80
    path = tmp_path / "r.sqlite"
    path.write_bytes(spoiled)
    with pytest.raises(StoreError, match="is damaged"):
        Store(path)


def test_flipped_bits_in_values_are_always_found(honest: Path, tmp_path: Path) -> None:
    """One bit within what is stored of answers, histories, labels, verdicts and times."""
    whole = honest.read_bytes()
    wanted = [random.Random(k).randbytes(60) for k in range(len(PAIRS) - 2)]
    wanted += [json.dumps({"natural": _result(k)["error"]}).encode() for k in range(len(PAIRS) - 2)]
    places = [m.start() + offset for text in wanted for m in re.finditer(re.escape(text), whole) for offset in (3, 11)]
    assert len(places) >= 80
    path = tmp_path / "r.sqlite"
    for place in random.Random(7).sample(places, 60):
        spoiled = bytearray(whole)
        spoiled[place] ^= 1
        path.write_bytes(spoiled)
        with Store(path) as store, pytest.raises(SealError, match="changed after it was sealed"):
            store.audit().require()


def test_what_is_written_into_a_row_that_waits_is_not_sealed(tmp_path: Path) -> None:
    """A solver that loosens the tolerance of its own pair before its answer is judged."""
    path = tmp_path / "r.sqlite"
    with Store(path, create=True) as store:
        store.plan(PAIRS)
        _change(path, ("UPDATE rows SET tolerance = 1e9 WHERE key = ?", (OURS,)))
        store.finish(OURS, Outcome(**_result(0), answer=b"answer"))
        _change(path, ("INSERT INTO answers VALUES (?, 1, 'x')", (PAIRS[1].key,)))
        store.finish(PAIRS[1].key, Outcome(**_result(1)))
        with pytest.raises(
            SealError, match="1 of its rows cannot be believed: lemke on p0: its plan changed after it was sealed"
        ):
            store.require_unchanged()
        assert PAIRS[1].key not in {key for key, _ in store.answers()}


def test_rows_that_contradict_themselves_are_found_without_seals(honest: Path, tmp_path: Path) -> None:
    path = tmp_path / "old.sqlite"
    shutil.copyfile(honest, path)
    _change(
        path,
        ("DROP TABLE seals", ()),
        ("DROP TABLE certificates", ()),
        ("DROP TABLE proved_problems", ()),
        ("DROP TABLE file_seal", ()),
        ("PRAGMA user_version = 3", ()),
    )
    with Store(path) as store:
        found = store.audit()
    assert not found.broken
    assert "made by an older cpbench" in found.notes[0]
    _change(path, ("UPDATE rows SET status = 'solved' WHERE key = ?", (PAIRS[2].key,)))
    with (
        Store(path) as store,
        pytest.raises(SealError, match=r"pgs on p0: is solved with error 2.5 at tolerance 1e-06"),
    ):
        store.audit().require()


# ----------------------------------------------------------------------------------- honest files, commands


def test_honest_files_pass_and_go_on(honest: Path, tmp_path: Path) -> None:
    path = tmp_path / "r.sqlite"
    shutil.copyfile(honest, path)
    with Store(path, create=True) as store:
        store.reset(["wrong"])
        store.finish(PAIRS[2].key, Outcome(**_result(0), answer=b"answer"))
        store.put(store.row(PAIRS[5].key), Outcome(**_result(1), answer=b"another"))
        store.require_unchanged()
    merge([path], tmp_path / "merged.sqlite")
    for file in (path, tmp_path / "merged.sqlite"):
        with Store(file) as store:
            found = store.audit()
        assert not found.broken
        assert not found.notes


def test_a_file_of_another_user_is_named_and_sealed_anew(
    honest: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.sqlite"
    shutil.copyfile(honest, path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "other"))
    for _ in range(2):
        with Store(path) as store:
            found = store.audit()
        assert not found.broken
        assert f"its {len(PAIRS)} rows are sealed by the key" in found.notes[0]
    with Store(path, create=True) as store:
        assert store.opened.notes == found.notes
    with Store(path) as store:
        assert not store.audit().notes


def test_where_no_key_can_be_kept_a_run_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    path = tmp_path / "r.sqlite"
    with Store(path, create=True) as store:
        assert "the key of the seals could not be kept" in store.opened.notes[0]
        store.plan(PAIRS)
        store.finish(OURS, Outcome(**_result(0)))
        store.require_unchanged()
        _change(path, ("UPDATE rows SET error = 0 WHERE key = ?", (OURS,)))
        with pytest.raises(SealError):
            store.require_unchanged()


def test_the_key_is_readable_by_its_owner_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert seal_key.find() is None
    made = seal_key.find_or_make()
    assert made.kept
    assert seal_key.find_or_make() == seal_key.find() == made
    assert [path.name for path in seal_key.folder().iterdir()] == ["key"]
    assert (seal_key.folder() / "key").stat().st_mode & 0o077 == 0


COMMANDS = (
    ("report", "r.sqlite", "-o", "report"),
    ("compare", "r.sqlite", "good.sqlite"),
    ("compare", "good.sqlite", "r.sqlite"),
    ("merge", "good.sqlite", "r.sqlite", "-o", "merged.sqlite"),
    ("export", "r.sqlite", "--rows", "rows.csv"),
    ("bundle", "r.sqlite", "-o", "bundle.zip"),
)


@pytest.mark.needs("cpbench_lab")
@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: " ".join(c[:2]))
def test_commands_refuse_rows_that_cannot_be_believed(
    command: tuple[str, ...], honest: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copyfile(honest, "good.sqlite")
    shutil.copyfile(honest, "r.sqlite")
    _verdict(random.Random(1), PAIRS[2].key, Path("r.sqlite"))
    done = CliRunner().invoke(cli, command)
    assert isinstance(done.exception, SealError), done.output
    assert "r.sqlite: 1 of its rows cannot be believed: pgs on p0: its result changed after it was sealed" in str(
        done.exception
    )
    assert {path.name for path in tmp_path.iterdir()} == {"good.sqlite", "r.sqlite"}


@pytest.mark.nightly
def test_what_it_costs(tmp_path: Path) -> None:
    """A file of 20,000 rows is checked in less than a second of this processor, and three on a busy one."""
    path = tmp_path / "r.sqlite"
    planned = {name: 1.0 if kind == "REAL" else 1 if kind == "INTEGER" else name for name, kind in PLANNED.items()}
    with Store(path, create=True) as store:
        told: dict[str, Any] = {**planned, "tolerance": 1e-6, **_result(0), "attempts": 1}
        store.add(Row(**{**told, "key": f"{k:040x}"}) for k in range(20_000))
    with Store(path) as store:
        begun = time.process_time()
        assert not store.audit().broken
        assert time.process_time() - begun < 3.0
