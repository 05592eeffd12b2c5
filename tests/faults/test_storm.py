"""A thousand random faults in one run of two thousand pairs, and the runner killed five times meanwhile."""

from __future__ import annotations

import json
import os
import random
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import psutil
import pytest
from test_faults import EXPECTED

from cpbench import storage
from cpbench.bench.results.store import Store, read_results
from cpbench.errors import StoreError
from cpbench.formulations import LCP

pytestmark = pytest.mark.nightly
PLUGIN = Path(__file__).with_name("faulty_solvers.py")
CHAOS, SEEDS, CALM = ("chaos1", "chaos2", "chaos3"), range(16), ("lemke", "bpp")
SIZES = range(2, 42)
FAULTS, KILLS = 1000, 5
PAIRS = len(SIZES) * (len(CHAOS) * len(SEEDS) + len(CALM))
DEALT = (
    "abort", "segfault", "own-group", "parent", "exit", "exit-0", "orphan", "close", "junk", "half", "flood", "raise",
    "mute", "cargo", "rant", "interrupt", "recurse", "short", "none", "no-claim", "complex", "nan", "inf", "liar",
    "nothing", "write", "daemon", "eat", "hang", "stop",
)  # fmt: skip
STATUSES = {fault: EXPECTED[fault][0] for fault in DEALT}
DEAR = {fault: 20 for fault, status in STATUSES.items() if status in ("crash", "memout", "solved")}
DEAR |= {"hang": 6, "stop": 6, "parent": 6}
"""How many there are of the faults that cost a process, or a limit; of each of the others, as many as it takes."""


def dealt() -> dict[str, str]:
    """Which of the pairs of chaos have which fault."""
    draw = random.Random(20261121)
    cases = [f"{name} {seed} {n}" for name in CHAOS for seed in SEEDS for n in SIZES]
    common = [fault for fault in STATUSES if fault not in DEAR]
    faults = [fault for fault, count in DEAR.items() for _ in range(count)]
    faults += [common[k % len(common)] for k in range(FAULTS - len(faults))]
    return dict(zip(draw.sample(cases, FAULTS), faults, strict=True))


def start(folder: Path, output: str, faults: dict[str, str]) -> subprocess.Popen[str]:
    deal = folder / f"{output}.json"
    deal.write_text(json.dumps(faults))
    chosen = [f"{name}[seed={seed}]" for name in CHAOS for seed in SEEDS] + list(CALM)
    command = [sys.executable, "-m", "cpbench", "--plugin", str(PLUGIN), "run", "."]
    command += [word for name in chosen for word in ("-s", name)]
    command += ["--timeout", "1s", "--memory", "256M", "--repeats", "1", "--no-report", "-q", "-o", output]
    environment = {**os.environ, "CHAOS": str(deal)}
    return subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )


def finish(running: subprocess.Popen[str]) -> None:
    _, told = running.communicate(timeout=600)
    assert running.returncode == 0, told


def finished(path: Path) -> int:
    try:
        with Store(path) as store:
            counts = store.counts()
    except StoreError as early:
        if re.search("no such results file|is empty", str(early)) is None:
            raise
        return 0
    return sum(counts.values()) - counts.get("not_run", 0)


def kill_after(running: subprocess.Popen[str], path: Path, count: int) -> None:
    """SIGKILL to the runner once so many rows are finished."""
    deadline = time.monotonic() + 600
    try:
        while running.poll() is None and finished(path) < count:
            assert time.monotonic() < deadline
            time.sleep(0.02)
    finally:
        running.kill()
        _, told = running.communicate()
    assert running.returncode == -9, told


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Results files of the storm and of the same pairs without a fault."""
    folder = tmp_path_factory.mktemp("storm")
    for n in SIZES:
        M = 4.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
        storage.save(LCP(M=M, q=-(M @ np.ones(n)), name=f"p{n:02}"), folder / f"p{n:02}.h5")
    calm, storm = folder / "calm.sqlite", folder / "storm.sqlite"
    finish(start(folder, calm.name, {}))
    done = pd.DataFrame()
    for k in range(KILLS):
        kill_after(start(folder, storm.name, dealt()), storm, (k + 1) * PAIRS // (KILLS + 1))
        rows = read_results(storm).set_index("key")
        if k:
            pd.testing.assert_frame_equal(rows.loc[done.index], done, check_dtype=False)
        done = rows[rows.status != "not_run"]
        assert len(rows) == PAIRS
    finish(start(folder, storm.name, dealt()))
    rows = read_results(storm).set_index("key")
    pd.testing.assert_frame_equal(rows.loc[done.index], done, check_dtype=False)
    return calm, storm


def test_each_pair_has_one_row(results: tuple[Path, Path]) -> None:
    """Run once, whole, and with its answer; the file is sound."""
    _, storm = results
    table = read_results(storm)
    assert len(table) == PAIRS == 2000
    assert table["key"].is_unique
    assert not (table.status == "not_run").any()
    assert (table.attempts == 1).all()
    with Store(storm) as store:
        assert store.read("PRAGMA integrity_check") == [("ok",)]


def test_each_fault_has_its_status(results: tuple[Path, Path]) -> None:
    _, storm = results
    table = read_results(storm)
    faults = dealt()
    options, sizes = table.options.map(json.loads), table.sizes.map(json.loads)
    cases = [f"{s} {o.get('seed')} {z['n']}" for s, o, z in zip(table.solver, options, sizes, strict=True)]
    table["fault"] = [faults.get(case, "") for case in cases]
    assert (table.fault != "").sum() == FAULTS
    expected = table.fault.map({**STATUSES, "": "solved"})
    odd = table[table.status != expected]
    assert odd.empty, odd[["label", "problem", "fault", "status", "message"]].to_string(max_colwidth=200)
    late = table[table.status == "timeout"]
    assert (late.wall < 1.5 + max(1.0, os.getloadavg()[0])).all(), "killed in time, and replaced"


def test_healthy_rows_are_those_of_a_calm_run(results: tuple[Path, Path]) -> None:
    calm, storm = (read_results(path).set_index("key") for path in results)
    assert (calm.status == "solved").all()
    healthy = storm[storm.status == "solved"].index
    assert len(healthy) >= PAIRS - FAULTS
    for column in ("status", "error", "claim", "route", "kind", "problem", "label"):
        assert (storm.loc[healthy, column] == calm.loc[healthy, column]).all(), column
    with Store(results[0]) as one, Store(results[1]) as other:
        wanted, found = dict(one.answers()), dict(other.answers())
    assert all(found[key] == wanted[key] for key in healthy)
    assert set(wanted) == set(calm.index)


def test_no_process_is_left(results: tuple[Path, Path]) -> None:
    """Of six runners, five of them killed, and of what a thousand faults started."""
    folder = str(results[0].parent)
    deadline = time.monotonic() + 120.0
    left = [0]
    while left and time.monotonic() < deadline:
        time.sleep(0.1)
        found = psutil.process_iter(["cwd", "status", "cmdline"])
        left = [p for p in found if p.info["cwd"] == folder and p.info["status"] != psutil.STATUS_ZOMBIE]
    assert not left
