"""The process that converts problems, lifts answers and judges them; it shares no memory with solvers.

It holds one problem at a time, that of the block being run: every conversion of it is done once, timed, written to the
scratch folder for the solvers to load, and kept to lift their answers.
"""

from __future__ import annotations

import copy
import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any

from cpbench import graph, proofs, storage, verification
from cpbench.bench import messages, shared_problem, starts
from cpbench.bench.history import RecordedIterates, coarse_to_fine
from cpbench.bench.judging import judge_answer, look_for_proof, optimality_gap
from cpbench.bench.messages import RefereeCase
from cpbench.bench.planning.features import features
from cpbench.bench.planning.plan import Request, parse_request
from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.isolation import limit_address_space
from cpbench.bench.processes.meter import checksum
from cpbench.bench.results.rows import pack_answer, unpack_answer
from cpbench.conversions import Conversion
from cpbench.errors import CpbenchError, FormatError, PointError, ProblemError
from cpbench.formulations.base import Kind, Problem


@dataclass
class ConvertedProblem:
    """A problem converted to a node: the file that solvers load, and what is needed to lift their answers."""

    problem: Problem
    kind: Kind
    label: str
    steps: int
    seconds: float
    path: str
    checksum: int


class ProblemCache:
    """One problem at a time; its conversions are written to `scratch` for the solvers to load."""

    def __init__(self, scratch: Path) -> None:
        self._scratch = scratch
        self._held: tuple[str, str | None] = ("", None)
        self._source: Problem | None = None
        self._prepared: dict[tuple[str, str], ConvertedProblem] = {}
        self._conversions = TimedConversions()
        self._files = 0

    def open(self, address: str, format: str | None, fingerprint: str = "") -> Problem:
        """Return the problem, which is loaded unless it is held; raises ProblemError when it is not the one that was
        planned."""
        if self._held != (address, format) or self._source is None:
            for prepared in self._prepared.values():
                Path(prepared.path).unlink(missing_ok=True)
            self._prepared, self._conversions, self._source = {}, TimedConversions(), None
            self._source = storage.load(address, format=format)
            self._held = (address, format)
        source = self._source
        assert source is not None
        return _planned(source, address, fingerprint)

    def ready(self, case: RefereeCase) -> tuple[Problem, ConvertedProblem]:
        """Return the problem and its conversion to the node, which is made at the first call."""
        problem = self.open(case.address, case.format, case.fingerprint)
        key = (case.request.name, case.node)
        if key not in self._prepared:
            self._prepared[key] = self._bring(problem, case)
        return problem, self._prepared[key]

    def _bring(self, problem: Problem, case: RefereeCase) -> ConvertedProblem:
        """Convert the problem and write what solvers load."""
        kinds, via = parse_request(case.request)
        arrival = graph.arrive(problem, case.node, kinds, via, self._conversions)
        # workers keep a loaded problem by its path: a referee that replaces a dead one must not reuse its names
        path = self._scratch / f"problem-{os.getpid()}-{self._files}"
        self._files += 1
        _write(shared_problem.write, arrival.problem, path)
        return ConvertedProblem(
            arrival.problem,
            arrival.kind,
            arrival.route.label,
            len(arrival.route.steps),
            self._conversions.seconds(problem, arrival.route),  # without those of dead ends
            str(path),
            checksum(arrival.problem),
        )


def _planned(problem: Problem, address: str, fingerprint: str) -> Problem:
    """Return the problem of a file; raises ProblemError when it is not the one that was planned."""
    if fingerprint and problem.fingerprint != fingerprint:
        raise ProblemError(
            address,
            f"the file changed after it was planned: fingerprint {problem.fingerprint}, planned {fingerprint}; "
            "run the same command again to plan what it holds now",
        )
    return problem


def _write(write: Callable[[Any, Path], None], data: Any, path: Path) -> None:
    """Write a file for workers; raises FormatError."""
    try:
        write(data, path)
    except OSError as cause:
        raise FormatError(path, "", f"cannot be written ({cause.strerror or cause})") from None


class TimedConversions(graph.Memory):
    """Conversions, each done and timed once: whether the edge applies, and the step.

    What the search for routes computed of a problem (a factorization, a least eigenvalue) is cached with it; its
    conversion starts without these, so that its time has all it needs.
    """

    def __call__(self, edge: Conversion, problem: Problem) -> Problem:
        key = (id(problem), edge.label)
        if key not in self._done:
            converted, seconds = _timed(edge, problem)
            self._done[key] = (problem, converted, seconds)
        return self._done[key][1]


def _timed(edge: Conversion, problem: Problem) -> tuple[Problem, float]:
    fresh = _without_caches(problem)
    begun = time.perf_counter()
    edge.require(fresh)
    return edge.step(fresh), time.perf_counter() - begun


def _without_caches(problem: Problem) -> Problem:
    """Return the same problem, its data shared, without what cached properties keep except for its fingerprint."""
    fresh = copy.copy(problem)
    for name in [n for n in vars(fresh) if isinstance(getattr(type(fresh), n, None), cached_property)]:
        del vars(fresh)[name]
    vars(fresh)["fingerprint"] = problem.fingerprint  # for the provenance
    return fresh


HISTORY_SECONDS = 30.0
"""Seconds after which no further iterate of a history is judged; the judged ones are spread over the whole."""


def main(connection: Channel, scratch: str, memory: int) -> None:
    """Answer the runner until it closes the connection, within `memory` bytes."""
    limit_address_space(memory)
    referee = Referee(Path(scratch))
    while True:
        try:
            request = messages.unpack(connection.recv_bytes())
        except EOFError:
            return
        try:
            reply = referee.answer(request)
        except CpbenchError as refusal:
            reply = messages.Declined(str(refusal), type(refusal).__name__)
        except MemoryError:  # the runner replaces a referee that says so
            reply = messages.OutOfMemory()
        except Exception as error:
            reply = messages.Failed(f"{type(error).__name__}: {error}")
        connection.send_bytes(messages.pack(reply))


class Referee:
    """The requests of the runner and their answers; each raises CpbenchError on bad input."""

    def __init__(self, scratch: Path) -> None:
        self._cache = ProblemCache(scratch)
        self._attempts: tuple[str, dict[tuple[str, float], proofs.ProofAttempt]] = ("", {})

    def answer(self, request: messages.Message) -> messages.Message:
        """Answer a message of the runner."""
        match request:
            case messages.Survey():
                return self.survey(request)
            case messages.Open():
                self._cache.open(request.address, request.format, request.fingerprint)
                return messages.Opened()
            case messages.Prepare():
                return self.prepare(request.case)
            case messages.FindStart():
                return self.find_start(request)
            case messages.Judge():
                return self.judge(request)
            case messages.JudgeHistory():
                return self.judge_history(request)
            case _:
                raise TypeError(f"a referee does not answer {type(request).__name__}")

    def survey(self, message: messages.Survey) -> messages.Surveyed:
        """Measure what a plan needs to know of a problem."""
        problem = self._cache.open(message.address, message.format)
        sequence = getattr(problem, "sequence", None)
        return messages.Surveyed(
            address=message.address,
            format=message.format,
            problem=problem.name,
            fingerprint=problem.fingerprint,
            node=problem.node,
            family=problem.info.family,
            sizes=problem.sizes(),
            features=features(problem),
            nodes={request.name: _open_nodes(problem, request) for request in message.requests},
            sequence=sequence.name if sequence else "",
            step=sequence.step if sequence else 0,
            guesses=len(storage.guesses(message.address)) if message.guesses else 0,
        )

    def prepare(self, case: messages.RefereeCase) -> messages.Prepared:
        """Convert the problem to the node as requested, into a file that solvers load."""
        _, ready = self._cache.ready(case)
        return messages.Prepared(
            path=ready.path,
            checksum=ready.checksum,
            route=ready.label,
            kind=str(ready.kind),
            convert=ready.seconds,
            tolerance=graph.tolerance(ready.problem, case.tolerance, ready.steps),
        )

    def find_start(self, request: messages.FindStart) -> messages.StartFound:
        """Find the point from which a solver is to start, on the converted problem; raises NotApplicable where there is
        none."""
        case, earlier = request.case, None
        source, ready = self._cache.ready(case)
        if request.before is not None:
            before, answer = request.before, unpack_answer(request.vectors["answer"])
            earlier = starts.step_before(before.address, before.format, before.fingerprint, answer)
        begin = starts.start(
            starts.parse_start(request.policy),
            source,
            case.address,
            ready.problem,
            ready.steps,
            earlier,
        )
        return messages.StartFound(begin.description, begin.point.arrays() if begin.point is not None else {})

    def judge(self, request: messages.Judge) -> messages.Judged:
        """Lift the answer, measure it on the problem that was asked, and give the row its status (`judge_answer`)."""
        source, ready = self._cache.ready(request.case)
        answer = {name: vector for name, vector in request.vectors.items() if name != "certificate"}
        certificate = request.vectors.get("certificate")
        attempt = partial(self._attempt, source, request.case.tolerance)
        judgement = judge_answer(
            source,
            ready.problem,
            ready.steps,
            answer if request.answered else None,
            tolerance=request.case.tolerance,
            claim=request.claim,
            kind=ready.kind,
            promise=Kind(request.promise),
            measure=request.case.measure,
            prove=lambda claim: look_for_proof(attempt, not ready.steps, claim, certificate, request.proof_seconds),
        )
        return messages.Judged(
            status=str(judgement.status),
            message=judgement.message,
            error=judgement.verdict.error,
            target_error=None if judgement.target is None else judgement.target.error,
            flags=tuple(judgement.flags),
            parts={**judgement.verdict.judged, **judgement.verdict.parts, **optimality_gap(source, judgement.point)},
            lift=judgement.lift,
            verify=judgement.verify,
            vectors=({} if judgement.point is None else {"answer": pack_answer(judgement.point)})
            | ({} if judgement.proof is None else {"proof": proofs.packed(judgement.proof)}),
        )

    def _attempt(
        self, source: Problem, tolerance: float, kind: str, certificate: Any, seconds: float
    ) -> proofs.ProofAttempt:
        """Return a proof of this kind, or the failed search for one; each search without a certificate is made once."""
        held, attempts = self._attempts
        if held != source.fingerprint:
            attempts.clear()
            self._attempts = (source.fingerprint, attempts)
        attempt = attempts.get((kind, tolerance))
        if attempt is None or (attempt.proof is None and certificate is not None):
            attempt = proofs.prove(source, kind, certificate, seconds, tolerance)
            if certificate is None or attempt.proof is not None:
                attempts[kind, tolerance] = attempt
        return attempt

    def judge_history(self, request: messages.JudgeHistory) -> messages.HistoryJudged:
        """Lift and measure the iterates of a recorded solve on the problem that was asked, as many as time permits."""
        source, ready = self._cache.ready(request.case)
        recorded = RecordedIterates.of(request, sum(ready.problem.point_sizes.values()))
        errors: dict[int, tuple[float, tuple[str, ...]]] = {}
        begun = time.perf_counter()
        for index in coarse_to_fine(len(recorded.iterates)):
            if errors and time.perf_counter() - begun > request.seconds:
                break
            errors[index] = _measured(source, ready, recorded.iterates[index], request.case.measure)
        return messages.HistoryJudged({"history": recorded.judged(errors).pack()})


def _open_nodes(problem: Problem, request: Request) -> tuple[str, ...]:
    """Return nodes that some route of the request reaches, judged by its first edge alone."""
    kinds, via = parse_request(request)
    opened: dict[Conversion | None, bool] = {None: True}

    def is_open(edge: Conversion | None) -> bool:
        if edge not in opened:
            opened[edge] = edge is not None and edge.obstacle(problem) is None
        return opened[edge]

    begin = _beginnings(problem.node, kinds, via)
    return tuple(
        node
        for node in sorted(begin)
        if (not request.nodes or node in request.nodes) and any(is_open(edge) for edge in begin[node])
    )


@lru_cache(maxsize=2**8)
def _beginnings(
    source: str, kinds: frozenset[Kind], via: tuple[Conversion, ...]
) -> dict[str, tuple[Conversion | None, ...]]:
    """Return first edges by node, found once for all problems of a node."""
    return graph.beginnings(source, kinds, via)


def _measured(source: Problem, ready: ConvertedProblem, x: Any, measure: str | None) -> tuple[float, tuple[str, ...]]:
    """Return the error of a solver's vector on the source problem, with the flags of a tolerance that it just meets."""
    try:
        answer = graph.lift(ready.problem, ready.problem.point_from_vector(x), ready.steps)
        error = verification.judge(source, answer, 0.0, measure).error
        if not math.isfinite(error):
            return math.inf, ()
        return error, verification.judge(source, answer, error, measure).flags
    except PointError:
        return math.inf, ()
