"""The page on how hard the tiers of the collection are, from the tables that `benchmarks/difficulty.py` wrote.

python docs/generate/difficulty_page.py     # writes reports/standard/difficulty.md
"""

from __future__ import annotations

import csv
import statistics
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from page_parts import table

FOLDER = Path(__file__).resolve().parents[2] / "reports" / "standard"
SMALL, STANDARD = "small", "standard"
SLOW = 1.0
"""Time of the fastest solver [s] above which a problem counts as slow."""
SHOWN = 4
"""Solvers of a ranking that are shown."""
Rows = Sequence[Mapping[str, str]]


@dataclass(frozen=True)
class Group:
    """Pairs of one tier and formulation, or of one family of it."""

    pairs: Rows

    @property
    def problems(self) -> int:
        return len({(pair["family"], pair["problem"]) for pair in self.pairs})

    @property
    def solved_by(self) -> dict[str, int]:
        """Problems solved by each solver that was started on any of them, the most first."""
        counts = {pair["solver"]: 0 for pair in self.pairs if pair["status"] not in NOT_STARTED}
        counts |= Counter(pair["solver"] for pair in self.pairs if pair["solved"] == "1")
        return dict(sorted(counts.items(), key=lambda item: (-item[1], item[0])))

    @property
    def fastest(self) -> dict[tuple[str, str], float]:
        """Least time [s] on each problem that a solver solved."""
        found: dict[tuple[str, str], float] = {}
        for pair in self.pairs:
            if pair["solved"] == "1":
                key, seconds = (pair["family"], pair["problem"]), float(pair["seconds"])
                found[key] = min(found.get(key, seconds), seconds)
        return found

    @property
    def shares(self) -> tuple[str, str]:
        """Problems solved by the best solver, with its name where no other is as good, and by the median solver."""
        counts = self.solved_by
        if not counts:
            return "no solver started", "·"
        most = max(counts.values())
        leaders = [solver for solver, count in counts.items() if count == most]
        named = f"`{leaders[0]}`" if len(leaders) == 1 else f"{len(leaders)} solvers"
        return f"{percent(most, self.problems)}, {named}", percent(statistics.median(counts.values()), self.problems)


NOT_STARTED = ("unsupported", "unavailable", "not_run")
"""Statuses of pairs that no solver was started on."""


def percent(part: float, whole: int) -> str:
    """Return a share as a whole percentage with its numbers."""
    return f"{100 * part / whole:.0f} % ({part:g} of {whole})"


def page() -> str:
    """Return the page: the answer, shares by formulation, rankings beside each other, families, how to repeat it."""
    pairs, ranking, runs = (_read(name) for name in ("pairs", "ranking", "runs"))
    both = _of_both(pairs)
    pairs, ranking = ([row for row in rows if (row["node"], row["solver"]) in both] for rows in (pairs, ranking))
    by_node = {tier: _grouped(pairs, tier, "node") for tier in (SMALL, STANDARD)}
    families = _grouped(pairs, STANDARD, "node", "family")
    return "\n\n".join(
        [
            "# How hard the collection is",
            _answer(by_node, ranking),
            _conditions(runs),
            "Compared are the solvers that were started on a formulation in both tiers.",
            "## Share of the problems solved",
            "Best: the solver with most problems solved. Median: of the solvers that were started on any problem of "
            "the formulation. Both are shares of all problems that were run, those that a solver cannot take included, "
            "and without those that were proved to have no solution. A point that is stationary only is not solved. "
            f"Slow: problems on which the fastest solver takes {SLOW:g} s or more. None: problems that no solver "
            "solves within the time limit.",
            table(SHARE_HEAD, _shares(by_node)),
            "## The ranking on each tier",
            f"The first {SHOWN} solvers in the order of the reports, with problems solved of those started on: by "
            "problems solved where that differs significantly, else by time.",
            table(("formulation", "small", "standard", "what changes"), _rankings(ranking)),
            "## Families of the standard tier",
            table(FAMILY_HEAD, _families(families)),
            "## How to repeat it",
            "`python benchmarks/difficulty.py --help` has the commands; `python docs/generate/difficulty_page.py` "
            "writes this page from the tables beside it.",
        ]
    )


SHARE_HEAD = ("formulation", "small: best", "median", "standard: best", "median", "slow", "none")
FAMILY_HEAD = ("formulation", "family", "best", "median", "slow", "none")


def _read(name: str) -> Rows:
    with (FOLDER / f"{name}.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _of_both(pairs: Rows) -> set[tuple[str, str]]:
    """Return formulations with the solvers that were started on them in both tiers."""
    started = (
        {(row["node"], row["solver"]) for row in pairs if row["tier"] == tier and row["status"] not in NOT_STARTED}
        for tier in (SMALL, STANDARD)
    )
    return set.intersection(*started)


def _grouped(pairs: Rows, tier: str, *keys: str) -> dict[tuple[str, ...], Group]:
    found: dict[tuple[str, ...], list[Mapping[str, str]]] = {}
    for pair in pairs:
        if pair["tier"] == tier:
            found.setdefault(tuple(pair[key] for key in keys), []).append(pair)
    return {key: Group(found[key]) for key in sorted(found)}


def _hardness(group: Group) -> tuple[str, str]:
    """Return how many problems are slow, and how many no solver solves."""
    fastest = group.fastest
    return str(sum(seconds >= SLOW for seconds in fastest.values())), str(group.problems - len(fastest))


def _shares(by_node: Mapping[str, Mapping[tuple[str, ...], Group]]) -> Iterator[tuple[str, ...]]:
    for key, group in by_node[STANDARD].items():
        small = by_node[SMALL].get(key)
        before = small.shares if small else ("·", "·")
        yield key[0], *before, *group.shares, *_hardness(group)


def _families(families: Mapping[tuple[str, ...], Group]) -> Iterator[tuple[str, ...]]:
    for (node, family), group in families.items():
        yield node, family, *group.shares, *_hardness(group)


def _order(ranking: Rows, tier: str, node: str) -> list[Mapping[str, str]]:
    found = [row for row in ranking if (row["tier"], row["node"]) == (tier, node)]
    ordered = sorted(found, key=lambda row: int(row["place"]))
    return [{**row, "place": str(place)} for place, row in enumerate(ordered, 1)]


def _rankings(ranking: Rows) -> Iterator[tuple[str, ...]]:
    for node in sorted({row["node"] for row in ranking if row["tier"] == STANDARD}):
        small, standard = (_order(ranking, tier, node) for tier in (SMALL, STANDARD))
        yield node, _listed(small), _listed(standard), change(small, standard)


def _listed(rows: Rows) -> str:
    named = [f"`{row['solver']}` {row['solved']}/{row['started']}" for row in rows[:SHOWN]]
    more = f", and {len(rows) - SHOWN} more" if len(rows) > SHOWN else ""
    return ", ".join(named) + more


def change(small: Rows, standard: Rows) -> str:
    """Say which solver leads on each tier, and which one falls farthest of those that both have."""
    if not small or not standard:
        return "ranked on one tier only"
    first, now = small[0]["solver"], standard[0]["solver"]
    said = [f"`{first}` stays first" if first == now else f"`{now}` leads instead of `{first}`"]
    places = {row["solver"]: int(row["place"]) for row in standard}
    falls = [
        (places[row["solver"]] - int(row["place"]), row["solver"], row["place"])
        for row in small
        if row["solver"] in places
    ]
    fall, solver, before = max(falls, default=(0, "", ""))
    if fall > 1:
        said.append(f"`{solver}` falls from place {before} to {places[solver]}")
    return "; ".join(said)


def _answer(by_node: Mapping[str, Mapping[tuple[str, ...], Group]], ranking: Rows) -> str:
    """Say what share the best and the median solvers solve of each tier, and how many winners change."""
    said = []
    for tier in (SMALL, STANDARD):
        groups = [group for group in by_node[tier].values() if group.solved_by]
        total = sum(group.problems for group in groups)
        best = 100 * sum(max(group.solved_by.values()) for group in groups) / total
        median = 100 * sum(statistics.median(group.solved_by.values()) for group in groups) / total
        said.append(
            f"Of the {tier} tier the best solver of each formulation solves {best:.0f} %, the median {median:.0f} %."
        )
    nodes = sorted({row["node"] for row in ranking if row["tier"] == STANDARD})
    orders = [(_order(ranking, SMALL, node), _order(ranking, STANDARD, node)) for node in nodes]
    both = [(small, standard) for small, standard in orders if small and standard]
    changed = sum(small[0]["solver"] != standard[0]["solver"] for small, standard in both)
    return f"{' '.join(said)} On {changed} of {len(both)} formulations another solver is first on the standard tier."


def _conditions(runs: Rows) -> str:
    lines = [
        f"- {run['tier']}: {run['pairs']} pairs on {_extent(run)} in {float(run['hours']):.2f} h, "
        f"{float(run['timeout']):g} s for each solve, tolerance {float(run['tolerance']):g}; the largest solve took "
        f"{run['peak_gb']} GB ({run['processor']}, cpbench {run['version']})"
        for run in runs
    ]
    return "\n".join([*lines, f"- {runs[0]['collection']}"])


def _extent(run: Mapping[str, str]) -> str:
    """Say how many problems of a tier were run, of those of its formulations, and of how many unknowns."""
    part = "all" if run["problems"] == run["of"] else f"{run['problems']} of"
    return f"{part} {run['of']} problems of the formulations below, of at most {run['largest']} unknowns,"


if __name__ == "__main__":
    (FOLDER / "difficulty.md").write_text(page() + "\n", encoding="utf-8")
    print(FOLDER / "difficulty.md")
