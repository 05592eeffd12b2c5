"""Availability of solvers: at a glance by what is installed, or by importing each guest in a separate process.

The import of a guest takes seconds and may crash or hang, hence the process, which has a time limit.
"""

from __future__ import annotations

import traceback
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import groupby
from multiprocessing.context import ForkServerContext

from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.launch import context
from cpbench.bench.processes.process import Child, Died, TimedOut
from cpbench.bench.time_limits import START
from cpbench.bench.worker_pool import describe_exit
from cpbench.foundation import frames
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
    trial, pool = _Trial(context(1)), ThreadPoolExecutor(SIDE_BY_SIDE)
    try:
        for done in as_completed([pool.submit(trial.states, names) for names in waiting]):
            yield from done.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        trial.stop()


def _guest(solver: Solver) -> tuple[str, tuple[str, ...]]:
    return type(solver).__module__, solver.spec.requires


class _Trial:
    """Processes that import guests, each started and waited for by a thread."""

    def __init__(self, means: ForkServerContext) -> None:
        self._means = means
        self._children: list[Child] = []
        self._stopped = False

    def stop(self) -> None:
        """End the processes at work; no other one is started."""
        self._stopped = True
        for child in list(self._children):
            child.kill_all()

    def states(self, names: Sequence[str]) -> list[SolverState]:
        """Return the states of the solvers; one that ends its process leaves the others a new one."""
        states: list[SolverState] = []
        while len(states) < len(names) and not self._stopped:
            states += self._answered(names[len(states) :])
        return states

    def _answered(self, names: Sequence[str]) -> list[SolverState]:
        """Return the states of the first solvers, up to and with the one that ended the process."""
        states: list[SolverState] = []
        child, why = None, ""
        try:
            child = Child(self._means, _main, (list(names),))
            self._children.append(child)
            for name in names:
                header, _ = frames.unpack(child.receive(PATIENCE))
                states.append(SolverState(name, str(header["state"]), str(header["detail"]), str(header["version"])))
            return states
        except TimedOut:
            why = f"did not answer within {PATIENCE:g} s"
        except Died as death:
            why = f"{death.output}\n{describe_exit(death)}".strip()
        except (frames.FrameError, KeyError) as noise:
            why = f"sent no valid message: {noise}"
        finally:
            if child is not None:
                self._children.remove(child)
                child.kill()
        return [*states, SolverState(names[len(states)], "broken", why)]


def _main(channel: Channel, names: Sequence[str]) -> None:
    """Send one message for each solver; runs in the process."""
    for name in names:
        solver = solvers.get(name)
        try:
            state = solver.availability()
            result = {"state": state.state, "detail": state.detail, "version": solver.version() if state.ok else ""}
        except Exception:
            result = {"state": "broken", "detail": traceback.format_exc(limit=5), "version": ""}
        channel.send_bytes(frames.pack(result))
