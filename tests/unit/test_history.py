"""Histories: what is kept of a solve, and how it is judged."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import planted
import pytest

from cpbench import graph, storage
from cpbench.bench import history as histories
from cpbench.bench.history import History, IterateRecorder, coarse_to_fine, recorded
from cpbench.bench.messages import JudgeHistory, Recorded, RefereeCase
from cpbench.bench.planning import plan
from cpbench.bench.referee import Referee
from cpbench.bench.slot import Slot
from cpbench.errors import PointError
from cpbench.formulations import LCP, LCPPoint
from cpbench.solvers.base import Budget, Claim, Solver, SolverOutput, SolverSpec, solvers
from cpbench.verification import judge

LEEWAY = 100.0
"""The backward error and a solver's own measure of a well-scaled problem are at most so far apart."""


def _time_to(history: History, tolerance: float) -> float:
    good = np.flatnonzero(history.error <= tolerance)
    return float(history.time[good[0]]) if good.size else math.inf


class Clock:
    """Seconds that pass only when they are told to."""

    def __init__(self) -> None:
        self.now = 0.0

    def perf_counter(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(histories, "time", clock)
    return clock


def _point(value: float) -> LCPPoint:
    return LCPPoint(z=np.array([value]))


def _finish(
    recorder: IterateRecorder, iterations: int = 0, claim: Claim = Claim.MAX_ITER
) -> tuple[Recorded, dict[str, Any]]:
    output = SolverOutput(claim=claim, point=_point(-1.0), counters={"iterations": iterations})
    found = recorder.finish(output)
    return found, dict(found.vectors)


# ---------------------------------------------------------------------------------------------------- recording


@pytest.mark.parametrize("step", [1e-6, 1e-3, 1.0])
def test_the_kept_iterates_lie_apart_by_a_factor(clock: Clock, step: float) -> None:
    """100,000 iterations at a steady pace: few are kept, no gap is wide, each is the iterate of its time."""
    recorder = IterateRecorder()
    for k in range(100_000):
        clock.now += step
        recorder(k, 1.0 / (k + 1), lambda k=k: _point(float(k)))
    clock.now += step
    header, found = _finish(recorder, 100_000)
    time = found["time"]
    assert 40 <= header.count == time.size <= 65
    assert header.calls == 100_000
    late = time > 10 * max(step, histories.FINEST)  # before, steps and the finest time are too long for a factor
    assert (time[1:] / time[:-1])[late[1:]].max() < 1.5
    np.testing.assert_allclose(found["iteration"][:-1], np.round(time[:-1] / step) - 1)
    np.testing.assert_array_equal(found["iterates"][:-1], found["iteration"][:-1])
    np.testing.assert_allclose(found["residual"][:-1], 1.0 / (found["iteration"][:-1] + 1))


def test_the_clock_stands_while_an_iterate_is_kept(clock: Clock) -> None:
    def slow() -> LCPPoint:
        clock.now += 5.0
        return _point(0.0)

    recorder = IterateRecorder()
    for k in range(10):
        clock.now += 1.0
        recorder(k, 1.0, slow)
    clock.now += 1.0
    header, found = _finish(recorder)
    np.testing.assert_allclose(found["time"], np.arange(1.0, 12.0))
    assert header.solve == pytest.approx(11.0)
    assert header.cost == pytest.approx(50.0)


def test_a_solve_that_ended_earlier_would_have_had_to_conclude_too(clock: Clock) -> None:
    times = {}
    for claim in (Claim.SOLVED, Claim.FAILED):
        clock.now = 0.0
        recorder = IterateRecorder()
        for k in range(3):
            recorder(k, 1.0, lambda: _point(0.0))
            clock.now += 1.0
        clock.now += 0.5
        times[claim] = _finish(recorder, claim=claim)[1]["time"].tolist()
    assert times[Claim.SOLVED] == [1.5, 2.5, 3.5, 3.5]
    assert times[Claim.FAILED] == [0.0, 1.0, 2.0, 3.5]  # what it did in the end is not known


# ------------------------------------------------------------------------------------------------------ judging


class Scene:
    """A problem in a file, and a referee who judges histories of it at a node."""

    def __init__(self, folder: Path, problem: Any, node: str) -> None:
        self.problem = problem
        path = folder / f"{problem.fingerprint}.h5"
        storage.save(problem, path)
        self.referee = Referee(folder)
        self.case = RefereeCase(str(path), None, problem.fingerprint, node, plan.exact(), 1e-10)

    def judged(self, found: Recorded, seconds: float = 30.0) -> History:
        reply = self.referee.judge_history(JudgeHistory(**vars(found), case=self.case, seconds=seconds))
        return History.unpack(reply.vectors["history"])


@pytest.fixture
def scene(tmp_path: Path) -> Callable[[Any, str], Scene]:
    return lambda problem, node: Scene(tmp_path, problem, node)


@pytest.mark.needs("cpbench_solvers")
def test_errors_are_those_of_the_iterates(scene: Any, rng: np.random.Generator) -> None:
    """PGS on a planted LCP, its iterates judged here one by one."""
    problem, _ = planted.lcp(rng, 30, "positive definite")
    budget, seen = Budget(tolerance=1e-10), list[Any]()
    output = solvers.get("pgs").run(problem, budget, record=lambda k, e, point: seen.append((k, e, point())))
    history = scene(problem, "lcp").judged(
        recorded(solvers.get("pgs"), problem, budget, solvers.get("pgs").spec.options(), None)
    )
    errors = [judge(problem, point, 1e-10).error for *_, point in seen]
    own = [problem.residuals(point, 1e-10).error for *_, point in seen]
    assert output.claim is Claim.SOLVED
    assert history.iteration[:-1].tolist() == [k for k, *_ in seen]
    np.testing.assert_array_equal(history.error[:-1], errors)
    np.testing.assert_allclose(history.residual[:-1], own, rtol=1e-6, atol=1e-15)
    assert history.residual[-2] <= 1e-10
    assert history.error[-1] == history.error[-2] <= LEEWAY * 1e-10


@pytest.mark.needs("cpbench_solvers")
def test_errors_are_of_the_problem_that_was_asked(scene: Any, rng: np.random.Generator) -> None:
    """A mixed LCP solved as an LCP: the errors are those of the lifted iterates."""
    problem, _ = planted.mlcp(rng, 4, 20, "positive definite")
    at = scene(problem, "lcp")
    converted = graph.arrive(problem, "lcp").problem
    message = recorded(solvers.get("pgs"), converted, Budget(tolerance=1e-10), solvers.get("pgs").spec.options(), None)
    history = at.judged(message)
    for x, error in zip(message.vectors["iterates"].reshape(history.error.size, -1), history.error, strict=True):
        assert error == judge(problem, graph.lift(converted, converted.point_from_vector(x)), 1e-10).error
    assert history.error[0] > 1e-3
    assert _time_to(history, 1e-8) < math.inf


class Liar(Solver):
    """Tells residual 0 of iterates that solve nothing."""

    spec = SolverSpec(name="liar", node="lcp", summary="", method="")

    def solve(self, prepared: Any, budget: Any, options: Any, start: Any = None, record: Any = None) -> SolverOutput:
        for k in range(5):
            record(k, 0.0, lambda k=k: LCPPoint(z=np.full(prepared.q.size, float(k))))
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=np.full(prepared.q.size, math.nan)))


def test_a_liar_gets_its_true_errors(scene: Any) -> None:
    """M = 1, q = -2: z = 2 is the solution, and of the iterates 0, 1, 2, 3, 4 only the third is one.

    The error is |z w| over max(|q z|, z²/2), w = z - 2: 1/2 at 1 and at 3, 1 at 4; at 0 the row is missed by all of q.
    """
    problem = LCP(M=np.eye(1), q=np.array([-2.0]))
    history = scene(problem, "lcp").judged(recorded(Liar(), problem, Budget(), None, None))
    assert history.residual[:-1].tolist() == [0.0] * 5
    np.testing.assert_allclose(history.error[:5], [1.0, 1 / 2, 0.0, 1 / 2, 1.0])
    assert history.error[5] == math.inf
    assert _time_to(history, 1e-10) == history.time[2]
    wrong = LCP(M=np.eye(1), q=np.array([-2.5]))
    history = scene(wrong, "lcp").judged(recorded(Liar(), wrong, Budget(), None, None))
    assert _time_to(history, 1e-2) == math.inf


def test_messages_that_do_not_hold_together_are_refused(scene: Any) -> None:
    problem = LCP(M=np.eye(2), q=-np.ones(2))
    at = scene(problem, "lcp")
    fine = {"time": [0.0, 1.0], "iteration": [0.0, 1.0], "residual": [1.0, 0.0], "iterates": np.ones(4)}
    assert at.judged(Recorded(2, 1.0, 0.0, 2, fine)).error.tolist() == [0.0, 0.0]
    for wrong in (
        {"iterates": np.ones(5)},
        {"iterates": np.ones(2)},
        {"time": [1.0, 0.0]},
        {"time": [0.0, math.nan]},
        {"time": [-1.0, 0.0]},
        {"residual": [1.0]},
    ):
        with pytest.raises(PointError, match="recorded iterates"):
            at.judged(Recorded(2, 1.0, 0.0, 2, {**fine, **wrong}))
    for missing in fine:
        with pytest.raises(PointError, match="recorded iterates"):
            at.judged(Recorded(2, 1.0, 0.0, 2, {k: v for k, v in fine.items() if k != missing}))


@pytest.mark.needs("cpbench_solvers")
def test_judging_ends_in_time_with_the_answer_first(scene: Any, rng: np.random.Generator) -> None:
    problem, _ = planted.lcp(rng, 10, "positive definite")
    message = recorded(solvers.get("pgs"), problem, Budget(tolerance=1e-10), solvers.get("pgs").spec.options(), None)
    at = scene(problem, "lcp")
    whole, cut = at.judged(message), at.judged(message, seconds=-1.0)
    assert cut.error.tolist() == [whole.error[-1]]


@pytest.mark.parametrize("count", [0, 1, 2, 3, 64, 65])
def test_cut_anywhere_the_judged_iterates_are_spread(count: int) -> None:
    order = coarse_to_fine(count)
    assert sorted(order) == list(range(count))
    for done in range(2, count):
        gaps = np.diff(sorted(order[:done]))
        assert gaps.max() <= 2 * gaps.min() + 2


# ------------------------------------------------------------------------------------------- storage


@pytest.mark.needs("cpbench_solvers")
def test_a_lane_returns_the_history_of_a_solver_that_records(tmp_path: Path, rng: np.random.Generator) -> None:
    problem, _ = planted.lcp(rng, 20, "positive definite")
    path = tmp_path / "p.h5"
    storage.save(problem, path)
    limits = plan.Limits(seconds=20.0, repeats=2, history=True)
    with Slot() as slot:
        survey = slot.survey(str(path), [plan.exact()])
        entries = [plan.Entry("pgs"), plan.Entry("lemke")]
        outcomes = {
            pair.entry.solver: slot.run(pair, slot.prepare(pair))
            for pair in plan.pairs([survey], entries, [plan.exact()], 1e-10, limits, relaxations=False)
        }
    assert {solver: outcome.status for solver, outcome in outcomes.items()} == {
        "pgs": "solved",
        "lemke": "solved",
    }
    assert outcomes["lemke"].history is None
    assert outcomes["pgs"].history is not None
    history = History.unpack(outcomes["pgs"].history)
    assert history.error[-1] == outcomes["pgs"].error
    assert 0.0 < _time_to(history, 1e-3) <= _time_to(history, 1e-10) <= history.solve
