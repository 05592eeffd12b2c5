"""Processes that read the problems of a plan: the referee of a slot, and more beside it where problems are many."""

from __future__ import annotations

import queue
from collections.abc import Generator, Mapping
from concurrent.futures import ThreadPoolExecutor

from cpbench.bench import machine
from cpbench.bench.messages import Surveyed
from cpbench.bench.planning.plan import Request
from cpbench.bench.slot import Slot
from cpbench.bench.worker_pool import RefereeClient
from cpbench.errors import CpbenchError

EACH = 250
"""Problems that pay for one more process: about as many are read while it starts."""
MOST = 8
"""Processes that one thread of Python can keep at work."""


def surveys(
    slot: Slot,
    asked: Mapping[tuple[str, str | None], Mapping[str, Request]],
    timeout: float,
    *,
    guesses: bool = False,
) -> Generator[Surveyed | CpbenchError]:
    """Yield the facts of each problem in turn, or why it has none. Closing the generator ends the further processes.

    asked : address and format of each problem -> the requests whose nodes are wanted, by name. timeout : of a solve.
    guesses : whether the starting points of files are counted.
    """
    count = max(1, min(len(machine.cores()), len(asked) // EACH, MOST))
    referees = [slot.referee, *(slot.another_referee() for _ in range(count - 1))]
    free: queue.SimpleQueue[RefereeClient] = queue.SimpleQueue()
    for referee in referees:
        free.put(referee)

    def one(place: tuple[str, str | None]) -> Surveyed | CpbenchError:
        referee, (address, file_format) = free.get(), place
        try:
            requests = list(asked[place].values())
            return slot.survey(address, requests, file_format, timeout, guesses=guesses, referee=referee)
        except CpbenchError as reason:
            return reason
        finally:
            free.put(referee)

    if count == 1:
        yield from map(one, asked)
        return
    pool = ThreadPoolExecutor(count)
    try:
        yield from pool.map(one, asked)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for referee in referees[1:]:
            referee.close()
