"""The process that runs one solver: it loads problems, warms up, solves and reports; it judges nothing.

Messages in: `Solve`. Messages out: `WarmingUp` once the solver is found to be available, `Ready`, then for
every request `ProblemLoaded`, `Result`, and where they are asked for `Repeats` and `Recorded`; or a `Failure`. The
limit of a solve counts from `ProblemLoaded`; what goes before has its own (`time_limits`).
"""

from __future__ import annotations

import errno
import gc
import itertools
import operator
import os
import tempfile
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from cpbench.bench import messages, shared_problem
from cpbench.bench.history import recorded
from cpbench.bench.outcome import method_seconds
from cpbench.bench.processes import guard
from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.isolation import limit_address_space
from cpbench.bench.processes.meter import Meter, checksum
from cpbench.errors import Ended, NotApplicable, Unavailable, described
from cpbench.formulations.base import Problem
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, Claim, Solver, SolverOutput, solvers

WORDS = 2000
"""Characters of a solver's messages that are passed on."""
COUNTERS, NAME = 100, 100
"""Counters of a solve that are kept, and characters of their names."""


def main(connection: Channel, solver_name: str, memory: int, scratch: str = "") -> None:
    """Serve solves of one solver until the runner closes the connection; temporary files of the solver are below
    `scratch`, which the runner removes."""
    gc.disable()  # imports leave hardly any garbage
    solver = solvers.get(solver_name)
    if scratch:  # before the guest is imported, whose code runs from then on
        tempfile.tempdir = os.environ["TMPDIR"] = tempfile.mkdtemp(prefix="worker-", dir=scratch)
    available = solver.availability()
    if not available.ok:
        connection.send_bytes(messages.pack(messages.SolverUnavailable(available.detail[-WORDS:], available.state)))
        return
    connection.send_bytes(messages.pack(messages.WarmingUp()))
    solver.warmup()
    version = solver.version()
    gc.enable()
    limit_address_space(memory)  # after the warm-up: its memory is not charged to solves
    runner = SolverRunner(connection, solver)
    runner.send(messages.Ready(version[:WORDS]))
    while True:
        try:
            request = messages.unpack(connection.recv_bytes())
        except EOFError:
            return
        assert isinstance(request, messages.Solve), "the runner asks a worker for nothing else"
        runner.serve(request)


class SolverRunner:
    """One solver, which serves one request at a time."""

    def __init__(self, connection: Channel, solver: Solver) -> None:
        self._connection, self._solver = connection, solver
        self._path, self._problem, self._handed, self._checksum = "", None, None, 0
        self._request = messages.Solve("", 0.0, 0.0, {})
        self.meter = Meter()

    def serve(self, request: messages.Solve) -> None:
        """Answer a request."""
        self._request = request
        result = self._safely(self._answer)
        if result is None:
            return
        if request.repeats > 1 and result["short"] and not result["wrote"]:
            times: list[Any] = []
            for _ in range(request.repeats - 1):
                times.append(self._safely(self._repeat))
                if times[-1] is None:
                    return
            self.send(messages.Repeats(tuple(times)))
        if request.history:
            self._safely(self._record)

    def send(self, message: messages.Message) -> None:
        self._connection.send_bytes(messages.pack(message))

    def _safely(self, step: Callable[[], Any]) -> Any:
        """Return what `step` returns; None when it raised, which was reported to the runner. SystemExit ends the
        process."""
        me = os.getpid()
        try:
            return step()
        except SystemExit:
            raise
        except BaseException as error:
            _end_unless(me)
            if isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM):
                self._forget()
                gc.collect()
                self.send(messages.OutOfMemory())
            elif isinstance(error, Ended):
                guard.end_like(error.code)
            elif isinstance(error, NotApplicable):
                self.send(messages.ProblemUnsupported(error.obstacle[:WORDS]))
            elif isinstance(error, Unavailable):
                self.send(messages.SolverUnavailable(str(error)[:WORDS]))
            else:
                self.send(messages.Failed(described(error)))
            return None

    # --------------------------------------------------------------------------------------------- steps

    def _answer(self) -> dict[str, Any] | None:
        begun = time.perf_counter()
        problem = self._loaded()
        why = self._solver.obstacle(problem)
        if why is not None:
            self.send(messages.ProblemUnsupported(why[:WORDS]))
            return None
        if self._handed is None:
            self._handed = self._solver.hand_over(problem)
        self.send(messages.ProblemLoaded(messages.Seconds(time.perf_counter() - begun)))
        arguments = self._arguments(problem)
        self.meter.begin()
        output, setup, wall, cpu = _timed(self._solver, self._handed, *arguments, self.meter.cpu)
        used = self.meter.end(setup + wall, cpu)
        trip, solve = self._solver.round_trip, self._method_seconds(wall, output)
        output = self._solver.collect(output)
        used["children"] = max(used["children"], self.meter.children)  # a program may start processes after its reply
        vectors, counters, notes = _checked(output, problem)
        wrote = checksum(problem) != self._checksum
        if wrote:
            self._forget()
        self.send(
            messages.Result(
                claim=str(output.claim),
                answered=output.point is not None,
                message="; ".join(filter(None, (*notes, str(output.message))))[:WORDS],
                counters=counters,
                setup=messages.Seconds(setup),
                solve=messages.Seconds(solve),
                cpu=messages.Seconds(cpu),
                reported=None if output.reported is None else messages.Seconds(output.reported),
                trip=None if trip is None else messages.Seconds(trip),
                solve_wall=None if trip is None else messages.Seconds(wall),
                wrote=wrote,
                vectors=vectors,
                **used,
            )
        )
        return {"short": setup + wall < self._request.repeat_below, "wrote": wrote}

    def _method_seconds(self, wall: float, output: SolverOutput) -> float:
        """Return the seconds of the method, of those that passed here."""
        solver = self._solver
        reported = getattr(output, "reported", None)  # what is not an output is refused later
        return method_seconds(wall, reported, solver.round_trip, trusted=solver.own_clock)

    def _repeat(self) -> tuple[messages.Seconds, messages.Seconds, messages.Seconds]:
        arguments = self._arguments(self._loaded())
        self._handed = self._solver.hand_over(self._problem)  # a program may cache what it has solved
        output, setup, wall, _ = _timed(self._solver, self._handed, *arguments, self.meter.cpu)
        return messages.Seconds(setup), messages.Seconds(self._method_seconds(wall, output)), messages.Seconds(wall)

    def _record(self) -> bool:
        me, problem = os.getpid(), self._loaded()
        recording = recorded(self._solver, problem, *self._arguments(problem))
        _end_unless(me)
        self.send(recording)
        return True

    def _loaded(self) -> Problem:
        path = self._request.path
        if self._problem is None or self._path != path:
            self._forget()  # two problems at a time might not fit
            self._problem = shared_problem.read(path)
            self._path, self._checksum = path, checksum(self._problem)
            if self._request.checksum not in (None, self._checksum):  # solvers can write to the files
                self._forget()
                raise ValueError(f"loading: {path} is not what the referee wrote")
        return self._problem

    def _forget(self) -> None:
        self._path, self._problem, self._handed = "", None, None

    def _arguments(self, problem: Problem) -> tuple[Budget, Any, Any]:
        """Return budget, options and starting point of the request."""
        request = self._request
        first = problem.point_type(**request.vectors) if request.vectors else None
        budget = Budget(tolerance=request.tolerance, seconds=request.seconds)
        return budget, self._solver.spec.options(**request.options), first


def _timed(
    solver: Solver, problem: Any, budget: Budget, options: Any, start: Any, clock: Callable[[], float]
) -> tuple[SolverOutput, float, float, float]:
    """Solve, and return the output, the seconds of `setup` and of `solve`, and the CPU seconds of both by `clock`."""
    me = os.getpid()
    gc.collect(0)  # here, so that it does not happen in the timed part
    cpu = clock()
    begun = time.perf_counter()
    prepared = solver.setup(problem, budget, options)
    between = time.perf_counter()
    output = solver.solve(prepared, budget, options, start)
    ended = time.perf_counter()
    seconds = clock() - cpu
    _end_unless(me)
    return output, between - begun, ended - between, seconds


def _end_unless(me: int) -> None:
    """End a process that a solver forked and that returned from the solver: it would answer the runner as if it were
    the worker, whose id is `me`."""
    if os.getpid() != me:
        os._exit(0)


def _checked(output: Any, problem: Problem) -> tuple[dict[str, Vector], dict[str, int], list[str]]:
    """Return vectors, counters and remarks of a solver's output; raises TypeError when it is not a valid output."""
    if not isinstance(output, SolverOutput):
        raise TypeError(f"returned a {type(output).__name__}, not a SolverOutput")
    if not isinstance(output.claim, Claim):
        raise TypeError(f"claims {output.claim!r:.100}, which is not a Claim")
    vectors: dict[str, Any] = {}
    if output.point is not None:
        if not isinstance(output.point, problem.point_type):
            raise TypeError(f"answered with a {type(output.point).__name__}, not a {problem.point_type.__name__}")
        vectors |= output.point.arrays()
    if output.certificate is not None:
        vectors["certificate"] = output.certificate
    for name, vector in vectors.items():
        kind = np.asarray(vector).dtype
        if kind.kind not in "fiub":
            raise TypeError(f"answered with a {name} of type {kind}, not of real numbers")
    return vectors, *_counters(output.counters)


def _counters(reported: Mapping[Any, Any]) -> tuple[dict[str, int], list[str]]:
    """Return the first counters, each a 64-bit integer >= 0 with a short name, and remarks on what is left out.

    To send and store a million of them would take seconds, after a solve that kept its limit.
    """
    counters: dict[str, int] = {}
    notes: list[str] = []
    for key, value in itertools.islice(reported.items(), COUNTERS):
        name = str(key)[:NAME]
        try:
            number = operator.index(value)
        except TypeError:
            number = -1
        if 0 <= number < 2**63:
            counters[name] = number
        else:
            notes.append(f"the counter {name} is no integer from 0 to 2^63, and not kept")
    if len(reported) > COUNTERS:
        notes.append(f"{len(reported)} counters, the first {COUNTERS} are kept")
    return counters, notes
