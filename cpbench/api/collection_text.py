"""Counts of the problems in the collection of cpbench: rows of tables and lines for a reader."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from cpbench.generators.base import SMALL, TIERS
from cpbench.generators.collection import ListedProblem, identity

BAR = 50
"""Characters of the longest bar of the histogram."""
NOT_PROVED = "without a proof"


def first_line(entries: Sequence[ListedProblem]) -> str:
    """Return the identity of the collection, and how many problems each tier has."""
    counts = Counter(entry.tier for entry in entries)
    made = [f"{counts[tier]} {tier}" for tier in TIERS if tier != SMALL and counts[tier]]
    rest = f"; {' and '.join(made)}, which cpbench generate --tier writes" if made else ""
    return f"{identity(entries)}: {counts[SMALL]} {SMALL}, installed as files{rest}"


def formulation_rows(entries: Sequence[ListedProblem]) -> Iterator[tuple[str, ...]]:
    """Yield a head, a row for each formulation, and one of sums: problems by tier and size, families, proofs."""
    decades = _decades(entries)
    yield "formulation", "families", "problems", *TIERS, *map(from_size, decades), "proved"
    by_node: dict[str, list[ListedProblem]] = {}
    for entry in entries:
        by_node.setdefault(entry.node, []).append(entry)
    for node in sorted(by_node):
        yield _counts(node, by_node[node], decades)
    yield _counts("all", entries, decades)


def _counts(name: str, entries: Sequence[ListedProblem], decades: Iterable[int]) -> tuple[str, ...]:
    tiers, sizes = Counter(entry.tier for entry in entries), Counter(entry.decade for entry in entries)
    numbers = (len({(entry.node, entry.family) for entry in entries}), len(entries))
    proved = sum(bool(entry.proof) for entry in entries)
    parts = (*numbers, *(tiers[tier] for tier in TIERS), *(sizes[decade] for decade in decades), proved)
    return name, *(str(part) if part else "·" for part in parts)


def family_rows(entries: Sequence[ListedProblem]) -> Iterator[tuple[str, ...]]:
    """Yield a head and a row for each family: formulation, tier, problems, least and largest size, proofs, citation."""
    yield "family", "formulation", "tier", "problems", "unknowns", "proved", "citation"
    families: dict[tuple[str, str, str], list[ListedProblem]] = {}
    for entry in entries:
        families.setdefault((entry.node, entry.family, entry.tier), []).append(entry)
    for (node, family, tier), members in sorted(families.items()):
        sizes = [entry.unknowns for entry in members]
        least, most = min(sizes), max(sizes)
        span = str(least) if least == most else f"{least} to {most}"
        proved = sum(bool(entry.proof) for entry in members)
        yield family, node, tier, str(len(members)), span, str(proved) if proved else "·", members[0].citation


def size_rows(entries: Sequence[ListedProblem]) -> Iterator[tuple[str, ...]]:
    """Yield a head and a row for each decade of sizes, with a bar as long as its count; the longest has BAR signs."""
    yield "unknowns", *TIERS, "problems", ""
    sizes = Counter(entry.decade for entry in entries)
    for decade in range(max(sizes) + 1):
        tiers = Counter(entry.tier for entry in entries if entry.decade == decade)
        counts = [str(tiers[tier]) if tiers[tier] else "·" for tier in TIERS]
        bar = "#" * -(-BAR * sizes[decade] // max(sizes.values()))
        yield f"{10**decade} to {10 ** (decade + 1) - 1}", *counts, str(sizes[decade]), bar


def total_lines(entries: Sequence[ListedProblem]) -> Iterator[str]:
    """Yield counts by licence, by what is proved, and by how a solution is known."""
    for title, names in (
        ("licence", (entry.licence for entry in entries)),
        ("proof", (entry.proof or NOT_PROVED for entry in entries)),
        ("how a solution is known", (entry.known for entry in entries)),
    ):
        yield f"{title}: {'; '.join(f'{count} {name}' for name, count in Counter(names).most_common())}"


def _decades(entries: Iterable[ListedProblem]) -> list[int]:
    return sorted({entry.decade for entry in entries})


def from_size(decade: int) -> str:
    """Return the head of the column of problems that have from 10ᵏ unknowns on, and fewer than ten times as many.

    >>> from_size(0), from_size(2), from_size(4)
    ('1+', '100+', '1e4+')
    """
    return f"{10**decade}+" if decade < 3 else f"1e{decade}+"
