"""Ways to start a process: a fork that ends itself, a program, and this interpreter once more.

All processes begin here, but for those of a run, which multiprocessing's forkserver makes with limits
(`bench.processes.launch`), and for commands whose output `subprocess.run` reads.
"""

from __future__ import annotations

import contextlib
import math
import os
import select
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Generator, Mapping, Sequence
from typing import Any, NoReturn

THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMBA_NUM_THREADS",
    "RAYON_NUM_THREADS",
)
"""What sets the number of threads of a numerical library, before it is imported."""
_POOLS: dict[int, Any] = {}
"""The numerical libraries of this process, by the number of modules that were imported when they were sought."""
LOOK = 0.001
"""Seconds between two looks at a process, where the system does not report its end."""


@contextlib.contextmanager
def blas_threads(count: int) -> Generator[None]:
    """Hold the numerical libraries of this process at `count` threads: many on a busy machine wait for each other. Each
    library is set only where it has another number."""
    if len(sys.modules) not in _POOLS:
        import threadpoolctl  # which no other command needs

        _POOLS.clear()
        _POOLS[len(sys.modules)] = threadpoolctl.ThreadpoolController().lib_controllers
    before = [(pool, number) for pool in next(iter(_POOLS.values())) if (number := pool.get_num_threads()) != count]
    for pool, _ in before:
        pool.set_num_threads(count)
    try:
        yield
    finally:
        for pool, number in before:
            pool.set_num_threads(number)


def fork(work: Callable[[], object]) -> int:
    """Fork, run `work` in the child, and end that with the exit code that Python gives to what `work` raised.

    Returns the id of the child. Only for processes with one thread: locks of others would stay closed in the child.
    """
    _flush()  # what is buffered would be written by both
    child = os.fork()
    if child == 0:
        _finish(work)
    return child


def start(command: Sequence[str], env: Mapping[str, str] | None = None, **options: Any) -> subprocess.Popen[bytes]:
    """Start a program, without a shell; `env` is added to our variables, `options` are those of Popen.

    Raises OSError where it cannot be started.
    """
    popen: type[subprocess.Popen[bytes]] = subprocess.Popen
    return popen(list(command), env={**os.environ, **(env or {})}, **options)


def start_python(code: str, *arguments: str, **options: Any) -> subprocess.Popen[bytes]:
    """Start this interpreter with a piece of code and the modules that this process finds; those in the current folder
    are not found unless this process names it. Raises OSError."""
    found = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    return start([sys.executable, "-P", "-c", code, *arguments], found, **options)


def wait(process: subprocess.Popen[bytes], seconds: float) -> int | None:
    """Wait for the end of a process as long as `seconds`; its return code, None when it goes on."""
    end = end_descriptor(process.pid)
    try:
        return wait_by(process, end, seconds)
    finally:
        if end is not None:
            os.close(end)


def wait_by(process: subprocess.Popen[bytes], end: int | None, seconds: float) -> int | None:
    """Wait as `wait` does, by a descriptor that becomes readable at its end, where there is one.

    `Popen.wait` is not used: where another part of this process has reaped the child, it reports success.
    """
    deadline = time.monotonic() + seconds
    while process.returncode is None:
        try:
            ended, status = os.waitpid(process.pid, os.WNOHANG)
        except ChildProcessError:
            return None
        if ended:
            process.returncode = os.waitstatus_to_exitcode(status)
            break
        left = deadline - time.monotonic()
        if left <= 0:
            return None
        if end is None:
            time.sleep(min(left, LOOK))
        else:
            poll = select.poll()
            poll.register(end, select.POLLIN)
            poll.poll(math.ceil(1000 * min(left, 3600.0)))
    return process.returncode


def end_descriptor(pid: int) -> int | None:
    """Return a descriptor that becomes readable when a child ends, None where the system has none (Linux does)."""
    try:
        return os.pidfd_open(pid)
    except (AttributeError, OSError):
        return None


def kill_tree(process: subprocess.Popen[bytes]) -> None:
    """Kill a process and its descendants (SIGKILL), and reap it."""
    import psutil

    family: list[psutil.Process] = []
    with contextlib.suppress(psutil.Error):
        first = psutil.Process(process.pid)
        family = [first, *first.children(recursive=True)] if process.returncode is None else []
    for member in family:
        with contextlib.suppress(psutil.Error):
            member.kill()
    if process.returncode is None:
        with contextlib.suppress(ChildProcessError):
            _, status = os.waitpid(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        process.returncode = process.returncode or 0


def _finish(work: Callable[[], object]) -> NoReturn:
    code = 0
    try:
        work()
    except SystemExit as leave:
        code = leave.code if isinstance(leave.code, int) else int(leave.code is not None)
        if isinstance(leave.code, str):
            print(leave.code, file=sys.stderr)
    except BaseException:
        code = 1
        with contextlib.suppress(BaseException):
            traceback.print_exc()
    _flush()
    os._exit(code & 0xFF)  # no handler of the parent's runs here


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(BaseException):
            stream.flush()
