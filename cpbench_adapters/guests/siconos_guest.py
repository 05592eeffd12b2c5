"""One solver of Siconos as a served program: `python3 siconos_guest.py SICONOS_LCP_LEMKE --storage dense`.

Needs NumPy and Debian's python3-siconos (4.4) only, and nothing of cpbench: it runs in the system's Python. Requests
and replies are lines of JSON (protocol 1 of served solvers). Siconos prints with printf: the stdout that it sees is
our stderr. Without a solver, it prints what this Siconos is and which constants it has, and ends.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any, TextIO


def main(arguments: list[str]) -> None:
    replies = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    if not arguments:
        replies.write(json.dumps(_about()) + "\n")
        replies.flush()
        return
    parser = argparse.ArgumentParser()
    parser.add_argument("solver", help="name of a constant of Siconos: SICONOS_LCP_LEMKE")
    parser.add_argument("--storage", default="given", choices=("dense", "blocks", "sparse", "given"))
    chosen = parser.parse_args(arguments)
    _serve(Guest(chosen.solver, chosen.storage), replies)


def _about() -> dict[str, Any]:
    from siconos_memory import numerics, version

    constants = {n: v for n in dir(numerics) if n.startswith("SICONOS_") and isinstance(v := getattr(numerics, n), int)}
    return {"version": version(), "constants": constants}


def _serve(guest: Guest, replies: TextIO) -> None:
    for line in iter(sys.stdin.readline, ""):
        while line and json.loads(line)["do"] == "load":
            line = _apart(guest, line, replies)
        if not line or json.loads(line)["do"] == "quit":
            return
        _answer(guest, line, replies)


def _apart(guest: Guest, line: str, replies: TextIO) -> str:
    """Answer a load, and all that follows up to the next one, in a child: memory that a solver leaves behind or spoils
    is gone with the problem. The request that the child leaves over; a child that dies takes its parent along."""
    left, over = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(left)
        _answer(guest, line, replies)
        for line in iter(sys.stdin.readline, ""):
            if json.loads(line)["do"] in ("load", "quit"):
                os.write(over, line.encode())
                break
            _answer(guest, line, replies)
        os._exit(0)
    os.close(over)
    with os.fdopen(left, encoding="utf-8") as rest:
        line = rest.read()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code < 0:
        if -code != signal.SIGKILL:
            signal.signal(-code, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    if code > 0:
        os._exit(code)
    return line


def _answer(guest: Guest, line: str, replies: TextIO) -> None:
    request = json.loads(line)
    try:
        if guest.known:
            reply = {"ok": True, **getattr(guest, request["do"])(request)}
        else:
            reply = {"unavailable": f"this Siconos has no {guest.solver}", "state": "missing"}
    except MemoryError as cause:
        reply = {"memory": str(cause) or "no memory for the problem"}
    except Exception as cause:
        reply = {"error": f"{type(cause).__name__}: {cause}"}
    replies.write(json.dumps(reply) + "\n")
    replies.flush()


class Guest:
    """Handlers of the requests, for one solver and the storage of its matrices."""

    def __init__(self, solver: str, storage: str) -> None:
        import siconos_maps  # before the first fork
        import siconos_problems
        from siconos_memory import numerics, read

        self.numerics: Any = numerics
        self.read, self.problems, self.maps = read, siconos_problems, siconos_maps
        self.solver, self.storage = solver, storage
        numerics.numerics_set_verbose(0)
        self.known = hasattr(numerics, solver)
        self.loaded: Any = None

    def hello(self, request: dict[str, Any]) -> dict[str, Any]:
        from siconos_memory import version

        return {"name": self.solver, "version": version()}

    def warmup(self, request: dict[str, Any]) -> dict[str, Any]:
        return {}

    def load(self, request: dict[str, Any]) -> dict[str, Any]:
        folder = Path(request["problem"])
        description = json.loads((folder / "problem.json").read_text(encoding="utf-8"))
        data = self.read(folder)
        if "F.heads" in data:
            self.loaded = self.maps.load(self.solver, data)
        else:
            self.loaded = self.problems.load(request["node"], data, self.storage, int(description.get("dimension", 1)))
        return {}

    def solve(self, request: dict[str, Any]) -> dict[str, Any]:
        """Solve; `options`: "tolerance", "max_iter", and "inner": "" or the constant of the solver of the
        subproblems."""
        settings = request.get("options") or {}
        self.loaded.start(self.read(Path(request["start"])) if request.get("start") else {})
        begun = time.perf_counter()
        options = self.numerics.SolverOptions(getattr(self.numerics, self.solver))
        limit = int(settings["max_iter"])
        options.iparam[self.numerics.SICONOS_IPARAM_MAX_ITER] = limit
        options.iparam[self.numerics.SICONOS_IPARAM_ITER_DONE] = 0
        if self.solver == "SICONOS_NCP_PATHSEARCH":  # without its own memory it frees what it does not have, and dies
            options.iparam[self.numerics.SICONOS_IPARAM_PREALLOC] = 1
        options.dparam[self.numerics.SICONOS_DPARAM_TOL] = settings["tolerance"]
        if settings.get("inner"):
            self.numerics.solver_options_update_internal(options, 0, getattr(self.numerics, settings["inner"]))
        info = self.loaded.call(int(options.this))
        seconds = time.perf_counter() - begun
        done = max(int(options.iparam[self.numerics.SICONOS_IPARAM_ITER_DONE]), 0)
        residual = float(options.dparam[self.numerics.SICONOS_DPARAM_RESIDU])
        # the codes of failure differ from solver to solver; that the bound was reached is the same for all
        claim = "solved" if info == 0 else "max_iter" if done >= limit else "failed"
        return {
            "claim": claim,
            "iterations": done,
            "seconds": seconds,
            "counters": self.loaded.counters(),
            "message": f"info {info}, Siconos' own error {residual:.1e}",
        }

    def write(self, request: dict[str, Any]) -> dict[str, Any]:
        import numpy as np

        folder = Path(request["answer"])
        folder.mkdir(parents=True, exist_ok=True)
        for name, part in self.loaded.answer().items():
            np.save(folder / f"{name}.npy", part)
        return {}


if __name__ == "__main__":
    main(sys.argv[1:])
