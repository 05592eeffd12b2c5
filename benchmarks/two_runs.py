"""Two runs of one plan side by side: are the counts of solved problems equal, and the ratios of times?

    python benchmarks/difficulty.py new.sqlite -o new
    python benchmarks/two_runs.py reports/standard/pairs.csv new/pairs.csv

takes two tables of pairs, for instance that of `reports/standard` and of another machine, and prints Markdown: of each
formulation the solvers that solve the most in the first run with what they solve and × fastest (geometric mean, over
what a solver solves, of its time over that of the fastest solver there) in both, and the pairs that only one run
solved. Times below 100 µs count as that, as in a report.
"""

from __future__ import annotations

import argparse

import numpy as np
import pandas as pd

FLOOR = 1e-4
"""Seconds below which times are not told apart."""
KEYS = ["node", "problem", "solver"]


def by_solver(pairs: pd.DataFrame) -> pd.DataFrame:
    """Return `solved`, the number of problems, and `× fastest` by node and solver."""
    time = pairs["seconds"].clip(lower=FLOOR).where(pairs["solved"] == 1)
    fastest = time.groupby([pairs["node"], pairs["problem"]]).transform("min")
    groups = [pairs["node"], pairs["solver"]]
    factor = np.exp(np.log(time / fastest).groupby(groups).mean())
    return pd.DataFrame({"solved": pairs["solved"].groupby(groups).sum(), "× fastest": factor})


def leading(first: pd.DataFrame, second: pd.DataFrame, count: int) -> pd.DataFrame:
    """Return both runs' numbers of the solvers that solve the most of each node in the first, the fastest first."""
    both = by_solver(first).join(by_solver(second), rsuffix=" again").reset_index()
    order = both.sort_values(["node", "solved", "× fastest"], ascending=[True, False, True])
    chosen = order.groupby("node").head(count)
    return chosen.assign(ratio=chosen["× fastest again"] / chosen["× fastest"])


def changed(first: pd.DataFrame, second: pd.DataFrame) -> pd.DataFrame:
    """Return the pairs that only one of the runs solved."""
    both = first.merge(second, on=KEYS, suffixes=("", " again"))
    columns = [*KEYS, "status", "seconds", "status again", "seconds again"]
    return both.loc[both["solved"] != both["solved again"], columns]


def markdown(table: pd.DataFrame) -> str:
    """Write a table."""
    cells = table.map(lambda value: f"{value:.3g}" if isinstance(value, float) else str(value))
    lines = [list(cells.columns), ["---"] * len(cells.columns), *cells.to_numpy().tolist()]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first")
    parser.add_argument("second")
    parser.add_argument("--solvers", type=int, default=3, help="so many of each formulation")
    args = parser.parse_args()
    first, second = pd.read_csv(args.first), pd.read_csv(args.second)
    top, different = leading(first, second, args.solvers), changed(first, second)
    near = int((top["ratio"].sub(1.0).abs() <= 0.05).sum())
    most = np.exp(np.log(top["ratio"]).abs().max())
    print(
        f"{len(different)} of {len(first)} pairs were solved by one run only; {near} of {len(top)} × fastest differ by"
    )
    print(f"at most 5 %, the largest by a factor of {most:.3g}.\n")
    print(markdown(top))
    print()
    print(markdown(different))


if __name__ == "__main__":
    main()
