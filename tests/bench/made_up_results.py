"""A results file that nobody measured, of any size, through the store that runs write: for `report_speed.py`.

    python tests/bench/made_up_results.py OUT.sqlite --problems 10000 --labels 100

Its rows are those of `made_up_rows`, with what makes a file of real results heavy: residual parts and three samples of
every answer, of which no two are alike.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from made_up_rows import make

from cpbench.bench.results.rows import MEASURED, PLANNED, Row
from cpbench.bench.results.store import Store

PARTS = ("natural", "energy", "opening", "drift", "per_contact", "fclib2018", "cone_violation [N s]", "work [J]")
"""Residuals of a row, some 250 characters of JSON."""
CHUNK = 20_000
"""Rows a transaction."""


def write(path: Path, problems: int, labels: int, seed: int = 0) -> int:
    """Write a results file, in place of one that is there; its number of rows."""
    table = make(problems, labels, seed)
    path.unlink(missing_ok=True)
    rng = np.random.default_rng(seed + 1)
    with Store(path, create=True) as store:
        for first in range(0, len(table), CHUNK):
            store.add(_rows(table.iloc[first : first + CHUNK], rng))
        store.set_meta(**_meta(table))
    return len(table)


def _rows(table: pd.DataFrame, rng: np.random.Generator) -> Iterator[Row]:
    """Rows as the store takes them: text, numbers, None."""
    residuals = np.exp(rng.uniform(-25, 0, (len(table), len(PARTS)))).tolist()
    answered = table["claim"].notna().tolist()
    told = [
        "{" + ", ".join(f'"{name}": {value!r}' for name, value in zip(PARTS, line, strict=True)) + "}"
        if there
        else "{}"
        for line, there in zip(residuals, answered, strict=True)
    ]
    names = (*PLANNED, *MEASURED)
    absent: dict[str, list[Any]] = dict.fromkeys(names, [None] * len(table))
    columns = absent | {str(name): table[name].tolist() for name in table} | {"parts": told}
    for values in zip(*(columns[name] for name in names), strict=True):
        yield Row(*values)


def _meta(table: pd.DataFrame) -> dict[str, Any]:
    """The facts of a run, with a sheet a solver."""
    sheets = {
        label: {"name": solver, "node": "fc", "licence": "MIT", "publishing": "", "summary": "made up", "version": "1"}
        for label, solver in table[["label", "solver"]].drop_duplicates().itertuples(index=False)
    }
    return {"command": "made up", "date": "2026-01-01", "machine": {"cpu": "none"}, "solvers": sheets, "cpbench": "0"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=Path)
    parser.add_argument("--problems", type=int, default=10_000)
    parser.add_argument("--labels", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    count = write(given.output, given.problems, given.labels, given.seed)
    print(f"{given.output}: {count} rows, {given.output.stat().st_size / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
