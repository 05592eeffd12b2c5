"""Sets that ask for throughput: many problems by one call, a row and a verdict each, beside solvers that take one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import command_line
import numpy as np
import pandas as pd
import pytest
import test_solve_many as planted_stacks

import cpbench as cp
from cpbench import storage
from cpbench.analysis import table as rows_of
from cpbench.analysis.throughput import throughputs
from cpbench.bench import block, messages, stacked, worker_call
from cpbench.bench.planning import plan
from cpbench.bench.processes.process import Child
from cpbench.bench.results import answers as packed
from cpbench.bench.results.rows import Row
from cpbench.bench.results.store import Store
from cpbench.bench.slot import Slot
from cpbench.errors import StoreError
from cpbench.formulations.stack import Stack
from cpbench.foundation.matrices import Dense
from cpbench.solvers.base import Budget, Claim, solvers

PLAN = """
output = "t.sqlite"
report = false
throughput = true
repeats = 2
[[set]]
name = "lcp"
problems = ["lcp.h5"]
solvers = ["auto-lcp"]
tolerance = 1e-9
[[set]]
name = "contact"
problems = ["fc.h5"]
solvers = ["auto-fc"]
tolerance = 1e-8
[[set]]
name = "few"
problems = ["few.h5"]
solvers = ["auto-lcp", "psor"]
"""


def _written(folder: Path, family: str, seed: int, first: int | None = None, name: str = "") -> Dense:
    """Write a pack of planted problems and return the planted solutions."""
    kind, data, planted = planted_stacks.FAMILIES[family](np.random.default_rng(seed))
    stack = Stack.of_arrays(kind, data)
    problems = {f"{i:04d}": stack.problem(i) for i in range(first or stack.count)}
    storage.save_pack(problems, folder / f"{name or family}.h5", compress=False)
    return np.concatenate(list(planted.values()), axis=1)


def _rows(store: Store, part: str, solver: str = "") -> list[Row]:
    found = [row for row in store.rows() if row.set == part and solver in ("", row.solver)]
    return sorted(found, key=lambda row: row.address)


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("count", [24, pytest.param(200, marks=pytest.mark.nightly)])
def test_a_set_is_solved_by_one_call_and_judged_one_by_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: int
) -> None:
    """LCPs of 6 unknowns have one solution each, which is planted; contact problems one to be verified."""
    monkeypatch.setattr(planted_stacks, "K", count)
    z = _written(tmp_path, "lcp", 3)
    _written(tmp_path, "fc", 8)
    _written(tmp_path, "lcp", 3, 4, "few")
    (tmp_path / "t.toml").write_text(PLAN)
    done = command_line.cpbench(tmp_path, "run", "--plan", "t.toml")
    assert done.returncode == 0, done.stderr
    assert "Problems per second" in done.stdout
    with Store(tmp_path / "t.sqlite") as store:
        rows, answers = _rows(store, "lcp"), dict(store.answers())
        contact, few = _rows(store, "contact"), _rows(store, "few", "psor")
        table = rows_of.normalised(store.table())
    assert {(row.status, row.batch, row.claim) for row in rows} == {("solved", count, "solved")}
    assert len({(row.solve, row.samples) for row in rows}) == 1, "equal parts of one time"
    assert len({row.error for row in rows}) > count / 2, "and a verdict of its own"
    found = np.array([_unpacked(answers[row.key]) for row in rows])
    np.testing.assert_allclose(found, z, rtol=1e-8, atol=1e-10)
    assert {(row.status, row.batch) for row in contact} == {("solved", count)}
    assert {row.batch for row in few} == {1}, "psor takes no stacks"
    assert {row.batch for row in _rows_of(table, "few", "auto-lcp")} == {4}
    by_label = {(one.group.set, one.label): one for one in throughputs(table)}
    one = by_label["lcp", "auto-lcp"]
    assert (one.problems, one.verified, one.calls) == (count, count, 1)
    assert one.per_second == pytest.approx(count / sum(row.solve or 0.0 for row in rows))
    assert by_label["few", "psor"].calls == 4


def _rows_of(table: pd.DataFrame, part: str, solver: str) -> list[pd.Series]:
    return [row for _, row in table[(table["set"] == part) & (table["solver"] == solver)].iterrows()]


def _unpacked(answer: bytes) -> Dense:
    return np.asarray(packed.unpack(answer))


@pytest.fixture(scope="module")
def pairs(tmp_path_factory: pytest.TempPathFactory, slot: Slot) -> list[plan.Pair]:
    """Four LCPs for `auto-lcp`, in a set that asks for throughput."""
    folder = tmp_path_factory.mktemp("few")
    _written(folder, "lcp", 3, 4)
    surveys = [slot.survey(f"{folder / 'lcp.h5'}::{i:04d}", [plan.exact()]) for i in range(4)]
    limits = plan.Limits(repeats=1, throughput=True)
    return plan.pairs(surveys, [plan.parse_entry("auto-lcp")], [plan.exact()], 1e-6, limits)


@pytest.fixture(scope="module")
def slot() -> Iterator[Slot]:
    with Slot() as slot:
        yield slot


@pytest.mark.needs("cpbench_solvers")
def test_pairs_share_a_call_where_nothing_tells_them_apart(pairs: list[plan.Pair]) -> None:
    def made(*planned: plan.Pair) -> list[int]:
        pending = {pair.key for pair in planned}
        return sorted(len(b.pairs) for b in block.blocks(planned, pending, 0, lambda key: ("", None)))

    first, *others = pairs
    assert made(*pairs) == [4]
    for other in (
        replace(first, limits=plan.Limits(repeats=1)),
        replace(first, start="file"),
        replace(first, sizes={"n": 7}),
        replace(first, tolerance=1e-8),
        replace(first, entry=plan.Entry("psor")),
    ):
        assert made(other, *others) == [1, 3]


@pytest.mark.needs("cpbench_solvers")
def test_a_file_that_changed_is_named_and_the_others_are_solved(slot: Slot, pairs: list[plan.Pair]) -> None:
    changed = replace(pairs[1], fingerprint="0" * 32)
    outcomes = {pair.key: outcome for pair, outcome in block.run(slot, block.Block((pairs[0], changed, pairs[2])))}
    assert [outcomes[pair.key].status for pair in (pairs[0], pairs[2])] == ["solved", "solved"]
    assert outcomes[changed.key].status == "error"
    assert "the file changed" in (outcomes[changed.key].message or "")
    assert {outcome.batch for outcome in outcomes.values()} == {1}


@pytest.mark.needs("cpbench_solvers")
def test_a_call_over_the_limits_of_its_problems_is_a_timeout_of_each(slot: Slot, pairs: list[plan.Pair]) -> None:
    short = [replace(pair, limits=replace(pair.limits, seconds=1e-7)) for pair in pairs]
    for _, outcome in block.run(slot, block.Block(tuple(short))):
        assert (outcome.status, outcome.batch) == ("timeout", 4)


@pytest.mark.needs("cpbench_solvers")
def test_a_call_that_ends_its_process_is_a_crash_of_each(
    slot: Slot, pairs: list[plan.Pair], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The worker is killed once it has the problems; the next call has a new one."""
    hear = worker_call.hear

    def killed(worker: Child, seconds: float) -> messages.Message:
        message = hear(worker, seconds)
        if isinstance(message, messages.ProblemLoaded):
            worker.kill_all()
            while True:  # what it had sent before is not heard
                hear(worker, seconds)
        return message

    with monkeypatch.context() as patch:
        patch.setattr(worker_call, "hear", killed)
        crashed = [outcome for _, outcome in block.run(slot, block.Block(tuple(pairs)))]
    assert [(outcome.status, outcome.batch) for outcome in crashed] == [("crash", 4)] * 4
    again = [outcome for _, outcome in block.run(slot, block.Block(tuple(pairs)))]
    assert [(outcome.status, outcome.batch) for outcome in again] == [("solved", 4)] * 4


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("many", "now"), [(True, "with throughput = true, now without"), (False, "without .* now with")]
)
def test_times_of_both_kinds_do_not_share_a_set(
    tmp_path: Path, slot: Slot, pairs: list[plan.Pair], many: bool, now: str
) -> None:
    def asked(throughput: bool) -> list[plan.Pair]:
        return [replace(pair, limits=replace(pair.limits, throughput=throughput)) for pair in pairs]

    with Store(tmp_path / "t.sqlite", create=True) as store:
        store.plan(asked(many))
        for pair, outcome in block.run(slot, block.Block(tuple(asked(many)[:2]))):
            store.finish(pair.key, outcome)
        store.plan(asked(many))
        with pytest.raises(StoreError, match=now):
            store.plan(asked(not many))


@pytest.mark.needs("cpbench_solvers")
def test_what_compiled_calls_leave_is_solved_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand sweeps do not solve number 48 of these to 1e-9; the automatic choice does, and the row says so."""
    monkeypatch.setattr(planted_stacks, "K", 300)
    kind, data, _ = planted_stacks.FAMILIES["fc"](np.random.default_rng(1))
    stack, solver = Stack.of_arrays(kind, data).only(np.arange(45, 50)), solvers.get("auto-fc")
    assert stacked.solve_measured(stacked.call_for(stack.problem(0)), stack, 1e-9, 1).left.tolist() == [3]
    vectors = stacked.solve_all(solver, stack, Budget(tolerance=1e-9), solver.spec.options(), 1)
    for i in range(5):
        claim, answered, alone, own = stacked.part_of(vectors, 5, i)
        assert (claim, answered, alone) == (Claim.SOLVED, True, i == 3)
        assert cp.verify(stack.problem(i), own["r"].tolist(), tolerance=1e-9).solved
    with pytest.raises(ValueError, match="reshape"):
        stacked.part_of({**vectors, "r": vectors["r"][:-1]}, 5, 0)


def test_time_of_calls_that_solve_nothing_counts() -> None:
    rows = pd.DataFrame(
        {
            "label": ["s"] * 4,
            "status": ["solved", "timeout", "crash", "unsupported"],
            "solve": [0.5, 2.0, np.nan, np.nan],
            "wall": [1.0, 2.5, 1.5, 0.1],
            "lift": [0.25, np.nan, np.nan, np.nan],
            "route": ["direct"] * 4,
            "batch": 1.0,
            "node": "lcp",
            "threads": 1,
        }
    )
    (one,) = throughputs(rows_of.normalised(rows))
    assert (one.problems, one.verified, one.seconds) == (3, 1, 0.5 + 2.0 + 1.5)
    (converted,) = throughputs(rows_of.normalised(rows.assign(route="fc_to_lcp")))
    assert converted.seconds == 4.25
