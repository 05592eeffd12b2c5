"""Steps of a command as lines on stderr, printed while they last."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence

from cpbench.bench.planning.quantities import duration
from cpbench.cli.terminal import print_lines
from cpbench.foundation.plurals import counted

PAUSE = 1.0
"""Seconds without a line after which a step has one."""
EVERY = 30.0
"""Seconds between two lines of a step that lasts, where the output is not a terminal."""


class Steps:
    """Steps of a command as lines on stderr, each with the seconds since the start; nothing when quiet.

    A step is printed when nothing was for `pause` seconds, even while it lasts, so that a short command prints none. A
    context manager, which ends the waiting.
    """

    def __init__(self, quiet: bool, pause: float = PAUSE) -> None:
        self._quiet, self._pause = quiet, pause
        self._began = time.monotonic()
        self._printed = self._began - pause / 2.0  # the interpreter has started before
        self._text: Callable[[], str] = str
        self._every = math.inf
        self._timer: threading.Timer | None = None
        self._lock = threading.RLock()

    def __enter__(self) -> Steps:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def say(self, step: str | Callable[[], str], every: float = math.inf) -> None:
        """Note a step, which begins; a function makes its text anew for each line. It has a line each `every`
        seconds."""
        self.stop()
        self._text, self._every = (step if callable(step) else lambda: step), every
        if not self._quiet:
            self._wait(max(0.0, self._printed + self._pause - time.monotonic()))

    def watch(self, text: Callable[[], str], every: float) -> None:
        """Note a step that has its own lines, and one more where `every` seconds went by without."""
        self.stop()
        self._text, self._every = text, every
        if not self._quiet:
            self._wait(every)

    def through(self, items: Sequence[str], doing: str, noun: str) -> Iterator[str]:
        """Yield the items; while they last, lines say how many are done, and how long the others take."""
        first, done = 0.0, 0

        def text() -> str:
            # what was before the first one, as the start of processes, says nothing of the others
            pace = (time.monotonic() - first) / (done - 1) if done > 1 else 0.0
            so_far = f": {done} done, about {duration(pace * (len(items) - done))} left" if pace else ""
            return f"{doing} {counted(len(items), noun)}{so_far}"

        self.say(text, EVERY)
        for item in items:
            yield item
            done += 1
            first = first or time.monotonic()
        self.stop()

    def stop(self) -> None:
        """End the step without a line."""
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
            self._timer = None

    def _wait(self, seconds: float) -> None:
        self._timer = threading.Timer(seconds, self._print)
        self._timer.daemon = True
        self._timer.start()

    def _print(self) -> None:
        with self._lock:
            if threading.current_thread() is not self._timer:  # the next step has begun
                return
            self._printed = time.monotonic()
            print_lines([f"{self._printed - self._began:5.1f} s  {self._text()}"], err=True)
            if self._every < math.inf:
                self._wait(self._every)
