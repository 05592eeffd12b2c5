"""One place where solves happen, one at a time: a referee, and one persistent worker a solver, with hard limits.

Whatever a solver, a conversion or a file does, `Lane.run` returns a row. A run has one lane, or several side by side.
"""

from __future__ import annotations

import json
import os
import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import cpbench.bench.worker as worker_process
from cpbench.bench import machine
from cpbench.bench.compiler import Compiler
from cpbench.bench.desk import Case
from cpbench.bench.outcome import Outcome, Predecessor, Result, conversion_row, iqr, remembered, repeat_times
from cpbench.bench.planning.plan import PREVIOUS, Limits, Pair, Request
from cpbench.bench.processes import wire
from cpbench.bench.processes.launch import context
from cpbench.bench.processes.process import Child, Died, TimedOut, crowded
from cpbench.bench.referee import PROOF_SECONDS
from cpbench.bench.staff import Referee, Setting, Workers, hear, obituary
from cpbench.bench.time_limits import GRACE, LOAD, REFEREE
from cpbench.errors import CpbenchError, NotApplicable
from cpbench.formulations.base import Kind
from cpbench.solvers.base import Trait, solvers
from cpbench.solvers.external import folder
from cpbench.temporary import RUN, TemporaryHome
from cpbench.verification import PROVEN

FELL_BACK = "cold: the step before was"
"""How `started` begins where a step had no answer to start from."""
FULL = 0.25
"""Share of the memory limit a worker may hold after a solve; beyond it, the next solve gets a fresh worker."""


class Refused(CpbenchError):
    """A file is no problem that a plan could take: it says why."""


class Unread(CpbenchError):
    """Nobody could say what a file holds: whoever read it died, ran out of time or of memory."""


class NoStart(Exception):
    """There is no point to start from; message and status become the row's."""

    def __init__(self, message: str, status: str = "unsupported") -> None:
        self.status = status
        super().__init__(message)


class Lane:
    """The processes of one lane. Use as a context manager; leaving it kills them all."""

    def __init__(self, setting: Setting | None = None) -> None:
        self.setting = setting = setting or Setting()
        self._scratch = TemporaryHome(RUN)
        means = context(setting.threads, few=setting.single)
        self.referee = Referee(means, setting, self._scratch.folder)
        self.workers = Workers(means, setting, self._scratch.folder)
        idle = sorted({*machine.cores()} - {*setting.cpus}) if setting.cpus and setting.lanes == 1 else []
        self.compiler = Compiler(means, idle)

    def __enter__(self) -> Lane:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Kill every process and remove the temporary files; harmless when done before."""
        self.compiler.close()
        self.workers.close()
        self.referee.close()
        self._scratch.remove()
        folder.remove_abandoned()  # what killed workers had handed to programs of their own

    def interrupt(self) -> None:
        """Kill what is at work, from another thread than the lane's, which then meets the dead."""
        for child in (*self.workers.children, self.referee.child):
            if child is not None:
                child.strike()

    def survey(
        self,
        address: str,
        requests: Sequence[Request],
        format: str | None = None,
        timeout: float = 0.0,
        *,
        guesses: bool = False,
    ) -> dict[str, Any]:
        """Facts of a problem for the plan; raises Refused, Unread. `timeout` : of a solve. `guesses` : whether the
        starting points of its file are counted, too."""
        reply, _ = self.referee.ask(
            REFEREE.limit(timeout),
            command="survey",
            address=address,
            format=format,
            requests=[r.header for r in requests],
            guesses=guesses,
        )
        if reply["event"] == "refused":
            raise Refused(reply["message"])
        if reply["event"] != "surveyed":
            raise Unread(f"{address}: {reply.get('message', reply['event'])}")
        return {**reply, "address": address, "format": format}

    def start(
        self,
        names: Iterable[str],
        limits: Limits,
        progress: Callable[[str, str], None] = lambda event, name: None,
        *,
        patient: bool = True,
    ) -> set[str]:
        """Start the workers and wait until every one has warmed up, so that none disturbs a measurement.

        limits : of the solves to come. progress : called with `start` and a name where a process begins, and with
        `compiling` where kernels are not in the cache yet. patient : whether these are waited for; else they are
        compiled where nothing is timed, if there is such a core, and their solvers are returned.
        """
        waiting = set[str]()
        for name in names:
            if self.compiler.waits(name) and not patient:
                waiting.add(name)
                continue
            wait = patient or not self.compiler.takes(name)
            if not self.workers.ready(name, limits.memory):
                progress("start", name)
            told = lambda name=name: progress("compiling", name)  # noqa: E731
            worker = self.workers.get(name, limits.memory, limits.seconds, told, patient=wait)
            if worker is None and name not in self.workers.unavailable:
                self.compiler.add(name)
                waiting.add(name)
        return waiting

    def prepare(self, pair: Pair) -> dict[str, Any]:
        """Bring the pair's problem to its solver's node; the referee's reply, whatever it is.

        A problem that cannot be loaded, or is not the one that was planned, is told apart by `stage`.
        """
        seconds = REFEREE.limit(pair.limits.seconds)
        opened, _ = self.referee.ask(seconds, command="open", **_problem_of(pair))
        if opened["event"] != "opened":
            return {**opened, "stage": "loading"}
        reply, _ = self.referee.ask(seconds, command="prepare", case=Case.header(pair))
        return reply

    def run(self, pair: Pair, prepared: Mapping[str, Any], before: Predecessor | None = None) -> Outcome:
        """The outcome of one pair. Never raises for anything that a solver, a conversion or a file does."""
        begun = time.perf_counter()
        row = conversion_row(prepared)
        try:
            outcome = self._run(pair, prepared, before, row) if not row["status"] else Outcome(row)
        except Exception as noise:  # a worker may say anything, and fail us in ways that nobody thought of
            self.workers.drop(pair.entry.solver)
            message = f"the worker sent no valid message: {type(noise).__name__}: {noise}"[:500]
            outcome = Outcome({**row, "status": "error", "message": message})
        self.workers.served(pair.entry.solver)
        about = {
            "wall": time.perf_counter() - begun,
            "jobs": self.setting.lanes,
            "loadavg": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        }
        return replace(outcome, row={**outcome.row, **about})

    def _run(self, pair: Pair, prepared: Mapping[str, Any], before: Predecessor | None, row: dict[str, Any]) -> Outcome:
        """The outcome; `row` is filled on the way, for what the worker says may be no message (any exception)."""
        name, limit = pair.entry.solver, pair.limits.seconds
        try:
            start, row["started"] = self._start_of(pair, before)
        except NoStart as why:
            return Outcome({**row, "status": why.status, "message": str(why)})
        worker = self.workers.get(name, pair.limits.memory, limit)
        if worker is None:
            state, detail = self.workers.unavailable[name]
            return Outcome({**row, "status": "unavailable", "message": f"{state}: {detail}"})
        row["version"] = self.workers.versions[name]
        promises = (Kind(row["kind"]), solvers.get(name).spec.kind)
        row["kind"] = str(max(promises, key=lambda kind: kind.rank))
        try:
            worker.forget()
            held = self.workers.holds(name, prepared["path"])
            asked = {
                "path": prepared["path"],
                "checksum": prepared["checksum"],
                "held": held,
                "budget": {"tolerance": prepared["tolerance"], "seconds": limit},
                "options": dict(pair.entry.options),
                "repeats": pair.limits.repeats,
                "history": pair.limits.history and Trait.HISTORY in solvers.get(name).spec.traits,
            }
            over = time.monotonic() + LOAD.limit(limit)
            worker.send(wire.pack(asked, start), LOAD.limit(limit))
            reply: dict[str, Any] = {"event": "loaded", "load": 0.0}
            if not held:
                reply, _ = hear(worker, over - time.monotonic())
            if reply["event"] == "loaded":
                row["load"] = float(reply["load"])
                self.workers.loaded(name, prepared["path"])
                begun = time.perf_counter()
                reply, vectors = hear(worker, limit + GRACE)
                if reply["event"] == "result":
                    result = Result.from_message(reply, time.perf_counter() - begun)
                    if result.children > self.setting.processes:
                        raise Died(None, worker.output(), reason=crowded(self.setting.processes))
                    return self._answered(pair, row, result, vectors, worker, asked["history"])
        except TimedOut:
            self.workers.drop(name)
            if "load" not in row:  # the solver was not asked yet
                message = f"loading: not over after {LOAD.limit(limit):g} s ({LOAD.what})"
                return Outcome({**row, "status": "error", "message": message})
            return Outcome({**row, "status": "timeout", "message": f"killed after {limit:g} s", "solve": limit})
        except Died as death:
            self.workers.drop(name)
            status = "memout" if death.out_of_memory else "crash"
            ending = {"message": obituary(death), "signal": death.signal, "code": death.code}
            return Outcome({**row, "status": status, **ending})
        if reply["event"] == "memory":
            self.workers.drop(name)  # what is left of its memory is not worth trusting
            return Outcome({**row, "status": "memout", "message": f"over {pair.limits.memory} bytes"})
        status = reply["event"] if reply["event"] in ("unsupported", "unavailable") else "error"
        if status == "error":
            self.workers.drop(name)  # nobody has looked at what it left behind
        told = str(reply.get("message", reply["event"]))[: worker_process.WORDS]
        return Outcome({**row, "status": status, "message": told})

    def _start_of(self, pair: Pair, before: Predecessor | None) -> tuple[Mapping[str, Any] | None, str]:
        """Vectors of the point to start from, and what the row tells of it; raises NoStart."""
        if pair.start == "cold":
            return None, "cold"
        spec = solvers.get(pair.entry.solver).spec
        if Trait.WARM_START not in spec.traits:
            raise NoStart(f"{spec.name} takes no starting point, and a cold start is not what was asked for")
        if pair.start == PREVIOUS and pair.scene is None:
            raise NoStart("start previous: the problem is no step of a sequence (cpbench pack --sequence makes one)")
        if pair.start == PREVIOUS and (before is None or before.answer is None):
            return None, "cold: first step" if before is None else f"{FELL_BACK} {before.status}"
        earlier = None
        if before is not None:
            earlier = {"address": before.address, "format": before.format, "fingerprint": before.fingerprint}
        reply, vectors = self.referee.ask(
            REFEREE.limit(pair.limits.seconds),
            {"answer": before.answer} if before is not None and before.answer is not None else None,
            command="start",
            case=Case.header(pair),
            policy=pair.start,
            before=earlier,
        )
        if reply["event"] != "started":
            known = reply["event"] == "refused" and reply.get("cause") == NotApplicable.__name__
            status = "unsupported" if known else "memout" if reply["event"] == "memory" else "error"
            raise NoStart(f"{'' if known else 'start: '}{reply.get('message', reply['event'])}", status)
        return vectors, str(reply["told"])

    def _answered(
        self,
        pair: Pair,
        row: dict[str, Any],
        result: Result,
        vectors: dict[str, Any],
        worker: Child,
        recorded: bool,
    ) -> Outcome:
        """The rest of a row whose worker returned: repeats, the history, the verdict."""
        setups, solves, lost = self._repeated(pair, result, worker)
        trail: tuple[dict[str, Any], dict[str, Any]] | None = None
        if recorded and not lost:
            trail, lost = self._recorded(pair, worker)
        if (
            result.children
            or result.wrote
            or result.threads > pair.limits.threads
            or 0 < pair.limits.memory * FULL < result.grown
        ):
            self.workers.drop(pair.entry.solver)  # what one problem left behind must not count against the next
        once = remembered(solves)
        marks = (*result.flags(pair.limits.threads), ("repeat", bool(lost)), ("remembered", once))
        told = [flag for flag, holds in marks if holds]
        row |= {
            "claim": result.claim,
            "counters": json.dumps(result.counters),
            "setup": statistics.median(setups),
            "solve": solves[0] if once else statistics.median(solves),
            "cpu": result.cpu,
            "peak": result.peak,
            "reported": result.reported,
            "repeats": len(solves),
            "samples": json.dumps([float(f"{s:.6g}") for s in solves]),
            "solve_min": min(solves),
            "solve_iqr": iqr(solves),
            "flags": ",".join(told),
        }
        case = Case.header(pair)
        reply, extra = self.referee.ask(
            REFEREE.limit(pair.limits.seconds),
            vectors,
            command="judge",
            case=case,
            claim=result.claim,
            answered=result.answered,
            promise=str(solvers.get(pair.entry.solver).spec.kind),
            proof_seconds=min(pair.limits.seconds / 2, PROOF_SECONDS),
        )
        if reply["event"] != "judged":
            message = f"the answer could not be judged: {reply.get('message', reply['event'])}"
            return Outcome({**row, "status": "error", "message": "; ".join(filter(None, (message, lost)))})
        row |= {
            "status": reply["status"],
            "message": "; ".join(filter(None, (reply["message"], result.message, lost))),
            "error": reply["error"],
            "target_error": reply["target_error"],
            "flags": ",".join([*reply["flags"], *told]),
            "parts": json.dumps(reply["parts"]),
            "lift": reply["lift"],
            "verify": reply["verify"],
        }
        if result.setup + result.solve > pair.limits.seconds:
            row |= {"status": "timeout", "message": f"answered after the limit of {pair.limits.seconds:g} s"}
        history = None
        if trail is not None:
            header, snapshots = trail
            judged, blobs = self.referee.ask(
                REFEREE.limit(pair.limits.seconds), snapshots, command="judge_history", case=case, trail=header
            )
            history = blobs.get("history") if judged["event"] == "history" else None
        proof = extra.get("proof") if row["status"] in PROVEN else None
        return Outcome(row, extra.get("answer"), history, proof)

    def _repeated(self, pair: Pair, result: Result, worker: Child) -> tuple[list[float], list[float], str]:
        """Setup and solve times of the first solve and its repeats, and what became of repeats that failed.

        The first answer stands whatever happens to a repeat, with its own times. It is judged after the repeats:
        the referee at work beside them would spoil the times.
        """
        setups, solves = [result.setup], [result.solve]
        more = pair.limits.repeats - 1
        if more < 1 or result.wrote or result.setup + result.solve >= worker_process.SHORT:
            return setups, solves, ""
        reply, _, lost = self._next(worker, pair, more * (pair.limits.seconds + GRACE), "repeat")
        if reply is not None and reply["event"] == "repeats":
            try:
                times = repeat_times(reply["times"], more)
            except (KeyError, TypeError, ValueError, OverflowError) as noise:
                self.workers.drop(pair.entry.solver)
                return setups, solves, f"a repeat failed: no valid message: {noise}"
            setups += [setup for setup, _ in times]
            solves += [solve for _, solve in times]
        return setups, solves, lost

    def _recorded(self, pair: Pair, worker: Child) -> tuple[tuple[dict[str, Any], dict[str, Any]] | None, str]:
        """The iterates of a solve that was recorded, after all that were timed."""
        reply, vectors, lost = self._next(worker, pair, pair.limits.seconds + GRACE, "history")
        return ((reply, vectors) if reply is not None and reply["event"] == "history" else None), lost

    def _next(
        self, worker: Child, pair: Pair, patience: float, what: str
    ) -> tuple[dict[str, Any] | None, dict[str, Any], str]:
        """One more message of a worker that has answered; what it did instead does not cost the answer."""
        try:
            reply, vectors = hear(worker, patience)
            if reply["event"] != "memory":
                told = "" if reply["event"] in ("repeats", "history") else str(reply.get("message", reply["event"]))
                if told:
                    self.workers.drop(pair.entry.solver)
                return reply, vectors, told and f"a {what} failed: {told}"
            lost = f"over {pair.limits.memory} bytes"
        except TimedOut:
            lost = f"killed after {patience:g} s"
        except Died as death:
            lost = obituary(death)
        except (wire.WireError, KeyError, TypeError, ValueError) as noise:
            lost = f"no valid message: {noise}"
        self.workers.drop(pair.entry.solver)
        return None, {}, f"a {what} failed: {lost}"


def _problem_of(pair: Pair) -> dict[str, Any]:
    """What every message about a pair says of its problem."""
    return {"address": pair.address, "format": pair.format, "fingerprint": pair.fingerprint}
