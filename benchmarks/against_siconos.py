"""The whole table of speed, losses first: what is asked of the native solvers, and what this machine measures today.

    python benchmarks/against_siconos.py [--data FOLDER] [--parts lcp,contact,...] [--rows] [--picture FILE]

Runs the races of the scripts beside it, one after the other: LCP and contact against Siconos, QPs against the installed
backends. A ratio is their time over ours. FOLDER holds real files of contact; without
it only generated problems are raced. Printed first is every race that was lost, or not solved where they solved; then a
line for each requirement with the least and the geometric mean of its ratios. About 25 minutes on a quiet machine.
"""

from __future__ import annotations

import argparse
import math
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from one_race import Race, read

HERE = Path(__file__).parent
FEW_CONTACTS = 200
"""Contact files of more contacts than that are not raced: theirs would take minutes a solve."""


@dataclass(frozen=True)
class Asked:
    """A requirement on the rows of `race`, and of `size`, `sizes` and `tolerance` where given: the least ratio and the
    geometric mean that are asked for, 0 where nothing is; `aim` : of the least."""

    work: str
    race: str
    least: float
    mean: float = 0.0
    aim: float = 0.0
    size: int | None = None
    sizes: range = range(1_000_000)
    tolerance: float | None = None

    def of(self, row: Race) -> bool:
        """Whether the row counts."""
        alike = self.size in (None, row.size) and self.tolerance in (None, row.tolerance)
        return row.race == self.race and alike and row.size in self.sizes

    def line(self, rows: list[Race]) -> str | None:
        """What was asked and what came out, None without rows."""
        mine = [row for row in rows if self.of(row)]
        ratios = [row.ratio for row in mine if row.ratio is not None]
        if not ratios:
            return None
        least, mean = min(ratios), statistics.geometric_mean(ratios)
        unsolved = sum(row.lost and row.ratio is None for row in mine)
        met = least >= self.least and mean >= self.mean and not unsolved
        asked = f"≥ {self.least:g}" + (f", mean ≥ {self.mean:g}" if self.mean else "")
        asked += f", aim {self.aim:g}" if self.aim else ""
        note = f", {unsolved} unsolved" if unsolved else ""
        figures = f"{least:8.2f} {mean:8.2f} {len(ratios):5d}{note}"
        return f"{'met' if met else 'SHORT':6s} {self.work:52s} {asked:22s} {figures}"


ASKED = (
    Asked("LCP n=1000, Lemke against lcp_lexicolemke", "lcp lemke", 15, aim=25, size=1000),
    Asked("LCP n=1000, Lemke against lcp_pivot", "lcp pivot", 100, aim=200, size=1000),
    Asked("LCP n=1000, best against best", "lcp best", 5, aim=10, size=1000),
    *(
        Asked(f"LCP n={n}, one compiled call", "lcp kernel", r, size=n)
        for n, r in ((5, 1.0), (10, 1.2), (20, 2), (50, 5))
    ),
    Asked("NSGS, one sweep", "contact sweep", 8, aim=10),
    *(
        Asked(f"NSGS to {t:.0e}, same rule, {words} contacts", "contact nsgs", least, mean, sizes=sizes, tolerance=t)
        for words, sizes, least, mean in (("20 and more", range(20, 1_000_000), 6, 12), ("fewer", range(20), 1, 0))
        for t in (1e-4, 1e-8)
    ),
    *(Asked(f"auto-fc to {t:.0e}, best of eight", "contact auto", 1, 4, 5, tolerance=t) for t in (1e-4, 1e-8)),
    Asked("QP, best native against best backend", "qp best", 0.5),
)


def parts(data: Path | None) -> dict[str, list[str]]:
    """Part -> the script that races it, with its arguments."""
    table = {
        "lcp": ["lcp_against_siconos.py", "--sizes", "5,10,20,50,1000"],
        "qp": ["qp_against_backends.py"],
    }
    if data is not None:
        races = ["--races", "auto,nsgs,sweep", "--most", str(FEW_CONTACTS)]
        table["contact"] = ["contact_against_siconos.py", str(data), *races]
    return table


def measured(command: list[str], results: Path) -> list[Race]:
    """The rows of one script; what it prints goes to stderr, for the losses of all come first here."""
    whole = [sys.executable, str(HERE / command[0]), *command[1:], "--json", str(results)]
    subprocess.run(whole, check=True, stdout=sys.stderr)
    return read(results)


def lines(rows: list[Race]) -> Iterator[str]:
    """One line a row."""
    for row in rows:
        ratio = f"{row.ratio:8.2f}" if row.ratio is not None else f"{'-':>8s}"
        tolerance = f"{row.tolerance:.0e}" if row.tolerance else ""
        yield f"{ratio}  {row.race:14s} {row.problem[:40]:40s} {tolerance:6s} {row.theirs} / {row.ours}"


def draw(rows: list[Race], path: Path) -> None:
    """A race against others is a dot on the line of its work, orange below 1; a bar is what is asked of each."""
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    works = [asked for asked in ASKED if any(asked.of(row) and row.ratio is not None for row in rows)]
    figure, axes = plt.subplots(figsize=(8, 0.32 * len(works) + 1.0), layout="constrained")
    for line, asked in enumerate(reversed(works)):
        ratios = sorted(row.ratio for row in rows if asked.of(row) and row.ratio is not None)
        height = [line + 0.12 * (k % 5 - 2) for k in range(len(ratios))]
        won = [ratio >= 1.0 for ratio in ratios]
        for good, color in ((True, "#0072b2"), (False, "#d55e00")):
            chosen = [k for k, is_won in enumerate(won) if is_won is good]
            axes.plot(
                [ratios[k] for k in chosen], [height[k] for k in chosen], "o", ms=4, mew=0, alpha=0.8, color=color
            )
        axes.plot([asked.least] * 2, [line - 0.4, line + 0.4], color="#333333", lw=1.5)
    axes.axvline(1.0, color="#999999", lw=0.8)
    axes.set_xscale("log")
    axes.set_yticks(range(len(works)), [asked.work for asked in reversed(works)])
    axes.set_xlabel("their time / ours")
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
    figure.savefig(path, dpi=130)


def raced(data: Path | None, chosen: list[str]) -> list[Race]:
    """All races of these parts."""
    rows: list[Race] = []
    known = parts(data)
    with tempfile.TemporaryDirectory() as folder:
        for part in chosen:
            if part in known:
                print(f"# {part}", file=sys.stderr, flush=True)
                rows += measured(known[part], Path(folder) / f"{part}.json")
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help="real files of contact problems")
    parser.add_argument("--parts", default="lcp,contact,qp")
    parser.add_argument("--rows", action="store_true", help="print every race, too")
    parser.add_argument("--picture", type=Path, help="draw the ratios there (.png, .svg)")
    asked_for = parser.parse_args()
    rows = raced(asked_for.data, asked_for.parts.split(","))
    rows.sort(key=lambda row: math.inf if row.ratio is None else row.ratio)
    lost = [row for row in rows if row.lost]
    print(f"Lost: {len(lost)} of {len(rows)} races")
    print("\n".join(lines(lost)))
    print(f"\n{'':6s} {'work':52s} {'asked of each':22s} {'least':>8s} {'mean':>8s} {'races':>5s}")
    for asked in ASKED:
        if (line := asked.line(rows)) is not None:
            print(line)
    if asked_for.rows:
        print("\n" + "\n".join(lines(rows)))
    if asked_for.picture is not None:
        draw(rows, asked_for.picture)


if __name__ == "__main__":
    main()
