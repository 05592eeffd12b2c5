"""Steps of a command as lines on stderr, printed while they last."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence

from cpbench.cli.terminal import print_lines
from cpbench.foundation.plurals import counted

PAUSE = 1.0
"""Seconds without a line after which a step has one."""
EVERY = 30.0
"""Seconds between two lines of a step that lasts."""


class Steps:
    """Steps of a command as lines on stderr, each with the seconds since the start; nothing when quiet.

    A step is printed when nothing was for `pause` seconds, even while it lasts, so that a short command prints none. A
    context manager, which ends the waiting.
    """

    def __init__(self, quiet: bool, pause: float = PAUSE) -> None:
        self._quiet, self._pause = quiet, pause
        self._began = time.monotonic()
        self._printed = self._began - pause / 2.0  # the interpreter has started before
        self._timer: threading.Timer | None = None
        self._lock = threading.RLock()

    def __enter__(self) -> Steps:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def say(self, step: str | Callable[[], str], first: float | None = None) -> None:
        """Note a step, which begins; a function makes its text anew for each line. `first` : seconds until its first
        line, None for the pause since the last one."""
        self.stop()
        if not self._quiet:
            wait = max(0.0, self._printed + self._pause - time.monotonic()) if first is None else first
            self._wait(wait, step if callable(step) else lambda: step)

    def through(self, items: Sequence[str], doing: str, noun: str) -> Iterator[str]:
        """Yield the items; while they last, a bar on a terminal, or lines say how many are done."""
        text = f"{doing} {counted(len(items), noun)}"
        if sys.stderr.isatty() and not self._quiet:
            from rich.console import Console
            from rich.progress import track

            self.stop()
            yield from track(items, description=text, console=Console(file=sys.stderr), transient=True)
            return
        done = 0
        self.say(lambda: f"{text}: {done} done")
        for item in items:
            yield item
            done += 1
        self.stop()

    def stop(self) -> None:
        """End the step without a line."""
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
            self._timer = None

    def _wait(self, seconds: float, text: Callable[[], str]) -> None:
        self._timer = threading.Timer(seconds, self._print, [text])
        self._timer.daemon = True
        self._timer.start()

    def _print(self, text: Callable[[], str]) -> None:
        with self._lock:
            if threading.current_thread() is not self._timer:  # the next step has begun
                return
            self._printed = time.monotonic()
            print_lines([f"{self._printed - self._began:5.1f} s  {text()}"], err=True)
            self._wait(EVERY, text)
