"""The progress of commands on stderr: steps while they last, the display of a run."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import click

from cpbench.bench.events import Event, Observer, Solving, Starting, Told
from cpbench.bench.planning.plan import Pair
from cpbench.cli.terminal import print_lines
from cpbench.foundation.text import counted, on_one_line, summary

if TYPE_CHECKING:
    from rich.console import Console
    from rich.status import Status

T = TypeVar("T")


def _stderr() -> Console:
    from rich.console import Console

    return Console(file=sys.stderr, markup=False, highlight=False)


def shown_progress(items: Iterable[T], total: int, text: str) -> Iterator[T]:
    """Yield the items, with a bar on a terminal while they last."""
    if not sys.stderr.isatty():
        yield from items
        return
    from rich.progress import track

    yield from track(items, text, total, console=_stderr(), transient=True)


class Steps:
    """Steps of a command: on a terminal the one that lasts, with a spinner; nothing elsewhere, or when quiet. A context
    manager, which ends the step."""

    def __init__(self, quiet: bool) -> None:
        self._shown = sys.stderr.isatty() and not quiet
        self._status: Status | None = None

    def __enter__(self) -> Steps:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def say(self, step: str) -> None:
        """Note a step, which begins; '' ends the one before, which has to be over where lines are printed."""
        self.stop()
        if self._shown and step:
            self._status = _spinner(step)
            self._status.start()

    def through(self, items: Sequence[str], text: str) -> Iterator[str]:
        """Yield the items, with a bar while they last."""
        self.stop()
        yield from shown_progress(items, len(items), text) if self._shown else items

    def stop(self) -> None:
        """End the step."""
        if self._status is not None:
            self._status.stop()
        self._status = None


def _spinner(text: str) -> Status:
    from rich.text import Text

    return _stderr().status(Text(on_one_line(text)))


class Display(Observer):
    """Progress of a run on stderr; data never goes there, so that stdout can be piped.

    A bar on a terminal, lines elsewhere, nothing when quiet. `steps` : what is done before and after pairs are run.
    """

    def __init__(self, quiet: bool = False) -> None:
        self._quiet = quiet
        self.steps = Steps(quiet)
        self._bar: Any = None
        self._total = 0
        self._counts: Counter[str] = Counter()

    def reading(self, addresses: Sequence[str]) -> Iterator[str]:
        """Yield the addresses, with a bar over the files on a terminal."""
        yield from self.steps.through(addresses, f"reading {counted(len(addresses), 'problem')}")
        self.steps.say("planning pairs")

    def begin(self, planned: Sequence[Pair], pending: Collection[str]) -> None:
        self.steps.stop()
        self._total = len({p.key for p in planned} & set(pending))
        before = len(planned) - self._total
        if not self._quiet:
            click.echo(f"{counted(len(planned), 'pair')}{f', {before} done before' if before else ''}", err=True)
        if self._total and sys.stderr.isatty() and not self._quiet:
            self._begin_bar()

    def progress(self, event: Event) -> None:
        """Show an event of the run."""
        doing = ""
        if isinstance(event, Starting):
            doing = f"starting {event.solver}"
        elif isinstance(event, Solving):
            doing = f"{event.pair.label} on {event.pair.problem}, at most {event.pair.limits.seconds:g} s"
        elif isinstance(event, Told):
            if not self._quiet:
                print_lines([event.line], err=True)
        else:
            self._count(event.outcome.status)
        if self._bar is not None and doing:
            self._bar.update(0, doing=on_one_line(doing))

    def end(self) -> None:
        if self._bar is not None:
            self._bar.stop()

    def _count(self, status: str) -> None:
        """Count a pair that has ended; a line tells each tenth of the way."""
        self._counts[status] += 1
        done = self._counts.total()
        if self._bar is not None:
            self._bar.update(0, completed=done, counts=summary(dict(self._counts)))
        elif not self._quiet and done % max(1, self._total // 10) == 0:
            click.echo(f"{done}/{self._total}  {summary(dict(self._counts))}", err=True)

    def _begin_bar(self) -> None:
        """Show how far the run is, the time left, the statuses so far, and what is being done for how long."""
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
        from rich.table import Column

        self._bar = Progress(
            BarColumn(20),
            MofNCompleteColumn(),
            TextColumn("pairs,"),
            TimeRemainingColumn(),
            TextColumn("left  {task.fields[counts]}\n{task.fields[doing]}", markup=False, table_column=Column(ratio=1)),
            console=_stderr(),
            expand=True,
            refresh_per_second=2,
            transient=True,
        )
        self._bar.add_task("", total=self._total, counts="", doing="")
        self._bar.start()
