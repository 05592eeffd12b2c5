"""Solves in a separate process, which may hang or die without taking anything along.

One process serves solve after solve; one that ends it, or takes too long, has failed, and the next gets a new process.
What comes back is a claim and numbers; they are measured by the caller.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cpbench.bench import shared_problem
from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.isolation import limit_address_space
from cpbench.bench.processes.launch import context
from cpbench.bench.processes.process import Child, Died, TimedOut
from cpbench.bench.time_limits import GRACE, LOAD, WARM_UP
from cpbench.bench.worker_pool import describe_exit
from cpbench.formulations.base import Problem
from cpbench.foundation import frames
from cpbench.solvers.base import Budget, warm_up
from cpbench.verification import Status
from cpbench_lab.diagnosis.attempts import Raw, named, solve_here
from cpbench_lab.diagnosis.deadline import Deadline

TEXTS, ARRAYS = ("status", "claim", "message"), ("answer", "certificate", "residuals", "iterations", "iterates")


class Apart:
    """A process in which solvers are run; a context manager, which ends it. `memory` : bytes it may add, 0: any.
    `deadline` : what runs then is stopped, a compilation too. `say` : takes a line on what it does."""

    def __init__(
        self,
        threads: int = 1,
        memory: int = 0,
        deadline: Deadline | None = None,
        say: Callable[[str], None] | None = None,
    ) -> None:
        self._context, self._memory, self._deadline = context(threads), memory, deadline or Deadline()
        self._say = say or (lambda line: None)
        self._child: Child | None = None
        self._folder = tempfile.TemporaryDirectory(prefix="cpbench-explain-")

    def __enter__(self) -> Apart:
        return self

    def __exit__(self, *_: object) -> None:
        self._close()
        self._folder.cleanup()

    def __call__(self, text: str, problem: Problem, budget: Budget, start: Any = None) -> Raw:
        """Solve; what ends the process, or the time, is the status."""
        path = Path(self._folder.name) / "problem"
        shared_problem.write(problem, path)
        request = {"path": str(path), "solver": text, "tolerance": budget.tolerance, "seconds": budget.seconds}
        vectors = {} if start is None else {"start": start.vector}
        try:
            start_too = "" if self._child is not None else "starting a process, "
            self._say(f"{start_too}loading {text} (compiling it, once on this machine)")
            self._ask({"warm": text}, {}, WARM_UP.limit())
            self._say(f"{text} solves, at most {budget.seconds:.3g} s")
            reply, arrays = self._ask(request, vectors, LOAD.floor + budget.seconds + GRACE)
            return _raw(reply, arrays)
        except TimedOut:
            result = Raw(
                status=Status.TIMEOUT, message=f"still running after {budget.seconds:g} s", seconds=budget.seconds
            )
        except Died as death:
            status = Status.MEMOUT if death.out_of_memory else Status.CRASH
            result = Raw(status=status, message=f"the process ended: {describe_exit(death)}")
        except (frames.FrameError, KeyError, TypeError, ValueError) as noise:
            result = Raw(status=Status.ERROR, message=f"what came is no answer: {noise}")
        self._close()
        return result

    def _ask(
        self, request: Mapping[str, Any], vectors: Mapping[str, Any], seconds: float
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        if not self._deadline.left:
            raise TimedOut
        if self._child is None:
            self._child = Child(self._context, _main, (self._memory,))
        self._child.forget()
        self._child.send(frames.pack(request, vectors))
        return frames.unpack(self._child.receive(min(seconds, self._deadline.left)), frames.UNTRUSTED_HEADER)

    def _close(self) -> None:
        if self._child is not None:
            self._child.kill()
            self._child = None


def _raw(reply: Mapping[str, Any], arrays: Mapping[str, Any]) -> Raw:
    """Return a reply as it was sent; raises KeyError, TypeError, ValueError where it does not hold together."""
    iterates = np.array(arrays["iterates"])
    counters = {str(name): int(value) for name, value in reply["counters"].items()}
    return Raw(
        **{name: str(reply[name]) for name in TEXTS},
        counters=counters,
        seconds=float(reply["seconds"]),
        answer=np.array(arrays["answer"]) if "answer" in arrays else None,
        certificate=np.array(arrays["certificate"]) if "certificate" in arrays else None,
        residuals=np.array(arrays["residuals"]),
        iterations=np.array(arrays["iterations"]),
        iterates=iterates.reshape(arrays["iterations"].size, -1) if iterates.size else np.zeros((0, 0)),
    )


def _main(channel: Channel, memory: int) -> None:
    """Answer each request, in the process."""
    limited = False
    while True:
        try:
            request, vectors = frames.unpack(channel.recv_bytes())
        except EOFError:
            return
        if "warm" in request:
            warm_up(named(request["warm"])[0])
            if not limited:
                limit_address_space(memory)
                limited = True
            channel.send_bytes(frames.pack({}))
            continue
        problem = shared_problem.read(request["path"])
        start = problem.point_from_vector(np.array(vectors["start"])) if "start" in vectors else None
        budget = Budget(tolerance=request["tolerance"], seconds=request["seconds"])
        raw = solve_here(request["solver"], problem, budget, start)
        found = {name: getattr(raw, name) for name in ARRAYS}
        header = {name: str(getattr(raw, name)) for name in TEXTS}
        header |= {"counters": dict(raw.counters), "seconds": raw.seconds}
        channel.send_bytes(frames.pack(header, {name: v for name, v in found.items() if v is not None}))
