"""Availability of solvers: at a glance by what is installed, or by importing each guest in a separate process.

The import of a guest takes seconds and may crash or hang, hence the process, which has a time limit.
"""

from __future__ import annotations

import traceback
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import groupby
from typing import Any

from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.launch import context
from cpbench.bench.processes.server import NoAnswer, ServerProcess, serve
from cpbench.bench.time_limits import START
from cpbench.solvers.base import Solver, package_version, solvers

PATIENCE = START.floor
"""Seconds that a guest may take to be imported and to report that it can run."""
SIDE_BY_SIDE = 2
STATES = ("ok", "installed", "untried", "licence", "broken", "missing")
"""States of a solver, best first; `installed` and `untried` only at a glance."""


@dataclass(frozen=True)
class SolverState:
    """A finding on one solver.

    Attributes
    ----------
    state : ok, missing, broken or licence, as in `Availability`; at a glance also installed (its packages exist but
        were not imported) or untried (it runs in another program, which was not started).
    detail : how to install it, the traceback, or its own message.
    version : of its package, '' where it is not known.
    """

    name: str
    state: str
    detail: str = ""
    version: str = ""

    @property
    def usable(self) -> bool:
        """Return whether it can run, as far as is known."""
        return self.state in ("ok", "installed", "untried")

    @property
    def line(self) -> str:
        """The state and its reason in one line; of a traceback the last."""
        lines = self.detail.strip().splitlines()
        return f"{self.state}: {lines[-1].strip()}" if lines else self.state


def glance(solver: Solver) -> SolverState:
    """Return the state of a solver as far as it is known without importing anything."""
    spec = solver.spec
    for package in spec.requires:
        if find_spec(package.partition(".")[0]) is None:
            return SolverState(spec.name, "missing", spec.install or f"pip install {package}")
    if spec.requires:
        return SolverState(spec.name, "installed", version=package_version(spec.requires[-1]))
    if type(solver).availability is not Solver.availability:
        return SolverState(spec.name, "untried")
    return SolverState(spec.name, "ok", version=solver.version())


def examine(chosen: Iterable[Solver]) -> Iterator[SolverState]:
    """Yield the states of solvers as they become known: those of one guest are imported in one process, two processes
    at a time."""
    waiting: list[list[str]] = []
    for _, members in groupby(sorted(chosen, key=_guest), key=_guest):
        glances = [glance(solver) for solver in members]
        yield from (seen for seen in glances if seen.state in ("missing", "ok"))
        waiting.append([seen.name for seen in glances if seen.state not in ("missing", "ok")])
    servers, pool = [ServerProcess(context(1), _main) for _ in waiting], ThreadPoolExecutor(SIDE_BY_SIDE)
    try:
        for done in as_completed([pool.submit(_answered, *each) for each in zip(servers, waiting, strict=True)]):
            yield from done.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for server in servers:
            server.stop()


def _guest(solver: Solver) -> tuple[str, tuple[str, ...]]:
    return type(solver).__module__, solver.spec.requires


def _answered(server: ServerProcess, names: Sequence[str]) -> list[SolverState]:
    """Return the states of the solvers; one that ends the process leaves the others a new one."""
    states: list[SolverState] = []
    with server:
        for name in names:
            try:
                header, _ = server.ask(PATIENCE, {"name": name})
                states.append(SolverState(name, *(str(header[part]) for part in ("state", "detail", "version"))))
            except (NoAnswer, KeyError) as end:
                states.append(SolverState(name, "broken", str(end)))
    return states


def _main(channel: Channel) -> None:
    """Look at one solver after the other; runs in the process."""

    def answer(request: Mapping[str, Any], _: Mapping[str, Any]) -> tuple[dict[str, str], dict[str, Any]]:
        solver = solvers.get(request["name"])
        try:
            state = solver.availability()
            version = solver.version() if state.ok else ""
            return {"state": state.state, "detail": state.detail, "version": version}, {}
        except Exception:
            return {"state": "broken", "detail": traceback.format_exc(limit=5), "version": ""}, {}

    serve(channel, answer)
