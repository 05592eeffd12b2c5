"""A recorded scene of contacts, warm step by step and cold: run, paired, killed in the middle, resumed."""

from __future__ import annotations

import json
import multiprocessing as mp
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from command_line import cpbench
from recorded import STEPS, write_sequence

from cpbench import storage
from cpbench.analysis import table as rows_of
from cpbench.analysis.starts import paired
from cpbench.bench import run
from cpbench.bench.block import block_name, predecessors
from cpbench.bench.events import Done, Event
from cpbench.bench.planning import plan
from cpbench.bench.planning.plan import Pair
from cpbench.bench.results.rows import Outcome, unpack_answer
from cpbench.bench.results.store import Store
from cpbench.bench.run import execute
from cpbench.bench.slot import Slot

LIMITS = plan.Limits(seconds=30.0, repeats=1)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One pack with the steps of the scene."""
    return write_sequence(tmp_path_factory.mktemp("scene") / "steps.h5")


def _plan(slot: Slot, scene: Path, starts: tuple[str, ...], solvers: tuple[str, ...] = ("nsgs",)) -> list[Pair]:
    asked = [plan.exact()]
    surveys = [slot.survey(address, asked) for address in storage.problem_files([str(scene)])]
    entries = [plan.Entry(name) for name in solvers]
    return [p for start in starts for p in plan.pairs(surveys, entries, asked, 1e-6, LIMITS, start=start)]


def _run(scene: Path, output: Path, starts: tuple[str, ...], solvers: tuple[str, ...] = ("nsgs",)) -> pd.DataFrame:
    with Slot() as slot, Store(output, create=True) as store:
        planned = _plan(slot, scene, starts, solvers)
        store.plan(planned)
        execute([slot], store, planned)
        return rows_of.normalised(store.table())


def _iterations(rows: pd.DataFrame) -> list[int]:
    return [json.loads(counters)["iterations"] for counters in rows.sort_values("step")["counters"]]


def _run_and_die(scene: Path, output: Path, after: int) -> None:
    """The runner kills itself, -9, after so many rows."""
    done = 0

    def on_event(event: Event) -> None:
        nonlocal done
        done += isinstance(event, Done)
        if done == after:
            os.kill(os.getpid(), signal.SIGKILL)

    with Slot() as slot, Store(output, create=True) as store:
        planned = _plan(slot, scene, ("previous",))
        store.plan(planned)
        execute([slot], store, planned, on_event=on_event)


@pytest.fixture(scope="module")
def both(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    return _run(scene, tmp_path_factory.mktemp("both") / "r.sqlite", ("previous", "cold"))


@pytest.mark.needs("cpbench_solvers")
def test_every_step_follows_the_one_before(both: pd.DataFrame) -> None:
    warm = both[both["start"] == "previous"].sort_values("step")
    assert list(warm["status"]) == ["solved"] * STEPS
    assert list(warm["started"]) == ["cold: first step"] + ["previous"] * (STEPS - 1)
    assert warm["finished"].is_monotonic_increasing, "steps are run in their order"


@pytest.mark.needs("cpbench_solvers")
def test_warm_and_cold_are_paired_by_step(both: pd.DataFrame) -> None:
    """The scene rests, nearly: warm starts save sweeps in most steps."""
    (found,) = paired(both).to_dict("records")
    assert (found["pairs"], found["warm"], found["cold"], found["fell_back"]) == (STEPS, STEPS, STEPS, 1)
    assert found["iterations"] < 1.0
    warm = np.array(_iterations(both[both["start"] == "previous"]))
    cold = np.array(_iterations(both[both["start"] == "cold"]))
    assert warm[0] == cold[0], "the first step has nothing before it"
    assert (warm[1:] < cold[1:]).sum() > 2 * STEPS // 3


@pytest.mark.nightly
def test_a_run_that_is_killed_goes_on_from_the_kept_answer(scene: Path, both: pd.DataFrame, tmp_path: Path) -> None:
    """kill -9 after 13 steps; the same again: every step does what it does in a run that is left alone."""
    output = tmp_path / "r.sqlite"
    runner = mp.get_context("spawn").Process(target=_run_and_die, args=(scene, output, 13))
    runner.start()
    runner.join(120)
    assert runner.exitcode == -signal.SIGKILL
    with Store(output) as store:
        assert store.counts() == {"solved": 13, "not_run": STEPS - 13}
        before = dict(store.answers())
    rows = _run(scene, output, ("previous",)).sort_values("step")
    calm = both[both["start"] == "previous"].sort_values("step")
    assert list(rows["started"]) == list(calm["started"])
    assert _iterations(rows) == _iterations(calm)
    assert list(rows["error"]) == list(calm["error"])
    with Store(output) as store:
        kept = dict(store.answers())
    assert all(np.array_equal(unpack_answer(kept[key]), unpack_answer(blob)) for key, blob in before.items())


@pytest.mark.needs("cpbench_solvers")
def test_a_step_whose_predecessor_failed_starts_cold_and_says_so(scene: Path, tmp_path: Path) -> None:
    """One iteration is not enough for the first step; the second has nothing to start from, nor has the third."""
    with Slot() as slot, Store(tmp_path / "r.sqlite", create=True) as store:
        asked = [plan.exact()]
        addresses = storage.problem_files([str(scene)])[:3]
        surveys = [slot.survey(address, asked) for address in addresses]
        entries = [plan.parse_entry("nsgs[max_iterations=1]")]
        planned = plan.pairs(surveys, entries, asked, 1e-6, LIMITS, start="previous")
        store.plan(planned)
        execute([slot], store, planned)
        rows = store.table().sort_values("step")
    assert list(rows["status"]) == ["max_iter"] * 3
    assert list(rows["started"]) == ["cold: first step"] + ["cold: the step before was max_iter"] * 2


@pytest.mark.nightly
def test_a_solver_that_takes_no_start_is_unsupported(scene: Path, tmp_path: Path) -> None:
    with Slot() as slot, Store(tmp_path / "r.sqlite", create=True) as store:
        asked = [plan.exact(), *plan.facets("inner", 8)]
        survey = slot.survey(storage.problem_files([str(scene)])[0], asked)
        planned = plan.pairs([survey], [plan.Entry("enumeration-lcp")], asked, 1e-6, LIMITS, start="previous")
        store.plan(planned)
        execute([slot], store, planned)
        rows = store.table()
    assert set(rows["status"]) == {"unsupported"}
    assert rows["message"].str.contains("takes no starting point").all()


def _steps(address: str, count: int, **given: Any) -> list[Pair]:
    """Pairs that follow a scene, with as much of a problem as blocks look at."""
    base: dict[str, Any] = {"problem": "p", "node": "fc", "family": "", "sizes": {}, "request": plan.exact()}
    base |= {"entry": plan.Entry("nsgs"), "target": "fc", "tolerance": 1e-6, "start": "previous", "sequence": "scene"}
    return [
        Pair(**{**base, "address": address.format(k), "fingerprint": f"{k}", "step": k, **given}) for k in range(count)
    ]


def test_scenes_of_one_name_in_two_places_are_two() -> None:
    """Twins of steps too: the same problem at two places of a scene at rest is two rows."""
    members = [*_steps("a/{}.h5", 3), *_steps("b/{}.h5", 3)]
    assert len({pair.key for pair in members}) == 6
    assert len({block_name(pair) for pair in members}) == 2
    found = predecessors(sorted(members, key=lambda pair: pair.step))
    assert {p.address: found[p.key].address for p in members if p.key in found} == {
        **{f"a/{k}.h5": f"a/{k - 1}.h5" for k in (1, 2)},
        **{f"b/{k}.h5": f"b/{k - 1}.h5" for k in (1, 2)},
    }
    rest = _steps("s.h5::step-{}", 3, fingerprint="same")
    assert len({pair.key for pair in rest}) == 3


@pytest.mark.nightly
def test_followers_of_a_step_that_is_run_again_are_run_again(scene: Path, tmp_path: Path) -> None:
    """Step 0 had crashed and step 1 begun cold: when 0 is reset, so is 1, and 2, which had an answer, is not."""
    with Slot() as slot, Store(tmp_path / "r.sqlite", create=True) as store:
        planned = sorted(_plan(slot, scene, ("previous",)), key=lambda pair: pair.step)[:3]
        store.plan(planned)
        store.finish(planned[0].key, Outcome(status="crash", started="cold: first step"))
        store.finish(planned[1].key, Outcome(status="solved", started="cold: the step before was crash"))
        store.finish(planned[2].key, Outcome(status="solved", started="previous"))
        store.reset(("crash",), [pair.key for pair in planned])
        run._reset_followers(store, planned)
        assert store.pending() == {planned[0].key, planned[1].key}


@pytest.mark.nightly
def test_steps_need_the_answers_before(scene: Path, tmp_path: Path) -> None:
    done = cpbench(tmp_path, "run", str(scene), "-s", "nsgs", "--start", "previous", "--keep", "none")
    assert done.returncode == 2
    assert "--keep none with --start previous" in done.stderr
    assert list(tmp_path.iterdir()) == []
