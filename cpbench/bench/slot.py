"""A slot runs pairs one at a time: it has a referee, and a persistent worker for each solver, with hard limits.

Whatever a solver, a conversion or a file does, `Slot.run` returns an outcome. A run has one slot or several.
"""

from __future__ import annotations

import json
import os
import platform
import statistics
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeAlias

import cpbench.bench.worker as worker_process
from cpbench import frames
from cpbench.bench import machine, messages
from cpbench.bench.compiler import Compiler
from cpbench.bench.events import Compiling, EventHandler, Starting, ignore_event
from cpbench.bench.outcome import iqr, marks, of_both, reason, remembered, unprepared
from cpbench.bench.planning.plan import PREVIOUS, Limits, Pair, Request
from cpbench.bench.processes.launch import context
from cpbench.bench.processes.process import Child, Died, TimedOut, crowded
from cpbench.bench.referee import HISTORY_SECONDS, PROOF_SECONDS
from cpbench.bench.results.rows import Outcome
from cpbench.bench.stacked import part_of
from cpbench.bench.time_limits import GRACE, LOAD, REFEREE, WARM_UP
from cpbench.bench.worker_pool import RefereeClient, Reply, Setting, WorkerPool, describe_exit, hear
from cpbench.errors import CpbenchError, NotApplicable
from cpbench.formulations.base import Kind
from cpbench.solvers.base import Trait, solvers
from cpbench.solvers.external import folder
from cpbench.solvers.stopping import second_tolerance
from cpbench.temporary import RUN, TemporaryHome
from cpbench.verification import FALSE_CLAIMS, MET_TOLERANCE, PROVEN

Before: TypeAlias = tuple[Pair, str, bytes | None]
"""The pair of the step before in a sequence: its status, and its kept answer."""
FELL_BACK = "cold: the step before was"
"""Beginning of `started` where a step had no answer to start from."""
NOTHING = Outcome()
"""The outcome of a pair before anything is known of it."""
FULL = 0.25
"""Share of the memory limit that a worker may keep after a solve; with more, the next solve gets a fresh worker."""


class Refused(CpbenchError):
    """A file holds no problem that can be planned; the message says why."""


class Unread(CpbenchError):
    """The process that read a file died, or ran out of time or memory: its content is unknown."""


class NoStart(Exception):
    """Refusal of a pair without a point to start from; message and status become the row's."""

    def __init__(self, message: str, status: str = "unsupported") -> None:
        self.status = status
        super().__init__(message)


class Slot:
    """The processes of one slot. Use as a context manager; leaving it kills them all."""

    def __init__(self, setting: Setting | None = None) -> None:
        self.setting = setting = setting or Setting()
        self._scratch = TemporaryHome(RUN)
        means = context(setting.threads, few=setting.single)
        self.referee = RefereeClient(means, setting, self._scratch.folder)
        self.workers = WorkerPool(means, setting, self._scratch.folder)
        idle = sorted({*machine.cores()} - {*setting.cpus}) if setting.cpus and setting.slots == 1 else []
        self.compiler = Compiler(means, idle)

    def __enter__(self) -> Slot:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Kill every process and remove the temporary files; harmless when done before."""
        self.compiler.close()
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
        asked = messages.Survey(address, format, tuple(requests), guesses)
        reply = self.referee.ask(REFEREE.limit(timeout), asked, messages.Surveyed)
        if isinstance(reply, messages.Declined):
            raise Refused(reply.message)
        if isinstance(reply, messages.Failure):
            raise Unread(f"{address}: {reason(reply)}")
        return reply

    def start(
        self,
        names: Iterable[str],
        limits: Limits,
        on_event: EventHandler = ignore_event,
        *,
        patient: bool = True,
    ) -> set[str]:
        """Start workers and wait until all have warmed up, so that none disturbs a measurement.

        limits : of the solves to come.
        patient : whether to wait for solvers whose kernels are not in the cache yet; otherwise these are compiled on a
            core where nothing is timed, if there is one, and returned.
        """
        waiting = set[str]()
        for name in names:
            if self.compiler.waits(name) and not patient:
                waiting.add(name)
                continue
            wait = patient or not self.compiler.takes(name)
            if not self.workers.ready(name, limits.memory):
                on_event(Starting(name))
            on_compiling = lambda name=name: on_event(Compiling(name))  # noqa: E731
            worker = self.workers.get(name, limits.memory, limits.seconds, on_compiling, patient=wait)
            if worker is None and name not in self.workers.unavailable:
                self.compiler.add(name)
                waiting.add(name)
        return waiting

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
        found = [prepared] if isinstance(prepared, Outcome) else self._run([pair], prepared, before)
        return self._completed(found, begun)[0]

    def prepare_stack(self, pairs: Sequence[Pair]) -> messages.Prepared | None:
        """Put the problems of some pairs into one file; None where they do not go together, or one cannot be read:
        run by itself, each tells."""
        asked = messages.PrepareStack(tuple(messages.RefereeCase.of(pair) for pair in pairs))
        reply = self.referee.ask(REFEREE.limit(pairs[0].limits.seconds), asked, messages.Prepared)
        return None if isinstance(reply, messages.Failure) else reply

    def run_stack(self, pairs: Sequence[Pair], prepared: messages.Prepared) -> list[Outcome]:
        """Return the outcomes of pairs of one solver that one call solves: each has an equal part of its time, and the
        call ends after the limits of all. Never raises, as `run`."""
        begun = time.perf_counter()
        return self._completed(self._run(pairs, prepared, None, stack=True), begun)

    def _completed(self, outcomes: Sequence[Outcome], begun: float) -> list[Outcome]:
        """Return outcomes with what is known of their run as a whole."""
        common = {
            "wall": (time.perf_counter() - begun) / len(outcomes),
            "jobs": self.setting.slots,
            "loadavg": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
            "host": platform.node(),
            "finished": time.strftime("%Y-%m-%dT%H:%M:%S"),
        }
        return [outcome.changed(**common) for outcome in outcomes]

    def _run(
        self, pairs: Sequence[Pair], prepared: messages.Prepared, before: Before | None, *, stack: bool = False
    ) -> list[Outcome]:
        """Return the outcomes of pairs whose problems are converted: of one, or of all that are in a `stack`."""
        found = self._solved(pairs, prepared, before, stack)
        if not stack and not isinstance(found, Outcome):
            found = [self._confirmed(pairs[0], prepared, before, found[0])]
        self.workers.served(pairs[0].entry.solver)
        return [found] * len(pairs) if isinstance(found, Outcome) else found

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
        second = self._solved([pair], replace(prepared, tolerance=tolerance), before, stack=False)
        return of_both(first, second if isinstance(second, Outcome) else second[0], tolerance)

    def _solved(
        self, pairs: Sequence[Pair], prepared: messages.Prepared, before: Before | None, stack: bool
    ) -> Outcome | list[Outcome]:
        """Return the outcomes, or one for all pairs where no answers came."""
        pair, count = pairs[0], len(pairs)
        name = pair.entry.solver
        # a chain of partials: a failure at any step has the columns that were known until then
        known = partial(
            NOTHING.changed,
            route=prepared.route,
            kind=str(max(Kind(prepared.kind), solvers.get(name).spec.kind, key=lambda kind: kind.rank)),
            convert=prepared.convert,
            target_tolerance=prepared.tolerance,
            batch=count if stack else None,
        )
        try:
            start, started = self._start_of(pair, before)
            known = partial(known, started=started)
            worker = self.workers.get(name, pair.limits.memory, pair.limits.seconds)
            if worker is None:
                why = self.workers.unavailable[name]
                return known(status="unavailable", message=f"{why.state}: {why.message}")
            known = partial(known, version=self.workers.versions[name])
            heard = self._heard(pair, prepared, start, worker, known, count if stack else 0)
            if isinstance(heard, Outcome):
                return heard
            known, result, waited = heard
            if stack:
                return self._all_answered(pairs, known, worker, result, waited)
            return [self._answered(pair, known, worker, result, waited)]
        except NoStart as why:
            return known(status=why.status, message=str(why))
        except Exception as noise:  # a worker may send anything, and fail in ways that nobody foresaw
            self.workers.drop(name)
            message = f"the worker sent no valid message: {type(noise).__name__}: {noise}"[:500]
            return known(status="error", message=message)

    def _heard(
        self,
        pair: Pair,
        prepared: messages.Prepared,
        start: messages.Vectors,
        worker: Child,
        known: partial[Outcome],
        stacked: int,
    ) -> Outcome | tuple[partial[Outcome], messages.Result, float]:
        """Return what is known of a pair, what its worker answered, and after how many seconds; the outcome where it
        did not answer. `known` completes what is known before. `stacked` : problems in the file where it is a stack.

        Raises FrameError.
        """
        name, limit = pair.entry.solver, pair.limits.seconds * max(stacked, 1)
        asked = messages.Solve(
            path=prepared.path,
            tolerance=prepared.tolerance,
            seconds=pair.limits.seconds,
            options=dict(pair.entry.options),
            repeats=pair.limits.repeats,
            history=self._recorded(pair),
            held=not stacked and self.workers.holds(name, prepared.path),
            checksum=prepared.checksum,
            stack=pair.limits.threads if stacked else 0,
            vectors=start,
        )
        loaded, loading = False, WARM_UP if stacked else LOAD  # the first call for a stack may have to compile
        try:
            worker.forget()  # what earlier solves printed is not this one's
            over = time.monotonic() + loading.limit(limit)
            worker.send(messages.pack(asked), loading.limit(limit))
            reply = messages.ProblemLoaded(messages.Seconds(0.0))
            if not asked.held:
                reply = hear(worker, over - time.monotonic())
            if isinstance(reply, messages.ProblemLoaded):
                known, loaded = partial(known, load=reply.load / max(stacked, 1)), True
                if not stacked:
                    self.workers.loaded(name, prepared.path)
                begun = time.perf_counter()  # a clock beside the worker's, which a solver could falsify
                reply = hear(worker, limit + GRACE)
                if isinstance(reply, messages.Result):
                    if reply.children > self.setting.processes:
                        raise Died(None, worker.output(), reason=crowded(self.setting.processes))
                    return known, reply, time.perf_counter() - begun
        except TimedOut:
            self.workers.drop(name)
            if loaded:
                whole = f", the limits of {stacked} problems in one call" if stacked else ""
                return known(status="timeout", message=f"killed after {limit:g} s{whole}", solve=pair.limits.seconds)
            message = f"loading: not over after {loading.limit(limit):g} s ({loading.what})"
            return known(status="error", message=message)
        except Died as death:
            self.workers.drop(name)
            status = "memout" if death.out_of_memory else "crash"
            return known(status=status, message=describe_exit(death), signal=death.signal, code=death.code)
        if isinstance(reply, messages.OutOfMemory):
            self.workers.drop(name)  # a process whose allocations failed is in an unknown state
            return known(status="memout", message=f"over {pair.limits.memory} bytes")
        status = "error"
        if isinstance(reply, messages.ProblemUnsupported):
            status = "unsupported"
        elif isinstance(reply, messages.SolverUnavailable):
            status = "unavailable"
        else:
            self.workers.drop(name)  # its state after the error was not examined
        return known(status=status, message=reason(reply)[: worker_process.WORDS])

    def _start_of(self, pair: Pair, before: Before | None) -> tuple[messages.Vectors, str]:
        """Return the point to start from, empty for a cold start, and its description for the row; raises NoStart."""
        if pair.start == "cold":
            return {}, "cold"
        spec = solvers.get(pair.entry.solver).spec
        if Trait.WARM_START not in spec.traits:
            raise NoStart(f"{spec.name} takes no starting point, and a cold start is not what was asked for")
        if pair.start == PREVIOUS and pair.scene is None:
            raise NoStart("start previous: the problem is no step of a sequence (cpbench pack --sequence makes one)")
        earlier, status, answer = before or (None, "", None)
        verified = answer if status in MET_TOLERANCE else None
        if pair.start == PREVIOUS and verified is None:
            return {}, f"{FELL_BACK} {status}" if earlier else "cold: first step"
        case, vectors = earlier and messages.RefereeCase.of(earlier), {} if verified is None else {"answer": verified}
        asked = messages.FindStart(messages.RefereeCase.of(pair), pair.start, case, vectors)
        reply = self.referee.ask(REFEREE.limit(pair.limits.seconds), asked, messages.StartFound)
        if isinstance(reply, messages.StartFound):
            return reply.vectors, reply.description
        if isinstance(reply, messages.Declined) and reply.cause == NotApplicable.__name__:
            raise NoStart(reply.message)
        raise NoStart(f"start: {reason(reply)}", "memout" if isinstance(reply, messages.OutOfMemory) else "error")

    def _recorded(self, pair: Pair) -> bool:
        return pair.limits.history and Trait.HISTORY in solvers.get(pair.entry.solver).spec.traits

    def _all_answered(
        self, pairs: Sequence[Pair], known: partial[Outcome], worker: Child, result: messages.Result, waited: float
    ) -> list[Outcome]:
        """Return the outcomes of pairs that one call has answered: its time in equal parts, a verdict each.

        Raises ValueError, IndexError where the answer is not one to so many problems.
        """
        first, count = pairs[0], len(pairs)
        _, solves, _, lost = self._repeated(first, result, worker)
        self._drop_changed(first, result)
        flags = self._flags(first, result, waited, solves, lost)
        shares = [seconds / count for seconds in solves]
        outcomes: list[Outcome] = []
        for i, pair in enumerate(pairs):
            claim, answered, alone, vectors = part_of(result.vectors, count, i)
            own = replace(
                result,
                claim=str(claim),
                answered=answered,
                counters={"alone": int(alone)},
                solve=messages.Seconds(result.solve / count),
                cpu=messages.Seconds(result.cpu / count),
                peak=None,
                vectors=vectors,
            )
            outcomes.append(self._judged(pair, known, own, [0.0], shares, flags, lost))
        return outcomes

    def _answered(
        self, pair: Pair, known: partial[Outcome], worker: Child, result: messages.Result, waited: float
    ) -> Outcome:
        """Return the outcome of a pair whose worker answered after `waited` seconds: repeats, history, verdict."""
        setups, solves, walls, lost = self._repeated(pair, result, worker)
        trail: messages.Recorded | None = None
        if self._recorded(pair) and not lost:
            trail, lost = self._next(worker, pair, messages.Recorded, pair.limits.seconds + GRACE, "history")
        self._drop_changed(pair, result)
        flags = self._flags(pair, result, waited, solves, lost)
        if result.trip is not None:
            known = partial(known, trip=result.trip, solve_wall=statistics.median(walls))
        return self._judged(pair, known, result, setups, solves, flags, lost, trail)

    def _drop_changed(self, pair: Pair, result: messages.Result) -> None:
        """Drop a worker in which a solve has left something behind: it must not count against the next."""
        if (
            result.children
            or result.wrote
            or result.threads > pair.limits.threads
            or 0 < pair.limits.memory * FULL < result.grown
        ):
            self.workers.drop(pair.entry.solver)

    def _flags(
        self, pair: Pair, result: messages.Result, waited: float, solves: Sequence[float], lost: str
    ) -> list[str]:
        own = (("repeat", bool(lost)), ("remembered", remembered(solves)))
        return [*marks(result, waited, pair.limits.threads), *(flag for flag, holds in own if holds)]

    def _judged(
        self,
        pair: Pair,
        known: partial[Outcome],
        result: messages.Result,
        setups: Sequence[float],
        solves: Sequence[float],
        flags: Sequence[str],
        lost: str,
        trail: messages.Recorded | None = None,
    ) -> Outcome:
        """Return the outcome of a pair, with the verdict on its answer."""
        case, seconds = messages.RefereeCase.of(pair), REFEREE.limit(pair.limits.seconds)
        asked = messages.Judge(
            case,
            claim=result.claim,
            answered=result.answered,
            promise=str(solvers.get(pair.entry.solver).spec.kind),
            proof_seconds=min(pair.limits.seconds / 2, PROOF_SECONDS),
            vectors=result.vectors,
        )
        judged = self.referee.ask(seconds, asked, messages.Judged)
        timed = partial(
            known,
            claim=result.claim,
            counters=json.dumps(result.counters),
            setup=statistics.median(setups),
            solve=solves[0] if "remembered" in flags else statistics.median(solves),
            cpu=result.cpu,
            peak=result.peak,
            reported=result.reported,
            repeats=len(solves),
            samples=json.dumps([float(f"{s:.6g}") for s in solves]),
            solve_min=min(solves),
            solve_iqr=iqr(solves),
        )
        if isinstance(judged, messages.Failure):
            message = f"the answer could not be judged: {reason(judged)}"
            return timed(flags=",".join(flags), status="error", message="; ".join(filter(None, (message, lost))))
        status, message = judged.status, "; ".join(filter(None, (judged.message, result.message, lost)))
        # within the grace of a process, but beyond the limit of the solve
        if result.setup + result.solve > pair.limits.seconds:
            status, message = "timeout", f"answered after the limit of {pair.limits.seconds:g} s"
        history = None
        if trail is not None:
            again = messages.JudgeHistory(case, HISTORY_SECONDS, **vars(trail))
            measured = self.referee.ask(seconds, again, messages.HistoryJudged)
            history = measured.vectors.get("history") if isinstance(measured, messages.HistoryJudged) else None
        return timed(
            status=status,
            message=message,
            error=judged.error,
            target_error=judged.target_error,
            flags=",".join([*judged.flags, *flags]),
            parts=json.dumps(judged.parts),
            lift=judged.lift,
            verify=judged.verify,
            answer=judged.vectors.get("answer"),
            history=history,
            proof=judged.vectors.get("proof") if status in PROVEN else None,
        )

    def _repeated(
        self, pair: Pair, result: messages.Result, worker: Child
    ) -> tuple[list[float], list[float], list[float], str]:
        """Return setup, solve and wall times of the first solve and its repeats, and why repeats failed.

        The first answer stands, with its own times, whatever happens to a repeat. It is judged after the repeats:
        a referee that works beside them would spoil their times.
        """
        setups, solves, walls = [float(result.setup)], [float(result.solve)], [float(result.solve_wall or 0.0)]
        more = pair.limits.repeats - 1
        if more < 1 or result.wrote or result.setup + result.solve >= worker_process.SHORT:
            return setups, solves, walls, ""
        repeats, lost = self._next(worker, pair, messages.Repeats, more * (pair.limits.seconds + GRACE), "repeat")
        if repeats is not None and len(repeats.times) > more:
            self.workers.drop(pair.entry.solver)
            return setups, solves, walls, f"a repeat failed: {len(repeats.times)} repeats, {more} were asked for"
        if repeats is not None:
            setups += [setup for setup, _, _ in repeats.times]
            solves += [solve for _, solve, _ in repeats.times]
            walls += [wall for _, _, wall in repeats.times]
        return setups, solves, walls, lost

    def _next(
        self, worker: Child, pair: Pair, expected: type[Reply], patience: float, what: str
    ) -> tuple[Reply | None, str]:
        """Return one more message of a worker that has answered, or why there is none: its answer stands either way."""
        try:
            reply = hear(worker, patience)
            if isinstance(reply, expected):
                return reply, ""
            lost = f"over {pair.limits.memory} bytes" if isinstance(reply, messages.OutOfMemory) else reason(reply)
        except TimedOut:
            lost = f"killed after {patience:g} s"
        except Died as death:
            lost = describe_exit(death)
        except frames.FrameError as noise:
            lost = f"no valid message: {noise}"
        self.workers.drop(pair.entry.solver)
        return None, f"a {what} failed: {lost}"
