"""Solvers that solve, but for the faults that a file deals out; a plugin file, loaded by `--plugin`.

`CHAOS` names a JSON file: "solver seed n" -> name of a fault. What is not in it is solved rightly.
"""

import ctypes
import json
import os
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cpbench.formulations import LCPPoint
from cpbench.solvers import Claim, Solver, SolverOutput, SolverSpec, register

DEALT = json.loads(Path(os.environ["CHAOS"]).read_text())


@dataclass(frozen=True)
class Seed:
    """`seed` : which pair this is; it is no more than a name."""

    seed: int = 0


class Unpicklable(Exception):
    def __reduce__(self):
        raise TypeError("no")


def _claim(z):
    return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=z))


def _fail(error):
    raise error


def _sleep(problem):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    time.sleep(3600)


def _eat(problem):
    """Address space is refused at once, memory is eaten page by page: what is limited is met well within the second."""
    hoard = []
    while True:
        hoard.append(np.empty(2**28))
        hoard[-1][::512] = 1.0


def _children(problem):
    for _ in range(10):
        if os.fork() == 0:
            time.sleep(3600)
    os.abort()


def _orphan(problem):
    if os.fork() == 0:
        time.sleep(3600)
    os._exit(3)


def _write(problem):
    """Of the problem, what may be written and what may not, and then a lie."""
    for array in (problem.q, problem.M):
        array.setflags(write=True)
        array[...] = 0.0
    return _claim(np.zeros(problem.q.size))


def _recurse(problem):
    return _recurse(problem)


def _stop_before_the_end(problem):
    """A right answer, and a child that holds on to everything."""
    if os.fork() == 0:
        time.sleep(3600)
    return _right(problem)


def _right(problem):
    return _claim(np.linalg.solve(problem.M, -problem.q))


FAULTS = {
    "abort": lambda p: os.abort(),
    "segfault": lambda p: ctypes.string_at(0),
    "kill": lambda p: os.kill(os.getpid(), signal.SIGKILL),
    "kill-parent": lambda p: (os.kill(os.getppid(), signal.SIGKILL), time.sleep(3600)),
    "exit": lambda p: sys.exit(3),
    "leave": lambda p: os._exit(0),
    "raise": lambda p: 1 / 0,
    "raise-unpicklable": lambda p: _fail(Unpicklable(lambda: 0)),
    "raise-odd-text": lambda p: _fail(ValueError("\udcff\x00\n" * 50)),
    "raise-much": lambda p: _fail(ValueError("x" * 10**7)),
    "raise-interrupt": lambda p: _fail(KeyboardInterrupt()),
    "recurse": _recurse,
    "nan": lambda p: _claim(np.full(p.q.size, np.nan)),
    "infinite": lambda p: _claim(np.full(p.q.size, np.inf)),
    "lie": lambda p: _claim(np.zeros(p.q.size)),
    "noise": lambda p: _claim(np.random.default_rng().standard_normal(p.q.size)),
    "short": lambda p: _claim(np.zeros(p.q.size - 1)),
    "nothing": lambda p: SolverOutput(claim=Claim.SOLVED),
    "none": lambda p: None,
    "words": lambda p: "solved",
    "complex": lambda p: _claim(np.full(p.q.size, 1j)),
    "hang": _sleep,
    "stop": lambda p: os.kill(os.getpid(), signal.SIGSTOP),
    "eat": _eat,
    "children": _children,
    "orphan": _orphan,
    "clinging": _stop_before_the_end,
    "close": lambda p: os.closerange(0, 256),
    "write": _write,
    "flood": lambda p: (os.write(1, b"noise\n" * 2**17), os.write(2, b"\xff" * 2**17), os.abort()),
}


def _chaos(name):
    def solve(self, prepared, budget, options, start=None, record=None):
        fault = DEALT.get(f"{name} {options.seed} {prepared.q.size}")
        return FAULTS[fault](prepared) if fault else _right(prepared)

    spec = SolverSpec(name=name, node="lcp", summary="solves, or worse", method="chaos", options=Seed)
    register(type(name.title(), (Solver,), {"spec": spec, "solve": solve}))


for name in ("chaos1", "chaos2", "chaos3"):
    _chaos(name)
