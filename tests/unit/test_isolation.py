"""Processes of a run are tied to cores, limited in memory, and killed with all that they started."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import psutil
import pytest

from cpbench.bench.processes.isolation import limit_address_space
from cpbench.bench.processes.launch import context
from cpbench.bench.processes.process import Child, Died, TimedOut
from cpbench.foundation.frames import FrameError

Start = Callable[..., Child]


@pytest.fixture
def start() -> Iterator[Start]:
    """Starts children of the target given, and kills them."""
    ctx = context(1)
    children: list[Child] = []

    def starter(target: Callable[..., None], *args: object, **more: object) -> Child:
        children.append(Child(ctx, target, args, **more))  # pyright: ignore
        return children[-1]

    yield starter
    for child in children:
        child.kill()


# ------------------------------------------------------------------------------------------- targets


def _echo(connection) -> None:
    while True:
        connection.send_bytes(connection.recv_bytes())


def _tell_cpus(connection) -> None:
    connection.send_bytes(repr(sorted(os.sched_getaffinity(0))).encode())


def _exit(connection, code: int) -> None:
    print("last words")
    sys.exit(code)


def _abort(connection) -> None:
    os.abort()


def _sleep(connection) -> None:
    time.sleep(3600)


def _hang_up(connection) -> None:
    connection.close()
    time.sleep(3600)


def _family(connection) -> None:
    """A child, a grandchild, and a daemon with a session of its own; tells their process ids."""
    reader, writer = os.pipe()
    for daemon in (False, True):
        if os.fork() == 0:
            if daemon:
                os.setsid()
            os.write(writer, b"%d " % os.getpid())
            if os.fork() == 0:
                os.write(writer, b"%d " % os.getpid())
            time.sleep(3600)
    told = b""
    while told.count(b" ") < 4:
        told += os.read(reader, 100)
    connection.send_bytes(told)
    time.sleep(3600)


def _grow(connection, growth: int) -> None:
    """As much more memory as told, in steps, written to."""
    limit_address_space(2**27)
    connection.send_bytes(b"warm")
    hoard = [bytearray(2**20) for _ in range(growth // 2**20)]
    time.sleep(1.0)
    connection.send_bytes(b"%d" % len(hoard))


# --------------------------------------------------------------------------------------------- tests


def test_messages_go_there_and_back(start: Start) -> None:
    child = start(_echo)
    for message in (b"", b"x" * 1_000_000):
        child.send(message)
        assert child.receive(30.0) == message
    assert child.alive


def test_a_child_is_tied_to_its_cores(start: Start) -> None:
    core = max(os.sched_getaffinity(0))
    assert start(_tell_cpus, cpus=(core,)).receive(30.0) == b"[%d]" % core


@pytest.mark.parametrize(("target", "args", "signal_", "code"), [(_exit, (3,), None, 3), (_abort, (), 6, -6)])
def test_an_end_is_reported_with_its_cause(start: Start, target, args, signal_: int | None, code: int) -> None:
    child = start(target, *args)
    with pytest.raises(Died) as death:
        child.receive(30.0)
    assert (death.value.signal, death.value.code) == (signal_, code)
    assert ("last words" in death.value.output) == (target is _exit)
    assert not child.alive


def test_a_hang_is_not_waited_for(start: Start) -> None:
    child = start(_sleep)
    begun = time.monotonic()
    with pytest.raises(TimedOut):
        child.receive(0.3)
    assert time.monotonic() - begun < 300.0


def test_a_worker_that_hangs_up_is_killed(start: Start) -> None:
    child = start(_hang_up)
    with pytest.raises(Died, match="closed its connection"):
        child.receive(30.0)
    _until(lambda: not child.alive)


def test_a_family_dies_together(start: Start) -> None:
    child = start(_family)
    members = [int(pid) for pid in child.receive(30.0).split()]
    assert len(members) == 4
    child.kill()
    _until(lambda: not any(_lives(pid) for pid in members))


def test_daemons_of_a_dead_worker_are_ended(start: Start) -> None:
    """The worker is killed by itself; what it started is adopted by its guard, which ends it."""
    child = start(_family)
    members = [int(pid) for pid in child.receive(30.0).split()]
    os.kill(psutil.Process(members[0]).ppid(), signal.SIGKILL)
    with pytest.raises(Died) as death:
        child.receive(30.0)
    assert death.value.signal == signal.SIGKILL
    _until(lambda: not any(_lives(pid) for pid in members))


def test_memory_is_limited(start: Start) -> None:
    """128 MiB are allowed: 32 more go well, 512 do not."""
    modest = start(_grow, 2**25)
    modest.receive(30.0)
    assert modest.receive(30.0) == b"32"
    greedy = start(_grow, 2**29)
    greedy.receive(30.0)
    with pytest.raises(Died) as death:
        greedy.receive(30.0)
    assert death.value.out_of_memory


def test_noise_is_no_message(start: Start) -> None:
    with pytest.raises(FrameError):
        start(_noise).receive(30.0)


def _noise(connection) -> None:
    os.write(connection.fileno(), b"what a library prints where it should not")
    time.sleep(3600)


def _lives(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def _until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 300.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_memory_is_limited_beside_a_process_that_cannot_be_read() -> None:
    """The system may refuse /proc/PID of somebody else, at which psutil gives up its look at all processes."""
    code = (
        "import resource, psutil\n"
        "def refused(*_, **__): raise psutil.AccessDenied(1)\n"
        "psutil.Process.children = refused\n"
        "from cpbench.bench.processes.isolation import address_space, limit_address_space\n"
        "before = address_space(); limit_address_space(2**30)\n"
        "print(0 <= resource.getrlimit(resource.RLIMIT_AS)[0] - before - 2**30 < 2**26)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "True", done.stderr
