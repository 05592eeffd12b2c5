"""The fault table: every fault has its row, in time, and the solvers beside it are unharmed."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from cpbench.bench.results.rows import unpack_answer
from cpbench.bench.results.store import Store

LIMIT = 1.0  # seconds for those that only the clock can end
AMPLE = 60.0  # for all others, whose end must not depend on how busy the machine is
HEALTHY = ("lemke", "bpp", "pgs")
EXPECTED: dict[str, tuple[str, int | None, str]] = {  # status, signal, part of the message
    # ends
    "abort": ("crash", 6, "SIGABRT"),
    "segfault": ("crash", 11, "SIGSEGV"),
    "term": ("crash", 15, "SIGTERM"),
    "own-group": ("crash", 9, "SIGKILL"),
    "exit": ("crash", None, "exited with code 3"),
    "exit-0": ("crash", None, "exited with code 0"),
    "orphan": ("crash", None, "exited with code 3"),
    "parent": ("crash", 9, "SIGKILL"),
    "forkserver": ("crash", None, "exited with code 255"),  # all that is left to be known
    "swarm": ("crash", None, "more than 65 processes at a time"),
    "recurse": ("error", None, "RecursionError"),
    # hangs
    "hang": ("timeout", None, "killed after 1 s"),
    "sleep-in-c": ("timeout", None, "killed after 1 s"),
    "stop": ("timeout", None, "killed after 1 s"),
    "children": ("timeout", None, "killed after 1 s"),
    "crowd": ("timeout", None, "killed after 1 s"),
    # what is left behind
    "stop-parent": ("solved", None, ""),
    "alarm": ("solved", None, ""),
    "burst": ("solved", None, ""),
    "daemon": ("solved", None, ""),
    "twin": ("solved", None, ""),
    "chatter": ("solved", None, ""),
    "threads": ("solved", None, ""),
    "busy": ("solved", None, ""),  # flagged where there are cores to spare
    # memory: 2 GiB under a limit of 1 GiB
    "eat": ("memout", None, "over 1073741824 bytes"),
    "numpy": ("memout", None, "over 1073741824 bytes"),
    "malloc": ("memout", 6, "bad_alloc"),
    "mmap": ("memout", None, "over 1073741824 bytes"),
    "page": ("memout", None, "over 1073741824 bytes"),
    # output, connection, data
    "flood": ("crash", 6, "last words"),
    "noise": ("solved", None, ""),
    "shut": ("solved", None, ""),
    "close": ("crash", None, "closed its connection"),
    "junk": ("error", None, "no valid message"),
    "giant": ("error", None, "a message of 1152921504606846976 bytes"),
    "half": ("crash", None, "exited with code 5"),
    "write": ("error", None, "read-only"),
    "overwrite": ("solved", None, ""),
    "overwrite-c": ("solved", None, ""),
    # exceptions
    "raise": ("error", None, "ZeroDivisionError: division by zero"),
    "mute": ("error", None, "_Mute, without a message"),
    "beyond": ("error", None, "_Beyond: base"),
    "interrupt": ("error", None, "KeyboardInterrupt"),
    "cargo": ("error", None, "_Cargo"),
    "rant": ("error", None, "ValueError: xxx"),
    "verbose": ("solved", None, "xxx"),
    # answers
    "nan": ("wrong", None, ""),
    "inf": ("wrong", None, ""),
    "liar": ("wrong", None, ""),
    "alias": ("wrong", None, ""),
    "nothing": ("wrong", None, ""),
    "integers": ("solved", None, ""),
    "short": ("error", None, "z has"),
    "complex": ("error", None, "complex"),
    "objects": ("error", None, "PointError"),
    "none": ("error", None, "returned a NoneType"),
    "other-point": ("error", None, "answered with a MLCPPoint"),
    "no-claim": ("error", None, "claims 'splendid'"),
    "counters": ("solved", None, "the counter iterations is no integer from 0 to 2^63, and not kept"),
    "tally": ("solved", None, "100000 counters, the first 100 are kept"),
    # after a right answer
    "then-abort": ("solved", None, "a repeat failed: killed by SIGABRT"),
    "then-hang": ("solved", None, "a repeat failed: killed after"),
    "then-eat": ("solved", None, "a repeat failed: over 1073741824 bytes"),
    "then-raise": ("solved", None, "a repeat failed: ZeroDivisionError"),
}
FLAGS = {
    "burst": "children",
    "daemon": "children",
    "chatter": "threads",
    "threads": "threads",
    "overwrite": "wrote",
    "overwrite-c": "wrote",
    "then-abort": "repeat",
    "then-hang": "repeat",
    "then-eat": "repeat",
    "then-raise": "repeat",
}
SAME = ["problem", "solver", "status", "claim", "error", "flags", "parts", "counters", "message", "repeats", "route"]


HANGS = [name for name, (status, *_) in EXPECTED.items() if status == "timeout" or name == "then-hang"]
LIMITS = {"hangs": LIMIT, "others": AMPLE}
FEW = (
    "abort", "exit-0", "orphan", "hang", "children", "daemon", "burst", "malloc", "flood", "close", "junk", "half",
    "write", "overwrite", "raise", "mute", "verbose", "nan", "liar", "nothing", "short", "none", "counters",
    "then-abort", "then-raise",
)  # fmt: skip
"""Of each kind some, which take one problem and few seconds."""


@dataclass(frozen=True)
class Run:
    """What was run, and the stores of two runs: of those that only the clock ends, and of all others."""

    faults: tuple[str, ...]
    problems: list[str]
    stores: dict[str, Store]

    def table(self) -> pd.DataFrame:
        return pd.concat([store.table() for store in self.stores.values()])

    def rows(self, fault: str) -> pd.DataFrame:
        table = self.table()
        return table[table.solver == f"faulty-{fault}"]


@pytest.fixture(scope="module", params=["few", pytest.param("all", marks=pytest.mark.nightly)])
def run(module_bench, request: pytest.FixtureRequest) -> Iterator[Run]:
    few = request.param == "few"
    problems = [module_bench.problem(f"p{n}", n) for n in ((3,) if few else (3, 8))]
    chosen = FEW if few else tuple(EXPECTED)
    stores = {}
    for name, limit in LIMITS.items():
        solvers = [*(f"faulty-{fault}" for fault in chosen if (fault in HANGS) == (name == "hangs")), *HEALTHY]
        output = f"{request.param}-{name}.sqlite"
        done = module_bench.run(problems, solvers, "--timeout", f"{limit}s", "--memory", "1G", "-o", output)
        assert done.returncode == 0, done.stderr
        assert module_bench.living() == []
        stores[name] = Store(module_bench.folder / output)
    yield Run(chosen, problems, stores)
    for store in stores.values():
        store.close()


@pytest.mark.needs("cpbench_solvers")
def test_every_pair_has_its_row(run: Run) -> None:
    table = run.table()
    assert len(table) == len(run.problems) * (len(run.faults) + len(run.stores) * len(HEALTHY))
    assert not (table.status == "not_run").any()


@pytest.mark.needs("cpbench_solvers")
def test_each_fault_is_what_it_is_called(run: Run) -> None:
    wrong: dict[str, Any] = {}
    for fault in run.faults:
        status, signal, told = EXPECTED[fault]
        for row in run.rows(fault).itertuples():
            said = None if pd.isna(row.signal) else int(row.signal)
            if (row.status, said) != (status, signal) or told not in row.message or len(row.message) >= 3000:
                wrong[fault] = (row.status, said, row.message[:300])
    assert wrong == {}


@pytest.mark.needs("cpbench_solvers")
def test_each_has_its_flag(run: Run) -> None:
    found = {fault: set(",".join(run.rows(fault)["flags"]).split(",")) for fault in FLAGS if fault in run.faults}
    assert len(found) > 3
    assert {fault: flags for fault, flags in found.items() if FLAGS[fault] not in flags} == {}


@pytest.mark.needs("cpbench_solvers")
def test_killed_within_half_a_second(run: Run, module_bench) -> None:
    table = run.table()
    late = table[table.status == "timeout"]
    assert (late.solve <= LIMIT).all()
    assert set(late.solver) == {f"faulty-{name}" for name in run.faults if EXPECTED[name][0] == "timeout"}
    taken = late.wall - late.load
    assert (taken <= LIMIT + module_bench.grace).all(), dict(zip(late.solver, taken, strict=True))
    others = table[table.status != "timeout"]
    assert (others.wall < AMPLE).all(), "no other fault waits for the limit, whatever it holds open"


@pytest.mark.needs("cpbench_solvers")
def test_a_repeat_that_fails_costs_no_answer(run: Run) -> None:
    """The row is the first answer's, with its times; the next problem meets a fresh worker."""
    for fault in (name for name in run.faults if name.startswith("then-")):
        rows = run.rows(fault)
        assert list(rows.repeats) == [1] * len(run.problems), fault
        assert (rows.solve < (LIMIT if fault in HANGS else AMPLE)).all(), fault


@pytest.mark.needs("cpbench_solvers")
def test_answers_are_kept_with_their_rows(run: Run) -> None:
    table = run.table().set_index("key")
    kept = {key: unpack_answer(blob) for store in run.stores.values() for key, blob in store.answers()}
    answered = table[table.status.isin(["solved", "wrong", "inaccurate"]) & (table.solver != "faulty-nothing")]
    assert set(kept) == set(answered.index)
    for key, row in answered.iterrows():
        assert kept[key].size == json.loads(row["sizes"])["n"]
    lies = table[table.solver == "faulty-liar"].index
    assert all(not kept[key].any() for key in lies)


@pytest.mark.needs("cpbench_solvers")
def test_claims_and_verdicts_are_apart(run: Run) -> None:
    table = run.table()
    lies = table[(table.claim == "solved") & (table.status != "solved")]
    liars = {"nan", "inf", "liar", "alias", "short", "nothing"}
    assert set(lies.solver) == {f"faulty-{name}" for name in liars.intersection(run.faults)}


@pytest.mark.needs("cpbench_solvers")
def test_the_others_are_as_in_a_run_without_faults(run: Run, module_bench) -> None:
    for name, store in run.stores.items():
        table = store.table()
        if name == "hangs" and run.faults == FEW:
            continue
        output = f"alone-{len(run.faults)}-{name}.sqlite"
        limits = ("--timeout", f"{LIMITS[name]}s", "--memory", "1G", "-o", output)
        alone = module_bench.run(sorted(set(table.address)), HEALTHY, *limits)
        assert alone.returncode == 0, alone.stderr
        with Store(module_bench.folder / output) as other:
            expected_table, expected = other.table(), dict(other.answers())
        mixed = table[table.solver.isin(HEALTHY)]
        both = [rows[SAME].reset_index(drop=True) for rows in (mixed, expected_table)]
        for rows in both:  # of a first solve that was interrupted: its time, not the solver, makes this flag
            rows["flags"] = [",".join(set(flags.split(",")) - {"remembered"}) for flags in rows["flags"]]
        pd.testing.assert_frame_equal(*both, check_dtype=False)
        answers = dict(store.answers())
        assert {key: answers[key] for key in expected} == expected


@pytest.mark.nightly
def test_a_flood_leaves_nothing_on_the_disk(bench) -> None:
    """300 MiB are printed before an abort: both ends are in the row, and no file grows meanwhile."""
    running = subprocess.Popen(
        bench.command([bench.problem("p", 3)], ["faulty-flood"], "--timeout", "60s"),
        cwd=bench.folder,
        env={**os.environ, "TMPDIR": str(bench.folder)},
        stdout=subprocess.DEVNULL,
    )
    largest = 0
    while running.poll() is None:
        for folder, _, files in os.walk(bench.folder):
            for name in files:
                with contextlib.suppress(FileNotFoundError):
                    largest = max(largest, os.stat(os.path.join(folder, name)).st_size)
    assert running.returncode == 0
    assert 0 < largest < 2**22
    row = bench.store().table().iloc[0]
    assert "first words" in row.message
    assert "last words" in row.message
    assert len(row.message) < 2000


@pytest.mark.nightly
def test_modules_of_the_folder_are_not_taken_for_others(bench) -> None:
    """A `numpy.py` where the run is started is the user's affair, and nobody's import."""
    for name in ("numpy", "json", "cpbench"):
        (bench.folder / f"{name}.py").write_text("raise RuntimeError('the wrong module')\n")
    problem = bench.problem("p", 3)
    script = str(Path(sys.executable).with_name("cpbench"))
    command = [script, "run", problem, "-s", "lemke", "--no-report", "-q", "-o", "r.sqlite"]
    done = subprocess.run(command, cwd=bench.folder, capture_output=True, text=True, timeout=600)
    assert (done.returncode, done.stderr) == (0, "")
    assert list(bench.store().table().status) == ["solved"]
