"""The baseline of a results file, and the changes since then in lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cpbench.analysis import baseline, participation, ratchet
from cpbench.analysis.ratchet import Change
from cpbench.bench.results.sealed import sealed
from cpbench.errors import StoreError
from cpbench.foundation.plurals import counted

if TYPE_CHECKING:
    import pandas as pd

LISTED, FEW = 40, 8
"""Lines that are shown of one kind of change; of pairs that are on one side only."""


def outcomes(results: Path) -> tuple[pd.DataFrame, list[str]]:
    """Return the outcomes of a results file as a baseline has them, and the solvers whose figures are restricted.

    Raises StoreError where no pair was run.
    """
    with sealed(results) as store:
        table, sheets = store.table(), store.meta().get("solvers") or {}
    new = baseline.outcomes(table)
    if new["status"].isin(baseline.UNMEASURED).all():
        cause = f"none of {counted(len(new), 'pair')} was run" if len(new) else "no row"
        raise StoreError(f"{results}: {cause}: nothing to keep; run it with: cpbench run PROBLEMS -o {results}")
    return new, list(participation.restricted(table, sheets))


def measured(outcomes: pd.DataFrame) -> int:
    """Return the number of pairs that were run."""
    return len(outcomes) - int(outcomes["status"].isin(baseline.UNMEASURED).sum())


def lines(changes: pd.DataFrame, accepted: pd.Series[bool]) -> Iterator[str]:
    """Yield what differs, worst first, and how many pairs there are of each kind.

    Parameters
    ----------
    changes : what `ratchet.changes` returned. accepted : the worse pairs that are taken over.
    """
    table = changes.assign(label=baseline.labels(changes), setting=_settings(changes), accepted=accepted)
    for change in (c for c in Change if c not in (Change.SAME, Change.KNOWN, Change.UNMEASURED)):
        rows = table[table["change"] == change]
        listed = FEW if change in (Change.NEW, Change.VANISHED) else LISTED
        for _, row in rows.head(listed).iterrows():
            mark = "accepted" if row["accepted"] else change
            note = f" (known: {row['known']})" if row["known"] else ""
            yield f"{mark:10} {row['problem']}:{row['label']} {row['setting']}{row['detail']}{note}"
        if len(rows) > listed:
            yield f"{change:10} and {len(rows) - listed} more"
    counts = changes["change"].value_counts()
    yield ", ".join(f"{counts[c]} {c}" for c in Change if counts.get(c))
    stale = int(counts.get(Change.FIXED, 0))
    if stale:
        yield f"{stale} known failures are fixed: --update removes the reason ('{ratchet.FLAKY} ...' keeps it)"


def failures(changes: pd.DataFrame, accepted: pd.Series[bool], kinds: Sequence[str]) -> dict[str, int]:
    """Return how many pairs that are not accepted changed in each of these ways, without those of which there are none.

    A kind is a change, or `wrong` or `crash` for a status that the baseline does not have.
    """
    counts: dict[str, int] = {}
    for kind in kinds:
        if kind in ("wrong", "crash"):
            meant = (changes["status_new"] == kind) & (changes["status_old"] != kind)
        else:
            meant = changes["change"] == (Change.REGRESSED if kind == "regression" else kind)
        counts[kind] = int((meant & ~accepted).sum())
    return {kind: count for kind, count in counts.items() if count}


def _settings(changes: pd.DataFrame) -> pd.Series[str]:
    """Return what tells pairs of one problem and solver apart, where the baseline has more than one of it."""
    text = changes["problem"].str.slice(0, 0)
    for name in ("tolerance", "start", "threads", "measure", "sequence"):
        if changes[name].nunique() > 1:
            text += f"{name}=" + changes[name] + " "
    return text
