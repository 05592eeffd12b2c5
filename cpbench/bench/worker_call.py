"""The part of a run that a worker has: its answer, the times of its repeats, and its iterates, stage by stage."""

from __future__ import annotations

import json
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cpbench.bench.worker as worker_process
from cpbench.bench import messages
from cpbench.bench.outcome import iqr, late, reason, remembered
from cpbench.bench.planning.plan import Pair
from cpbench.bench.processes.process import Child, Died, TimedOut, crowded
from cpbench.bench.time_limits import GRACE, LOAD
from cpbench.bench.worker_pool import Reply, Setting, WorkerPool, describe_exit, hear
from cpbench.foundation import frames

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


class WorkerCall:
    """One call of a warm worker.

    `recorded` : whether iterates are asked for. `load` : seconds that a problem took to be read, None before it is.
    """

    def __init__(
        self,
        setting: Setting,
        workers: WorkerPool,
        worker: Child,
        pair: Pair,
        prepared: messages.Prepared,
        *,
        recorded: bool,
    ) -> None:
        self.setting, self.workers, self.worker = setting, workers, worker
        self.pair, self.prepared, self.name = pair, prepared, pair.entry.solver
        self.recorded = recorded
        self.load: float | None = None

    def solve(self, start: messages.Vectors) -> tuple[messages.Result, float]:
        """Return what the worker answers, and after how many seconds. Raises FrameError."""
        limits = self.pair.limits
        asked = messages.Solve(
            path=self.prepared.path,
            tolerance=self.prepared.tolerance,
            seconds=limits.seconds,
            options=dict(self.pair.entry.options),
            repeats=limits.repeats,
            repeat_below=limits.repeat_below,
            history=self.recorded,
            held=self.workers.holds(self.name, self.prepared.path),
            checksum=self.prepared.checksum,
            vectors=start,
        )
        try:
            self.worker.forget()  # what earlier solves printed is not this one's
            over = time.monotonic() + LOAD.limit(limits.seconds)
            self.worker.send(messages.pack(asked), LOAD.limit(limits.seconds))
            reply = messages.ProblemLoaded(messages.Seconds(0.0))
            if not asked.held:
                reply = hear(self.worker, over - time.monotonic())
            if isinstance(reply, messages.ProblemLoaded):
                self.load = reply.load
                self.workers.loaded(self.name, self.prepared.path)
                begun = time.perf_counter()  # a clock beside the worker's, which a solver could falsify
                reply = hear(self.worker, limits.seconds + GRACE)
                if isinstance(reply, messages.Result):
                    if reply.children > self.setting.processes:
                        raise Died(None, self.worker.output(), reason=crowded(self.setting.processes))
                    return reply, time.perf_counter() - begun
        except TimedOut:
            self.workers.drop(self.name)
            if self.load is not None:
                raise RunStopped("timeout", f"killed after {limits.seconds:g} s", solve=limits.seconds) from None
            why = f"loading: not over after {LOAD.limit(limits.seconds):g} s ({LOAD.what})"
            raise RunStopped("error", why) from None
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

    def repeat(self, result: messages.Result) -> Times:
        """Return the times of the first solve and its repeats.

        The first answer stands, with its own times, whatever happens to a repeat. It is judged after the repeats:
        a referee that works beside them would spoil their times.
        """
        first = Times([float(result.setup)], [float(result.solve)], [float(result.solve_wall or 0.0)])
        limits, more = self.pair.limits, self.pair.limits.repeats - 1
        if more < 1 or result.wrote or result.setup + result.solve >= limits.repeat_below:
            return first
        begun = time.perf_counter()
        repeats, lost = self._next(messages.Repeats, more * (limits.seconds + GRACE), "repeat")
        waited = time.perf_counter() - begun
        if repeats is None:
            return replace(first, lost=lost)
        if len(repeats.times) > more:
            self.workers.drop(self.name)
            return replace(first, lost=f"a repeat failed: {len(repeats.times)} repeats, {more} were asked for")
        shown = sum(setup + wall for setup, _, wall in repeats.times)
        # a request to another process may take long outside of any clock; a repeat may have to load the problem again
        if result.trip is None and late(waited, shown + more * (self.load or 0.0)):
            why = f"the repeats took {waited:.3g} s, of which the solver's process shows {shown:.3g} s"
            return replace(first, lost=f"a repeat failed: {why}")
        setup, solve, wall = ([seconds[k] for seconds in repeats.times] for k in range(3))
        return Times([*first.setup, *setup], [*first.solve, *solve], [*first.wall, *wall])

    def read_history(self, times: Times) -> tuple[messages.Recorded | None, Times]:
        """Return the iterates of the solve, where they were asked for."""
        if not self.recorded or times.lost:
            return None, times
        trail, lost = self._next(messages.Recorded, self.pair.limits.seconds + GRACE, "history")
        return trail, replace(times, lost=lost)

    def _next(self, expected: type[Reply], patience: float, what: str) -> tuple[Reply | None, str]:
        """Return one more message of a worker that has answered, or why there is none: its answer stands either way."""
        try:
            reply = hear(self.worker, patience)
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
