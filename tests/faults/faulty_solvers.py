"""Solvers that misbehave in every way the runner must survive; a plugin file, loaded by `--plugin`."""

import ctypes
import itertools
import json
import mmap
import os
import shutil
import signal
import socket
import stat
import struct
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cpbench.formulations import LCPPoint, MLCPPoint
from cpbench.solvers import Claim, Solver, SolverOutput, SolverSpec, register

LONG = 3600
FAULTS = {}


def _faulty(name, misbehave):
    FAULTS[name] = misbehave

    def solve(self, prepared, budget, options, start=None, record=None):
        return misbehave(prepared)

    spec = SolverSpec(name=f"faulty-{name}", node="lcp", summary=f"always {name}", method="fault")
    register(type(f"Faulty{name.title().replace('-', '')}", (Solver,), {"spec": spec, "solve": solve}))


def _claim(z, **more):
    return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=z), **more)


def _right(problem, **more):
    return _claim(np.linalg.solve(problem.M, -problem.q), **more)


def _and_right(misbehave):
    """A fault, and then the right answer."""
    return lambda problem: (misbehave(problem), _right(problem))[1]


def _raising(error):
    def misbehave(problem):
        raise error

    return misbehave


# ------------------------------------------------------------------------------------- ends and hangs


def _hang(problem):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    while True:
        time.sleep(LONG)


def _sleep_in_c(problem):
    """Without the interpreter: no Python signal handler would run."""
    ctypes.CDLL(None).sleep(LONG)


def _orphan(problem):
    if os.fork() == 0:
        time.sleep(LONG)
    os._exit(3)


def _forkserver(problem):
    """The parent of our parent, who is the parent of everybody's parents."""
    import psutil

    psutil.Process().parents()[1].kill()
    time.sleep(LONG)


def _alarm(problem):
    signal.setitimer(signal.ITIMER_REAL, 0.05)


def _recurse(problem):
    return _recurse(problem)


_faulty("abort", lambda p: os.abort())
_faulty("segfault", lambda p: ctypes.string_at(0))
_faulty("term", lambda p: os.kill(os.getpid(), signal.SIGTERM))
_faulty("own-group", lambda p: os.killpg(0, signal.SIGKILL))
_faulty("exit", lambda p: sys.exit(3))
_faulty("exit-0", lambda p: sys.exit())
_faulty("hang", _hang)
_faulty("sleep-in-c", _sleep_in_c)
_faulty("stop", lambda p: os.kill(os.getpid(), signal.SIGSTOP))
_faulty("orphan", _orphan)
_faulty("parent", _and_right(lambda p: (os.kill(os.getppid(), signal.SIGKILL), time.sleep(0.2))))
_faulty("stop-parent", _and_right(lambda p: os.kill(os.getppid(), signal.SIGSTOP)))
_faulty("forkserver", _forkserver)
_faulty("alarm", _and_right(_alarm))
_faulty("recurse", _recurse)


# -------------------------------------------------------------------------------------------- children


def _children(problem):
    for _ in range(5):
        if os.fork() == 0:
            time.sleep(LONG)
    time.sleep(LONG)


def _burst(problem, count=50):
    for _ in range(count):
        os.posix_spawn(shutil.which("sleep"), ["sleep", str(LONG)], os.environ)


def _daemon(problem):
    """Forked twice, in a session of its own: no child of ours any more, nor of our group."""
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            time.sleep(LONG)
        os._exit(0)
    os.waitpid(-1, 0)


def _twin(problem):
    os.fork()


def _crowd(problem):
    """Children of every kind, and then a hang."""
    for _ in range(3):
        _daemon(problem)
    _burst(problem, 10)
    time.sleep(LONG)


def _swarm(problem):
    """More children than anybody may have, and then a hang."""
    for _ in range(400):
        if os.fork() == 0:
            time.sleep(LONG)
    time.sleep(LONG)


_faulty("children", _children)
_faulty("swarm", _swarm)
_faulty("burst", _and_right(_burst))
_faulty("daemon", _and_right(_daemon))
_faulty("twin", _and_right(_twin))
_faulty("crowd", _crowd)


# ---------------------------------------------------------------------------------------------- memory


def _eat(problem):
    hoard = []
    while True:
        hoard.append(np.empty(2**22))  # 32 MiB, a page of each written: quick on a busy machine too
        hoard[-1][0] = 1.0


def _malloc(problem):
    libc = ctypes.CDLL(None)
    libc.malloc.restype = ctypes.c_void_p
    libc.malloc.argtypes = [ctypes.c_size_t]
    if not libc.malloc(2**31):  # what `new` does then, in a library of C++
        os.write(2, b"terminate called after throwing an instance of 'std::bad_alloc'\n")
        os.abort()


def _page(problem):
    """Written page by page: 2 GiB of resident memory."""
    room, part = mmap.mmap(-1, 2**31), b"\1" * 2**24
    for at in range(0, 2**31, len(part)):
        room[at : at + len(part)] = part
    time.sleep(LONG)


_faulty("eat", _eat)
_faulty("numpy", lambda p: np.ones(2**28))
_faulty("malloc", _and_right(_malloc))
_faulty("mmap", lambda p: mmap.mmap(-1, 2**31))
_faulty("page", _page)


# ---------------------------------------------------------------------------------------------- output


def _flood(problem):
    os.write(1, b"first words\n")
    for _ in range(100):
        os.write(1, b"noise\n" * 2**19)  # 3 MiB, 300 MiB in all
    os.write(2, b"last words\n")
    os.abort()


def _chatter(problem):
    """A thread that goes on printing when the answer is there."""

    def talk():
        while True:
            os.write(1, b"noise\n" * 1000)
            time.sleep(1e-3)

    threading.Thread(target=talk, daemon=True).start()


_faulty("flood", _flood)
_faulty("chatter", _and_right(_chatter))
_faulty("noise", _and_right(lambda p: os.write(1, b"noise\n" * 1000)))


# ------------------------------------------------------------------------------------- descriptors, data


def _sockets():
    """Every socket this process has: the connection to the runner is among them."""
    for descriptor in range(3, 256):
        try:
            if stat.S_ISSOCK(os.fstat(descriptor).st_mode):
                yield socket.socket(fileno=os.dup(descriptor))
        except OSError:
            continue


def _say(message):
    def misbehave(problem):
        for connection in _sockets():
            connection.sendall(message)
        time.sleep(LONG)

    return misbehave


def _half(problem):
    """Half a message, then an end, with a child that holds the connection open."""
    for connection in _sockets():
        connection.sendall(struct.pack("<4sIQ", b"cpb1", 1, 1000) + b"half")
    if os.fork() == 0:
        time.sleep(LONG)
    os._exit(5)


def _close(problem):
    os.closerange(3, 256)
    time.sleep(LONG)


def _shut(problem):
    os.closerange(0, 3)


def _write(problem):
    problem.q[0] = 1.0


def _overwrite(problem):
    problem.q.setflags(write=True)
    problem.q[:] = 1.0


def _overwrite_matrix(problem):
    """Past what numpy knows: sorted in place, as a pivoting in C would leave it."""
    answer = _right(problem)
    rows = (ctypes.c_double * problem.M.size).from_address(problem.M.ctypes.data)
    rows[:] = sorted(rows)
    return answer


def _threads(problem):
    import threadpoolctl

    threadpoolctl.threadpool_limits(4)
    M = np.ones((300, 300))
    M @ M


def _busy(problem):
    """Threads at work that are gone when the answer is there."""

    def work():
        end = time.perf_counter() + 0.3
        x = np.ones(500_000)
        while time.perf_counter() < end:
            np.sin(x)

    workers = [threading.Thread(target=work) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()


_faulty("junk", _say(b"junk" * 100))
_faulty("giant", _say(struct.pack("<4sIQ", b"cpb1", 1, 2**60)))
_faulty("half", _half)
_faulty("close", _close)
_faulty("shut", _and_right(_shut))
_faulty("write", _write)
_faulty("overwrite", lambda p: (_right(p), _overwrite(p))[0])
_faulty("overwrite-c", _overwrite_matrix)
_faulty("threads", _and_right(_threads))
_faulty("busy", _and_right(_busy))


# ---------------------------------------------------------------------------------- exceptions, answers


class _Mute(Exception):
    def __str__(self):
        raise RuntimeError("no words")

    __repr__ = __str__


class _Beyond(BaseException):
    pass


class _Cargo(Exception):
    def __init__(self):
        super().__init__(lambda: None, threading.Lock(), open(os.devnull))  # noqa: SIM115 - cannot be pickled


_faulty("raise", lambda p: 1 / 0)
_faulty("mute", _raising(_Mute()))
_faulty("beyond", _raising(_Beyond("base")))
_faulty("interrupt", _raising(KeyboardInterrupt()))
_faulty("cargo", lambda p: _raising(_Cargo())(p))  # made in the worker: nothing here travels
_faulty("verbose", lambda p: _right(p, message="x" * 10**7))
_faulty("rant", _raising(ValueError("x" * 10**7)))
_faulty("nan", lambda p: _claim(np.full(p.q.size, np.nan)))
_faulty("inf", lambda p: _claim(np.full(p.q.size, np.inf)))
_faulty("liar", lambda p: _claim(np.zeros(p.q.size)))
_faulty("alias", lambda p: _claim(p.q))
_faulty("short", lambda p: _claim(np.zeros(p.q.size + 1)))
_faulty("integers", lambda p: _claim(np.ones(p.q.size, dtype=int)))
_faulty("complex", lambda p: _claim(np.ones(p.q.size) * 1j))
_faulty("objects", lambda p: _claim(np.array([object()] * p.q.size)))
_faulty("nothing", lambda p: SolverOutput(claim=Claim.SOLVED))
_faulty("none", lambda p: None)
_faulty("other-point", lambda p: SolverOutput(claim=Claim.SOLVED, point=MLCPPoint(u=np.zeros(0), v=np.ones(p.q.size))))
_faulty("no-claim", lambda p: SolverOutput(claim="splendid", point=LCPPoint(z=np.ones(p.q.size))))
_faulty("tally", lambda p: _right(p, counters={f"c{k}": k for k in range(10**5)}))
_faulty("counters", lambda p: _right(p, counters={"iterations": 2.5, "pivots": np.int64(3)}))


# ------------------------------------------------------------------------------------- repeats, queues


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


_faulty("turnstile", _turnstile)
_then("abort", lambda p: os.abort())
_then("hang", _hang)
_then("eat", _eat)
_then("raise", lambda p: 1 / 0)


# ---------------------------------------------------------------------------------------------- a storm


DEALT = json.loads(Path(os.environ["CHAOS"]).read_text()) if "CHAOS" in os.environ else {}
"""Of the file that the variable names: "solver seed n" -> a fault; what is not in it is solved rightly."""


@dataclass(frozen=True)
class Seed:
    """`seed` : which pair this is; it is no more than a name."""

    seed: int = 0


def _chaos(name):
    def solve(self, prepared, budget, options, start=None, record=None):
        fault = DEALT.get(f"{name} {options.seed} {prepared.q.size}")
        return FAULTS[fault](prepared) if fault else _right(prepared)

    spec = SolverSpec(name=name, node="lcp", summary="solves, or worse", method="chaos", options=Seed)
    register(type(name.title(), (Solver,), {"spec": spec, "solve": solve}))


for _name in ("chaos1", "chaos2", "chaos3"):
    _chaos(_name)
