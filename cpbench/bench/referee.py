"""The process that converts problems, lifts answers and judges them. It shares nothing with the solvers.

It holds one problem at a time, the one whose block of pairs is being run: every conversion of it is done
once, written to the scratch folder for the solvers to load, and kept here to lift their answers.
"""

from __future__ import annotations

import math
import time
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from cpbench import graph, storage, verification
from cpbench.bench import starts
from cpbench.bench.desk import Case, Desk, Prepared
from cpbench.bench.history import Trail, coarse_to_fine
from cpbench.bench.judging import judge_answer, look_for_proof
from cpbench.bench.planning.features import features
from cpbench.bench.planning.plan import parse_request
from cpbench.bench.processes import wire
from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.launch import limit_memory
from cpbench.bench.results import answers
from cpbench.conversions import Conversion
from cpbench.errors import CpbenchError, PointError
from cpbench.formulations.base import Kind, Problem

HISTORY_SECONDS = 30.0
"""Seconds after which no further iterate of a history is judged; those that were are spread over the whole."""
PROOF_SECONDS = 20.0
"""The most seconds in which a proof is looked for, that the problem that was asked has no solution."""


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


class Referee:
    """The commands that the runner gives, each with its reply; `case` is a `Case` as it came in the message."""

    def __init__(self, scratch: Path) -> None:
        self._desk = Desk(scratch)
        self._attempts: tuple[str, dict[str, verification.Attempt]] = ("", {})

    def survey(
        self, _: Any, address: str, format: str | None, requests: list[dict[str, Any]], guesses: bool = False
    ) -> bytes:
        """What a plan needs to know of a problem, with the nodes whose first edge is open, by request."""
        problem = self._desk.open(address, format)
        open_nodes = {r["name"]: _open_nodes(problem, r) for r in requests}
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
                "guesses": len(storage.guesses(address)) if guesses else 0,
            }
        )

    def open(self, _: Any, address: str, format: str | None, fingerprint: str) -> bytes:
        """Load the problem, unless it is the one that is held; refuses another one than was planned."""
        self._desk.open(address, format, fingerprint)
        return wire.pack({"event": "opened"})

    def prepare(self, _: Any, case: dict[str, Any]) -> bytes:
        """Bring the problem to the node along the request; the reply names the file that solvers load."""
        asked = Case(**case)
        _, ready = self._desk.ready(asked)
        return wire.pack(
            {
                "event": "prepared",
                "path": ready.path,
                "checksum": ready.checksum,
                "route": ready.label,
                "kind": str(ready.kind),
                "convert": ready.seconds,
                "tolerance": graph.tolerance(ready.problem, asked.tolerance, ready.steps),
            }
        )

    def start(self, vectors: dict[str, Any], case: dict[str, Any], policy: str, before: dict[str, Any] | None) -> bytes:
        """The point that a solver is to start from, on the converted problem; refuses where there is none.

        `before` names the step before, whose kept answer comes with the message.
        """
        asked = Case(**case)
        source, prepared = self._desk.ready(asked)
        earlier = None
        if before is not None:
            earlier = starts.step_before(**before, answer=answers.unpack(vectors["answer"]))
        begin = starts.start(
            starts.parse_start(policy),
            source,
            asked.address,
            prepared.problem,
            prepared.steps,
            tolerance=asked.tolerance,
            before=earlier,
        )
        found = begin.point.arrays() if begin.point is not None else {}
        return wire.pack({"event": "started", "told": begin.told}, found)

    def judge(
        self,
        vectors: dict[str, Any],
        case: dict[str, Any],
        claim: str,
        answered: bool,
        promise: str = Kind.EQUIVALENT,
        proof_seconds: float = PROOF_SECONDS,
    ) -> bytes:
        """Lift the answer, measure it on the problem that was asked, and give the row its status (`judge_answer`).

        A claim that there is no solution gets `proof_seconds` for its proof.
        """
        asked = Case(**case)
        source, prepared = self._desk.ready(asked)
        certificate = vectors.pop("certificate", None)
        found = judge_answer(
            source,
            prepared.problem,
            prepared.steps,
            vectors if answered else None,
            tolerance=asked.tolerance,
            claim=claim,
            kind=prepared.kind,
            promise=Kind(promise),
            measure=asked.measure,
            prove=lambda: look_for_proof(
                partial(self._attempt, source), not prepared.steps, claim, certificate, proof_seconds
            ),
        )
        return wire.pack(
            {
                "event": "judged",
                "status": str(found.status),
                "message": found.message,
                "error": found.verdict.error,
                "target_error": None if found.target is None else found.target.error,
                "flags": found.flags,
                "parts": {**found.verdict.judged, **found.verdict.parts},
                "lift": found.lift,
                "verify": found.verify,
            },
            ({} if found.point is None else {"answer": answers.pack(found.point)})
            | ({} if found.proof is None else {"proof": verification.packed(found.proof)}),
        )

    def _attempt(self, source: Problem, kind: str, certificate: Any, seconds: float) -> verification.Attempt:
        """A proof of this kind; it is found once, and not found once without a certificate."""
        held, attempts = self._attempts
        if held != source.fingerprint:
            attempts.clear()
            self._attempts = (source.fingerprint, attempts)
        known = attempts.get(kind)
        if known is None or (known.proof is None and certificate is not None):
            known = verification.prove(source, kind, certificate, seconds)
            if certificate is None or known.proof is not None:
                attempts[kind] = known
        return known

    def judge_history(
        self,
        vectors: dict[str, Any],
        case: dict[str, Any],
        trail: dict[str, Any],
        seconds: float = HISTORY_SECONDS,
    ) -> bytes:
        """Lift and measure the iterates of a recorded solve on the problem that was asked, as many as time permits."""
        asked = Case(**case)
        source, prepared = self._desk.ready(asked)
        recorded = Trail.from_message(trail, vectors, sum(prepared.problem.point_sizes.values()))
        errors: dict[int, tuple[float, tuple[str, ...]]] = {}
        begun = time.perf_counter()
        for place in coarse_to_fine(len(recorded.iterates)):
            if errors and time.perf_counter() - begun > seconds:
                break
            errors[place] = _measured(source, prepared, recorded.iterates[place], asked.measure)
        return wire.pack(
            {"event": "history", "judged": len(errors), "of": len(recorded.iterates)},
            {"history": recorded.judged(errors).pack()},
        )


def _open_nodes(problem: Problem, request: dict[str, Any]) -> list[str]:
    """Nodes that some route of the request reaches, as far as its first edge tells."""
    kinds, via = parse_request(request)
    nodes: list[str] = []
    for node in graph.formulations.names():
        if request["nodes"] and node not in request["nodes"]:
            continue
        routes = _routes(problem.node, node, kinds, via)
        if any(not r.steps or r.steps[0].obstacle(problem) is None for r in routes):
            nodes.append(node)
    return nodes


@lru_cache(maxsize=2**12)
def _routes(source: str, target: str, kinds: frozenset[Kind], via: tuple[Conversion, ...]) -> tuple[graph.Route, ...]:
    """Paths between nodes, found once for all problems of a node."""
    return tuple(graph.candidates(source, target, kinds, via))


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
