"""The process that converts problems, lifts answers and judges them. It shares nothing with the solvers.

It holds one problem at a time, the one whose block of pairs is being run: every conversion of it is done
once, written to the scratch folder for the solvers to load, and kept here to lift their answers.
"""

from __future__ import annotations

import copy
import io
import math
import os
import sys
import time
import zlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cpbench import graph, storage, verification
from cpbench.bench import starts
from cpbench.bench.history import Trail, coarse_to_fine
from cpbench.bench.planning.features import features
from cpbench.bench.processes import wire
from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.launch import limit_memory
from cpbench.conversions import Conversion, make
from cpbench.errors import CpbenchError, PointError, ProblemError
from cpbench.formulations.base import Kind, Problem

HISTORY_SECONDS = 30.0
"""Seconds after which no further iterate of a history is judged; those that were are spread over the whole."""


def main(connection: Channel, scratch: str, memory: int) -> None:
    """Serve `survey`, `open`, `prepare` and `judge` until the runner closes the pipe, within `memory` bytes."""
    limit_memory(memory)
    referee = Referee(Path(scratch))
    while True:
        try:
            header, vectors = wire.unpack(connection.recv_bytes())
        except EOFError:
            return
        try:
            reply = getattr(referee, header.pop("command"))(vectors, **header)
        except CpbenchError as refusal:
            reply = wire.pack({"event": "refused", "cause": type(refusal).__name__, "message": str(refusal)})
        except MemoryError:
            reply = wire.pack({"event": "memory"})
        except Exception as error:
            reply = wire.pack({"event": "error", "message": f"{type(error).__name__}: {error}"})
        connection.send_bytes(reply)


@dataclass
class Prepared:
    """A problem brought to a node: what solvers load, and what lifts their answers."""

    problem: Problem
    kind: Kind
    label: str
    steps: int
    seconds: float
    path: str


class Referee:
    """One problem, its conversions and its judge."""

    def __init__(self, scratch: Path) -> None:
        self._scratch = scratch
        self._address = ""
        self._source: Problem | None = None
        self._prepared: dict[str, Prepared] = {}
        self._conversions = _Charged()
        self._files = 0

    def survey(self, _: Any, address: str, format: str | None, requests: list[dict[str, Any]]) -> bytes:
        """What a plan needs to know of a problem, with the nodes whose first edge is open, by request."""
        problem = self._open(address, format)
        open_nodes = {r["name"]: self._open_nodes(problem, r) for r in requests}
        sequence = getattr(problem, "sequence", None)
        return wire.pack(
            {
                "event": "surveyed",
                "problem": problem.name,
                "fingerprint": problem.fingerprint,
                "node": problem.node,
                "family": problem.info.family,
                "sizes": problem.sizes(),
                "features": features(problem),
                "nodes": open_nodes,
                "sequence": sequence.name if sequence else "",
                "step": sequence.step if sequence else 0,
            }
        )

    def open(self, _: Any, address: str, format: str | None, fingerprint: str) -> bytes:
        """Load the problem, unless it is the one that is held; refuses another one than was planned."""
        self._open(address, format, fingerprint)
        return wire.pack({"event": "opened"})

    def prepare(
        self,
        _: Any,
        address: str,
        format: str | None,
        fingerprint: str,
        node: str,
        request: dict[str, Any],
        tolerance: float,
    ) -> bytes:
        """Bring the problem to `node` along the request; the reply names the file that solvers load."""
        problem = self._open(address, format, fingerprint)
        key = f"{request['name']}>{node}"
        ready = self._prepared.get(key) or self._bring(problem, node, request)
        self._prepared[key] = ready
        return wire.pack(
            {
                "event": "prepared",
                "path": ready.path,
                "route": ready.label,
                "kind": str(ready.kind),
                "convert": ready.seconds,
                "tolerance": graph.tolerance(ready.problem, tolerance, ready.steps),
            }
        )

    def start(
        self,
        vectors: dict[str, Any],
        address: str,
        format: str | None,
        fingerprint: str,
        node: str,
        request: dict[str, Any],
        tolerance: float,
        policy: str,
        before: dict[str, Any] | None,
    ) -> bytes:
        """The point that a solver is to start from, on the converted problem; refuses where there is none.

        `before` names the step before, whose kept answer comes with the message.
        """
        source = self._open(address, format, fingerprint)
        prepared = self._ready(address, format, fingerprint, node, request, tolerance)
        earlier = starts.step_before(**before, answer=unblob(vectors["answer"])) if before is not None else None
        begin = starts.start(
            starts.parse_start(policy),
            source,
            address,
            prepared.problem,
            prepared.steps,
            tolerance=tolerance,
            before=earlier,
        )
        vectors = begin.point.arrays() if begin.point is not None else {}
        return wire.pack({"event": "started", "told": begin.told}, vectors)

    def judge(
        self,
        vectors: dict[str, Any],
        address: str,
        format: str | None,
        fingerprint: str,
        node: str,
        request: dict[str, Any],
        claim: str,
        answered: bool,
        tolerance: float,
        measure: str | None = None,
    ) -> bytes:
        """Lift the answer, measure it on the problem that was asked, and give the row its status."""
        source = self._open(address, format, fingerprint)
        prepared = self._ready(address, format, fingerprint, node, request, tolerance)
        certificate = vectors.pop("certificate", None)
        proven = prepared.kind == Kind.EQUIVALENT and verification.certified_infeasible(prepared.problem, certificate)
        lifted = verified = 0.0
        answer: Any = None
        message = ""
        verdict = verification.no_answer(tolerance)
        if answered:
            try:
                begun = time.perf_counter()
                target = prepared.problem.point_type(**vectors)
                prepared.problem.check_point(target)
                answer = graph.lift(prepared.problem, target, prepared.steps)
                between = time.perf_counter()
                verdict = verification.judge(source, answer, tolerance, measure)
                lifted, verified = between - begun, time.perf_counter() - between
            except (PointError, TypeError) as refusal:
                message, answer = f"the answer is none: {refusal}", None
        status = verification.status(verdict, claim, proven_infeasible=proven)
        return wire.pack(
            {
                "event": "judged",
                "status": str(verification.Status.ERROR if message else status),
                "message": message,
                "error": verdict.error,
                "flags": list(verdict.flags),
                "parts": {**verdict.judged, **verdict.parts},
                "lift": lifted,
                "verify": verified,
            },
            {"answer": _blob(answer)} if answer is not None else None,
        )

    def judge_history(
        self,
        vectors: dict[str, Any],
        address: str,
        format: str | None,
        fingerprint: str,
        node: str,
        request: dict[str, Any],
        tolerance: float,
        trail: dict[str, Any],
        measure: str | None = None,
        seconds: float = HISTORY_SECONDS,
    ) -> bytes:
        """Lift and measure the iterates of a recorded solve on the problem that was asked, as many as time permits."""
        source = self._open(address, format, fingerprint)
        prepared = self._ready(address, format, fingerprint, node, request, tolerance)
        recorded = Trail.from_message(trail, vectors, sum(prepared.problem.point_sizes.values()))
        errors: dict[int, tuple[float, tuple[str, ...]]] = {}
        begun = time.perf_counter()
        for place in coarse_to_fine(len(recorded.iterates)):
            if errors and time.perf_counter() - begun > seconds:
                break
            errors[place] = _measured(source, prepared, recorded.iterates[place], measure)
        return wire.pack(
            {"event": "history", "judged": len(errors), "of": len(recorded.iterates)},
            {"history": recorded.judged(errors).pack()},
        )

    def _open(self, address: str, format: str | None, fingerprint: str = "") -> Problem:
        if self._address != address or self._source is None:
            for prepared in self._prepared.values():
                Path(prepared.path).unlink(missing_ok=True)
            self._prepared, self._conversions, self._source = {}, _Charged(), None
            self._source = storage.load(address, format=format)
            self._address = address
        source = self._source
        assert source is not None
        if fingerprint and source.fingerprint != fingerprint:
            raise ProblemError(
                address,
                f"the file changed after it was planned: fingerprint {source.fingerprint}, planned {fingerprint}; "
                "run the same command again to plan what it holds now",
            )
        return source

    def _ready(
        self, address: str, format: str | None, fingerprint: str, node: str, request: dict[str, Any], tolerance: float
    ) -> Prepared:
        """What `prepare` made, made again by a referee that replaces one that died."""
        key = f"{request['name']}>{node}"
        if key not in self._prepared:
            self.prepare(None, address, format, fingerprint, node, request, tolerance)
        return self._prepared[key]

    def _bring(self, problem: Problem, node: str, request: dict[str, Any]) -> Prepared:
        """Convert the problem and write what solvers load."""
        kinds, via = parse_request(request)
        arrival = graph.arrive(problem, node, kinds, via, self._conversions)
        # workers keep a loaded problem by its path: a referee that replaces a dead one must not reuse its names
        path = self._scratch / f"problem-{os.getpid()}-{self._files}.h5"
        self._files += 1
        storage.save(arrival.problem, path, compress=False, force=True)
        return Prepared(
            arrival.problem,
            arrival.kind,
            arrival.route.label,
            len(arrival.route.steps),
            self._conversions.seconds(problem, arrival.route),  # not of dead ends before it
            str(path),
        )

    def _open_nodes(self, problem: Problem, request: dict[str, Any]) -> list[str]:
        kinds, via = parse_request(request)
        nodes: list[str] = []
        for node in graph.formulations.names():
            if request["nodes"] and node not in request["nodes"]:
                continue
            routes = graph.candidates(problem.node, node, kinds, via)
            if any(not r.steps or r.steps[0].obstacle(problem) is None for r in routes):
                nodes.append(node)
        return nodes


def _measured(source: Problem, prepared: Prepared, x: Any, measure: str | None) -> tuple[float, tuple[str, ...]]:
    """Error of a solver's vector on the problem that was asked, with the flags of a tolerance that it just meets."""
    try:
        answer = graph.lift(prepared.problem, prepared.problem.point_from_vector(x), prepared.steps)
        error = verification.judge(source, answer, 0.0, measure).error
        if not math.isfinite(error):
            return math.inf, ()
        return error, verification.judge(source, answer, error, measure).flags
    except PointError:
        return math.inf, ()


class _Charged(graph.Memory):
    """Conversions, each done and timed once: whether the edge applies, what it promises, and the step.

    What was asked of a problem while routes were sought (a factorization, a least eigenvalue) stays with it; its
    conversion starts without, so that all it needs is in its time. One that had to load a compiled kernel, which
    happens once in a process and never again, is done once more.
    """

    def __call__(self, edge: Conversion, problem: Problem) -> Problem:
        key = (id(problem), edge.label)
        if key not in self._done:
            loaded = _kernels()
            converted, seconds = _timed(edge, problem)
            if _kernels() != loaded:
                converted, seconds = _timed(edge, problem)
            self._done[key] = (problem, converted, seconds)
        return self._done[key][1]


def _timed(edge: Conversion, problem: Problem) -> tuple[Problem, float]:
    fresh = _without_caches(problem)
    begun = time.perf_counter()
    edge.require(fresh)
    return edge.step(fresh), time.perf_counter() - begun


def _kernels() -> set[str]:
    """Modules of compiled loops that this process has."""
    return {name for name in sys.modules if name.startswith(("numba", "cpbench.conversions.kernels"))}


def _without_caches(problem: Problem) -> Problem:
    """The same problem, its data shared, without what cached properties keep except for its fingerprint."""
    fresh = copy.copy(problem)
    for name in [n for n in vars(fresh) if isinstance(getattr(type(fresh), n, None), cached_property)]:
        del vars(fresh)[name]
    vars(fresh)["fingerprint"] = problem.fingerprint  # a name for the provenance, no part of a conversion
    return fresh


def parse_request(request: dict[str, Any]) -> tuple[frozenset[Kind], tuple[Conversion, ...]]:
    """Kinds and pinned conversions of a route request."""
    via = tuple(make(name, dict(parameters)) for name, parameters in request["via"])
    return frozenset(Kind(k) for k in request["kinds"]), via


def _blob(point: Any) -> bytes:
    """The answer as one compressed .npy, parts one after the other (`Problem.point_from_vector` splits them)."""
    buffer = io.BytesIO()
    np.save(buffer, np.concatenate(list(point.arrays().values())), allow_pickle=False)
    return zlib.compress(buffer.getvalue(), 1)


def unblob(blob: bytes) -> Any:
    """The vector in a kept answer."""
    return np.load(io.BytesIO(zlib.decompress(blob)), allow_pickle=False)
