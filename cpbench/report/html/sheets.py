"""Sheet of the problems of a run: where they are from, and their licences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from cpbench.report.html.markup import Markup, element, table
from cpbench.report.run import ProblemOrigin, Run


def problems(run: Run) -> Iterator[Markup]:
    """Yield families of problems with their source and licence, as far as their files give them; nothing where none
    does.
    """
    if any(any(origin) for origin in run.origins.values()):
        yield element("p", "What the files of the problems say; the sheet of each pair says it of its problem.")
        first = run.rows.drop_duplicates("fingerprint")
        known = {family: run.origins.get(str(family), ProblemOrigin("", "")) for family in first["family"]}
        counts = Counter(zip(first["node"], first["family"], strict=True))
        lines = (
            [family or "(none)", node, count, known[family].source or "not given", known[family].licence or "not given"]
            for (node, family), count in sorted(counts.items())
        )
        yield table("Problems", ["family", "formulation", "problems", "source", "licence"], lines, right=[2])
