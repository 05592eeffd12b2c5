"""The display of a run: a live table on a terminal, lines elsewhere, nothing when quiet."""

from __future__ import annotations

import shutil
import sys
import time
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from cpbench.bench.events import Compiling, Event, Joined, Observer, Solving, Spent, Starting
from cpbench.bench.planning.plan import Pair
from cpbench.cli.steps import EVERY, Steps
from cpbench.cli.terminal import print_lines
from cpbench.conversions import Conversion
from cpbench.errors import NotApplicable
from cpbench.formulations import Problem
from cpbench.foundation.plain_text import on_one_line
from cpbench.foundation.plurals import counted, summary
from cpbench.graph import Apply
from cpbench.verification import MET_TOLERANCE, REFUSED

if TYPE_CHECKING:
    from rich.console import Group
    from rich.table import Table

ROOM = 4
"""Lines of a terminal that no solver's row may take: head and end of its table, and what is below it."""
LARGE = 50e6
"""Bytes of a conversion's result from which on it is announced."""


class Display(Observer):
    """Progress on stderr; data never goes there, so that stdout can be piped.

    A live table on a terminal, lines elsewhere, nothing when quiet. With `verbose` every event has a line on stderr.
    """

    def __init__(self, quiet: bool = False, verbose: bool = False) -> None:
        self._quiet = quiet
        self._terminal = sys.stderr.isatty() and not quiet and not verbose
        self._verbose = verbose
        self._steps = Steps(quiet)
        self._live: Any = None
        self._bar: Any = None
        self._total = self._done = 0
        self._counts: Counter[str] = Counter()
        self._of_solver: dict[str, Counter[str]] = {}
        self._now: dict[str, tuple[str, float, float]] = {}
        self._warming = ""

    def step(self, text: str) -> None:
        """Note what is being done before and after pairs are run: it has a line while it lasts."""
        self._steps.say(text)

    def rest(self) -> None:
        """Note that the step has ended, and none begins."""
        self._steps.stop()

    def reading(self, addresses: Sequence[str]) -> Iterator[str]:
        """Yield the addresses, with a bar over the files on a terminal, with lines elsewhere."""
        yield from self._steps.through(addresses, "reading", "problem")
        self.step("planning pairs")

    def begin(self, planned: Sequence[Pair], pending: Collection[str]) -> None:
        self._steps.stop()
        self._total, self._done = len({p.key for p in planned} & set(pending)), 0
        before = len(planned) - self._total
        if not self._quiet:
            click.echo(f"{counted(len(planned), 'pair')}{f', {before} done before' if before else ''}", err=True)
        if self._terminal and self._total:
            self._begin_live()
        elif self._total:
            self._steps.say(self._line, EVERY)

    def progress(self, event: Event) -> None:
        """Show an event of the run."""
        if isinstance(event, Starting):
            self._warming = event.solver
        elif isinstance(event, Compiling):
            self._warming = compiling(event.solver)
            if not self._quiet and not self._terminal:
                click.echo(self._warming, err=True)
        elif isinstance(event, Solving):
            self._warming, pair = "", event.pair
            self._now[pair.key] = (f"{pair.label} on {pair.problem}", time.monotonic(), pair.limits.seconds)
        elif isinstance(event, Joined | Spent):
            if not self._quiet:
                print_lines([str(event)], err=True)
        else:
            self._now.pop(event.pair.key, None)
            self._count(event.pair.label, event.outcome.status, event.outcome.wall or 0.0)
        if self._verbose:
            print_lines([f"{time.strftime('%Y-%m-%dT%H:%M:%S')} {event_line(event)}"], err=True)

    def end(self) -> None:
        self._steps.stop()
        if self._live is not None:
            self._live.stop()

    def _count(self, label: str, status: str, seconds: float) -> None:
        """Count a pair that has ended; a line tells each tenth of the way, and what lasts longer than others."""
        self._done += 1
        self._counts[status] += 1
        standing = "solved" if status in MET_TOLERANCE else "refused" if status in REFUSED else "failed"
        self._of_solver.setdefault(label, Counter()).update({standing: 1, "time": seconds})
        if self._bar is not None:
            self._bar.update(0, completed=self._done)
        elif not self._quiet and self._done % max(1, self._total // 10) == 0:
            click.echo(self._line(), err=True)
            if self._done < self._total:
                self._steps.say(self._line, EVERY)

    def _line(self) -> str:
        return f"{self._done}/{self._total}  {summary(dict(self._counts))}".rstrip()

    def _begin_live(self) -> None:
        from rich.console import Console
        from rich.live import Live
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        console = Console(file=sys.stderr)
        self._bar = Progress(
            TextColumn("done"), BarColumn(), MofNCompleteColumn(), TextColumn("pairs,"), TimeRemainingColumn(),
            TextColumn("left"), console=console,
        )  # fmt: skip
        self._bar.add_task("", total=self._total)
        self._live = Live(get_renderable=self.view, console=console, refresh_per_second=2, transient=True)
        self._live.start()

    def view(self) -> Group:
        """Return the live table: how far, how long it will take, what is being solved, and how the solvers stand."""
        from rich.console import Group
        from rich.text import Text

        now = time.monotonic()
        lines = [f"solving  {text}  {now - since:.1f} s of {limit:g} s" for text, since, limit in [*self._now.values()]]
        if self._warming:
            lines.append(f"warming  {self._warming}")
        room = shutil.get_terminal_size().lines - len(lines) - ROOM
        shown = [Text(line, no_wrap=True, overflow="ellipsis") for line in lines]
        return Group(self._bar.get_renderable(), *shown, self._standings(max(room, 1)))

    def _standings(self, most: int) -> Table:
        """Return a row for each of at most so many solvers that were started, those that solved most above."""
        from rich.table import Table
        from rich.text import Text

        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")
        table.add_column("solver", no_wrap=True, overflow="ellipsis", max_width=40)
        for name in ("solved", "failed", "time"):
            table.add_column(name, justify="right", no_wrap=True)
        started = {label: s for label, s in [*self._of_solver.items()] if s["solved"] or s["failed"]}
        ordered = sorted(started, key=lambda label: (-started[label]["solved"], started[label]["failed"], label))
        for label in ordered[:most]:
            s = started[label]
            failed = Text(str(s["failed"] or "·"), style="red" if s["failed"] else "dim")
            table.add_row(Text(label), str(s["solved"]), failed, f"{s['time']:.1f} s")
        if len(ordered) > most:
            table.add_row(Text(f"and {len(ordered) - most} more", style="dim"))
        return table


def event_line(event: Event) -> str:
    """Return an event of the run in one line."""
    if isinstance(event, Starting):
        return f"{'start':<12} {event.solver}"
    if isinstance(event, Compiling):
        return f"{'compiling':<12} {event.solver}"
    if isinstance(event, Joined | Spent):
        return on_one_line(f"{'cluster':<12} {event}")
    named = f"{event.pair.address} {event.pair.label}"
    if isinstance(event, Solving):
        return on_one_line(f"{'solve':<12} {named}")
    outcome = event.outcome
    took = f", solve {outcome.solve:.3g} s" if outcome.solve is not None else ""
    error = f", error {outcome.error:.2e}" if outcome.error is not None else ""
    message = f": {' '.join(outcome.message.split())}" if outcome.message else ""
    return on_one_line(f"{outcome.status:<12} {named}{error}{took}{message}")


def compiling(solver: str) -> str:
    """Return the message while a solver compiles, so that it is not taken for a solve that hangs."""
    return f"{solver}: compiling its loops, once on this machine (cpbench doctor --warm does so for all solvers)"


def converting(edge: Conversion, problem: Problem, apply: Apply, room: int) -> Problem:
    """Convert as `apply` does, announced on stderr where the result is large, with a spinner on a terminal.

    Raises NotApplicable, with the estimate, when the result may take more than `room` bytes (0: no limit).
    """
    size = edge.predict(problem)
    if size is not None and 0 < room < size.bytes:
        raise NotApplicable(
            edge.label, f"would not fit: {size}, {room / 1e9:.3g} GB are allowed; --memory says otherwise"
        )
    if size is None or size.bytes < LARGE:
        return apply(edge, problem)
    if not sys.stderr.isatty():
        click.echo(f"{edge.label}: {size}", err=True)
        return apply(edge, problem)
    from rich.console import Console

    with Console(file=sys.stderr).status(f"{edge.label}: {size}"):
        return apply(edge, problem)
