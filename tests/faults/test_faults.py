"""The fault table: every fault has its row, in time, and the solvers beside it are unharmed."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess

import pandas as pd
import pytest

from cpbench.bench.results import answers
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
    "counters": ("solved", None, "the counter iterations is no integer: 2.5"),
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


@pytest.fixture(scope="module")
def results(module_bench) -> dict[str, Store]:
    """The stores of two runs: those that only the clock ends, and all others."""
    problems = [module_bench.problem(f"p{n}", n) for n in (3, 8)]
    stores = {}
    for name, faults in {"hangs": HANGS, "others": [name for name in EXPECTED if name not in HANGS]}.items():
        solvers = [*(f"faulty-{fault}" for fault in faults), *HEALTHY]
        limits = ("--timeout", f"{LIMITS[name]}s", "--memory", "1G")
        done = module_bench.run(problems, solvers, *limits, "-o", f"{name}.sqlite")
        assert done.returncode == 0, done.stderr
        assert module_bench.living() == []
        stores[name] = Store(module_bench.folder / f"{name}.sqlite")
    return stores


def _table(results: dict[str, Store]) -> pd.DataFrame:
    return pd.concat([store.table() for store in results.values()])


def _rows(results: dict[str, Store], fault: str) -> pd.DataFrame:
    table = _table(results)
    return table[table.solver == f"faulty-{fault}"]


def test_every_pair_has_its_row(results: dict[str, Store]) -> None:
    table = _table(results)
    assert len(table) == 2 * (len(EXPECTED) + len(results) * len(HEALTHY))
    assert not (table.status == "not_run").any()


@pytest.mark.parametrize("fault", EXPECTED)
def test_fault(results: dict[str, Store], fault: str) -> None:
    rows = _rows(results, fault)
    status, signal, told = EXPECTED[fault]
    assert list(rows.status) == [status] * 2, list(rows.message)
    assert rows.message.str.contains(told, regex=False).all(), list(rows.message)
    assert (rows.message.str.len() < 3000).all()
    assert [None if pd.isna(s) else int(s) for s in rows.signal] == [signal] * 2


@pytest.mark.parametrize("fault", FLAGS)
def test_flag(results: dict[str, Store], fault: str) -> None:
    assert all(FLAGS[fault] in flags.split(",") for flags in _rows(results, fault)["flags"])


def test_killed_within_half_a_second(results: dict[str, Store], module_bench) -> None:
    table = _table(results)
    late = table[table.status == "timeout"]
    assert (late.solve <= LIMIT).all()
    assert set(late.solver) == {f"faulty-{name}" for name, (status, *_) in EXPECTED.items() if status == "timeout"}
    taken = late.wall - late.load
    assert (taken <= LIMIT + module_bench.grace).all(), dict(zip(late.solver, taken, strict=True))


def test_what_breaks_off_is_told_at_once(bench) -> None:
    """No fault but a hang waits for the limit, whatever it holds open.

    In a run of their own: whoever comes after `forkserver` waits until there is a new one.
    """
    faults = [f"faulty-{name}" for name in ("close", "junk", "giant", "half", "orphan", "parent")]
    problems = [bench.problem(f"p{n}", n) for n in (3, 8)]
    done = bench.run(problems, faults, "--timeout", "30s", "--memory", "1G")
    assert done.returncode == 0, done.stderr
    rows = bench.store().table()
    assert len(rows) == len(problems) * len(faults)
    late = rows[rows.wall >= 15.0]  # `close` takes half a second, all others less; the machine may be busy
    assert late.empty, dict(zip(late.solver, late.wall, strict=True))


@pytest.mark.parametrize("fault", ["abort", "hang", "eat", "raise"])
def test_a_repeat_that_fails_costs_no_answer(results: dict[str, Store], fault: str) -> None:
    """The row is the first answer's, with its times; the next problem meets a fresh worker."""
    rows = _rows(results, f"then-{fault}")
    assert list(rows.repeats) == [1] * 2
    assert (rows.solve < (LIMIT if fault == "hang" else AMPLE)).all()


def test_answers_are_kept_with_their_rows(results: dict[str, Store]) -> None:
    table = _table(results).set_index("key")
    kept = {key: answers.unpack(blob) for store in results.values() for key, blob in store.answers()}
    answered = table[table.status.isin(["solved", "wrong", "inaccurate"]) & (table.solver != "faulty-nothing")]
    assert set(kept) == set(answered.index)
    for key, row in answered.iterrows():
        assert kept[key].size == json.loads(row["sizes"])["n"]
    lies = table[table.solver == "faulty-liar"].index
    assert all(not kept[key].any() for key in lies)


def test_claims_and_verdicts_are_apart(results: dict[str, Store]) -> None:
    table = _table(results)
    lies = table[(table.claim == "solved") & (table.status != "solved")]
    assert set(lies.solver) == {f"faulty-{name}" for name in ("nan", "inf", "liar", "alias", "short", "nothing")}


def test_the_others_are_as_in_a_run_without_faults(results: dict[str, Store], module_bench) -> None:
    addresses = sorted(set(_table(results).address))
    for name, store in results.items():
        limits = ("--timeout", f"{LIMITS[name]}s", "--memory", "1G", "-o", f"{name}-alone.sqlite")
        alone = module_bench.run(addresses, HEALTHY, *limits)
        assert alone.returncode == 0, alone.stderr
        other = Store(module_bench.folder / f"{name}-alone.sqlite")
        table = store.table()
        mixed = table[table.solver.isin(HEALTHY)]
        pd.testing.assert_frame_equal(mixed[SAME].reset_index(drop=True), other.table()[SAME], check_dtype=False)
        answers, expected = dict(store.answers()), dict(other.answers())
        assert {key: answers[key] for key in expected} == expected


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


def test_other_limits_do_not_mix(bench) -> None:
    path = bench.problem("p", 3)
    assert bench.run([path], ["lemke"]).returncode == 0
    other = bench.run([path], ["lemke"], "--timeout", "20s")
    assert other.returncode == 2
    assert "was made with timeout" in other.stderr
    assert other.stderr.count("\n") == 1
