"""How hard the tiers of the collection are: the rows and rankings of one run of both, as small tables.

    python benchmarks/difficulty.py standard.sqlite -o reports/standard

takes the results of the plan `reports/standard/standard.toml`, which says how to run it, or of any plan for both, and
writes pairs.csv, ranking.csv and runs.csv. `python docs/generate/difficulty_page.py` then writes the page.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.run_table import RunTable
from cpbench.api.results import Results
from cpbench.generators.base import SMALL, STANDARD
from cpbench.generators.collection import catalogue, identity
from cpbench.verification import PROVEN, Status

PAIRS = ("tier", "node", "family", "problem", "solver", "status", "solved", "seconds")
RANKING = ("tier", "node", "place", "solver", "started", "solved", "median")
RUNS = (
    "tier", "pairs", "problems", "of", "largest", "hours", "peak_gb", "timeout", "tolerance", "version", "processor",
    "collection",
)  # fmt: skip


def finished(results: Results) -> dict[str, RunTable]:
    """Return of each tier the rows of the problems all of whose pairs have run."""
    frame = results.frame
    waiting = frame.loc[frame["status"] == str(Status.NOT_RUN), "fingerprint"]
    tiers = frame["fingerprint"].map({entry.fingerprint: entry.tier for entry in catalogue()})
    tiers = tiers.mask(frame["fingerprint"].isin(waiting))
    return {tier: RunTable.of(frame[tiers == tier], results.meta) for tier in (SMALL, STANDARD)}


def pairs(tier: str, run: RunTable) -> Iterator[tuple[object, ...]]:
    """Yield a row for each pair; seconds are those of conversion, solve and way back, empty where not solved.

    Problems that were proved to have no solution are left out, as in rankings.
    """
    frame = run.rows
    frame = frame[~frame["fingerprint"].isin(frame.loc[frame["status"].isin(PROVEN), "fingerprint"])]
    solved = rows_of.solved(frame)
    charged = frame[list(rows_of.CHARGED)].sum(axis=1)
    for index, row in frame.iterrows():
        right = bool(solved[index])
        seconds = f"{charged[index]:.3g}" if right else ""
        yield tier, row["node"], row["family"], row["problem"], row["label"], row["status"], int(right), seconds


def ranking(tier: str, run: RunTable) -> Iterator[tuple[object, ...]]:
    """Yield the solvers of each formulation in the order in which a report ranks them; medians in seconds."""
    for answer in run.rankings:
        for place, row in enumerate(answer.rows, 1):
            median = "" if pd.isna(row.median) else f"{row.median:.3g}"
            yield tier, answer.group.node, place, row.solver, row.started, row.solved, median


def run_facts(tier: str, run: RunTable) -> tuple[object, ...]:
    """Return the size of the run of a tier, the problems of its formulations, the time of its pairs [h], its largest
    process [GB], and its conditions."""
    frame, nodes = run.rows, set(run.rows["node"])
    entries = {one.fingerprint: one for one in catalogue() if one.tier == tier and one.node in nodes}
    marks = set(frame["fingerprint"])
    machine: dict[str, Any] = dict(run.meta.get("machine") or {})
    tolerance, timeout = (sorted(frame[name].dropna().unique().tolist()) for name in ("tolerance", "seconds"))
    return (
        tier,
        len(frame),
        len(marks),
        len(entries),
        max(entries[mark].unknowns for mark in marks),
        f"{frame['wall'].sum() / 3600:.2f}",
        f"{frame['peak'].max() / 1e9:.2f}",
        " ".join(f"{value:g}" for value in timeout),
        " ".join(f"{value:g}" for value in tolerance),
        str(run.meta.get("cpbench", "")),
        str(machine.get("cpu", "")),
        str(identity(catalogue())),
    )


def write(path: Path, head: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    """Write a table with its head."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        writer.writerows(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    chosen = parser.parse_args()
    runs = finished(Results(chosen.results))
    chosen.output.mkdir(parents=True, exist_ok=True)
    write(chosen.output / "pairs.csv", PAIRS, (row for tier, run in runs.items() for row in pairs(tier, run)))
    write(chosen.output / "ranking.csv", RANKING, (row for tier, run in runs.items() for row in ranking(tier, run)))
    write(chosen.output / "runs.csv", RUNS, (run_facts(tier, run) for tier, run in runs.items()))


if __name__ == "__main__":
    main()
