"""The process that runs one solver. It loads, warms up, solves and reports; it judges nothing.

Messages in: `solve` (path of the problem, budget, options). Messages out: `ready`, then for every solve
`loaded`, `result` and, for short solves, `repeats`. The limit of the runner counts from `loaded`.
"""

from __future__ import annotations

import gc
import os
import time
import traceback
from multiprocessing.connection import Connection
from typing import Any

from cpbench import storage
from cpbench.bench import wire
from cpbench.bench.history import recorded
from cpbench.bench.process import address_space, limit_memory
from cpbench.formulations.base import Problem
from cpbench.solvers.base import Budget, Solver, SolverOutput, solvers

SHORT = 1.0
"""Solves below this many seconds are repeated."""


def main(connection: Connection, solver_name: str, memory: int, fresh: bool = False) -> None:
    """Serve solves of one solver until the runner closes the pipe."""
    solver = solvers.get(solver_name)
    available = solver.availability()
    if not available.ok:
        connection.send_bytes(wire.pack({"event": "unavailable", "state": available.state, "detail": available.detail}))
        return
    started = time.perf_counter()
    solver.warmup()
    version = solver.version()
    limit_memory(memory)
    warm = address_space()
    connection.send_bytes(
        wire.pack({"event": "ready", "version": version, "seconds": time.perf_counter() - started, "pid": os.getpid()})
    )
    cached: tuple[str, Problem] | None = None
    while True:
        try:
            header, start = wire.unpack(connection.recv_bytes())
        except EOFError:
            return
        try:
            begun = time.perf_counter()
            if cached is None or cached[0] != header["path"]:
                cached = (header["path"], storage.load(header["path"]))
            problem = cached[1]
            connection.send_bytes(wire.pack({"event": "loaded", "load": time.perf_counter() - begun}))
            _solve(connection, solver, problem, header, start, warm)
        except MemoryError:
            cached = None
            gc.collect()
            connection.send_bytes(wire.pack({"event": "memory"}))
        except Exception as error:
            connection.send_bytes(
                wire.pack({"event": "error", "message": f"{type(error).__name__}: {error}"[:2000], "trace": _trace()})
            )


def _solve(
    connection: Connection,
    solver: Solver,
    problem: Problem,
    header: dict[str, Any],
    start: dict[str, Any],
    warm: int,
) -> None:
    budget = Budget(**header["budget"])
    options = solver.spec.options(**header["options"])
    why = solver.obstacle(problem)
    if why is not None:
        connection.send_bytes(wire.pack({"event": "unsupported", "message": why}))
        return
    first = problem.point_type(**start) if start else None
    output, setup, solve, cpu = _timed(solver, problem, budget, options, first)
    vectors = output.point.arrays() if output.point is not None else {}
    if output.certificate is not None:
        vectors = {**vectors, "certificate": output.certificate}
    connection.send_bytes(
        wire.pack(
            {
                "event": "result",
                "claim": str(output.claim),
                "answered": output.point is not None,
                "message": output.message[:2000],
                "counters": {k: int(v) for k, v in output.counters.items()},
                "setup": setup,
                "solve": solve,
                "cpu": cpu,
                "grown": address_space() - warm,
            },
            vectors,
        )
    )
    if header["repeats"] > 1 and setup + solve < SHORT:
        times = [_timed(solver, problem, budget, options, first)[1:] for _ in range(header["repeats"] - 1)]
        connection.send_bytes(wire.pack({"event": "repeats", "times": times}))
    if header.get("history"):
        connection.send_bytes(recorded(solver, problem, budget, options, first))


def _timed(
    solver: Solver, problem: Problem, budget: Budget, options: Any, start: Any
) -> tuple[SolverOutput, float, float, float]:
    gc.collect(0)
    cpu = time.process_time()
    begun = time.perf_counter()
    prepared = solver.setup(problem, budget, options)
    between = time.perf_counter()
    output = solver.solve(prepared, budget, options, start)
    ended = time.perf_counter()
    return output, between - begun, ended - between, time.process_time() - cpu


def _trace() -> str:
    return traceback.format_exc(limit=-6)[-4000:]


solvers.discover()  # in the forkserver's preload: every worker inherits the imported specs
