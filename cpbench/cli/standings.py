"""How solvers stand while a run goes on: a row each, those that solved most above."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from cpbench.bench.results.rows import Outcome
from cpbench.verification import MET_TOLERANCE, REFUSED

if TYPE_CHECKING:
    from rich.table import Table


@dataclass
class Standing:
    """Outcomes of a solver so far: pairs solved and not, those it never started on, and the time it took [s]."""

    solved: int = 0
    failed: int = 0
    refused: int = 0
    seconds: float = 0.0


@dataclass
class Standings:
    """The standings of all solvers of a run."""

    of: dict[str, Standing] = field(default_factory=dict)

    def note(self, label: str, outcome: Outcome) -> None:
        """Count a pair of a solver that has ended."""
        standing, status = self.of.setdefault(label, Standing()), outcome.status
        standing.solved += status in MET_TOLERANCE
        standing.refused += status in REFUSED
        standing.failed += status not in (*MET_TOLERANCE, *REFUSED)
        standing.seconds += outcome.wall or 0.0

    def table(self, most: int) -> Table:
        """Return at most so many rows of solvers that were started, the rest counted."""
        from rich.table import Table
        from rich.text import Text

        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")
        table.add_column("solver", no_wrap=True, overflow="ellipsis", max_width=40)
        for name in ("solved", "failed", "time"):
            table.add_column(name, justify="right", no_wrap=True)
        started = {label: s for label, s in list(self.of.items()) if s.solved or s.failed}
        ordered = sorted(started, key=lambda label: (-started[label].solved, started[label].failed, label))
        for label in ordered[:most]:
            s = started[label]
            failed = Text(str(s.failed or "·"), style="red" if s.failed else "dim")
            table.add_row(Text(label), str(s.solved), failed, f"{s.seconds:.1f} s")
        if len(ordered) > most:
            table.add_row(Text(f"and {len(ordered) - most} more", style="dim"))
        return table
