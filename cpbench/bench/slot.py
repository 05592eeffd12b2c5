"""A slot runs pairs one at a time: it has a referee, and a persistent worker for each solver, with hard limits.

Whatever a solver, a conversion or a file does, `Slot.run` returns an outcome. A run has one slot or several.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace

from cpbench.bench import messages
from cpbench.bench.events import Compiling, EventHandler, Starting, ignore_event
from cpbench.bench.outcome import of_both, reason, unprepared
from cpbench.bench.pair_run import Before, PairRun
from cpbench.bench.planning.plan import Limits, Pair, Request
from cpbench.bench.processes.launch import context
from cpbench.bench.results.rows import Outcome
from cpbench.bench.time_limits import REFEREE
from cpbench.bench.worker_pool import RefereeClient, Setting, WorkerPool
from cpbench.errors import CpbenchError
from cpbench.foundation.temporary import RUN, TemporaryHome
from cpbench.solvers.base import solvers
from cpbench.solvers.external import folder
from cpbench.solvers.stopping import second_tolerance
from cpbench.verification import FALSE_CLAIMS


class Refused(CpbenchError):
    """A file holds no problem that can be planned; the message says why."""


class Unread(CpbenchError):
    """The process that read a file died, or ran out of time or memory: its content is unknown."""


class Slot:
    """The processes of one slot. Use as a context manager; leaving it kills them all."""

    def __init__(self, setting: Setting | None = None) -> None:
        self.setting = setting = setting or Setting()
        self._scratch = TemporaryHome(RUN)
        self._means = means = context(setting.threads)
        self.referee = self.another_referee()
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

    def another_referee(self) -> RefereeClient:
        """Return a further referee beside that of the slot, which the caller closes."""
        return RefereeClient(self._means, self.setting, self._scratch.folder)

    def survey(
        self,
        address: str,
        requests: Sequence[Request],
        format: str | None = None,
        timeout: float = 0.0,
        *,
        guesses: bool = False,
        referee: RefereeClient | None = None,
    ) -> messages.Surveyed:
        """Return facts of a problem for the plan; raises Refused, Unread. `timeout` : of a solve. `guesses` : whether
        the starting points of its file are counted, too. `referee` : its reader, None for that of the slot."""
        asked = messages.Survey(address, format, tuple(requests), guesses)
        reply = (referee or self.referee).ask(REFEREE.limit(timeout), asked, messages.Surveyed)
        if isinstance(reply, messages.Declined):
            raise Refused(reply.message)
        if isinstance(reply, messages.Failure):
            raise Unread(f"{address}: {reason(reply)}")
        return reply

    def start(self, names: Iterable[str], limits: Limits, on_event: EventHandler = ignore_event) -> None:
        """Start workers and wait until all have warmed up, so that none disturbs a measurement.

        limits : of the solves to come.
        """
        for name in names:
            if not self.workers.ready(name, limits.memory):
                on_event(Starting(name))
            on_compiling = lambda name=name: on_event(Compiling(name))  # noqa: E731
            self.workers.get(name, limits.memory, limits.seconds, on_compiling)

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
        if isinstance(prepared, Outcome):
            outcome = prepared
        else:
            outcome = self._confirmed(pair, prepared, before, self._run(pair, prepared, before))
        return replace(
            outcome,
            wall=time.perf_counter() - begun,
            jobs=self.setting.slots,
            loadavg=os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
            host=platform.node(),
            finished=time.strftime("%Y-%m-%dT%H:%M:%S"),
        )

    def _run(self, pair: Pair, prepared: messages.Prepared, before: Before | None) -> Outcome:
        return PairRun(self.setting, self.workers, self.referee, pair, prepared, before).outcome()

    def _confirmed(self, pair: Pair, prepared: messages.Prepared, before: Before | None, first: Outcome) -> Outcome:
        """Return the outcome of a pair whose solver is asked once more where its package's claim failed: what it was
        asked for may have been too little in the units of this problem."""
        missed = first.error if first.target_error is None else first.target_error
        stopping = solvers.get(pair.entry.solver).stopping
        tolerance = None
        if first.status in FALSE_CLAIMS:
            tolerance = second_tolerance(stopping, prepared.tolerance, first.claim or "", missed)
        if tolerance is None:
            return first
        second = self._run(pair, replace(prepared, tolerance=tolerance), before)
        return of_both(first, second, tolerance)
