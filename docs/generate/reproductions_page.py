"""Pages of published results that were measured again, from the tables that `benchmarks/reproductions.py` wrote.

    python docs/generate/reproductions_page.py     # writes reports/reproductions/NAME.md

The words are in reports/reproductions/texts.toml.
"""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from page_parts import table

from cpbench_problems.scenes.motions import incline

REPORTS = Path(__file__).resolve().parents[2] / "reports"
FOLDER = REPORTS / "reproductions"
Rows = Sequence[dict[str, str]]
TIE = 1.25
"""Ratio of two times below which neither is ahead."""
MARGIN = 0.1
"""Share of the problems by which a claim has to hold on more of them than not."""
KAMINO = 1.766686
"""Way of the block on the incline [m] that the authors of fbf-sca-2026 report of Kamino."""
NEAR = 1e-6
"""[m]"""
ORDERINGS = (
    ("Gauss-Seidel before Newton at 1e-4", "nsgs", "newton-alart-curnier", 1e-4),
    ("proximal points before Gauss-Seidel at 1e-8", "proximal-newton", "nsgs", 1e-8),
    ("proximal points before Newton at 1e-8", "proximal-newton", "newton-alart-curnier", 1e-8),
)
"""Claims on rigid bodies, the solver that is ahead and the other, and the tolerance."""


def page() -> str:
    """Return all pages as one."""
    pages = (text(name).replace("\n## ", "\n### ").replace("# ", "## ", 1) for name in PAGES)
    return "\n\n".join(["# Published results, measured again", *pages])


def text(name: str) -> str:
    """Return a page: the answer, what was published, ours, what differs, and how to repeat it."""
    words = tomllib.loads((FOLDER / "texts.toml").read_text("utf-8"))[name]
    tables, facts = PAGES[name]()
    answer, published, differs = (words[key].strip().format(**facts) for key in ("answer", "published", "differs"))
    parts = [
        f"# {words['title']}",
        answer,
        "## Published",
        published,
        "## Measured",
        *tables,
        "## What differs",
        differs,
    ]
    if (FOLDER / f"{name}.csv").exists():
        again = f"`python benchmarks/reproductions.py {name}` runs the plan `{name}.toml`"
        parts += ["## How to repeat it", f"{again}, and `python docs/generate/reproductions_page.py` writes this page."]
    return "\n\n".join(parts)


Page = tuple[list[str], dict[str, Any]]
"""Tables, and the values of the words in braces."""


def fathi_page() -> Page:
    """Return iterations by size, for Harker and Pang's line search and for whole steps."""
    rows = _rows("fathi")
    counts = _counts(rows, "iterations")
    sizes = sorted({_size(row) for row in rows})
    names = ("newton-min-harker-pang", "newton-min-plain")
    body = [[str(n), str(n), *(counts[f"fathi-{n}", name] for name in names)] for n in sizes]
    agree = sum(row[1] == row[2] for row in body)
    return [table(["n", "published", "Harker and Pang", "whole steps"], body)], {"agree": agree, "sizes": len(sizes)}


def bg2012_page() -> Page:
    """Return the periods of the cycles by size, and the iterations with a line search."""
    rows = _rows("bg2012")
    periods, counts = _counts(rows, "period"), _counts(rows, "iterations")
    sizes = sorted({_size(row) for row in rows})
    body: list[list[str]] = []
    for n in sizes:
        period = periods.get((f"bg2012-{n}", "newton-min-plain"))
        plain = "no cycle" if period is None else f"a cycle of {period} points"
        body.append([str(n), "may cycle", plain, counts.get((f"bg2012-{n}", "newton-min-harker-pang"), "none")])
    agree = sum(row[2] == f"a cycle of {row[0]} points" for row in body)
    head = ["n", "published", "whole steps", "iterations with Harker and Pang's line search"]
    return [table(head, body)], {"agree": agree, "sizes": len(sizes)}


def exponential_page() -> Page:
    """Return the lengths of Lemke and Howson's paths, and the pivots on Murty's problem."""
    rows = _rows("exponential")
    games = [row for row in rows if row["problem"].startswith("game-")]
    length = {(_size(row), row["what"]): int(row["count"]) for row in games}
    paths, growth = [], 0.0
    for d in sorted({_size(row) for row in games}):
        longest, shortest = length[d, "longest path"], length[d, "shortest path"]
        before = length.get((d - 4, "shortest path"))
        growth = shortest / before if before else 0.0
        ratio = f"{growth:.2f}" if before else ""
        paths.append([str(d), str(longest), str(_fibonacci(3 * d // 2 + 2) - 1), str(shortest), ratio])
    done = {(row["problem"], row["solver"]): row["count"] for row in rows if row["status"] == "solved"}
    pivots: list[list[str]] = []
    for n in sorted({_size(row) for row in rows if row["problem"].startswith("lemke-")}):
        ours = [done.get(key, "limit") for key in ((f"lemke-{n}", "lemke"), (f"least-index-{n}", "murty"))]
        pivots.append([str(n), str(2**n), ours[0], str(2**n - 1), ours[1]])
    ended = [row for row in pivots if "limit" not in row]
    tables = [
        table(["d", "longest path", "F(3d/2 + 2) − 1", "shortest path", "over that of d − 4"], paths),
        table(["n", "2ⁿ", "Lemke", "2ⁿ − 1", "least index"], pivots),
    ]
    agree = sum((row[1], row[3]) == (row[2], row[4]) for row in ended)
    return tables, {"growth": f"{growth:.1f}", "agree": agree, "sizes": len(ended)}


def mass_ratio_page() -> Page:
    """Return what each solver does by mass ratio."""
    rows = _rows("mass-ratio")
    ratios = sorted({row["problem"] for row in rows}, key=_ratio)
    cells = {
        (row["solver"], row["problem"]): row["count"] if row["status"] == "solved" else row["status"] for row in rows
    }
    solvers = dict.fromkeys(row["solver"] for row in rows)
    body = [[f"`{name}`", *(cells[name, ratio].replace("_", " ") for ratio in ratios)] for name in solvers]
    last = {row["solver"]: row["status"] for row in rows if row["problem"] == ratios[-1]}
    good, bad = ([f"`{name}`" for name in last if (last[name] == "solved") is yes] for yes in (True, False))
    head = ["solver", *(f"ratio {_ratio(name):g}" for name in ratios)]
    return [table(head, body)], {"good": ", ".join(good), "bad": ", ".join(bad)}


def orderings_page() -> Page:
    """Return how many problems each solver solves, and who is ahead of whom."""
    rows = _rows("orderings")
    solved = [row for row in rows if row["status"] == "solved" and row["time"]]
    times = {(row["problem"], row["solver"], float(row["tolerance"])): float(row["time"]) for row in solved}
    files = sorted({row["problem"] for row in rows})
    solvers = list(dict.fromkeys(row["solver"] for row in rows))
    counts = {(s, t): sum((f, s, t) in times for f in files) for s in solvers for t in (1e-4, 1e-8)}
    body = [[f"`{s}`", *(f"{counts[s, t]} of {len(files)}" for t in (1e-4, 1e-8))] for s in solvers]
    duels = [_duel(files, times, *ordering) for ordering in ORDERINGS]
    universal = sum(counts[s, 1e-8] == len(files) for s in solvers)
    head = ["published, on rigid bodies", "faster on", "slower on", "alone on", "other alone on", "here"]
    facts = {
        "agree": sum(duel[-1] == "reproduced" for duel in duels),
        "sizes": len(duels),
        "universal": universal or "none",
        "solvers": f"{len(solvers)} solvers",
        "problems": len(files),
        "tie": TIE,
        "margin": f"{MARGIN:.0%}",
        "proximal": counts["proximal-newton", 1e-8],
        "sweeps": counts["nsgs", 1e-8],
    }
    return [table(["solver", "solved at 1e-4", "solved at 1e-8"], body), table(head, duels)], facts


def incline_page() -> Page:
    """Return how far each solver's block ends from the closed form."""
    motion = incline()
    exact = float(motion.exact[0] - motion.places(motion.scene.start)[0])
    with (REPORTS / "motion" / "table.csv").open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["scene"] == "incline" and not row["message"]]
    body = [
        [f"`{row['solver']}`", f"{float(row['tolerance']):g}", f"{float(row['motion']) * exact:.1e}", row["missed"]]
        for row in rows
    ]
    fine = [float(row["motion"]) * exact for row in rows if float(row["tolerance"]) <= 1e-6]
    facts = {"agree": sum(way <= NEAR for way in fine), "sizes": len(fine), "exact": f"{exact:.6f}", "kamino": KAMINO}
    steps = _rows("incline")
    solved = [
        [f"`{name}`", f"{sum(row['status'] == 'solved' for row in own)} of {len(own)}"]
        for name in dict.fromkeys(row["solver"] for row in steps)
        if (own := [row for row in steps if row["solver"] == name])
    ]
    head = ["solver", "tolerance", "distance from the closed form [m]", "steps that miss the tolerance"]
    return [table(head, body), table(["solver", "first steps solved to 1e-6"], solved)], {
        **facts,
        "difference": f"{KAMINO - exact:.1e}",
    }


PAGES: Mapping[str, Callable[[], Page]] = {
    "fathi": fathi_page,
    "bg2012": bg2012_page,
    "exponential": exponential_page,
    "mass-ratio": mass_ratio_page,
    "orderings": orderings_page,
    "incline": incline_page,
}


def _rows(name: str) -> list[dict[str, str]]:
    with (FOLDER / f"{name}.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _counts(rows: Rows, what: str) -> dict[tuple[str, str], str]:
    """Return a count by problem and solver."""
    return {(row["problem"], row["solver"]): row["count"] for row in rows if row["what"] == what}


def _size(row: dict[str, str]) -> int:
    return int(row["problem"].rpartition("-")[2])


def _ratio(problem: str) -> float:
    return float(problem.removeprefix("cubes-"))


def _fibonacci(k: int) -> int:
    """Return the k-th Fibonacci number, F(1) = F(2) = 1."""
    a, b = 0, 1
    for _ in range(k):
        a, b = b, a + b
    return a


def _duel(
    files: Sequence[str],
    times: Mapping[tuple[str, str, float], float],
    claim: str,
    ahead: str,
    other: str,
    tolerance: float,
) -> list[str]:
    """Return a row: on how many files one solver is faster than the other, and on how many one of them is alone."""
    pairs = [(times.get((file, ahead, tolerance)), times.get((file, other, tolerance))) for file in files]
    both = [(a, b) for a, b in pairs if a is not None and b is not None]
    faster, slower = sum(a * TIE < b for a, b in both), sum(b * TIE < a for a, b in both)
    alone, others = (sum(a is not None and b is None for a, b in way) for way in (pairs, [(b, a) for a, b in pairs]))
    margin = faster + alone - slower - others
    decided = abs(margin) >= MARGIN * len(files)
    verdict = "undecided" if not decided else "reproduced" if margin > 0 else "not reproduced"
    return [claim, str(faster), str(slower), str(alone), str(others), verdict]


def main() -> None:
    """Write the pages."""
    for name in PAGES:
        (FOLDER / f"{name}.md").write_text(text(name) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
