"""The run of a pair whose problem is converted: its start, its worker's answer, repeats and verdict, stage by stage.

Some pairs of one solver may share a call (a stack). They are run as one pair is, and share its time in equal parts.
"""

from __future__ import annotations

import json
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import cpbench.bench.worker as worker_process
from cpbench.bench import messages
from cpbench.bench.judging import PROOF_SECONDS
from cpbench.bench.outcome import CLOCK, iqr, late, marks, reason, remembered, runners_time
from cpbench.bench.planning.plan import PREVIOUS, Pair
from cpbench.bench.processes.process import Child, Died, TimedOut, crowded
from cpbench.bench.referee import HISTORY_SECONDS
from cpbench.bench.results.rows import Outcome
from cpbench.bench.stacked import part_of
from cpbench.bench.time_limits import GRACE, LOAD, REFEREE, WARM_UP
from cpbench.bench.worker_pool import RefereeClient, Reply, Setting, WorkerPool, describe_exit, hear
from cpbench.errors import NotApplicable
from cpbench.formulations.base import Kind
from cpbench.foundation import frames
from cpbench.solvers.base import Trait, solvers
from cpbench.verification import MET_TOLERANCE, PROVEN

Before: TypeAlias = tuple[Pair, str, bytes | None]
"""The pair of the step before in a sequence: its status, and its kept answer."""
FELL_BACK = "cold: the step before was"
"""Beginning of `started` where a step had no answer to start from."""
FULL = 0.25
"""Share of the memory limit that a worker may keep after a solve; with more, the next solve gets a fresh worker."""


class RunStopped(Exception):
    """End of a run without an answer to be judged; `columns` of its row say why."""

    def __init__(self, status: str, message: str, **columns: Any) -> None:
        self.columns = {"status": status, "message": message, **columns}
        super().__init__(message)


@dataclass(frozen=True)
class Times:
    """Seconds of the first solve and of its repeats: of `setup`, of `solve`, and that passed meanwhile (`wall`).
    `lost` : why repeats or the history failed."""

    setup: Sequence[float]
    solve: Sequence[float]
    wall: Sequence[float]
    lost: str = ""

    @property
    def remembered(self) -> bool:
        """Whether the repeats are those of a cache."""
        return remembered(self.solve)

    def columns(self) -> dict[str, Any]:
        """Return the columns of a row."""
        return {
            "setup": statistics.median(self.setup),
            "solve": self.solve[0] if self.remembered else statistics.median(self.solve),
            "repeats": len(self.solve),
            "samples": json.dumps([float(f"{seconds:.6g}") for seconds in self.solve]),
            "solve_min": min(self.solve),
            "solve_iqr": iqr(self.solve),
        }


class PairRun:
    """One run of a pair, or of a stack of pairs.

    `row` has the columns that are known so far: a run that ends at any stage keeps those of the stages before.
    """

    def __init__(
        self,
        setting: Setting,
        workers: WorkerPool,
        referee: RefereeClient,
        pairs: Sequence[Pair],
        prepared: messages.Prepared,
        before: Before | None = None,
        *,
        stacked: bool = False,
    ) -> None:
        self.setting, self.workers, self.referee = setting, workers, referee
        self.pairs, self.pair, self.prepared, self.before = pairs, pairs[0], prepared, before
        self.count, self.stacked = len(pairs), stacked
        self.name, self.spec = self.pair.entry.solver, solvers.get(self.pair.entry.solver).spec
        self.recorded = self.pair.limits.history and Trait.HISTORY in self.spec.traits
        self.row = Outcome(
            route=prepared.route,
            kind=str(max(Kind(prepared.kind), self.spec.kind, key=lambda kind: kind.rank)),
            convert=prepared.convert,
            target_tolerance=prepared.tolerance,
            batch=self.count if stacked else None,
        )

    def outcomes(self) -> list[Outcome]:
        """Run all stages; return the outcome of every pair. Never raises, whatever a solver does."""
        try:
            start = self.find_start()
            worker = self.find_worker()
            result, waited = self.solve(worker, start)
            times = self.repeat(worker, result)
            trail, times = self.read_history(worker, times)
            self.drop_changed(result)
            flags = self.flags(result, times, waited)
            if CLOCK in flags:
                result, times = runners_time(result, waited), Times([0.0], [waited], [waited], times.lost)
            if not self.stacked:
                return [self.judge(self.pair, result, times, flags, trail)]
            return [self.judge(pair, *self.share(result, times, i), flags) for i, pair in enumerate(self.pairs)]
        except RunStopped as end:
            ended = replace(self.row, **end.columns)
        except Exception as noise:  # a worker may send anything, and fail in ways that are not known
            self.workers.drop(self.name)
            message = f"the worker sent no valid message: {type(noise).__name__}: {noise}"[:500]
            ended = replace(self.row, status="error", message=message)
        return [ended] * self.count

    def find_start(self) -> messages.Vectors:
        """Return the point to start from, empty for a cold start."""
        pair, before = self.pair, self.before
        vectors: messages.Vectors = {}
        if pair.start == "cold":
            started = "cold"
        else:
            if Trait.WARM_START not in self.spec.traits:
                message = f"{self.name} takes no starting point, and a cold start is not what was asked for"
                raise RunStopped("unsupported", message)
            if pair.start == PREVIOUS and pair.scene is None:
                message = "start previous: the problem is no step of a sequence (cpbench pack --sequence makes one)"
                raise RunStopped("unsupported", message)
            if pair.start == PREVIOUS and before is None:
                started = "cold: first step"
            elif pair.start == PREVIOUS and before is not None and _verified(before) is None:
                started = f"{FELL_BACK} {before[1]}"
            else:
                vectors, started = self._ask_for_start()
        self.row = replace(self.row, started=started)
        return vectors

    def _ask_for_start(self) -> tuple[messages.Vectors, str]:
        """Return the point that the referee makes for the solver, and its description."""
        pair, before, case, answer = self.pair, self.before, None, None
        if before is not None:
            case, answer = messages.RefereeCase.of(before[0]), _verified(before)
        vectors = {} if answer is None else {"answer": answer}
        asked = messages.FindStart(messages.RefereeCase.of(pair), pair.start, case, vectors)
        reply = self.referee.ask(REFEREE.limit(pair.limits.seconds), asked, messages.StartFound)
        if isinstance(reply, messages.StartFound):
            return reply.vectors, reply.description
        if isinstance(reply, messages.Declined) and reply.cause == NotApplicable.__name__:
            raise RunStopped("unsupported", reply.message)
        status = "memout" if isinstance(reply, messages.OutOfMemory) else "error"
        raise RunStopped(status, f"start: {reason(reply)}")

    def find_worker(self) -> Child:
        """Return a warm worker of the solver."""
        worker = self.workers.get(self.name, self.pair.limits.memory, self.pair.limits.seconds)
        if worker is None:
            why = self.workers.unavailable[self.name]
            raise RunStopped("unavailable", f"{why.state}: {why.message}")
        self.row = replace(self.row, version=self.workers.versions[self.name])
        return worker

    def solve(self, worker: Child, start: messages.Vectors) -> tuple[messages.Result, float]:
        """Return what the worker answers, and after how many seconds. Raises FrameError."""
        limits, whole = self.pair.limits, self.pair.limits.seconds * self.count
        loading = WARM_UP if self.stacked else LOAD  # the first call for a stack may have to compile
        asked = messages.Solve(
            path=self.prepared.path,
            tolerance=self.prepared.tolerance,
            seconds=limits.seconds,
            options=dict(self.pair.entry.options),
            repeats=limits.repeats,
            history=self.recorded,
            held=not self.stacked and self.workers.holds(self.name, self.prepared.path),
            checksum=self.prepared.checksum,
            stack=limits.threads if self.stacked else 0,
            vectors=start,
        )
        loaded = False
        try:
            worker.forget()  # what earlier solves printed is not this one's
            over = time.monotonic() + loading.limit(whole)
            worker.send(messages.pack(asked), loading.limit(whole))
            reply = messages.ProblemLoaded(messages.Seconds(0.0))
            if not asked.held:
                reply = hear(worker, over - time.monotonic())
            if isinstance(reply, messages.ProblemLoaded):
                self.row, loaded = replace(self.row, load=reply.load / self.count), True
                if not self.stacked:
                    self.workers.loaded(self.name, self.prepared.path)
                begun = time.perf_counter()  # a clock beside the worker's, which a solver could falsify
                reply = hear(worker, whole + GRACE)
                if isinstance(reply, messages.Result):
                    if reply.children > self.setting.processes:
                        raise Died(None, worker.output(), reason=crowded(self.setting.processes))
                    return reply, time.perf_counter() - begun
        except TimedOut:
            self.workers.drop(self.name)
            if loaded:
                calls = f", the limits of {self.count} problems in one call" if self.stacked else ""
                raise RunStopped("timeout", f"killed after {whole:g} s{calls}", solve=limits.seconds) from None
            raise RunStopped("error", f"loading: not over after {loading.limit(whole):g} s ({loading.what})") from None
        except Died as death:
            self.workers.drop(self.name)
            status = "memout" if death.out_of_memory else "crash"
            raise RunStopped(status, describe_exit(death), signal=death.signal, code=death.code) from None
        raise self._without_answer(reply)

    def _without_answer(self, reply: messages.Message) -> RunStopped:
        """Return the end of a run whose worker sent no answer, but why."""
        if isinstance(reply, messages.ProblemUnsupported):
            status = "unsupported"
        elif isinstance(reply, messages.SolverUnavailable):
            status = "unavailable"
        else:
            self.workers.drop(self.name)  # its state is not known: neither after an error, nor with its memory full
            if isinstance(reply, messages.OutOfMemory):
                return RunStopped("memout", f"over {self.pair.limits.memory} bytes")
            status = "error"
        return RunStopped(status, reason(reply)[: worker_process.WORDS])

    def repeat(self, worker: Child, result: messages.Result) -> Times:
        """Return the times of the first solve and its repeats.

        The first answer stands, with its own times, whatever happens to a repeat. It is judged after the repeats:
        a referee that works beside them would spoil their times.
        """
        first = Times([float(result.setup)], [float(result.solve)], [float(result.solve_wall or 0.0)])
        limits, more = self.pair.limits, self.pair.limits.repeats - 1
        if more < 1 or result.wrote or result.setup + result.solve >= worker_process.SHORT:
            return first
        begun = time.perf_counter()
        repeats, lost = self._next(worker, messages.Repeats, more * (limits.seconds + GRACE), "repeat")
        waited = time.perf_counter() - begun
        if repeats is None:
            return replace(first, lost=lost)
        if len(repeats.times) > more:
            self.workers.drop(self.name)
            return replace(first, lost=f"a repeat failed: {len(repeats.times)} repeats, {more} were asked for")
        shown = sum(setup + wall for setup, _, wall in repeats.times)
        # a request to another process may take long outside of any clock; a repeat may have to load the problem again
        if result.trip is None and late(waited, shown + more * (self.row.load or 0.0)):
            why = f"the repeats took {waited:.3g} s, of which the solver's process shows {shown:.3g} s"
            return replace(first, lost=f"a repeat failed: {why}")
        setup, solve, wall = ([seconds[k] for seconds in repeats.times] for k in range(3))
        return Times([*first.setup, *setup], [*first.solve, *solve], [*first.wall, *wall])

    def read_history(self, worker: Child, times: Times) -> tuple[messages.Recorded | None, Times]:
        """Return the iterates of the solve, where they were asked for."""
        if self.stacked or not self.recorded or times.lost:
            return None, times
        trail, lost = self._next(worker, messages.Recorded, self.pair.limits.seconds + GRACE, "history")
        return trail, replace(times, lost=lost)

    def _next(self, worker: Child, expected: type[Reply], patience: float, what: str) -> tuple[Reply | None, str]:
        """Return one more message of a worker that has answered, or why there is none: its answer stands either way."""
        try:
            reply = hear(worker, patience)
            if isinstance(reply, expected):
                return reply, ""
            full = isinstance(reply, messages.OutOfMemory)
            lost = f"over {self.pair.limits.memory} bytes" if full else reason(reply)
        except TimedOut:
            lost = f"killed after {patience:g} s"
        except Died as death:
            lost = describe_exit(death)
        except frames.FrameError as noise:
            lost = f"no valid message: {noise}"
        self.workers.drop(self.name)
        return None, f"a {what} failed: {lost}"

    def drop_changed(self, result: messages.Result) -> None:
        """Drop a worker in which a solve has left something behind: it must not count against the next."""
        limits = self.pair.limits
        grown = 0 < limits.memory * FULL < result.grown
        if result.children or result.wrote or result.threads > limits.threads or grown:
            self.workers.drop(self.name)

    def flags(self, result: messages.Result, times: Times, waited: float) -> list[str]:
        """Return the flags of the solve."""
        of_times = (("repeat", bool(times.lost)), ("remembered", times.remembered))
        return [*marks(result, waited, self.pair.limits.threads), *(flag for flag, holds in of_times if holds)]

    def share(self, result: messages.Result, times: Times, i: int) -> tuple[messages.Result, Times]:
        """Return the answer to problem i of a stack, with an equal part of the time.

        Raises ValueError, IndexError where the answer is not one to so many problems.
        """
        claim, answered, alone, vectors = part_of(result.vectors, self.count, i)
        own = replace(
            result,
            claim=str(claim),
            answered=answered,
            counters={"alone": int(alone)},
            solve=messages.Seconds(result.solve / self.count),
            cpu=messages.Seconds(result.cpu / self.count),
            peak=None,
            trip=None,
            vectors=vectors,
        )
        return own, replace(times, setup=[0.0], solve=[seconds / self.count for seconds in times.solve])

    def judge(
        self,
        pair: Pair,
        result: messages.Result,
        times: Times,
        flags: Sequence[str],
        trail: messages.Recorded | None = None,
    ) -> Outcome:
        """Return the outcome of a pair, with the verdict on its answer."""
        row = replace(
            self.row,
            claim=result.claim,
            counters=json.dumps(result.counters),
            cpu=result.cpu,
            peak=result.peak,
            reported=result.reported,
            **times.columns(),
        )
        if result.trip is not None:
            row = replace(row, trip=result.trip, solve_wall=statistics.median(times.wall))
        case, seconds = messages.RefereeCase.of(pair), REFEREE.limit(pair.limits.seconds)
        asked = messages.Judge(
            case,
            claim=result.claim,
            answered=result.answered,
            promise=str(self.spec.kind),
            proof_seconds=min(pair.limits.seconds / 2, PROOF_SECONDS),
            vectors=result.vectors,
        )
        judged = self.referee.ask(seconds, asked, messages.Judged)
        if isinstance(judged, messages.Failure):
            message = _joined(f"the answer could not be judged: {reason(judged)}", times.lost)
            return replace(row, flags=",".join(flags), status="error", message=message)
        status, message = judged.status, _joined(judged.message, result.message, times.lost)
        # within the grace of a process, but beyond the limit of the solve
        if result.setup + result.solve > pair.limits.seconds:
            status, message = "timeout", f"answered after the limit of {pair.limits.seconds:g} s"
        return replace(
            row,
            status=status,
            message=message,
            error=judged.error,
            target_error=judged.target_error,
            flags=",".join([*judged.flags, *flags]),
            parts=json.dumps(judged.parts),
            lift=judged.lift,
            verify=judged.verify,
            answer=judged.vectors.get("answer"),
            history=None if trail is None else self._judge_history(case, trail, seconds),
            proof=judged.vectors.get("proof") if status in PROVEN else None,
        )

    def _judge_history(self, case: messages.RefereeCase, trail: messages.Recorded, seconds: float) -> bytes | None:
        """Return the iterates with their errors; None where they could not be judged."""
        asked = messages.JudgeHistory(case, HISTORY_SECONDS, **vars(trail))
        reply = self.referee.ask(seconds, asked, messages.HistoryJudged)
        return reply.vectors.get("history") if isinstance(reply, messages.HistoryJudged) else None


def _verified(before: Before) -> bytes | None:
    """Return the answer to the step before, where it met the tolerance."""
    _, status, answer = before
    return answer if status in MET_TOLERANCE else None


def _joined(*messages: str) -> str:
    return "; ".join(filter(None, messages))
