"""The problem that the referee holds, with its conversions: each is done once, timed, and kept to lift answers."""

from __future__ import annotations

import copy
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from cpbench import graph, storage
from cpbench.bench import shared_problem
from cpbench.bench.messages import RefereeCase
from cpbench.bench.planning.plan import parse_request
from cpbench.bench.processes.meter import checksum
from cpbench.conversions import Conversion
from cpbench.errors import FormatError, ProblemError
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
