"""Merging results files: shards give what one run gives, and what does not compare is refused or marked."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import cpbench
from synthetic_results import pair

from cpbench import storage
from cpbench.bench.planning.plan import Limits, Pair
from cpbench.bench.results.merge import merge
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store, read_results
from cpbench.errors import StoreError
from cpbench.formulations import LCP

MACHINE = {"cpu": "quick", "cores": 2, "load": 0.1}
ROW = {"status": "solved", "error": 1e-9, "flags": "", "solve": 1e-3, "version": "1.0", "finished": "now"}
TIMES = {"wall", "load", "convert", "setup", "solve", "lift", "verify", "cpu", "peak", "samples", "solve_min"}
TIMES |= {"solve_iqr", "loadavg", "finished"}


Make = Callable[..., Path]


@pytest.fixture
def made(tmp_path: Path) -> Make:
    """Makes a results file of planned pairs, of which some were run."""

    def make(name: str, planned: Iterable[Pair], ran: Iterable[Pair] = (), row: Any = ROW, **meta: Any) -> Path:
        path = tmp_path / name
        with Store(path, create=True) as store:
            store.plan(planned)
            store.set_meta(**{"machine": MACHINE, "cpbench": "0.1.0", "command": f"cpbench run {name}", **meta})
            store.note_machine("node", meta.get("machine", MACHINE))
            store.add_reference(0, 0.5)
            for p in ran:
                store.finish(p.key, Outcome(**row, answer=f"{name} {p.problem}".encode(), history=b"history"))
        return path

    return make


def test_rows_answers_and_histories_of_all(made: Make, tmp_path: Path) -> None:
    a = made("a.sqlite", [pair(0), pair(1)], [pair(0), pair(1)])
    b = made("b.sqlite", [pair(2), pair(0, "pgs")], [pair(2)], machine={**MACHINE, "load": 1.5})
    before = (a.read_bytes(), b.read_bytes())
    merge([a, b], tmp_path / "c.sqlite")
    assert (a.read_bytes(), b.read_bytes()) == before
    with Store(tmp_path / "c.sqlite") as merged, Store(a) as first, Store(b) as second:
        rows = {row.key: row for row in merged.rows()}
        assert rows == {row.key: row for store in (first, second) for row in store.rows()}
        assert dict(merged.answers()) == dict([*first.answers(), *second.answers()])
        assert dict(merged.histories()) == dict([*first.histories(), *second.histories()])
        assert len(merged.references()) == 2
        assert merged.machines() == {"node": {**MACHINE, "load": 1.5}}
        told = merged.meta()["merged"]
        assert [(m["file"], m["command"]) for m in told] == [
            ("a.sqlite", "cpbench run a.sqlite"),
            ("b.sqlite", "cpbench run b.sqlite"),
        ]
    assert {p.name for p in tmp_path.iterdir()} == {"a.sqlite", "b.sqlite", "c.sqlite"}


def test_features_of_all_problems(made: Make, tmp_path: Path) -> None:
    a, b = made("a.sqlite", [pair(0), pair(1)]), made("b.sqlite", [pair(1)])
    for path, name, facts in ((a, 0, {"n": 1.0}), (a, 1, {"n": 2.0}), (b, 1, {"n": 3.0})):
        with Store(path, create=True) as store:
            store.note_features({pair(name).fingerprint: facts})
    merge([a, b], tmp_path / "c.sqlite")
    with Store(tmp_path / "c.sqlite") as merged:
        assert merged.features() == {pair(0).fingerprint: {"n": 1.0}, pair(1).fingerprint: {"n": 2.0}}


def test_a_row_that_was_run_wins_over_one_that_was_not(made: Make, tmp_path: Path) -> None:
    both = [pair(0), pair(1)]
    a, b = made("a.sqlite", both, both[:1]), made("b.sqlite", both, both[1:])
    for k, inputs in enumerate(([a, b], [b, a])):
        merge(inputs, tmp_path / f"c{k}.sqlite")
        with Store(tmp_path / f"c{k}.sqlite") as merged:
            assert merged.counts() == {"solved": 2}
            assert dict(merged.answers()) == {both[0].key: b"a.sqlite p0", both[1].key: b"b.sqlite p1"}


def test_a_pair_that_was_run_twice(made: Make, tmp_path: Path) -> None:
    a = made("a.sqlite", [pair(0)], [pair(0)])
    b = made("b.sqlite", [pair(0)], [pair(0)], {**ROW, "solve": 2e-3})
    with pytest.raises(StoreError, match="lemke on p0 was run in both; leave one of them out"):
        merge([a, b], tmp_path / "c.sqlite")
    merge([a, a], tmp_path / "same.sqlite")
    assert len(read_results(tmp_path / "same.sqlite")) == 1, "one measurement in two files is no conflict"


MIXES = {
    "timeout": ({"limits": Limits(seconds=20.0)}, {}, {}, "differ in timeout: 10 and 20"),
    "repeats": ({"limits": Limits(repeats=5)}, {}, {}, "differ in repeats: 3 and 5"),
    "tolerance": ({"tolerance": 1e-8}, {}, {}, "differ in tolerance: 1e-06 and 1e-08"),
    "machine": ({}, {}, {"machine": {**MACHINE, "cpu": "slow"}}, "differ in machine: cpu quick and cpu slow"),
    "cpbench": ({}, {}, {"cpbench": "0.2.0"}, "differ in version of cpbench: 0.1.0 and 0.2.0"),
    "solver": ({}, {"version": "2.0"}, {}, "differ in version of lemke: 1.0 and 2.0"),
}


@pytest.mark.parametrize("mix", MIXES)
def test_what_does_not_compare_is_refused(made: Make, tmp_path: Path, mix: str) -> None:
    planned, row, meta, told = MIXES[mix]
    mine, theirs = [pair(0), pair(1)], [pair(2, **planned), pair(3, **planned)]
    a, b = made("a.sqlite", mine, mine), made("b.sqlite", theirs, theirs[:1], {**ROW, **row}, **meta)
    out = tmp_path / "c.sqlite"
    with pytest.raises(StoreError, match=told) as refusal:
        merge([a, b], out)
    assert "\n" not in str(refusal.value)
    assert not out.exists()


def test_a_problem_that_changed_under_its_name(made: Make, tmp_path: Path) -> None:
    changed = pair(0, fingerprint="f" * 32)
    a = made("a.sqlite", [pair(0), pair(1)], [pair(0), pair(1)])
    b = made("b.sqlite", [changed], [changed])
    with pytest.raises(StoreError, match="differ in fingerprint of problem p0"):
        merge([a, b], tmp_path / "c.sqlite")


def test_a_file_without_a_row_that_was_run(made: Make, tmp_path: Path) -> None:
    """A shard that came out empty, or was not started: where it was planned does not matter."""
    a, b = made("a.sqlite", [pair(0)], [pair(0)]), made("b.sqlite", [], machine={"cpu": "slow"}, cpbench="0.2.0")
    merge([b, a], tmp_path / "c.sqlite")
    assert list(read_results(tmp_path / "c.sqlite").status) == ["solved"]
    with Store(tmp_path / "c.sqlite") as merged:
        assert merged.meta()["machine"] == MACHINE


def test_an_output_that_is_there_is_left_alone(made: Make, tmp_path: Path) -> None:
    a = made("a.sqlite", [pair(0)], [pair(0)])
    with pytest.raises(StoreError, match="exists"):
        merge([a, a], a)
    (tmp_path / "c.sqlite-wal").write_bytes(b"left by another file")
    with pytest.raises(StoreError, match=r"c\.sqlite-wal: exists"):
        merge([a, a], tmp_path / "c.sqlite")


@pytest.mark.nightly
def test_shards_give_what_one_run_gives(tmp_path: Path) -> None:
    """Rows, answers and the order of the table; times, dates and loads aside."""
    for n in (3, 4, 5, 6):
        M = 4.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
        storage.save(LCP(M=M, q=-(M @ np.ones(n)), name=f"p{n}"), tmp_path / f"p{n}.h5")
    (tmp_path / "broken.h5").write_text("no problem")

    def run(*arguments: str) -> str:
        done = cpbench(tmp_path, *arguments)
        assert done.returncode == 0, done.stderr
        return done.stdout

    options = ["-s", "lemke", "-s", "bpp", "--no-report", "-q"]
    run("run", ".", *options, "-o", "whole.sqlite")
    for part in ("1/3", "2/3", "3/3"):
        run("run", ".", *options, "--shard", part, "-o", f"part{part[0]}.sqlite")
    told = run("results", "merge", "part1.sqlite", "part2.sqlite", "part3.sqlite", "-o", "both.sqlite")
    assert "8 pairs of 3 files: 8 solved" in told
    whole, both = (read_results(tmp_path / f"{name}.sqlite") for name in ("whole", "both"))
    assert (whole.solve > 0).all()
    stays = [c for c in whole.columns if c not in TIMES]
    assert whole[stays].equals(both[stays])
    with Store(tmp_path / "whole.sqlite") as one, Store(tmp_path / "both.sqlite") as other:
        assert list(one.answers()) == list(other.answers())
        for name in ("solvers", "cpbench", "refused"):
            assert one.meta()[name] == other.meta()[name]
        assert other.meta()["plan"] == {**one.meta()["plan"], "output": "", "report": None}


def test_the_command_refuses_in_one_line(made: Make, tmp_path: Path) -> None:
    a = made("a.sqlite", [pair(0)], [pair(0)])
    b = made("b.sqlite", [pair(1)], [pair(1)], cpbench="0.2.0")
    done = cpbench(tmp_path, "results", "merge", str(a), str(b), "-o", "c.sqlite")
    assert done.returncode == 2
    assert done.stderr.startswith("cpbench: ")
    assert done.stderr.count("\n") == 1
