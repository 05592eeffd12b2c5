"""Add the times of a run to `cpbench/api/solve_times.json`, from which a run is estimated before it starts.

    cpbench run builtin -o small.sqlite
    python tests/bench/solve_times.py small.sqlite ...

Problems that the table has keep their times; those that are in no tier of the collection any more are dropped. Of the
others, each label that was started by an exact route gets the seconds of its solve, or null where it did not solve.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

import cpbench
from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import REFUSED
from cpbench.api.results import Results
from cpbench.formulations.base import Kind
from cpbench.generators.collection import catalogue

TABLE = Path(__file__).resolve().parents[2] / "cpbench" / "api" / "solve_times.json"
EXACT = [str(kind) for kind in Kind if kind.exact]


def times(results: Results) -> dict[str, dict[str, float | None]]:
    """Return the seconds of each label by fingerprint, to three digits."""
    frame = rows_of.normalised(results.frame)
    started = frame[frame["kind"].isin(EXACT) & ~frame["status"].isin(REFUSED)]
    solved = rows_of.solved(started)
    found: dict[str, dict[str, float | None]] = {}
    for index, row in started.iterrows():
        seconds = float(f"{row['solve']:.3g}") if solved[index] and pd.notna(row["solve"]) else None
        found.setdefault(row["fingerprint"], {})[row["label"]] = seconds
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", nargs="+", type=Path)
    table: dict[str, Any] = json.loads(TABLE.read_text("utf-8"))
    current = {entry.fingerprint for entry in catalogue()}
    known: dict[str, Mapping[str, float | None]] = {
        mark: row for mark, row in table["seconds"].items() if mark in current
    }
    before = len(known)
    for path in parser.parse_args().results:
        results = Results(path)
        known |= {mark: row for mark, row in times(results).items() if mark in current and mark not in known}
        table["about"] = f"cpbench {cpbench.__version__}, {str(results.meta['date'])[:10]}"
    table["seconds"] = {mark: dict(sorted(row.items())) for mark, row in sorted(known.items())}
    rows = ",\n".join(f"{json.dumps(mark)}: {json.dumps(row)}" for mark, row in table.pop("seconds").items())
    TABLE.write_text(f'{json.dumps(table)[:-1]}, "seconds": {{\n{rows}\n}}}}\n', encoding="utf-8")
    print(f"{len(known) - before} problems added, {before} kept; {len(current - known.keys())} have no times")


if __name__ == "__main__":
    main()
