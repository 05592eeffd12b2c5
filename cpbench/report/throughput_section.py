"""The section about sets that ask for throughput: problems per second, in the report and on the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import pandas as pd

from cpbench.analysis.ranking import formulation
from cpbench.analysis.throughput import throughputs
from cpbench.report.run import Run
from cpbench.report.text import code, plain, table

HEAD = ("formulation", "solver", "threads", "problems", "verified", "calls", "problems/s")
TITLE = "Problems per second"
GUIDE = (
    "Verified answers over the time of all calls, those included that solved nothing. A call for many problems has "
    "each of them in its row with an equal part of its time (column `batch`: how many); who cannot take many is called "
    "for each."
)


def throughput_lines(rows: pd.DataFrame) -> list[Sequence[str]]:
    """Return the cells of the table, none where no set asks for throughput."""
    rates = throughputs(rows)
    groups = sorted({one.group for one in rates})
    return [
        (
            formulation(one.group, groups),
            one.label,
            str(one.group.threads),
            str(one.problems),
            str(one.verified),
            str(one.calls),
            f"{float(f'{one.per_second:.3g}'):,.10g}" if one.per_second >= 1 else f"{one.per_second:.3g}",
        )
        for one in rates
    ]


def throughput_section(run: Run) -> Iterator[str]:
    """Yield the table; nothing where no set asks for throughput."""
    lines = throughput_lines(run.rows)
    if lines:
        yield f"## {TITLE}"
        yield table(HEAD, ([plain(name), code(label), *rest] for name, label, *rest in lines), right=range(2, 7))
        yield GUIDE
