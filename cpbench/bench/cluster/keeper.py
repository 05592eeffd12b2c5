"""What runs inside a Dask worker: it keeps one station a run, and passes messages on. Nothing is computed here.

A station ends with the Dask worker, whatever ends that (the pipe between them is closed), at the end of its run, and
when its run has not asked for anything for a while (a client that was killed says no goodbye).
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
import time
import uuid
from multiprocessing import Pipe
from typing import Any

from cpbench import frames

IDENTITY = uuid.uuid4().hex
"""Of this process: a Dask worker that died and came back has another one, at the same address or not."""
IDLE = 300.0
"""Seconds after which the process of a station that nobody asked for anything is ended."""
PARTING = 5.0
"""Seconds in which a process that was told to end may do so by itself."""
END = b""
"""What follows the last message of an answer."""
_START = "from cpbench.bench.cluster.station import main; main()"

_stations: dict[str, Station] = {}
_table = threading.RLock()
_solving = threading.Lock()
"""One solve at a time in this process, however many threads the Dask worker has."""


def greet(run: str, opening: bytes) -> tuple[str, bytes]:
    """Start the station of a run, unless it is there: who we are, and what it says of itself."""
    with _table:
        if not _stations:
            threading.Thread(target=_end_idle, daemon=True).start()
        station = _stations.setdefault(run, Station(opening))
    with _solving:
        return IDENTITY, station.greeting()


def work(run: str, identity: str, message: bytes) -> list[bytes]:
    """Return what the station of a run answers. Only who was greeted works: a task that Dask hands on when its worker
    is lost is not done elsewhere behind the client's back."""
    if identity != IDENTITY or run not in _stations:
        return [frames.pack({"event": "stranger"})]
    with _solving:
        return _stations[run].ask(message)


def stop(run: str) -> None:
    """End the station of a run, in the middle of a solve if need be."""
    with _table:
        station = _stations.pop(run, None)
    if station is not None:
        station.end()


def _end_idle() -> None:
    while True:
        time.sleep(IDLE / 10)
        with _table:
            if not _stations:
                return
            for station in _stations.values():
                if time.monotonic() - station.used > IDLE:
                    station.end()


class Station:
    """The process `cpbench.bench.cluster.station` and the pipe to it; started when it is needed."""

    def __init__(self, opening: bytes) -> None:
        self._opening = opening
        self._process: subprocess.Popen[bytes] | None = None
        self._pipe: Any = None
        self._greeting = b""
        self.used = time.monotonic()

    def greeting(self) -> bytes:
        """Return its first message, or why there is none."""
        try:
            self._start()
        except (EOFError, OSError) as cause:
            message = f"no process of its own could be started ({self._ended() or cause})"
            return frames.pack({"event": "refused", "message": message})
        finally:
            self.used = time.monotonic()
        return self._greeting

    def ask(self, message: bytes) -> list[bytes]:
        """Return all that the station answers; its death is the last message."""
        answers: list[bytes] = []
        try:
            self._start()
            self._pipe.send_bytes(message)
            while (answer := self._pipe.recv_bytes()) != END:
                answers.append(answer)
        except (EOFError, OSError):
            answers.append(frames.pack({"event": "died", "message": self._ended()}))
        self.used = time.monotonic()
        return answers

    def end(self) -> None:
        """Tell the process to end, and see to it."""
        with _table:
            process, self._process = self._process, None
        if process is not None:
            process.terminate()
            threading.Thread(target=_reap, args=(process,), daemon=True).start()

    def _start(self) -> None:
        with _table:
            self.used = float("inf")
            if self._process is not None and self._process.poll() is None:
                return
            self._pipe, theirs = Pipe()
            # the modules that this process finds, those in the current folder apart
            path = os.pathsep.join(filter(None, sys.path))
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", _START, str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                env={**os.environ, "PYTHONPATH": path},
                stdin=subprocess.DEVNULL,
                start_new_session=True,
            )
            theirs.close()
        self._pipe.send_bytes(self._opening)
        self._greeting = self._pipe.recv_bytes()

    def _ended(self) -> str:
        with _table:
            process, self._process = self._process, None
        return f"it ended with code {_reap(process)}" if process is not None else ""


def _reap(process: subprocess.Popen[bytes]) -> int:
    with contextlib.suppress(subprocess.TimeoutExpired):
        return process.wait(PARTING)
    process.kill()
    return process.wait()
