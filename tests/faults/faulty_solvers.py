"""Solvers that misbehave in every way the runner must survive; a plugin file, loaded by `--plugin`."""

import ctypes
import itertools
import os
import signal
import sys
import time

import numpy as np

from cpbench.formulations import LCPPoint
from cpbench.solvers import Claim, Solver, SolverOutput, SolverSpec, register


def _faulty(name, misbehave):
    def solve(self, prepared, budget, options, start=None, record=None):
        return misbehave(prepared)

    spec = SolverSpec(name=f"faulty-{name}", node="lcp", summary=f"always {name}", method="fault")
    register(type(f"Faulty{name.title().replace('-', '')}", (Solver,), {"spec": spec, "solve": solve}))


def _claim(z):
    return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=z))


def _hang(problem):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    while True:
        time.sleep(3600)


def _eat(problem):
    hoard = []
    while True:
        hoard.append(np.empty(2**22))  # 32 MiB, a page of each written: quick on a busy machine too
        hoard[-1][0] = 1.0


def _children(problem):
    for _ in range(5):
        if os.fork() == 0:
            time.sleep(3600)
    time.sleep(3600)


def _orphan(problem):
    if os.fork() == 0:
        time.sleep(3600)
    os._exit(3)


def _flood(problem):
    os.write(1, b"first words\n")
    for _ in range(100):
        os.write(1, b"noise\n" * 2**19)  # 3 MiB, 300 MiB in all
        time.sleep(0.01)
    os.write(2, b"last words\n")
    os.abort()


def _right(problem):
    return _claim(np.linalg.solve(problem.M, -problem.q))


def _then(name, misbehave):
    """A right answer first, every second time a fault: what a repeat for the time's sake meets."""
    calls = itertools.count()
    _faulty(f"then-{name}", lambda p: misbehave(p) if next(calls) % 2 else _right(p))


_passed = itertools.count()


def _turnstile(problem):
    """Ten problems pass (each is solved three times); the next ones wait as long as the file `hold` is there."""
    if next(_passed) >= 30:
        while os.path.exists("hold"):
            time.sleep(0.01)
    return _right(problem)


_faulty("abort", lambda p: os.abort())
_faulty("segfault", lambda p: ctypes.string_at(0))
_faulty("flood", _flood)
_faulty("exit", lambda p: sys.exit(3))
_faulty("hang", _hang)
_faulty("children", _children)
_faulty("orphan", _orphan)
_faulty("raise", lambda p: 1 / 0)
_faulty("nan", lambda p: _claim(np.full(p.q.size, np.nan)))
_faulty("liar", lambda p: _claim(np.zeros(p.q.size)))
_faulty("short", lambda p: _claim(np.zeros(p.q.size + 1)))
_faulty("nothing", lambda p: SolverOutput(claim=Claim.SOLVED))
_faulty("eat", _eat)
_faulty("noise", lambda p: (os.write(1, b"noise\n" * 1000), _right(p))[1])
_faulty("turnstile", _turnstile)
_then("abort", lambda p: os.abort())
_then("hang", _hang)
_then("eat", _eat)
_then("raise", lambda p: 1 / 0)
