"""The run of a pair whose problem is converted: its start, its worker's call and its verdict, stage by stage."""

from __future__ import annotations

import json
import statistics
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

from cpbench.bench import messages
from cpbench.bench.judging import PROOF_SECONDS
from cpbench.bench.outcome import CLOCK, marks, reason, runners_time
from cpbench.bench.planning.plan import PREVIOUS, Pair
from cpbench.bench.referee import HISTORY_SECONDS
from cpbench.bench.results.rows import Outcome
from cpbench.bench.time_limits import REFEREE
from cpbench.bench.worker_call import RunStopped, Times, WorkerCall
from cpbench.bench.worker_pool import RefereeClient, Setting, WorkerPool
from cpbench.errors import NotApplicable
from cpbench.formulations.base import Kind
from cpbench.solvers.base import Trait, solvers
from cpbench.verification import MET_TOLERANCE, PROVEN

Before: TypeAlias = tuple[Pair, str, bytes | None]
"""The pair of the step before in a sequence: its status, and its kept answer."""
FELL_BACK = "cold: the step before was"
"""Beginning of `started` where a step had no answer to start from."""


class PairRun:
    """One run of a pair.

    `row` has the columns that are known so far: a run that ends at any stage keeps those of the stages before.
    """

    def __init__(
        self,
        setting: Setting,
        workers: WorkerPool,
        referee: RefereeClient,
        pair: Pair,
        prepared: messages.Prepared,
        before: Before | None = None,
    ) -> None:
        self.setting, self.workers, self.referee = setting, workers, referee
        self.pair, self.prepared, self.before = pair, prepared, before
        self.name, self.spec = pair.entry.solver, solvers.get(pair.entry.solver).spec
        self.recorded = pair.limits.history and Trait.HISTORY in self.spec.traits
        self.row = Outcome(
            route=prepared.route,
            kind=str(max(Kind(prepared.kind), self.spec.kind, key=lambda kind: kind.rank)),
            convert=prepared.convert,
            target_tolerance=prepared.tolerance,
        )

    def outcome(self) -> Outcome:
        """Run all stages; return the outcome. Never raises, whatever a solver does."""
        try:
            start = self.find_start()
            call = self.find_worker()
            result, waited = self.solve(call, start)
            times = call.repeat(result)
            trail, times = call.read_history(times)
            call.drop_changed(result)
            flags = self.flags(result, times, waited)
            if CLOCK in flags:
                result, times = runners_time(result, waited), Times([0.0], [waited], [waited], times.lost)
            return self.judge(result, times, flags, trail)
        except RunStopped as end:
            return replace(self.row, **end.columns)
        except Exception as noise:  # a worker may send anything, and fail in ways that are not known
            self.workers.drop(self.name)
            message = f"the worker sent no valid message: {type(noise).__name__}: {noise}"[:500]
            return replace(self.row, status="error", message=message)

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

    def find_worker(self) -> WorkerCall:
        """Return the call of a warm worker of the solver."""
        worker = self.workers.get(self.name, self.pair.limits.memory, self.pair.limits.seconds)
        if worker is None:
            why = self.workers.unavailable[self.name]
            raise RunStopped("unavailable", f"{why.state}: {why.message}")
        self.row = replace(self.row, version=self.workers.versions[self.name])
        return WorkerCall(self.setting, self.workers, worker, self.pair, self.prepared, recorded=self.recorded)

    def solve(self, call: WorkerCall, start: messages.Vectors) -> tuple[messages.Result, float]:
        """Return what the worker answers, and after how many seconds. Raises RunStopped, FrameError."""
        try:
            return call.solve(start)
        finally:
            self.row = replace(self.row, load=call.load)

    def flags(self, result: messages.Result, times: Times, waited: float) -> list[str]:
        """Return the flags of the solve."""
        of_times = (("repeat", bool(times.lost)), ("remembered", times.remembered))
        return [*marks(result, waited, self.pair.limits.threads), *(flag for flag, holds in of_times if holds)]

    def judge(
        self,
        result: messages.Result,
        times: Times,
        flags: Sequence[str],
        trail: messages.Recorded | None = None,
    ) -> Outcome:
        """Return the outcome, with the verdict on the answer."""
        pair = self.pair
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
