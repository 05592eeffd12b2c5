"""What a run shows: a bar on a terminal, one line a tenth of the way elsewhere, nothing when quiet."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

import click

from cpbench.bench.plan import Pair
from cpbench.conversions import Conversion
from cpbench.errors import NotApplicable
from cpbench.formulations import Problem
from cpbench.graph import Apply

LARGE = 50e6
"""Bytes of a conversion's result from which on it is announced."""


class Display:
    """Progress on stderr; data never goes there, so that stdout can be piped."""

    def __init__(self, quiet: bool) -> None:
        self._quiet = quiet
        self._terminal = sys.stderr.isatty() and not quiet
        self._bar: Any = None
        self._task: Any = None
        self._total = self._done = 0
        self._counts: Counter[str] = Counter()

    def reading(self, addresses: Sequence[str]) -> Iterator[str]:
        """The addresses, with a bar over the files on a terminal."""
        yield from self._track(addresses, "reading")

    def begin(self, planned: Sequence[Pair], pending: Collection[str]) -> None:
        self._total = len({p.key for p in planned} & set(pending))
        already = len(planned) - self._total
        if not self._quiet:
            resumed = f", {already} done before" if already else ""
            click.echo(f"{len(planned)} pairs{resumed}", err=True)
        if self._terminal and self._total:
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

            self._bar = Progress(
                TextColumn("{task.description:40.40}"),
                BarColumn(),
                MofNCompleteColumn(),
                TimeRemainingColumn(),
                TextColumn("{task.fields[counts]}"),
                console=Console(file=sys.stderr),
                transient=True,
            )
            self._task = self._bar.add_task("starting", total=self._total, counts="")
            self._bar.start()

    def progress(self, event: str, pair: Pair | None, row: Mapping[str, Any]) -> None:
        """Called by the runner with `start` (a solver warms up), `solve` and `done`."""
        if event == "done":
            self._done += 1
            self._counts[str(row["status"])] += 1
        if self._bar is not None:
            text = (
                f"warming up {row['solver']}" if event == "start" else f"{pair.problem}  {pair.label}" if pair else ""
            )
            self._bar.update(self._task, description=text, completed=self._done, counts=self._summary())
        elif not self._quiet and event == "done" and self._done % max(1, self._total // 10) == 0:
            click.echo(f"{self._done}/{self._total}  {self._summary()}", err=True)

    def end(self) -> None:
        if self._bar is not None:
            self._bar.stop()

    def _summary(self) -> str:
        return " ".join(f"{status} {n}" for status, n in self._counts.most_common(4))

    def _track(self, items: Sequence[str], label: str) -> Iterable[str]:
        if not self._terminal:
            return items
        from rich.console import Console
        from rich.progress import track

        return track(items, description=label, console=Console(file=sys.stderr), transient=True)


def converting(edge: Conversion, problem: Problem, apply: Apply, room: int) -> Problem:
    """`apply`, announced on stderr where the result is large, with a spinner on a terminal.

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
