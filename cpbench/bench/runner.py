"""Runs a plan: one referee, one persistent worker a solver, hard limits, every pair a row.

Problems come in a seeded random order, and within the block of a problem its solvers do: a drift of the machine
then touches all solvers of a problem alike, and every conversion is done once and shared.
"""

from __future__ import annotations

import json
import random
import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cpbench.bench.referee as referee_process
import cpbench.bench.worker as worker_process
from cpbench.bench import wire
from cpbench.bench.plan import Pair, Request
from cpbench.bench.process import Child, Died, TimedOut, context
from cpbench.bench.scratch import Scratch
from cpbench.bench.store import Store
from cpbench.errors import CpbenchError
from cpbench.formulations.base import Kind
from cpbench.solvers.base import solvers

GRACE = 0.5
"""Seconds after the limit at which a process is killed."""
FULL = 0.25
"""Share of the memory limit a worker may hold after a solve; beyond it, the next solve gets a fresh worker."""
STARTUP = 600.0
"""Seconds a worker may take to import its guest and to compile (once a machine)."""
LOAD_LIMIT = 120.0
"""Seconds the loading of a problem may take; no solver is charged for it."""

REFEREE_SHARE = 2
"""How many times the memory limit of a worker the referee has: it holds a problem with all its conversions."""
REFEREE_LEAST = 2 * 2**30
"""Bytes the referee has at least, however little a solver is to get by on."""

Progress = Callable[[str, "Pair | None", Mapping[str, Any]], None]


@dataclass(frozen=True)
class Limits:
    """Wall-clock seconds and bytes of memory of one solve, threads, repeats of short solves."""

    seconds: float = 10.0
    memory: int = 4 * 2**30
    threads: int = 1
    repeats: int = 3

    @property
    def referee_memory(self) -> int:
        """Bytes that conversions and judging may take (0: no limit)."""
        return max(REFEREE_SHARE * self.memory, REFEREE_LEAST) if self.memory > 0 else 0


class Surveyed(CpbenchError):
    """A file was refused while planning; carries (address, reason)."""


class Session:
    """The processes of one run. Use as a context manager; leaving it kills them all."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self._ctx = context(limits.threads)
        self._scratch = Scratch()
        self._referee: Child | None = None
        self._workers: dict[str, Child] = {}
        self.versions: dict[str, str] = {}
        self.unavailable: dict[str, tuple[str, str]] = {}

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        for child in (*self._workers.values(), self._referee):
            if child is not None:
                child.kill()
        self._scratch.remove()

    # ----------------------------------------------------------------------------------------- referee

    def ask(self, seconds: float, vectors: Mapping[str, Any] | None = None, **header: Any) -> Any:
        """Send the referee a command; the reply's header and vectors. One that dies, hangs or is full is replaced."""
        if self._referee is None:
            arguments = (str(self._scratch.folder), self.limits.referee_memory)
            self._referee = Child(self._ctx, self._scratch.folder, referee_process.main, arguments)
        try:
            self._referee.output()
            self._referee.send(wire.pack(header, vectors))
            reply, found = wire.unpack(self._referee.receive(seconds))
            if reply["event"] != "memory":
                return reply, found
        except TimedOut:
            reply = {"event": "timeout", "message": f"no reply within {seconds:g} s"}
        except Died as death:
            reply = {"event": "memory" if death.out_of_memory else "died", "message": _obituary(death)}
        self._referee.kill()
        self._referee = None
        if reply["event"] == "memory":
            limit = self.limits.referee_memory
            reply["message"] = f"ran out of memory, limited to {limit} bytes" if limit else "ran out of memory"
        return reply, {}

    def survey(self, address: str, requests: Sequence[Request], format: str | None = None) -> dict[str, Any]:
        """Facts of a problem for the plan; raises CpbenchError with the reason a file is refused."""
        reply, _ = self.ask(
            LOAD_LIMIT, command="survey", address=address, format=format, requests=[r.header() for r in requests]
        )
        if reply["event"] != "surveyed":
            message = reply.get("message", reply["event"])
            raise Surveyed(message if reply["event"] == "refused" else f"{address}: {message}")
        return {**reply, "address": address}

    # ----------------------------------------------------------------------------------------- workers

    def start(self, names: Iterable[str], progress: Callable[[str], None] = lambda _: None) -> None:
        """Start the workers and wait until every one has warmed up, so that none disturbs a measurement."""
        for name in names:
            progress(name)
            self._worker(name)

    def _worker(self, name: str) -> Child | None:
        if name in self.unavailable:
            return None
        if name not in self._workers:
            child = Child(self._ctx, self._scratch.folder, worker_process.main, (name, self.limits.memory))
            try:
                reply, _ = wire.unpack(child.receive(STARTUP))
            except TimedOut:
                reply = {"event": "unavailable", "state": "broken", "detail": f"no sign of life within {STARTUP:g} s"}
            except Died as death:
                reply = {"event": "unavailable", "state": "broken", "detail": f"{death}: {death.output}"}
            if reply["event"] != "ready":
                child.kill()
                self.unavailable[name] = (reply["state"], reply["detail"])
                return None
            self._workers[name] = child
            self.versions[name] = reply["version"]
        return self._workers[name]

    def _drop(self, name: str) -> None:
        child = self._workers.pop(name, None)
        if child is not None:
            child.kill()

    # -------------------------------------------------------------------------------------------- pairs

    def prepare(self, pair: Pair, format: str | None = None) -> dict[str, Any]:
        """Bring the pair's problem to its solver's node; the referee's reply, whatever it is.

        A problem that cannot be loaded, or is not the one that was planned, is told apart by `stage`.
        """
        problem = _problem_of(pair, format)
        opened, _ = self.ask(LOAD_LIMIT, command="open", **problem)
        if opened["event"] != "opened":
            return {**opened, "stage": "loading"}
        reply, _ = self.ask(
            max(self.limits.seconds, LOAD_LIMIT),
            command="prepare",
            **problem,
            node=pair.target,
            request=pair.request.header(),
            tolerance=pair.tolerance,
        )
        return reply

    def run(
        self, pair: Pair, prepared: Mapping[str, Any], format: str | None = None
    ) -> tuple[dict[str, Any], bytes | None]:
        """One row (columns of the store) and the kept answer of one pair. Never raises for a solver's faults."""
        row = _conversion_row(prepared)
        if row["status"]:
            return row, None
        worker = self._worker(pair.entry.solver)
        if worker is None:
            state, detail = self.unavailable[pair.entry.solver]
            return {**row, "status": "unavailable", "message": f"{state}: {detail}"}, None
        row["version"] = self.versions[pair.entry.solver]
        promises = (Kind(row["kind"]), solvers.get(pair.entry.solver).spec.kind)
        row["kind"] = str(max(promises, key=lambda kind: kind.rank))
        limit = self.limits.seconds
        try:
            worker.output()
            worker.send(
                wire.pack(
                    {
                        "path": prepared["path"],
                        "budget": {"tolerance": prepared["tolerance"], "seconds": limit},
                        "options": dict(pair.entry.options),
                        "repeats": self.limits.repeats,
                    }
                )
            )
            reply, _ = wire.unpack(worker.receive(LOAD_LIMIT))
            if reply["event"] == "loaded":
                row["load"] = reply["load"]
                reply, vectors = wire.unpack(worker.receive(limit + GRACE))
                if reply["event"] == "result":
                    return self._judged(pair, row, reply, vectors, worker, format)
        except TimedOut:
            self._drop(pair.entry.solver)
            if "load" not in row:  # the solver was not asked yet
                message = f"loading: the worker did not read the converted problem within {LOAD_LIMIT:g} s"
                return {**row, "status": "error", "message": message}, None
            return {**row, "status": "timeout", "message": f"killed after {limit:g} s", "solve": limit}, None
        except Died as death:
            self._drop(pair.entry.solver)
            status = "memout" if death.out_of_memory else "crash"
            return {**row, "status": status, "message": _obituary(death), "signal": death.signal}, None
        except wire.WireError as noise:
            self._drop(pair.entry.solver)
            return {**row, "status": "error", "message": str(noise)}, None
        if reply["event"] == "memory":
            self._drop(pair.entry.solver)  # what is left of its memory is not worth trusting
            return {**row, "status": "memout", "message": f"over {self.limits.memory} bytes"}, None
        status = "unsupported" if reply["event"] == "unsupported" else "error"
        return {**row, "status": status, "message": reply.get("message", reply["event"])}, None

    def _judged(
        self,
        pair: Pair,
        row: dict[str, Any],
        result: dict[str, Any],
        vectors: dict[str, Any],
        worker: Child,
        format: str | None,
    ) -> tuple[dict[str, Any], bytes | None]:
        setups, solves, lost = self._repeated(pair, result, worker)
        if 0 < self.limits.memory * FULL < result["grown"]:
            self._drop(pair.entry.solver)  # what one problem left behind must not count against the next
        reply, extra = self.ask(
            max(self.limits.seconds, LOAD_LIMIT),
            vectors,
            command="judge",
            **_problem_of(pair, format),
            node=pair.target,
            request=pair.request.header(),
            claim=result["claim"],
            answered=result["answered"],
            tolerance=pair.tolerance,
        )
        row |= {
            "claim": result["claim"],
            "counters": json.dumps(result["counters"]),
            "setup": statistics.median(setups),
            "solve": statistics.median(solves),
            "cpu": result["cpu"],
            "repeats": len(solves),
            "solve_min": min(solves),
            "solve_iqr": _iqr(solves),
            "flags": "repeat" if lost else "",
        }
        if reply["event"] != "judged":
            message = f"the answer could not be judged: {reply.get('message', reply['event'])}"
            return {**row, "status": "error", "message": "; ".join(filter(None, (message, lost)))}, None
        row |= {
            "status": reply["status"],
            "message": "; ".join(filter(None, (reply["message"], result["message"], lost))),
            "error": reply["error"],
            "flags": ",".join([*reply["flags"], *filter(None, [row["flags"]])]),
            "parts": json.dumps(reply["parts"]),
            "lift": reply["lift"],
            "verify": reply["verify"],
        }
        if result["setup"] + result["solve"] > self.limits.seconds:
            row |= {"status": "timeout", "message": f"answered after the limit of {self.limits.seconds:g} s"}
        return row, extra.get("answer")

    def _repeated(self, pair: Pair, result: Mapping[str, Any], worker: Child) -> tuple[list[float], list[float], str]:
        """Setup and solve times of the first solve and its repeats, and what became of repeats that failed.

        The first answer stands whatever happens to a repeat, with its own times. It is judged after the repeats:
        the referee at work beside them would spoil the times.
        """
        setups, solves = [result["setup"]], [result["solve"]]
        more = self.limits.repeats - 1
        if more < 1 or result["setup"] + result["solve"] >= worker_process.SHORT:
            return setups, solves, ""
        patience = more * (self.limits.seconds + GRACE)
        lost = ""
        try:
            reply, _ = wire.unpack(worker.receive(patience))
            if reply["event"] == "repeats":
                setups += [setup for setup, _, _ in reply["times"]]
                solves += [solve for _, solve, _ in reply["times"]]
            elif reply["event"] == "memory":
                lost = f"over {self.limits.memory} bytes"
            else:  # an exception, after which the worker goes on
                return setups, solves, f"a repeat failed: {reply.get('message', reply['event'])}"
        except TimedOut:
            lost = f"killed after {patience:g} s"
        except Died as death:
            lost = _obituary(death)
        except wire.WireError as noise:
            lost = str(noise)
        if lost:
            self._drop(pair.entry.solver)
            lost = f"a repeat failed: {lost}"
        return setups, solves, lost


def execute(
    session: Session,
    store: Store,
    planned: Sequence[Pair],
    seed: int,
    progress: Progress = lambda event, pair, row: None,
    format: str | None = None,
) -> None:
    """Run every planned pair that the store has not run yet."""
    pending = store.pending()
    todo = [p for p in planned if p.key in pending]
    if not todo:
        return
    names = sorted({p.entry.solver for p in todo})
    session.start(names, lambda name: progress("start", None, {"solver": name}))
    draw = random.Random(seed)
    blocks: dict[str, list[Pair]] = {}
    for pair in sorted(todo, key=lambda p: p.key):
        blocks.setdefault(pair.address, []).append(pair)
    addresses = sorted(blocks)
    draw.shuffle(addresses)
    for address in addresses:
        block = blocks[address]
        draw.shuffle(block)
        prepared: dict[tuple[str, str], dict[str, Any]] = {}
        for pair in block:
            where = (pair.request.name, pair.target)
            if where not in prepared:
                prepared[where] = session.prepare(pair, format)
            progress("solve", pair, {})
            row, answer = session.run(pair, prepared[where], format)
            store.finish(pair.key, {**row, "finished": time.strftime("%Y-%m-%dT%H:%M:%S")}, answer)
            progress("done", pair, row)


def _problem_of(pair: Pair, format: str | None) -> dict[str, Any]:
    """What every message about a pair says of its problem."""
    return {"address": pair.address, "format": format, "fingerprint": pair.fingerprint}


def _conversion_row(prepared: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a row that the referee decides; `status` is empty when a solver may go on."""
    event = prepared["event"]
    if event == "prepared":
        return {
            "status": "",
            "route": prepared["route"],
            "kind": prepared["kind"],
            "convert": prepared["convert"],
        }
    stage = prepared.get("stage", "conversion")
    told = {"refused": "unsupported", "timeout": "timeout", "memory": "memout"}
    if stage == "loading":  # in which no solver has a part
        told = {"memory": "memout"}
    status = told.get(event, "error")
    return {"status": status, "message": f"{stage}: {prepared.get('message', event)}"}


def _obituary(death: Died) -> str:
    return f"{death.cause}: {death.output}" if death.output else death.cause


def _iqr(values: Sequence[float]) -> float:
    if len(values) < 2:
        return 0.0
    quartiles = statistics.quantiles(values, n=4, method="inclusive")
    return quartiles[2] - quartiles[0]
