"""What a run shows: a bar on a terminal, one line a tenth of the way elsewhere, nothing when quiet."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

import click

from cpbench.bench.plan import Pair


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
