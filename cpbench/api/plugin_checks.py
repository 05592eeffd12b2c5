"""Checks of a plugin, each in a process that may hang or die without taking anything along.

One process serves check after check; a check that ends it, or takes too long, has failed, and the next one gets a new
process.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.launch import context
from cpbench.bench.processes.process import Child, Died, TimedOut
from cpbench.bench.time_limits import START, WARM_UP
from cpbench.bench.worker_pool import describe_exit
from cpbench.errors import CpbenchError
from cpbench.foundation import frames
from cpbench.testing.conduct import Item, Mark, conduct, named, registered_by


class PluginChecker:
    """Checks of a plugin, a file or a registered name; a context manager, which ends its process."""

    def __init__(self, plugin: str, seconds: float) -> None:
        self._plugin, self._seconds = plugin, seconds
        self._context = context(1)
        self._child: Child | None = None

    def __enter__(self) -> PluginChecker:
        return self

    def __exit__(self, *_: object) -> None:
        self._close()

    def items(self) -> list[Item]:
        """Return what there is to check. Raises CpbenchError when the plugin does not load."""
        try:
            return [
                Item(kind, name, tuple(nodes)) for kind, name, nodes in self._ask({"do": "items"}, START.floor)["items"]
            ]
        except TimedOut:
            why = f"was not loaded within {START.floor:g} s"
        except Died as death:
            why = f"ends the process that loads it ({describe_exit(death)})"
        except frames.FrameError as noise:
            why = f"sends what is no message while it is loaded ({noise})"
        self._close()
        raise CpbenchError(f"{self._plugin}: {why}")

    def marks(self, item: Item, only: tuple[str, ...] = ()) -> Iterator[tuple[str, Mark]]:
        """Yield every check of one item, or those in `only`, with its mark. A solver that cannot run is not checked."""
        if item.kind == "solver":
            ready = self._mark(item, "ready", START.floor + WARM_UP.floor)
            if ready.word != "passed":
                yield "availability", ready
                return
        for check in item.checks:
            if not only or check in only:
                yield check, self._mark(item, check, self._seconds)

    def _mark(self, item: Item, check: str, seconds: float) -> Mark:
        try:
            if self._child is None:
                self.items()
            answer = self._ask({"do": check, "kind": item.kind, "name": item.name}, seconds)
            return Mark(str(answer["word"]), str(answer["reason"]))
        except TimedOut:
            why = f"still running after {seconds:g} s"
        except Died as death:
            why = f"the process ended: {describe_exit(death)}"
        except (frames.FrameError, KeyError) as noise:
            why = f"what came is no answer: {noise}"
        self._close()
        return Mark("failed", " ".join(why.split()))

    def _ask(self, request: Mapping[str, Any], seconds: float) -> dict[str, Any]:
        if self._child is None:
            self._child = Child(self._context, _main, (self._plugin,))
        self._child.forget()
        self._child.send(frames.pack(request))
        answer, _ = frames.unpack(self._child.receive(seconds))
        if "refused" in answer:
            raise CpbenchError(str(answer["refused"]))
        return answer

    def _close(self) -> None:
        if self._child is not None:
            self._child.kill()
            self._child = None


def _main(channel: Channel, plugin: str) -> None:
    """Answer each request, in the process."""
    items: dict[tuple[str, str], Item] = {}
    while True:
        try:
            request, _ = frames.unpack(channel.recv_bytes())
        except EOFError:
            return
        if request["do"] == "items":
            try:
                listed = registered_by(Path(plugin)) if is_file(plugin) else named(plugin)
            except CpbenchError as refusal:
                channel.send_bytes(frames.pack({"refused": str(refusal)}))
                continue
            items = {(item.kind, item.name): item for item in listed}
            channel.send_bytes(frames.pack({"items": [[item.kind, item.name, item.nodes] for item in listed]}))
            continue
        item = items[request["kind"], request["name"]]
        mark = _ready(item) if request["do"] == "ready" else conduct(item, request["do"])
        channel.send_bytes(frames.pack({"word": mark.word, "reason": mark.reason}))


def _ready(item: Item) -> Mark:
    """Return whether a solver can run, and warm it up: no check waits for its compiler."""
    solver = item.plugin
    state = solver.availability()
    if not state.ok:
        return Mark(state.state, state.detail)
    try:
        solver.warmup()
    except Exception as failure:
        return Mark("failed", f"the warm-up raises {type(failure).__name__}: {failure}")
    return Mark("passed")


def is_file(plugin: str) -> bool:
    """Return whether a plugin is given by its file and not by its name."""
    return Path(plugin).suffix in (".py", ".toml")
