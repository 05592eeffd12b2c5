"""The process in which a solver of cpbench solves one problem of a file: it reads, converts, solves, judges, and writes
the answer as text and into a file.

What asks (`bench.processes.supervised`) kills it where a phase exceeds its limit. Its own memory is limited by the
system, from after its imports on; what a solve loads or compiles is off the clock, and counts as no memory of it.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from cpbench import graph, storage
from cpbench.api.answered import Answered
from cpbench.api.solution import Solution
from cpbench.api.solving import JUDGE, SOLVE, Way, solve_there, way_to
from cpbench.api.takers import advised
from cpbench.bench import starts
from cpbench.bench.planning import plan
from cpbench.bench.planning.nearest import AUTO
from cpbench.bench.planning.places import located
from cpbench.bench.processes.isolation import address_space, die_with_parent, memory_around
from cpbench.bench.results.rows import Outcome
from cpbench.conversions.base import Conversion
from cpbench.errors import CpbenchError, NoRoute, NotApplicable, Unavailable
from cpbench.formulations.base import Kind, Problem
from cpbench.foundation import brackets, kernel_cache
from cpbench.foundation.extensions import hook
from cpbench.generators.collection import builtin_folder
from cpbench.solvers import clock, warming
from cpbench.solvers.base import Trait, solvers
from cpbench.storage.base import require_new
from cpbench.verification import Status

READ, WARM_UP = "read", "warm-up"
"""The phases before SOLVE and JUDGE."""


def main() -> None:
    """Answer the request on stdin by lines on stdout, of which solvers that print get none."""
    die_with_parent(signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that asks handles Ctrl-C
    talk = _Talk()
    asked = json.loads(sys.stdin.readline() or "null")
    if asked is None:
        return
    try:
        answer = _answer(asked, talk)
    except CpbenchError as refusal:
        answer = {"refused": str(refusal)}
    except MemoryError:
        answer = {"status": str(Status.MEMOUT), "message": f"{talk.phase}: ran out of memory"}
    except Exception as error:
        answer = {"status": str(Status.ERROR), "message": f"{talk.phase}: {type(error).__name__}: {error}"}
    talk.say(answer=answer)


class _Talk:
    """Messages of this process on its phases, and the limits of its memory that go with them."""

    def __init__(self) -> None:
        self._out = os.fdopen(os.dup(1), "w", encoding="utf-8")
        os.dup2(2, 1)
        self._memory = self._solving = 0
        self.phase = READ

    def say(self, **note: Any) -> None:
        self._out.write(json.dumps(note) + "\n")
        self._out.flush()

    def limit(self, memory: int) -> None:
        """Limit the memory from here on, that of a solve to `memory` more [bytes], 0 for none."""
        self._memory = memory
        if memory > 0:
            self._allow(address_space() + memory_around(memory))

    def begin(self, phase: str) -> None:
        """Say that a phase begins; a solve has its own limit."""
        self.phase = phase
        if self._memory > 0 and phase == SOLVE:
            self._solving = address_space() + self._memory
            self._allow(self._solving)
        elif self._memory > 0:
            self._allow(address_space() + memory_around(self._memory))
        self.say(phase=phase)

    def off_the_clock(self, loading: bool) -> None:
        """Stop the clock of a solve while something is loaded, and leave out the memory that this takes."""
        if self.phase != SOLVE:
            return
        if self._memory > 0 and loading:
            self._solving -= address_space()
            self._allow(address_space() + memory_around(self._memory))
        elif self._memory > 0:
            self._solving += address_space()
            self._allow(self._solving)
        self.say(phase=WARM_UP if loading else SOLVE)

    @staticmethod
    def _allow(limit: int) -> None:
        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        resource.setrlimit(resource.RLIMIT_AS, (limit if hard < 0 else min(limit, hard), hard))


def _answer(asked: Mapping[str, Any], talk: _Talk) -> dict[str, Any]:
    """Solve as asked; raises CpbenchError where there is nothing to solve."""
    if not _of_cpbench(asked["solver"]):
        return {"others": True}
    if asked["output"] is not None:
        require_new(Path(asked["output"]), asked["force"])
    talk.limit(asked["memory"])
    if asked["all"]:
        require_rows, reply_to = hook("require_rows"), hook("reply_to")
        if asked["output"] is not None:
            require_rows(Path(asked["output"]))
        talk.begin(JUDGE)
        return reply_to(located(asked["address"], builtin_folder), asked)
    answered = _answered(asked, talk)
    talk.begin(JUDGE)
    lines = list(answered.lines(verbose=asked["verbose"]))
    output: str | None = asked["output"]
    written = output is not None and answered.point is not None
    if output is not None and written:
        answered.save(Path(output), force=asked["force"])
    return {"lines": lines, "record": answered.record(), "good": bool(answered), "written": written}


def _of_cpbench(solver: str) -> bool:
    """Return whether a solver is one of cpbench's own; raises UnknownName."""
    name = brackets.read("solver", solver)[0]
    return name == AUTO or solvers.get(name).origin == "native"


def _answered(asked: Mapping[str, Any], talk: _Talk) -> Answered:
    """Return what became of the solve, whatever that is."""
    begun = time.perf_counter()
    address, known = located(asked["address"], builtin_folder), Outcome()
    policy = starts.one_start(asked["start"])
    problem = storage.load(address, format=asked["format"])
    known = replace(known, load=time.perf_counter() - begun)
    talk.say(problem=problem.name, node=problem.node)
    label = asked["solver"]
    try:
        way = _way(problem, asked)
        label = way.name
        talk.say(solver=label)
        known = replace(known, route=way.label, kind=str(way.kind), convert=way.seconds)
        known = replace(known, target_tolerance=graph.tolerance(way.problem, asked["tolerance"], way.steps))
        point = None
        if policy.warm:
            point, started = _start(policy, problem, way, address, asked["tolerance"])
            known = replace(known, started=started)
        talk.begin(WARM_UP)
        with kernel_cache.compiling_reported(lambda: talk.say(compiling=way.name)):
            warming.warm_up_quickly(way.solver)
            clock.listen(talk.off_the_clock)
            solution, there = solve_there(
                problem, way, asked["tolerance"], asked["seconds"], point, on_phase=talk.begin
            )
    except (NotApplicable, Unavailable) as refusal:
        status = Status.UNSUPPORTED if isinstance(refusal, NotApplicable) else Status.UNAVAILABLE
        refused = replace(known, status=str(status), message=str(refusal))
        return Answered(asked["address"], problem.name, problem.node, label, asked["tolerance"], refused)
    return _of(asked["address"], advised(solution), there, known)


def _way(problem: Problem, asked: Mapping[str, Any]) -> Way:
    """Bring the problem to the solver: by exact conversions, and where these do not lead there by all of them if that
    is asked for."""
    via: tuple[Conversion, ...] = ()
    if asked["via"]:
        via = plan.parse_request(plan.pinned(asked["via"], {"facets": asked["facets"]}))[1]
    try:
        return way_to(problem, asked["solver"], via)
    except NoRoute:
        if asked["routes"] != "all":
            raise
    return way_to(problem, asked["solver"], via, frozenset(Kind))


def _start(policy: starts.StartPolicy, problem: Problem, way: Way, address: str, tolerance: float) -> tuple[Any, str]:
    """Return the starting point on the solver's own problem, and its description; raises NotApplicable."""
    if Trait.WARM_START not in way.solver.spec.traits:
        raise NotApplicable(way.name, "takes no starting point, and a cold start is not what was asked for")
    begin = starts.start(policy, problem, address, way.problem, way.steps)
    return begin.point, begin.description


def _of(address: str, solution: Solution, there: float, known: Outcome) -> Answered:
    """Return a solution as the outcome of a solve, with `there`, its error on the solver's own problem."""
    problem, verdict, spent = solution.problem, solution.verdict, solution.seconds
    outcome = replace(
        known,
        status=str(solution.status),
        claim=solution.claim or None,
        error=verdict.error,
        target_error=there,
        flags=",".join(verdict.flags),
        message=solution.message,
        parts=json.dumps({**verdict.judged, **verdict.parts}),
        counters=json.dumps(dict(solution.counters)),
        **{name: spent[name] for name in ("setup", "solve", "lift", "verify") if name in spent},
    )
    asked = address, problem.name, problem.node, solution.solver, solution.tolerance
    return Answered(*asked, outcome, problem, solution.point)
