"""The section of a report about answers that were made elsewhere."""

from __future__ import annotations

from collections.abc import Iterator

from cpbench.analysis import table as rows_of
from cpbench.report.run import Run
from cpbench.report.text import code, plain, table
from cpbench.verification import Status


def imported(run: Run) -> Iterator[str]:
    """Yield one line a label and place; nothing when all rows are of this tool."""
    foreign = run.rows[run.rows["origin"] != ""]
    if not len(foreign):
        return
    yield f"## Made elsewhere ({len(foreign)})"
    ranked = "here they are ranked all the same" if "ranked" in foreign else "they are not ranked"
    yield (
        "These answers were imported: each was judged here, on the problem that was asked. Their times are what was "
        f"told, of another machine; {ranked}. An answer without a claim counts as claimed."
    )
    yield table(
        ["solver", "made on", "pairs", "solved", "stationary", "no answer", "with a time"],
        (
            [
                code(label),
                plain(origin),
                str(len(rows)),
                str(int(rows_of.solved(rows).sum())),
                str(int((rows["status"] == str(Status.STATIONARY)).sum())),
                str(int((rows["message"] == rows_of.NO_ANSWER).sum())),
                str(int(rows["solve"].notna().sum())),
            ]
            for (label, origin), rows in foreign.groupby(["label", "origin"], sort=True)  # type: ignore[misc]
        ),
        right=range(2, 7),
    )
