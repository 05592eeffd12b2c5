"""Solvers served by a program that is started once: it loads a problem, solves it as often as it is asked, writes the
answer. Loading, compiling and writing stay outside of what is timed. The requests, one JSON object a line each:

    {"do": "hello", "protocol": 1}                  -> {"ok": true, "name": "mine", "version": "1.2"}
                                                       first, and again after the warm-up: how long a request takes
    {"do": "warmup"}                                -> {"ok": true}      once, without a problem: compiling
    {"do": "load", "problem": PATH, "node": "lcp"}  -> {"ok": true}      reads the problem into memory
    {"do": "solve", "tolerance": 1e-6, "seconds": 10.0, "iterations": null, "seed": 0, "options": {}, "start": null}
        -> {"ok": true, "claim": "solved", "iterations": 12, "seconds": 0.0012, "message": "", "counters": {}}
    {"do": "write", "answer": PATH}                 -> {"ok": true}      a folder is there and empty, a file is not
    {"do": "quit"}

`start` is the path of a point, written as an answer is; infinity is null. `claim` is one of solved, inaccurate,
infeasible, unbounded, max_iter, failed; where it is neither solved nor inaccurate `write` may write nothing. In place
of {"ok": true}: {"error": "what"}, {"unsupported": "why"}, {"memory": "what"}, {"unavailable": "why", "state":
"missing|broken|licence"}. Unknown keys are ignored.
"""

from __future__ import annotations

import dataclasses
import math
import os
import shutil
import statistics
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cpbench.errors import CpbenchError, FormatError, Unavailable
from cpbench.formulations.base import Problem
from cpbench.formulations.exchange import Exchange, exchanges
from cpbench.foundation import matrices
from cpbench.solvers.base import Availability, Budget, Claim, Record, Solver, SolverOutput, SolverSpec
from cpbench.solvers.external.folder import Folder
from cpbench.solvers.external.session import ProgramError, Session

PROTOCOL = 1
BACKSTOP = 600.0
"""Seconds for any answer but that to `solve`, should nothing else end a hanging program: a run does, much earlier."""
MATRICES = ("as-is", "dense", "csr")
CLAIM = "claim.json"
"""File of a command's claims, beside its answer or in its folder."""
TRIPS, LONG = 9, 0.05
"""Empty requests that measure a round trip; seconds of the first from which on it stays alone."""
ANSWERED = (Claim.SOLVED, Claim.INACCURATE)
"""Claims that have an answer; with others it may be missing."""
Key = tuple[tuple[str, ...], tuple[tuple[str, str], ...], str | None]


@dataclass(frozen=True, eq=False)
class HandedOver:
    """A problem in a folder, where a program finds it."""

    problem: Problem
    exchange: Exchange
    place: Folder

    @classmethod
    def make(cls, problem: Problem, exchange: Exchange, form: str) -> HandedOver:
        """Write `problem` with its matrices as they are, dense, or as CSR; raises FormatError."""
        written = problem
        if form == "csr":
            data = {name: value for name, value in problem.data().items() if value.ndim == 2}
            written = dataclasses.replace(problem, **{name: matrices.sparse(M) for name, M in data.items()})
        numbers = [
            math.prod(M.shape) if form == "dense" or isinstance(M, np.ndarray) else 2 * M.nnz
            for M in written.data().values()
        ]
        handed = cls(problem, exchange, Folder(8 * sum(numbers)))
        exchange.write_problem(written, handed.path("problem"), form == "dense")
        handed.clean_answer_path()  # which is ready then: what collects an answer is part of every pair
        return handed

    def path(self, name: str) -> Path:
        if name == "answer" and self.exchange.answer_name:
            return self.place.path / self.exchange.answer_name
        return self.place.path / (name + self.exchange.suffix)

    def start(self, point: Any | None) -> str | None:
        """Return where the starting point stands, None for none."""
        if point is None:
            return None
        self.exchange.write_answer(point, self.path("start"))
        return str(self.path("start"))

    def clean_answer_path(self) -> Path:
        """Return the path for an answer, cleaned: an empty folder, or no file."""
        path = self.path("answer")
        if self.exchange.suffix:
            path.unlink(missing_ok=True)
        elif not path.is_dir():
            path.mkdir()
        elif any(path.iterdir()):  # an answer, or what was said of one
            shutil.rmtree(path)
            path.mkdir()
        return path

    def answered(self) -> bool:
        """Return whether anything was written to the path of the answer."""
        path = self.path("answer")
        if path.is_dir():
            return any(entry.name != CLAIM for entry in path.iterdir())
        return self.exchange.holds_answer(path)

    def answer(self, solver: str, claim: Claim) -> Any | None:
        """Return the answer that the program wrote, None without one; raises ValueError where it does not fit the
        claim."""
        if claim not in ANSWERED and not self.answered():
            return None
        try:
            return self.exchange.read_answer(self.path("answer"), self.problem)
        except FormatError as cause:
            raise ValueError(f"{solver} claims {claim}, its answer {cause.field} {cause.cause}") from None


class ProgramSolver(Solver):
    """A solver in a program, which gets problems by an exchange.

    Parameters
    ----------
    spec : name, node, options, ... as of any solver; `spec.install` is what `availability` tells where the executable
    is missing. command : the executable and its arguments: an absolute path, a path in `cwd`, or a name looked up in
    PATH. exchange : how problems and answers are handed over. matrices : "as-is", all "dense", or all "csr".
    env : variables beside those of this process. cwd : the folder it runs in, None for that of this process.
    """

    def __init__(
        self,
        spec: SolverSpec,
        command: Sequence[str],
        exchange: str = "npy-dir",
        matrices: str = "as-is",
        env: Mapping[str, str] | None = None,
        cwd: str | None = None,
    ) -> None:
        self.spec = spec  # pyright: ignore[reportAttributeAccessIssue] - one class, a spec for every program
        self.command, self.exchange, self.matrices = tuple(command), exchange, matrices
        self.env, self.cwd = dict(env or {}), cwd

    def obstacle(self, problem: Any) -> str | None:
        return exchanges.get(self.exchange).obstacle(problem)

    def hand_over(self, problem: Any) -> HandedOver:
        return HandedOver.make(problem, exchanges.get(self.exchange), self.matrices)


class ServedSolver(ProgramSolver):
    """A solver in a program that is started once. The options of a solve are sent as they are, by name.

    ServedSolver(spec, command, exchange="npy-dir", matrices="as-is", env=None, cwd=None)
    """

    _session: Session | None = None
    _round_trip: float | None = None

    @property
    def round_trip(self) -> float | None:
        """Median seconds of the empty requests at the start of the session; None before it."""
        return self._round_trip

    def hand_over(self, problem: Any) -> HandedOver:
        handed = super().hand_over(problem)
        self._load(self._running(), handed)
        return handed

    def setup(self, problem: HandedOver, budget: Budget, options: Any) -> HandedOver:
        return problem

    def solve(
        self, prepared: HandedOver, budget: Budget, options: Any, start: Any | None = None, record: Record | None = None
    ) -> SolverOutput:
        """Return the point of the output is where it will be found: `collect` brings it."""
        session = self._session
        if session is None or not session.alive or session.holds is not prepared:
            session = self._running()
            self._load(session, prepared)
        reply = session.ask(
            "solve",
            backstop(budget.seconds),
            tolerance=budget.tolerance,
            seconds=budget.seconds if math.isfinite(budget.seconds) else None,
            iterations=budget.iterations,
            seed=budget.seed,
            options=dataclasses.asdict(options),
            start=prepared.start(start),
        )
        return output(self.spec.name, reply, prepared)

    def collect(self, output: SolverOutput) -> SolverOutput:
        handed: HandedOver | None = output.point
        session = self._session
        if handed is None:
            return output
        if session is None or session.holds is not handed:
            raise ProgramError(f"{self.spec.name}: holds another problem than the one whose answer is wanted")
        session.ask("write", BACKSTOP, answer=str(handed.clean_answer_path()))
        return dataclasses.replace(output, point=handed.answer(self.spec.name, output.claim))

    def warmup(self) -> None:
        self._running()

    def version(self) -> str:
        return _greet(self).version if self.availability().ok else ""

    def availability(self) -> Availability:
        lacking = missing_executable(self.command[0], self)
        return Availability("missing", lacking) if lacking else _greet(self).availability

    def close(self) -> None:
        """End the program; the next problem starts another one. Harmless when done before."""
        session, self._session = self._session, None
        if session is not None:
            session.close()

    @property
    def key(self) -> Key:
        """Solvers of one key have one program."""
        return self.command, tuple(sorted(self.env.items())), self.cwd

    def _running(self) -> Session:
        """Return the program, warm; started anew where it has ended since its last answer."""
        session = self._session
        if session is None or not session.alive or session.ended():
            self.close()
            session = _take_spare(self.key) or _started(self)[0]
            session.pass_on()
            try:
                session.ask("warmup", BACKSTOP)
                self._round_trip = _round_trip(session)
            except BaseException:
                session.kill()
                raise
            self._session = session
        return session

    def _load(self, session: Session, handed: HandedOver) -> None:
        session.holds = None
        session.ask("load", BACKSTOP, problem=str(handed.path("problem")), node=handed.problem.node)
        session.holds = handed


def _round_trip(session: Session) -> float:
    """Return the median seconds of a greeting and its reply: the first words are over, so that nothing is left to do
    but to answer."""
    trips: list[float] = []
    while len(trips) < TRIPS and not (trips and trips[0] > LONG):
        begun = time.perf_counter()
        session.ask("hello", BACKSTOP, protocol=PROTOCOL)
        trips.append(time.perf_counter() - begun)
    return statistics.median(trips)


def backstop(seconds: float) -> float:
    """Return when a program that does not heed its limit is killed, should nothing else do it: a run does, at the
    limit."""
    return 1.5 * seconds + 5.0


def output(solver: str, reply: Mapping[str, Any], point: Any) -> SolverOutput:
    """Return a claim with what else a program may say of its solve; raises ProgramError on a claim that is none."""
    try:
        claim = Claim(reply.get("claim"))
    except ValueError:
        raise ProgramError(f"{solver}: claims {reply.get('claim')!r:.100}, expected {', '.join(Claim)}") from None
    counted, iterations, seconds = reply.get("counters"), reply.get("iterations"), reply.get("seconds")
    counters = dict(counted) if isinstance(counted, dict) else {}
    if iterations is not None:
        counters["iterations"] = iterations
    measured = isinstance(seconds, int | float) and not isinstance(seconds, bool) and 0 <= seconds < math.inf
    message = "" if reply.get("message") is None else str(reply["message"])
    reported = float(seconds) if measured and seconds is not None else None
    return SolverOutput(claim=claim, point=point, counters=counters, message=message, reported=reported)


# ------------------------------------------------------------------------------------------ the first words


@dataclass(frozen=True)
class _Greeting:
    availability: Availability
    version: str = ""


_greetings: dict[Key, _Greeting] = {}
_spare: tuple[Key, Session] | None = None
"""The program that was asked last whether it is available, so that its next run need not start it again."""


def missing_executable(command: str, solver: Any) -> str:
    """Return what to do where there is no such executable, "" where there is; a path is one from the solver's `cwd`
    on."""
    if os.path.dirname(command):
        path = os.path.join(solver.cwd or "", command)
        executable = shutil.which(path)
        if not executable and os.path.isfile(path):
            return f"{command}: is no executable; chmod +x {command}, or name the program that runs it"
    else:
        executable = shutil.which(command, path=solver.env.get("PATH"))
    return "" if executable else f"{command}: no such executable; {solver.spec.install or 'build or install it'}"


def _greet(solver: ServedSolver) -> _Greeting:
    """Return a program's reply to the greeting, once a process."""
    global _spare
    greeting = _greetings.get(solver.key)
    if greeting is None:
        try:
            session, version = _started(solver)
            greeting = _Greeting(Availability("ok"), version)
            if _spare is not None:
                _spare[1].close()
            _spare = (solver.key, session)
        except Unavailable as cause:
            greeting = _Greeting(Availability(cause.state, cause.detail))
        except (CpbenchError, MemoryError, OSError) as cause:
            greeting = _Greeting(Availability("broken", str(cause)))
        _greetings[solver.key] = greeting
    return greeting


def _take_spare(key: Key) -> Session | None:
    """Return the program of a key that was greeted and not used yet, if it is still there."""
    global _spare
    if _spare is None or _spare[0] != key:
        return None
    session, _spare = _spare[1], None
    return None if session.ended() else session


def _started(solver: ServedSolver) -> tuple[Session, str]:
    """Return the program, greeted, and its version; raises Unavailable with what it said on its way out."""
    lacking = missing_executable(solver.command[0], solver)
    if lacking:
        raise Unavailable("missing", lacking)
    session = Session(solver.spec.name, solver.command, solver.env, solver.cwd)
    try:
        reply = session.ask("hello", BACKSTOP, protocol=PROTOCOL)
    except Unavailable:
        session.kill()
        raise
    except CpbenchError as cause:
        session.kill()
        message = "\n".join(filter(None, (session.words, str(cause))))
        raise Unavailable("broken", f"{message}{_way_out(solver)}") from None
    version = reply.get("version")
    return session, "" if version is None else str(version)


def _way_out(solver: ServedSolver) -> str:
    return f"; {solver.spec.install}" if solver.spec.install else ""
