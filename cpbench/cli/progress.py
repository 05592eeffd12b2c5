"""The display of a run: a live table on a terminal, lines elsewhere, nothing when quiet."""

from __future__ import annotations

import shutil
import sys
import time
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import click

from cpbench.bench.events import Compiling, Event, Joined, Solving, Spent, Starting
from cpbench.bench.pace import Expected, Pace
from cpbench.bench.planning.plan import Pair
from cpbench.cli.standings import Standings
from cpbench.cli.steps import EVERY, Steps
from cpbench.cli.terminal import print_lines
from cpbench.conversions import Conversion
from cpbench.errors import NotApplicable
from cpbench.formulations import Problem
from cpbench.foundation.plain_text import on_one_line
from cpbench.foundation.plurals import counted, summary
from cpbench.graph import Apply

if TYPE_CHECKING:
    from rich.console import Group

FIRST = 50
"""Pairs after which a run of more than ten times as many has its first line, with an estimate."""
ROOM = 4
"""Lines of a terminal that no row of the live table may take: head and end of the table, and what is below it."""
LARGE = 50e6
"""Bytes of a conversion's result from which on it is announced."""


class Display:
    """Progress on stderr; data never goes there, so that stdout can be piped.

    A live table on a terminal, lines elsewhere, nothing when quiet. With `verbose` every event has a line on stderr.
    """

    def __init__(self, quiet: bool = False, verbose: bool = False, slots: int = 1) -> None:
        self._quiet, self._slots = quiet, slots
        self._terminal = sys.stderr.isatty() and not quiet and not verbose
        self._verbose = verbose
        self._steps = Steps(quiet)
        self._live: Any = None
        self._total = self._done = self._before = 0
        self._counts: Counter[str] = Counter()
        self._standings = Standings()
        self._now: dict[str, tuple[str, float, float]] = {}
        self._warming = ""
        self._pace = Pace(slots)

    def step(self, text: str) -> None:
        """Note what is being done before and after pairs are run: it has a line while it lasts."""
        self._steps.say(text, EVERY)

    def rest(self) -> None:
        """Note that the step has ended, and none begins."""
        self._steps.stop()

    def reading(self, addresses: Sequence[str]) -> Iterator[str]:
        """Yield the addresses, with a bar over the files on a terminal, with lines elsewhere."""
        if self._terminal:
            from rich.console import Console
            from rich.progress import track

            self._steps.stop()
            console = Console(file=sys.stderr)
            yield from track(addresses, description="reading", console=console, transient=True)
        else:
            yield from self._steps.through(addresses, "reading", "problem")
        self.step("planning pairs")

    def begin(self, planned: Sequence[Pair], pending: Collection[str]) -> None:
        self._steps.stop()
        self._total = len({p.key for p in planned} & set(pending))
        self._before = len(planned) - self._total
        self._done, self._pace = 0, Pace(self._slots)
        if not self._quiet:
            resumed = f", {self._before} done before" if self._before else ""
            click.echo(f"{counted(len(planned), 'pair')}{resumed}", err=True)
        if self._terminal and self._total:
            from rich.console import Console
            from rich.live import Live

            console = Console(file=sys.stderr)
            self._live = Live(get_renderable=self.view, console=console, refresh_per_second=2, transient=True)
            self._live.start()
        elif self._total:
            self._steps.watch(self._line, EVERY)

    def progress(self, event: Event) -> None:
        """Show an event of the run."""
        self._pace.note(event)
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
            self._done += 1
            self._counts[event.outcome.status] += 1
            self._standings.note(event.pair.label, event.outcome)
            self._tell()
        if self._verbose:
            print_lines([f"{time.strftime('%Y-%m-%dT%H:%M:%S')} {event_line(event)}"], err=True)

    def end(self) -> None:
        self._steps.stop()
        if self._live is not None:
            self._live.stop()

    def view(self) -> Group:
        """Return the live table: how far, how long it will take, what is being solved, and how the solvers stand."""
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table

        table = Table.grid(padding=(0, 2), expand=True)
        table.add_column(style="dim", width=9)
        table.add_column(ratio=1, no_wrap=True, overflow="ellipsis")
        now = time.monotonic()
        table.add_row("done", f"{self._done} of {counted(self._total, 'pair')}, {self._left() or 'no estimate yet'}")
        table.add_row("", ProgressBar(total=max(self._total, 1), completed=self._done))
        for text, since, limit in list(self._now.values()):
            table.add_row("solving", f"{text}  {now - since:.1f} s of {limit:g} s")
        if self._warming:
            table.add_row("warming", self._warming)
        room = shutil.get_terminal_size().lines - table.row_count - ROOM
        return Group(table, self._standings.table(max(room, 1)))

    def _tell(self) -> None:
        """Print a line each tenth of the way, and the first of a long run as soon as it can be estimated."""
        tenth = self._done % max(1, self._total // 10) == 0
        first = self._done == FIRST < self._total / 10
        if self._quiet or self._terminal or not (tenth or first):
            return
        click.echo(self._line(), err=True)
        if self._done < self._total:
            self._steps.watch(self._line, EVERY)

    def _line(self) -> str:
        left = self._left() if self._done < self._total else ""
        return "  ".join(filter(None, (f"{self._done}/{self._total}", self._summary(), left)))

    def _left(self) -> str:
        """Return the time for the rest; nothing before enough pairs have ended."""
        expected: Expected | None = self._pace.expected(self._total - self._done)
        return f"{expected} left" if expected is not None else ""

    def _summary(self) -> str:
        return summary(dict(self._counts))


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
