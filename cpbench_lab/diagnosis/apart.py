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
from cpbench.bench.processes.server import NoAnswer, ServerProcess, serve
from cpbench.bench.time_limits import GRACE, LOAD, WARM_UP
from cpbench.formulations.base import Problem
from cpbench.solvers.base import Budget, warm_up
from cpbench.verification import Status
from cpbench_lab.diagnosis.attempts import Deadline, Raw, named, solve_here

TEXTS, ARRAYS = ("status", "claim", "message"), ("answer", "certificate", "residuals", "iterations", "iterates")


class Apart(ServerProcess):
    """A process in which solvers are run. `memory` : bytes it may add, 0: any. `deadline` : what runs then is stopped,
    a compilation too. `say` : takes a line on what it does."""

    def __init__(
        self,
        threads: int = 1,
        memory: int = 0,
        deadline: Deadline | None = None,
        say: Callable[[str], None] | None = None,
    ) -> None:
        super().__init__(context(threads), _main, (memory,))
        self._deadline, self._say = deadline or Deadline(), say or (lambda line: None)
        self._folder = tempfile.TemporaryDirectory(prefix="cpbench-explain-")

    def __exit__(self, *_: object) -> None:
        self.close()
        self._folder.cleanup()

    def __call__(self, text: str, problem: Problem, budget: Budget, start: Any = None) -> Raw:
        """Solve; what ends the process, or the time, is the status."""
        path = Path(self._folder.name) / "problem"
        shared_problem.write(problem, path)
        request = {"path": str(path), "solver": text, "tolerance": budget.tolerance, "seconds": budget.seconds}
        vectors = {} if start is None else {"start": start.vector}
        try:
            start_too = "" if self.running else "starting a process, "
            self._say(f"{start_too}loading {text} (compiling it, once on this machine)")
            self._in_time(WARM_UP.limit(), {"warm": text}, {})
            self._say(f"{text} solves, at most {budget.seconds:.3g} s")
            return _raw(*self._in_time(LOAD.floor + budget.seconds + GRACE, request, vectors))
        except NoAnswer as end:
            spent = budget.seconds if end.status == Status.TIMEOUT else 0.0
            return Raw(status=end.status, message=str(end), seconds=spent)
        except (KeyError, TypeError, ValueError) as noise:
            self.close()
            return Raw(status=Status.ERROR, message=f"what came is no answer: {noise}")

    def _in_time(
        self, seconds: float, request: Mapping[str, Any], vectors: Mapping[str, Any]
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Ask within the time that is left; raises NoAnswer."""
        if not self._deadline.left:
            raise NoAnswer(Status.TIMEOUT, "the time of the diagnosis is over")
        return self.ask(min(seconds, self._deadline.left), request, vectors)


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

    def answer(request: Mapping[str, Any], vectors: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        nonlocal limited
        if "warm" in request:
            warm_up(named(request["warm"])[0])
            if not limited:
                limit_address_space(memory)
                limited = True
            return {}, {}
        problem = shared_problem.read(request["path"])
        start = problem.point_from_vector(np.array(vectors["start"])) if "start" in vectors else None
        budget = Budget(tolerance=request["tolerance"], seconds=request["seconds"])
        raw = solve_here(request["solver"], problem, budget, start)
        header = {name: str(getattr(raw, name)) for name in TEXTS} | {"counters": dict(raw.counters)}
        arrays = {name: getattr(raw, name) for name in ARRAYS}
        return header | {"seconds": raw.seconds}, {name: v for name, v in arrays.items() if v is not None}

    serve(channel, answer)
