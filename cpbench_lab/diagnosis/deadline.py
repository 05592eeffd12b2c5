"""The time of a whole diagnosis: what is still running when it is over is left."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

T = TypeVar("T")


class OutOfTime(Exception):
    """The time of the diagnosis is over."""


@dataclass(frozen=True)
class Deadline:
    """End of a diagnosis, on the clock of `time.monotonic` [s]; by default there is none."""

    at: float = math.inf

    @classmethod
    def after(cls, seconds: float) -> Deadline:
        """Return the one in so many seconds."""
        return cls(time.monotonic() + seconds)

    @property
    def left(self) -> float:
        """Seconds until then, 0 when it has passed."""
        return max(0.0, self.at - time.monotonic())

    def run(self, function: Callable[[], T]) -> T:
        """Return what the function returns; raises OutOfTime when it is not done by then, and what it raises.

        With a limit it runs in a thread, because a factorization cannot be interrupted; what is late ends with the
        process, unheeded.
        """
        if math.isinf(self.at):
            return function()
        kept: dict[str, Any] = {}

        def keep() -> None:
            try:
                kept["value"] = function()
            except BaseException as error:
                kept["error"] = error

        thread = threading.Thread(target=keep, daemon=True)
        thread.start()
        thread.join(self.left)
        if thread.is_alive():
            raise OutOfTime
        if "error" in kept:
            raise kept["error"]
        return kept["value"]
