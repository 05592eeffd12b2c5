"""`python -m cpbench.solvers.external.serve NAME`: serve a registered solver to a cpbench in another process.

The other side of `served`, for a solver of another interpreter or environment: one solver, two builds in one run.
What the solver prints goes to stderr; stdout is for replies. A certificate stays here: only a claim and a point travel.
"""

from __future__ import annotations

import os

if __name__ == "__main__":
    _replies = os.dup(1)
    os.dup2(2, 1)  # before anything is imported that may print
else:
    _replies = -1

import json
import math
import sys
import time
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

from cpbench.errors import CpbenchError, FormatError, NotApplicable, Unavailable
from cpbench.formulations.base import Problem
from cpbench.formulations.exchange import Exchange, exchanges
from cpbench.solvers.base import Budget, Solver, SolverOutput, solvers

Reply = dict[str, Any]


class Desk:
    """A solver, the problem it holds, and its last answer: each is there from the request on that makes it."""

    _solver: Solver
    _exchange: Exchange
    _problem: Problem
    _handed: Any
    _output: SolverOutput | None = None

    def __init__(self, name: str) -> None:
        self._name = name

    def serve(self, requests: IO[bytes], replies: IO[bytes]) -> None:
        """Answer line by line until `quit` or the end."""
        for line in requests:
            request = json.loads(line)
            if request["do"] == "quit":
                return
            replies.write(json.dumps(self.answer(request)).encode() + b"\n")

    def answer(self, request: Mapping[str, Any]) -> Reply:
        """Return the reply to one request; never raises."""
        steps = {
            "hello": self._hello,
            "warmup": self._warmup,
            "load": self._load,
            "solve": self._solve,
            "write": self._write,
        }
        step = steps.get(request["do"])
        try:
            if step is None:
                return {"error": f"unknown request '{request['do']}'"}
            return {"ok": True, **step(request)}
        except NotApplicable as refusal:
            return {"unsupported": refusal.obstacle}
        except Unavailable as refusal:
            return {"unavailable": refusal.detail, "state": refusal.state}
        except MemoryError as cause:
            return {"memory": str(cause) or "MemoryError"}
        except Exception as cause:
            if not isinstance(cause, CpbenchError):
                traceback.print_exc()
            return {"error": f"{type(cause).__name__}: {cause}"}

    def _hello(self, request: Mapping[str, Any]) -> Reply:
        self._solver = solvers.get(self._name)
        available = self._solver.availability()
        if not available.ok:
            raise Unavailable(available.state, available.detail)
        return {"name": self._name, "version": self._solver.version()}

    def _warmup(self, request: Mapping[str, Any]) -> Reply:
        self._solver.warmup()
        return {}

    def _load(self, request: Mapping[str, Any]) -> Reply:
        path = Path(request["problem"])
        self._output = self._handed = None
        self.__dict__.pop("_problem", None)  # two at a time might not fit
        self._exchange = _exchange(path)
        problem = self._exchange.read_problem(path)
        why = self._solver.obstacle(problem)
        if why is not None:
            raise NotApplicable(self._name, why)
        self._handed, self._problem = self._solver.hand_over(problem), problem
        return {}

    def _solve(self, request: Mapping[str, Any]) -> Reply:
        solver, start = self._solver, None
        seconds = request.get("seconds")
        budget = Budget(
            tolerance=request["tolerance"],
            seconds=math.inf if seconds is None else seconds,
            iterations=request.get("iterations"),
            seed=request.get("seed", 0),
        )
        options = solver.spec.options(**request.get("options", {}))
        if request.get("start") is not None:
            start = self._exchange.read_answer(Path(request["start"]), self._problem)
        begun = time.perf_counter()
        output = solver.solve(solver.setup(self._handed, budget, options), budget, options, start)
        taken = time.perf_counter() - begun
        self._output = output
        counters = {str(name): int(count) for name, count in output.counters.items()}
        return {"claim": str(output.claim), "seconds": taken, "message": str(output.message), "counters": counters}

    def _write(self, request: Mapping[str, Any]) -> Reply:
        if self._output is None:
            raise CpbenchError("nothing was solved since the problem was loaded")
        point = self._solver.collect(self._output).point
        if point is not None:
            self._exchange.write_answer(point, Path(request["answer"]))
        return {}


def _exchange(path: Path) -> Exchange:
    """Return the one that wrote a problem, as its name or its folder says; raises FormatError."""
    if path.is_dir():
        return exchanges.get("npy-dir")
    for exchange in exchanges:
        if exchange.suffix and path.name.endswith(exchange.suffix):
            return exchange
    raise FormatError(path, "", "is not a file or folder of any exchange")


if __name__ == "__main__":
    Desk(sys.argv[1]).serve(sys.stdin.buffer, os.fdopen(_replies, "wb", buffering=0))
