"""Sheet of the problems of a run: where they are from, and their licences."""

from __future__ import annotations

from collections.abc import Iterator

from cpbench.analysis import starts
from cpbench.report.html.markup import Markup, element, table
from cpbench.report.run import Run


def problems(run: Run) -> Iterator[Markup]:
    """Yield families of problems with their source and licence, as far as their files give them; nothing where none
    does.
    """
    thumbnails = run.thumbnails()
    first = run.rows.drop_duplicates("fingerprint")
    counts: dict[tuple[str, str, str, str], int] = {}
    for fingerprint, node, family in zip(first["fingerprint"], first["node"], first["family"], strict=True):
        thumbnail = thumbnails.get(starts.original(str(fingerprint)), {})
        source = "; ".join(filter(None, (thumbnail.get("source", ""), thumbnail.get("citation", ""))))
        key = (str(node), str(family) or "(none)", source, str(thumbnail.get("licence", "")))
        counts[key] = counts.get(key, 0) + 1
    if any(source or licence for _, _, source, licence in counts):
        yield element("p", "What the files of the problems say; the sheet of each pair says it of its problem.")
        lines = (
            [family, node, count, source or "not given", licence or "not given"]
            for (node, family, source, licence), count in sorted(counts.items())
        )
        yield table("Problems", ["family", "formulation", "problems", "source", "licence"], lines, right=[2])
