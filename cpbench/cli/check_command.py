"""Run the conformance checks on a plugin.

Each in a process that may hang or die without taking anything along: one process serves check after check; a check
that ends it, or takes too long, has failed, and the next one gets a new process.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.launch import context
from cpbench.bench.processes.server import NoAnswer, ServerProcess, serve
from cpbench.bench.time_limits import START, WARM_UP
from cpbench.cli.options import ListOption
from cpbench.cli.types import DURATION
from cpbench.errors import CpbenchError, UnknownName
from cpbench.registry import PLUGIN_FILES
from cpbench.testing.conduct import Item, Mark, conduct, named, registered_by

GOOD = ("passed", "does not apply", "known failure")
WIDE = 52
"""Characters of the column of checks."""


@click.command()
@click.argument("plugin")
@click.option("--only", cls=ListOption, metavar="CHECK", help="Check to run; default: all. Repeatable.")
@click.option(
    "--timeout", type=DURATION, default="60s", show_default=True, help="Time limit of one check (30s, 5m, none)."
)
@click.option("--quiet", "-q", is_flag=True, help="Print only failures and sums.")
def command(plugin: str, only: tuple[str, ...], timeout: float, quiet: bool) -> None:
    """Run the public conformance checks on a plugin.

    PLUGIN is a Python file, a .toml file that declares solvers, or the name of a registered solver, conversion,
    formulation or format. Checks run in another process: a check that hangs or crashes has failed, and the next one
    gets a new process. The exit code is 1 when a check failed or a solver cannot run here, and 2 when the plugin does
    not load.

    If your solver is known to fail a check, enter the check with the reason in `known_failures` of its spec.
    """
    if _is_file(plugin):
        plugin = os.path.abspath(plugin)
        others = [path for path in os.environ.get(PLUGIN_FILES, "").split(os.pathsep) if path and path != plugin]
        os.environ[PLUGIN_FILES] = os.pathsep.join(others)  # the process that checks it loads it, and no other
    failed = False
    with PluginChecker(plugin, timeout) as checker:
        items = checker.items()
        checks = {check for item in items for check in item.checks}
        for name in only:
            if name not in checks:
                raise UnknownName("check", name, checks)
        for item in items:
            click.echo(f"{item.kind} {item.name} ({' -> '.join(item.nodes)})")
            count = Counter[str]()
            for check, mark in checker.marks(item, only):
                count[mark.word] += 1
                bad = mark.word not in GOOD
                failed = failed or bad
                if bad or not quiet:
                    reason = f"  {mark.reason}" if mark.reason else ""
                    click.echo(f"  {mark.word:<15}{check:<{WIDE if reason else 0}}{reason}")
            click.echo(f"  {', '.join(f'{number} {word}' for word, number in sorted(count.items()))}")
    if failed:
        sys.exit(1)


class PluginChecker(ServerProcess):
    """A process that checks a plugin, a file or a registered name."""

    def __init__(self, plugin: str, seconds: float) -> None:
        super().__init__(context(1), _main, (plugin,))
        self._plugin, self._seconds = plugin, seconds

    def items(self) -> list[Item]:
        """Return what there is to check. Raises CpbenchError when the plugin does not load."""
        try:
            answer, _ = self.ask(START.floor, {"do": "items"})
        except NoAnswer as end:
            raise CpbenchError(f"{self._plugin}: while it is loaded: {end}") from None
        if "refused" in answer:
            raise CpbenchError(str(answer["refused"]))
        return [Item(kind, name, tuple(nodes)) for kind, name, nodes in answer["items"]]

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
            if not self.running:
                self.items()
            answer, _ = self.ask(seconds, {"do": check, "kind": item.kind, "name": item.name})
            return Mark(str(answer["word"]), str(answer["reason"]))
        except NoAnswer as end:
            return Mark("failed", " ".join(str(end).split()))


def _main(channel: Channel, plugin: str) -> None:
    """Answer each request, in the process."""
    items: dict[tuple[str, str], Item] = {}

    def answer(request: Mapping[str, Any], _: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        if request["do"] == "items":
            try:
                listed = registered_by(Path(plugin)) if _is_file(plugin) else named(plugin)
            except CpbenchError as refusal:
                return {"refused": str(refusal)}, {}
            items.update({(item.kind, item.name): item for item in listed})
            return {"items": [[item.kind, item.name, item.nodes] for item in listed]}, {}
        item = items[request["kind"], request["name"]]
        mark = _ready(item) if request["do"] == "ready" else conduct(item, request["do"])
        return {"word": mark.word, "reason": mark.reason}, {}

    serve(channel, answer)


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


def _is_file(plugin: str) -> bool:
    """Return whether a plugin is given by its file and not by its name."""
    return Path(plugin).suffix in (".py", ".toml")
