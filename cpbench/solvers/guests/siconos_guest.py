"""One solver of Siconos as a served program: `python3 siconos_guest.py SICONOS_LCP_LEMKE --storage dense`.

Needs NumPy and Debian's python3-siconos (4.4) only, and nothing of cpbench: it runs in the system's Python. Requests
and replies are lines of JSON (protocol 1 of served solvers). Siconos prints with printf: the stdout that it sees is
our stderr. Without a solver, it prints what this Siconos is and which constants it has, and ends.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any, TextIO

INFO_LINE = "siconos-guest "


def main(arguments: list[str]) -> None:
    replies = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    if not arguments:
        replies.write(f"{INFO_LINE}{json.dumps(_about())}\n")
        replies.flush()
        return
    parser = argparse.ArgumentParser()
    parser.add_argument("solver", help="name of a constant of Siconos: SICONOS_LCP_LEMKE")
    parser.add_argument("--storage", default="given", choices=("dense", "blocks", "sparse", "given"))
    parser.add_argument("--block", type=int, default=1, help="rows of a block where the problem does not tell")
    chosen = parser.parse_args(arguments)
    _serve(Guest(chosen.solver, chosen.storage, chosen.block), replies)


def _about() -> dict[str, Any]:
    from siconos_memory import numerics, version

    constants = {n: v for n in dir(numerics) if n.startswith("SICONOS_") and isinstance(v := getattr(numerics, n), int)}
    return {"version": version(), "constants": constants}


def _serve(guest: Guest, replies: TextIO) -> None:
    for line in sys.stdin:
        request = json.loads(line)
        if request["do"] == "quit":
            return
        try:
            if not guest.known:
                reply = {"unavailable": f"this Siconos has no {guest.solver}", "state": "missing"}
            else:
                reply = {"ok": True, **getattr(guest, request["do"])(request)}
        except MemoryError as cause:
            reply = {"memory": str(cause) or "no memory for the problem"}
        except Exception as cause:
            reply = {"error": f"{type(cause).__name__}: {cause}"}
        replies.write(json.dumps(reply) + "\n")
        replies.flush()


class Guest:
    """What the requests do, for one solver and the storage of its matrices."""

    def __init__(self, solver: str, storage: str, block: int) -> None:
        from siconos_memory import numerics

        self.numerics: Any = numerics
        self.solver, self.storage, self.block = solver, storage, block
        numerics.numerics_set_verbose(0)
        self.known = hasattr(numerics, solver)
        self.loaded: Any = None

    def hello(self, request: dict[str, Any]) -> dict[str, Any]:
        from siconos_memory import version

        return {"name": self.solver, "version": version()}

    def warmup(self, request: dict[str, Any]) -> dict[str, Any]:
        return {}

    def load(self, request: dict[str, Any]) -> dict[str, Any]:
        from siconos_memory import read
        from siconos_problems import load

        folder = Path(request["problem"])
        description = json.loads((folder / "problem.json").read_text(encoding="utf-8"))
        self.loaded = load(
            request["node"], read(folder), self.storage, self.block, int(description.get("dimension", 1))
        )
        return {}

    def solve(self, request: dict[str, Any]) -> dict[str, Any]:
        """`options`: "tolerance" and "max_iter"; by index what else of "iparam" and "dparam" is not the default; and
        "inner", the constant of another solver of the subproblems than the default."""
        from siconos_memory import read

        settings = request.get("options") or {}
        self.loaded.start(read(Path(request["start"])) if request.get("start") else {})
        begun = time.perf_counter()
        options = self.numerics.SolverOptions(getattr(self.numerics, self.solver))
        limit = int(settings["max_iter"])
        options.iparam[self.numerics.SICONOS_IPARAM_MAX_ITER] = limit
        options.iparam[self.numerics.SICONOS_IPARAM_ITER_DONE] = 0
        options.dparam[self.numerics.SICONOS_DPARAM_TOL] = settings["tolerance"]
        for index, value in settings.get("iparam", {}).items():
            options.iparam[int(index)] = value
        for index, value in settings.get("dparam", {}).items():
            options.dparam[int(index)] = value
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
