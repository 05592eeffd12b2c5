"""A process that answers one request after the other, of which any may hang, or end it, without taking anything along.

A request without an answer costs the process: the next one gets a new process. Requests and answers are frames, a
header with arrays (`foundation.frames`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from multiprocessing.context import ForkServerContext
from typing import Any, Self

from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.process import Child, Died, TimedOut
from cpbench.foundation import frames
from cpbench.verification import Status


class NoAnswer(Exception):
    """A request without an answer, and why. `status` : as in a run, timeout, memout, crash, or error for noise."""

    def __init__(self, status: Status, why: str) -> None:
        self.status = status
        super().__init__(why)


class ServerProcess:
    """A process running `target(channel, *args)`, which calls `serve`; it is started at a request. A context manager,
    which ends it. `cpus` : as of `Child`."""

    def __init__(
        self, ctx: ForkServerContext, target: Callable[..., None], args: tuple[Any, ...] = (), cpus: Sequence[int] = ()
    ) -> None:
        self._start = partial(Child, ctx, target, args, cpus=cpus)
        self._child: Child | None = None
        self._stopped = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def running(self) -> bool:
        """Return whether the next request needs no new process."""
        return self._child is not None

    def ask(
        self, seconds: float, request: Mapping[str, Any], arrays: Mapping[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the answer to a request, header and arrays, which has to come within so many seconds; raises NoAnswer.
        Nothing of it is believed."""
        try:
            child = self._child = self._child or self._start()
            if self._stopped:
                child.kill_all()
            child.forget()
            child.send(frames.pack(request, arrays))
            return frames.unpack(child.receive(seconds), frames.UNTRUSTED_HEADER)
        except TimedOut:
            end = NoAnswer(Status.TIMEOUT, f"still running after {seconds:g} s")
        except Died as death:
            status = Status.MEMOUT if death.out_of_memory else Status.CRASH
            end = NoAnswer(status, f"the process ended: {death}")
        except frames.FrameError as noise:
            end = NoAnswer(Status.ERROR, f"what came is no answer: {noise}")
        self.close()
        raise end

    def stop(self) -> None:
        """End the process while another thread waits for it, which has no answer then, nor to what it asks after."""
        self._stopped = True
        if self._child is not None:
            self._child.kill_all()

    def close(self) -> None:
        """End the process."""
        child, self._child = self._child, None
        if child is not None:
            child.kill()


def serve(
    channel: Channel,
    answer: Callable[[dict[str, Any], dict[str, Any]], tuple[Mapping[str, Any], Mapping[str, Any]]],
) -> None:
    """Answer each request in the process, header and arrays, until the other side closes the channel."""
    while True:
        try:
            request, arrays = frames.unpack(channel.recv_bytes())
        except EOFError:
            return
        channel.send_bytes(frames.pack(*answer(request, arrays)))
