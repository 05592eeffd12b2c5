"""A slot runs pairs one at a time: it has a referee, and a persistent worker for each solver, with hard limits.

A pair runs in stages: its problem is converted (`Slot.prepare`), a start is found, the worker solves, repeats and
records, the referee judges (`PairRun`). Whatever a solver, a conversion or a file does, `Slot.run` returns an outcome.
A run has one slot or several.
"""

from __future__ import annotations

import json
import os
import platform
import statistics
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

from cpbench.bench import messages
from cpbench.bench.events import EventHandler, Starting, ignore_event
from cpbench.bench.judging import PROOF_SECONDS
from cpbench.bench.outcome import CLOCK, Times, late, marks, of_both, reason, runners_time, unprepared
from cpbench.bench.planning.plan import PREVIOUS, Limits, Pair, Request
from cpbench.bench.processes.launch import context
from cpbench.bench.processes.process import Child, Died, TimedOut, crowded
from cpbench.bench.referee import HISTORY_SECONDS
from cpbench.bench.results.rows import Outcome
from cpbench.bench.time_limits import GRACE, LOAD, REFEREE
from cpbench.bench.worker import WORDS
from cpbench.bench.worker_pool import RefereeClient, Reply, Setting, WorkerPool, hear
from cpbench.errors import CpbenchError, NotApplicable
from cpbench.formulations.base import Kind
from cpbench.foundation import frames
from cpbench.foundation.locks import RUN, TemporaryHome
from cpbench.solvers.base import Trait, solvers
from cpbench.solvers.external import folder
from cpbench.solvers.stopping import second_tolerance
from cpbench.verification import FALSE_CLAIMS, MET_TOLERANCE, PROVEN

Before: TypeAlias = tuple[Pair, str, bytes | None]
"""The pair of the step before in a sequence: its status, and its kept answer."""
FELL_BACK = "cold: the step before was"
"""Beginning of `started` where a step had no answer to start from."""
FULL = 0.25
"""Share of the memory limit that a worker may keep after a solve; with more, the next solve gets a fresh worker."""


class Refused(CpbenchError):
    """A file holds no problem that can be planned; the message says why."""


class Unread(CpbenchError):
    """The process that read a file died, or ran out of time or memory: its content is unknown."""


class Slot:
    """The processes of one slot. Use as a context manager; leaving it kills them all."""

    def __init__(self, setting: Setting | None = None) -> None:
        self.setting = setting = setting or Setting()
        self._scratch = TemporaryHome(RUN)
        means = context(setting.threads)
        self.referee = RefereeClient(means, setting, self._scratch.folder)
        self.workers = WorkerPool(means, setting, self._scratch.folder)

    def __enter__(self) -> Slot:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Kill every process and remove the temporary files; harmless when done before."""
        self.workers.close()
        self.referee.close()
        self._scratch.remove()
        folder.remove_abandoned()  # files that killed workers had written for programs of their own

    def interrupt(self) -> None:
        """Kill the processes at work, from another thread than the slot's, which then finds that they have died."""
        for child in (*self.workers.children, self.referee.child):
            if child is not None:
                child.kill_all()

    def survey(
        self,
        address: str,
        requests: Sequence[Request],
        format: str | None = None,
        timeout: float = 0.0,
        *,
        guesses: bool = False,
    ) -> messages.Surveyed:
        """Return facts of a problem for the plan; raises Refused, Unread. `timeout` : of a solve. `guesses` : whether
        the starting points of its file are counted, too."""
        request = messages.Survey(address, format, tuple(requests), guesses)
        reply = self.referee.ask(REFEREE.limit(timeout), request, messages.Surveyed)
        if isinstance(reply, messages.Declined):
            raise Refused(reply.message)
        if isinstance(reply, messages.Failure):
            raise Unread(f"{address}: {reason(reply)}")
        return reply

    def start(self, wanted: Mapping[str, Limits], on_event: EventHandler = ignore_event) -> None:
        """Start workers, as many side by side as there are cores, and wait until all have warmed up, so that none
        disturbs a measurement.

        wanted : limits of the solves to come, by solver.
        """
        missing = [name for name, limits in wanted.items() if not self.workers.ready(name, limits.memory)]
        for at, name in enumerate(missing):
            on_event(Starting(name))
            for beside in missing[at : at + (os.cpu_count() or 1)]:
                self.workers.begin(beside, wanted[beside].memory)
            limits = wanted[name]
            self.workers.get(name, limits.memory, limits.seconds)

    def prepare(self, pair: Pair) -> messages.Prepared | Outcome:
        """Convert the pair's problem to its solver's node; the outcome of the pair where that fails.

        The message distinguishes a problem that cannot be loaded, or is not the one that was planned.
        """
        seconds = REFEREE.limit(pair.limits.seconds)
        opened = self.referee.ask(seconds, messages.Open(pair.address, pair.format, pair.fingerprint), messages.Opened)
        # loading first, by itself: a failure there is the file's, one below is the conversion's
        if isinstance(opened, messages.Failure):
            return unprepared(opened, loading=True)
        reply = self.referee.ask(seconds, messages.Prepare(messages.RefereeCase.of(pair)), messages.Prepared)
        return unprepared(reply, loading=False) if isinstance(reply, messages.Failure) else reply

    def run(self, pair: Pair, prepared: messages.Prepared | Outcome, before: Before | None = None) -> Outcome:
        """Return the outcome of one pair; never raises, whatever a solver, a conversion or a file does.

        `prepared` : by `prepare`. `before` : the step before, where the pair starts from it.
        """
        begun = time.perf_counter()
        outcome = prepared if isinstance(prepared, Outcome) else self._confirmed(pair, prepared, before)
        return replace(
            outcome,
            wall=time.perf_counter() - begun,
            jobs=self.setting.slots,
            loadavg=os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
            host=platform.node(),
            finished=time.strftime("%Y-%m-%dT%H:%M:%S"),
        )

    def _confirmed(self, pair: Pair, prepared: messages.Prepared, before: Before | None) -> Outcome:
        """Return the outcome of a pair whose solver is asked once more where its package's claim failed: what it was
        asked for may have been too little in the units of this problem."""
        first = PairRun(self, pair, prepared, before).outcome()
        if first.status not in FALSE_CLAIMS:
            return first
        missed = first.error if first.target_error is None else first.target_error
        stopping = solvers.get(pair.entry.solver).stopping
        tolerance = second_tolerance(stopping, prepared.tolerance, first.claim or "", missed)
        if tolerance is None:
            return first
        second = PairRun(self, pair, replace(prepared, tolerance=tolerance), before).outcome()
        return of_both(first, second, tolerance)


class RunStopped(Exception):
    """End of a run without an answer to be judged; `columns` of its row say why."""

    def __init__(self, status: str, message: str, **columns: Any) -> None:
        self.columns = {"status": status, "message": message, **columns}
        super().__init__(message)


class PairRun:
    """One run of a pair whose problem is converted.

    `row` has the columns that are known so far: a run that ends at any stage keeps those of the stages before.
    """

    def __init__(self, slot: Slot, pair: Pair, prepared: messages.Prepared, before: Before | None = None) -> None:
        self.setting, self.workers, self.referee = slot.setting, slot.workers, slot.referee
        self.pair, self.prepared, self.before = pair, prepared, before
        self.name, self.limits = pair.entry.solver, pair.limits
        self.spec = solvers.get(self.name).spec
        self.recorded = self.limits.history and Trait.HISTORY in self.spec.traits
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
            worker = self.find_worker()
            result, waited = self.solve(worker, start)
            # the answer is judged after the repeats: a referee that works beside them would spoil their times
            times = self.repeat(worker, result)
            trail, times = self.read_history(worker, times)
            self.drop_changed(result)
            flags = marks(result, waited, self.limits.threads)
            flags += ["repeat"] if times.lost else []
            flags += ["remembered"] if times.remembered else []
            if CLOCK in flags:
                result, times = runners_time(result, waited), Times([0.0], [waited], [waited], times.lost)
            return self.judge(result, times, flags, trail)
        except RunStopped as end:
            return replace(self.row, **end.columns)
        except Exception as noise:  # a worker may send anything, and fail in ways that are not known
            self.workers.drop(self.name)
            message = f"the worker sent no valid message: {type(noise).__name__}: {noise}"[:500]
            return replace(self.row, status="error", message=message)

    # ------------------------------------------------------------------------------------------ before the solve

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
                message = "start previous: the problem is no step of a sequence (cpbench.Recorder makes one)"
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
        request = messages.FindStart(messages.RefereeCase.of(pair), pair.start, case, vectors)
        reply = self.referee.ask(REFEREE.limit(self.limits.seconds), request, messages.StartFound)
        if isinstance(reply, messages.StartFound):
            return reply.vectors, reply.description
        if isinstance(reply, messages.Declined) and reply.cause == NotApplicable.__name__:
            raise RunStopped("unsupported", reply.message)
        status = "memout" if isinstance(reply, messages.OutOfMemory) else "error"
        raise RunStopped(status, f"start: {reason(reply)}")

    def find_worker(self) -> Child:
        """Return a warm worker of the solver."""
        worker = self.workers.get(self.name, self.limits.memory, self.limits.seconds)
        if worker is None:
            why = self.workers.unavailable[self.name]
            raise RunStopped("unavailable", f"{why.state}: {why.message}")
        self.row = replace(self.row, version=self.workers.versions[self.name])
        return worker

    # ------------------------------------------------------------------------------------------ the worker's part

    def solve(self, worker: Child, start: messages.Vectors) -> tuple[messages.Result, float]:
        """Return what the worker answers, and after how many seconds. Raises RunStopped, FrameError."""
        limits, prepared = self.limits, self.prepared
        request = messages.Solve(
            path=prepared.path,
            tolerance=prepared.tolerance,
            seconds=limits.seconds,
            options=dict(self.pair.entry.options),
            repeats=limits.repeats,
            repeat_below=limits.repeat_below,
            history=self.recorded,
            checksum=prepared.checksum,
            vectors=start,
        )
        loaded, limit = False, LOAD.limit(limits.seconds)
        try:
            worker.forget()  # what earlier solves printed is not this one's
            over = time.monotonic() + limit
            worker.send(messages.pack(request), limit)
            reply = hear(worker, over - time.monotonic())
            if isinstance(reply, messages.ProblemLoaded):
                loaded, self.row = True, replace(self.row, load=reply.load)
                begun = time.perf_counter()  # a clock beside the worker's, which a solver could falsify
                reply = hear(worker, limits.seconds + GRACE)
                if isinstance(reply, messages.Result):
                    if reply.children > self.setting.processes:
                        raise Died(None, worker.output(), reason=crowded(self.setting.processes))
                    return reply, time.perf_counter() - begun
        except TimedOut:
            self.workers.drop(self.name)
            if loaded:
                raise RunStopped("timeout", f"killed after {limits.seconds:g} s", solve=limits.seconds) from None
            raise RunStopped("error", f"loading: not over after {limit:g} s ({LOAD.what})") from None
        except Died as death:
            self.workers.drop(self.name)
            status = "memout" if death.out_of_memory else "crash"
            raise RunStopped(status, str(death), signal=death.signal, code=death.code) from None
        raise self._without_answer(reply)

    def _without_answer(self, reply: messages.Message) -> RunStopped:
        """Return the end of a run whose worker sent no answer, but why."""
        if isinstance(reply, messages.ProblemUnsupported):
            return RunStopped("unsupported", reason(reply)[:WORDS])
        if isinstance(reply, messages.SolverUnavailable):
            return RunStopped("unavailable", reason(reply)[:WORDS])
        self.workers.drop(self.name)  # its state is not known: neither after an error, nor with its memory full
        if isinstance(reply, messages.OutOfMemory):
            return RunStopped("memout", f"over {self.limits.memory} bytes")
        return RunStopped("error", reason(reply)[:WORDS])

    def repeat(self, worker: Child, result: messages.Result) -> Times:
        """Return the times of the first solve and its repeats.

        The first answer stands, with its own times, whatever happens to a repeat.
        """
        first = Times([float(result.setup)], [float(result.solve)], [float(result.solve_wall or 0.0)])
        limits, more = self.limits, self.limits.repeats - 1
        if more < 1 or result.wrote or result.setup + result.solve >= limits.repeat_below:
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
        if not self.recorded or times.lost:
            return None, times
        trail, lost = self._next(worker, messages.Recorded, self.limits.seconds + GRACE, "history")
        return trail, replace(times, lost=lost)

    def _next(self, worker: Child, expected: type[Reply], patience: float, what: str) -> tuple[Reply | None, str]:
        """Return one more message of a worker that has answered, or why there is none: its answer stands either way."""
        try:
            reply = hear(worker, patience)
            if isinstance(reply, expected):
                return reply, ""
            full = isinstance(reply, messages.OutOfMemory)
            lost = f"over {self.limits.memory} bytes" if full else reason(reply)
        except TimedOut:
            lost = f"killed after {patience:g} s"
        except Died as death:
            lost = str(death)
        except frames.FrameError as noise:
            lost = f"no valid message: {noise}"
        self.workers.drop(self.name)
        return None, f"a {what} failed: {lost}"

    def drop_changed(self, result: messages.Result) -> None:
        """Drop a worker in which a solve has left something behind: it must not count against the next."""
        grown = 0 < self.limits.memory * FULL < result.grown
        if result.children or result.wrote or result.threads > self.limits.threads or grown:
            self.workers.drop(self.name)

    # ------------------------------------------------------------------------------------------ the verdict

    def judge(
        self,
        result: messages.Result,
        times: Times,
        flags: Sequence[str],
        trail: messages.Recorded | None = None,
    ) -> Outcome:
        """Return the outcome, with the verdict on the answer."""
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
        case, limit = messages.RefereeCase.of(self.pair), self.limits.seconds
        request = messages.Judge(
            case,
            claim=result.claim,
            answered=result.answered,
            promise=str(self.spec.kind),
            proof_seconds=min(limit / 2, PROOF_SECONDS),
            vectors=result.vectors,
        )
        judged = self.referee.ask(REFEREE.limit(limit), request, messages.Judged)
        if isinstance(judged, messages.Failure):
            message = _joined(f"the answer could not be judged: {reason(judged)}", times.lost)
            return replace(row, flags=",".join(flags), status="error", message=message)
        status, message = judged.status, _joined(judged.message, result.message, times.lost)
        # within the grace of a process, but beyond the limit of the solve
        if result.setup + result.solve > limit:
            status, message = "timeout", f"answered after the limit of {limit:g} s"
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
            history=None if trail is None else self._judge_history(case, trail),
            proof=judged.vectors.get("proof") if status in PROVEN else None,
        )

    def _judge_history(self, case: messages.RefereeCase, trail: messages.Recorded) -> bytes | None:
        """Return the iterates with their errors; None where they could not be judged."""
        request = messages.JudgeHistory(**vars(trail), case=case, seconds=HISTORY_SECONDS)
        reply = self.referee.ask(REFEREE.limit(self.limits.seconds), request, messages.HistoryJudged)
        return reply.vectors.get("history") if isinstance(reply, messages.HistoryJudged) else None


def _verified(before: Before) -> bytes | None:
    """Return the answer to the step before, where it met the tolerance."""
    _, status, answer = before
    return answer if status in MET_TOLERANCE else None


def _joined(*messages: str) -> str:
    return "; ".join(filter(None, messages))
