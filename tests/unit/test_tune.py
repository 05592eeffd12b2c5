"""`cpbench tune`: where it searches, what it finds, what it writes, and what a run makes of that."""

from __future__ import annotations

import contextlib
import itertools
import re
import signal
import subprocess
import sys
import time
from collections.abc import Generator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cpbench import storage
from cpbench.advice.tuning import record
from cpbench.advice.tuning.search import Search, SearchResult, rungs
from cpbench.advice.tuning.space import space
from cpbench.bench.block import Block
from cpbench.bench.events import EventHandler
from cpbench.bench.messages import Surveyed
from cpbench.bench.planning import plan_file
from cpbench.bench.planning.plan import Entry, Limits, Pair, exact
from cpbench.bench.planning.selection import split_of
from cpbench.bench.planning.tunings import Tuning, require_unseen
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store
from cpbench.cli import main
from cpbench.errors import CpbenchError
from cpbench.formulations import LCP


def cpbench(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """Exit code of the command line, run in this process."""
    monkeypatch.setattr(sys, "argv", ["cpbench", *map(str, arguments)])
    try:
        main()
    except SystemExit as leave:
        return int(leave.code or 0)
    return 0


# ----------------------------------------------------------------------------------------------- where


def labels(text: str, seed: int, count: int) -> list[str]:
    return [entry.label for entry in itertools.islice(space(text).configurations(seed), count)]


def test_the_seed_alone_decides_what_is_tried() -> None:
    first = labels("nsgs", 3, 40)
    assert first == labels("nsgs", 3, 40)
    assert first[0] == "nsgs", "the default is the first"
    assert len(set(first)) == 40
    assert first[1:] != labels("nsgs", 4, 40)[1:]


def test_brackets_fix_an_option_or_say_what_to_choose_from() -> None:
    here = space("nsgs-rfc[shuffle=true,omega=0.8:1.2:0.2]")
    assert here.entry == Entry("nsgs-rfc", {"shuffle": True})
    assert here.domains["omega"].choices == (0.8, 1.0, 1.2)
    assert here.size == 3
    every = list(here.configurations(0))
    assert len(every) == 4, "the default and three"
    assert all(entry.options["shuffle"] for entry in every)


@pytest.mark.parametrize(("text", "word"), [("apgd", "nothing to search"), ("newton-*", "one at a time"), ("x", "x")])
def test_what_cannot_be_tuned(text: str, word: str) -> None:
    with pytest.raises(CpbenchError, match=word):
        space(text)


# ----------------------------------------------------------------------------------------------- how


def planned(count: int) -> list[Pair]:
    pair = Pair("a.h5", "a", "", "lcp", "", {}, exact(), Entry("psor"), "lcp", 1e-6, Limits(seconds=2.0))
    return [Pair(**{**vars(pair), "address": f"{i}.h5", "fingerprint": f"f{i}"}) for i in range(count)]


class Formula:
    """An executor for which ω = 1.7 is best: how long a solve takes is a formula, a pair takes `each` seconds."""

    reference = None
    machines: Mapping[str, Mapping[str, Any]] = {}

    def __init__(self, each: float = 0.0, stop_after: int = 10**9) -> None:
        self.solved: list[tuple[str, str]] = []
        self._each, self._stop_after = each, stop_after

    def outcomes(self, todo: Sequence[Block], on_event: EventHandler) -> Generator[tuple[Pair, Outcome]]:
        for pair in (pair for block in todo for pair in block.pairs):
            if len(self.solved) == self._stop_after:
                raise KeyboardInterrupt
            time.sleep(self._each)
            self.solved.append((pair.fingerprint, pair.entry.label))
            took = 0.01 + abs(pair.entry.options.get("omega", 1.3) - 1.7)
            yield pair, Outcome(status="solved" if took < 0.5 else "max_iter", solve=took, host="here")


def searched(executor: Formula, problems: int = 9, budget: float = 60.0, configurations: int = 82) -> SearchResult:
    entries = itertools.islice(space("psor").configurations(0), configurations)
    search = Search(planned(problems), entries, budget)
    with contextlib.suppress(KeyboardInterrupt):
        search.run(executor)
    return search.found


def test_the_best_of_all_is_found_with_a_share_of_the_solves() -> None:
    executor = Formula()
    found = searched(executor, 27)
    best = min(
        itertools.islice(space("psor").configurations(0), 82),
        key=lambda entry: abs(entry.options.get("omega", 1.3) - 1.7),
    )
    assert found.entry == best
    assert (found.score.unsolved, found.score.problems) == (0, 27)
    assert found.whole
    assert found.final
    assert found.configurations == 82
    assert found.solves == len(executor.solved) < 0.35 * 82 * 27
    assert found.problems == tuple(sorted(f"f{i}" for i in range(27)))


def test_rungs_are_the_same_problems_for_all() -> None:
    executor = Formula()
    searched(executor, 9, configurations=10)
    tried: dict[str, list[str]] = {}
    for problem, label in executor.solved:
        tried.setdefault(label, []).append(problem)
    assert rungs(9) == [3, 9]
    sizes = sorted(len(set(problems)) for problems in tried.values())
    assert sizes == [3, 3, 3, 3, 3, 3, 9, 9, 9, 9]
    least = {frozenset(problems) for problems in tried.values() if len(problems) == 3}
    assert len(least) == 1


class Clock:
    """Goes on while somebody sleeps, and only then: how fast this machine is does not matter."""

    def __init__(self) -> None:
        self._now = 0.0

    def monotonic(self) -> float:
        return self._now

    def sleep(self, seconds: float) -> None:
        self._now += seconds


def test_the_budget_ends_the_search_with_the_final_in_it(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    monkeypatch.setattr("cpbench.advice.tuning.search.time", clock)
    monkeypatch.setitem(globals(), "time", clock)
    found = searched(Formula(0.005), budget=1.5, configurations=10**6)
    assert clock.monotonic() < 1.6
    assert found.final
    assert found.score < found.default


def test_what_is_cut_short_is_compared_on_what_both_have_run() -> None:
    found = searched(Formula(stop_after=14))
    assert not found.final
    assert not found.whole
    assert 0 < found.score.problems < 9
    assert found.score <= found.default


def test_no_solve_at_all_is_no_result() -> None:
    with pytest.raises(CpbenchError, match="give it more"):
        searched(Formula(stop_after=0))


def test_a_tie_is_the_defaults() -> None:
    entries = iter([Entry("psor"), Entry("psor", {"omega": 1.3})])
    search = Search(planned(3), entries, 60.0)
    search.run(Formula())
    assert search.found.entry == Entry("psor")


# ----------------------------------------------------------------------------------------------- what is written


@pytest.fixture(scope="module")
def obstacles(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Strings over obstacles, on which SOR needs ω ≈ 2/(1 + sin(π/(n+1))) (Young 1954): 1.85 to 1.89 here."""
    folder = tmp_path_factory.mktemp("obstacles")
    for n in range(40, 52):
        M = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
        storage.save(LCP(M=M, q=-np.ones(n), name=f"string-{n}"), folder / f"string-{n}.h5")
    return folder


def fingerprints(folder: Path) -> dict[str, str]:
    return {path.stem: storage.load(path).fingerprint for path in sorted(folder.glob("*.h5"))}


@pytest.mark.nightly
def test_a_tuned_plan_runs_on_the_other_half_and_is_marked(obstacles: Path, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    told = ["tune", "psor[max_iterations=300]", obstacles, "--budget", "20s", "--configurations", 12, "-o", "t.toml"]
    assert cpbench(monkeypatch, *told, "-q") == 0
    assert cpbench(monkeypatch, *told) == 2, "it is there"
    file = plan_file.read("t.toml")
    (made,) = file.tunings
    assert made.configurations == 12
    halves = {name: split_of(fingerprint) for name, fingerprint in fingerprints(obstacles).items()}
    dev = [fingerprint for name, fingerprint in fingerprints(obstacles).items() if halves[name] == "dev"]
    assert 0 < len(dev) < 12
    assert sorted(made.problems) == sorted(dev)
    assert made.found.startswith(f"{len(dev)} of {len(dev)} solved")
    assert made.default.startswith(f"0 of {len(dev)} solved"), "300 sweeps are too few with the default ω"

    assert cpbench(monkeypatch, "run", "--plan", "t.toml", "-q", "--report", "rep") == 0
    with Store("t.sqlite") as store:
        rows, sheets = list(store.rows()), store.meta()["solvers"]
    assert {row.problem for row in rows} == {name for name, half in halves.items() if half == "test"}
    statuses = {label: {r.status for r in rows if r.label == label} for label in sheets}
    assert statuses == {made.label: {"solved"}, "psor[max_iterations=300]": {"max_iter"}}
    assert sheets[made.label]["tuned"]["solves"] == made.solves
    assert sheets["psor[max_iterations=300]"]["tuned"] is None
    report = Path("rep/report.md").read_text()
    assert f"`{made.label}` (tuned)" in report
    assert "## Tuned solvers (1)" in report
    assert f"0 of {12 - len(dev)} |" in report


def test_the_test_split_refuses_what_was_seen(obstacles: Path, tmp_path: Path, monkeypatch: Any, capsys: Any) -> None:
    monkeypatch.chdir(tmp_path)
    here = fingerprints(obstacles)
    seen = [name for name, fingerprint in here.items() if split_of(fingerprint) == "test"][:2]
    Path("t.toml").write_text(
        f'problems = ["{obstacles}"]\nsolvers = ["psor[omega=1.85]"]\n\n[[tuning]]\nsolver = "psor[omega=1.85]"\n'
        f"problems = {[here[name] for name in seen]}\n".replace("'", '"')
    )
    assert cpbench(monkeypatch, "run", "--plan", "t.toml", "--split", "test", "--dry-run", "-q") == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert all(name in said for name in seen)
    assert cpbench(monkeypatch, "run", "--plan", "t.toml", "--split", "all", "--dry-run", "-q") == 0
    others = [obstacles / f"{name}.h5" for name, f in here.items() if split_of(f) == "test" and name not in seen]
    assert cpbench(monkeypatch, "run", *others, "--plan", "t.toml", "--split", "test", "--dry-run", "-q") == 0


def test_dev_problems_alone_are_refused_by_name(obstacles: Path, tmp_path: Path, monkeypatch: Any, capsys: Any) -> None:
    monkeypatch.chdir(tmp_path)
    name, fingerprint = next((n, f) for n, f in fingerprints(obstacles).items() if split_of(f) == "dev")
    Path("t.toml").write_text(
        f'problems = ["{obstacles / name}.h5"]\nsolvers = ["psor"]\nsplit = "test"\n[[tuning]]\nsolver = "psor"\n'
        f'problems = ["{fingerprint}"]\n'
    )
    assert cpbench(monkeypatch, "run", "--plan", "t.toml", "-q") == 2
    assert f"psor was tuned on {name}" in capsys.readouterr().err


def test_another_solver_may_run_on_what_this_one_has_seen() -> None:
    seen = [Surveyed("p.h5", None, "p", "f", "lcp", "", {}, {}, {})]
    tuned = [Tuning("psor[omega=1.5]", problems=("f",))]
    require_unseen(tuned, [Entry("psor")], seen, "test")
    require_unseen(tuned, [Entry("psor", {"omega": 1.5})], seen, "dev")
    with pytest.raises(CpbenchError, match="tuned on p"):
        require_unseen(tuned, [Entry("psor", {"omega": 1.5})], seen, "test")


def test_halves_are_halves_and_stay() -> None:
    assert [split_of(text) for text in ("a", "b", "c", "d")] == [split_of(text) for text in ("a", "b", "c", "d")]
    share = sum(split_of(f"problem {i}") == "test" for i in range(2000)) / 2000
    assert share == pytest.approx(0.5, abs=0.04)


@pytest.mark.parametrize(
    ("table", "word"),
    [
        ("[[tuning]]\nsolver = 'psor'\nsed = 1", "unknown key"),
        ("[[tuning]]\nseed = 1", "names no solver"),
        ("[[tuning]]\nsolver = 'psor[omega=1|2]'", "several solvers"),
        ("[[tuning]]\nsolver = 'psor'\nproblems = 'f'", "expected"),
        ("[tuning]\nsolver = 'psor'", "not a list of tables"),
    ],
)
def test_a_mistake_in_a_tuning_is_one_line(tmp_path: Path, table: str, word: str) -> None:
    path = tmp_path / "t.toml"
    path.write_text(table)
    with pytest.raises(plan_file.PlanError) as refusal:
        plan_file.read(path)
    assert word in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_what_is_written_is_read_the_same(tmp_path: Path) -> None:
    made = Tuning("psor[omega=1.5]", "m", 'a "score"', "f", "d", 3, 60.0, 59.5, 7, 90, "dev", ("f1", "f2"))
    default = Entry("psor")
    text = record.plan_text(made, default, _part(tmp_path), 1, tmp_path)
    (tmp_path / "t.toml").write_text(text)
    file = plan_file.read(tmp_path / "t.toml")
    assert file.tunings == (made,)
    assert file.top["solvers"] == ("psor", "psor[omega=1.5]")
    assert file.top["split"] == "test"
    assert file.top["problems"] == (str(tmp_path / "p"), "builtin/lcp")
    assert file.top["where"] == "n > 3 and family != 'x'"


def _part(folder: Path) -> Any:
    from cpbench.bench.planning.run_plan import ProblemSet

    where = "n > 3 and family != 'x'"
    return ProblemSet(problems=(str(folder / "p"), "builtin/lcp"), split="dev", where=where, family=("x*",))


def test_a_plan_that_cannot_be_written_is_told_before_the_search(monkeypatch: Any, tmp_path: Path, capsys: Any) -> None:
    begun = time.monotonic()
    assert cpbench(monkeypatch, "tune", "psor", "--budget", "2m", "-o", tmp_path / "nowhere" / "t.toml") == 2
    assert time.monotonic() - begun < 110.0
    assert "there is no folder" in capsys.readouterr().err


@pytest.mark.nightly
def test_ctrl_c_keeps_the_best_so_far(obstacles: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cpbench", "tune", "psor", str(obstacles), "--budget", "2m", "-o", "t.toml"]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stderr is not None
    assert "problems" in process.stderr.readline(), "the search begins"
    assert re.match(r"\d+ s: ", process.stderr.readline()), "it has a best so far"
    process.send_signal(signal.SIGINT)
    told, said = process.communicate(timeout=600)
    assert process.returncode == 130
    assert "interrupted" in said
    assert "not side by side" in told
    (made,) = plan_file.read(tmp_path / "t.toml").tunings
    assert made.spent < 110.0
