"""A served solver that misbehaves: `python served_faults.py FAULT`. Without a fault it solves LCPs by Gauss-Seidel.

It knows nothing of cpbench, as no program has to: NumPy alone, and the protocol of cpbench/solvers/external/served.py.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

FAULT = sys.argv[1]
_known: set[bytes] = set()
"""Problems that were solved before: nobody has to solve them again."""


def reply(**what: object) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def gauss_seidel(M: np.ndarray, q: np.ndarray) -> np.ndarray:
    z = np.zeros_like(q)
    for _ in range(200):
        for i in range(q.size):
            z[i] = max(0.0, z[i] - (M[i] @ z + q[i]) / M[i, i])
    return z


def solve(M: np.ndarray, q: np.ndarray) -> None:
    """Reply to `solve`, in one way or another."""
    match FAULT:
        case "hang":
            time.sleep(60.0)
        case "remember" if M.tobytes() not in _known:
            _known.add(M.tobytes())
            time.sleep(0.8)
        case "segfault":
            sys.stderr.write("last words of a program\n")
            ctypes.string_at(0)
        case "exit":
            sys.exit(3)
        case "exit-0":
            sys.exit(0)
        case "noise":
            print("iteration 1: 0.5", flush=True)
        case "json":
            print('{"ok": true', flush=True)
        case "list":
            print("[1, 2]", flush=True)
        case "giant":
            os.write(1, b"x" * 2**21)
        case "binary":
            os.write(1, bytes(range(256)) + b"\n")
        case "deep":
            os.write(1, b"[" * 10**5 + b"\n")
        case "close":
            os.close(1)
            time.sleep(60.0)
        case "twice":  # one write(2) whatever buffers there are (PYTHONUNBUFFERED): no line is late by chance
            os.write(1, b'{"ok": true, "claim": "solved"}\n{"ok": true}\n')
            return
        case "claim":
            return reply(ok=True, claim="splendid")
        case "error":
            return reply(error="a pivot is 0")
        case "refuse":
            return reply(unsupported="M is not symmetric")
        case "licence":
            return reply(unavailable="the licence ended yesterday", state="licence")
        case "memory":
            return reply(memory="no room for a factorization")
        case "eat":
            np.ones(2**28)
        case "infeasible":
            return reply(ok=True, claim="infeasible")
        case "odd":
            return reply(ok=True, claim="solved", iterations=2.5, seconds="fast", counters=[1], message=["ok"], more=1)
    reply(ok=True, claim="solved", iterations=200, seconds=0.25, message="", counters={"sweeps": 200})
    if FAULT == "late":
        time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGABRT)


def write(folder: Path, z: np.ndarray) -> None:
    match FAULT:
        case "infeasible" | "missing":
            return
        case "nan":
            z = np.full_like(z, np.nan)
        case "size":
            z = z[:-1]
        case "complex":
            z = z + 1j
        case "objects":
            z = np.array([{}], dtype=object)
        case "text":
            (folder / "z.npy").write_text("1.0 1.0 1.0")
            return
    np.save(folder / "z.npy", z)


def main() -> None:
    M = q = z = np.zeros(0)
    for line in sys.stdin:
        request = json.loads(line)
        match request["do"]:
            case "hello" if FAULT == "hello-hang":
                time.sleep(600.0)
            case "warmup" if FAULT == "warmup-hang":
                time.sleep(600.0)
            case "load" if FAULT == "load-hang":
                time.sleep(600.0)
            case "hello":
                if FAULT == "no-licence":
                    reply(unavailable="no licence file", state="licence")
                    continue
                if FAULT == "broken":
                    raise ImportError("libmine.so.2")
                reply(ok=True, name=FAULT, version="1.2")
                continue
            case "load":
                folder = Path(request["problem"])
                M, q = np.load(folder / "M.npy"), np.load(folder / "q.npy")
            case "solve":
                solve(M, q)
                z = gauss_seidel(M, q)
                continue
            case "write":
                if FAULT == "stall":
                    time.sleep(60.0)
                write(Path(request["answer"]), z)
            case "quit":
                if FAULT != "stay":
                    return
                signal.signal(signal.SIGTERM, signal.SIG_IGN)
                time.sleep(60.0)
        reply(ok=True)


main()
