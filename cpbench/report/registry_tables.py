"""Markdown tables of what is registered: the README's, and whoever else wants them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from cpbench.conversions import Conversion
from cpbench.formulations import formulations
from cpbench.graph import ALL, edges
from cpbench.report.graph_drawing import draw, promise
from cpbench.solvers.base import Trait, solvers
from cpbench.storage import formats

BEGIN, END = "<!-- tables from the registries: begin -->", "<!-- tables from the registries: end -->"


def registry_tables() -> str:
    """Formulations, conversions, solvers and formats, each a heading and a table, and the graph of the first two."""
    parts = [
        ("Formulations", ["node", "problem", "lecture"], ([c.node, c.title, c.equation] for c in formulations)),
        (
            "Conversions",
            ["conversion", "from", "to", "promise", "lecture", "what it does"],
            ([f"`{e.name}`", e.source, e.target, promise(e), e.equation, _summary(e)] for e in edges()),
        ),
        (
            "Solvers",
            ["solver", "solves", "method", "", "licence"],
            ([f"`{s.spec.name}`", s.spec.node, s.spec.summary, _marks(s.spec.traits), s.spec.licence] for s in solvers),
        ),
        (
            "File formats",
            ["format", "files", "content"],
            ([f"`{f.name}`", ", ".join(f.suffixes), f.summary] for f in formats),
        ),
    ]
    tables = [f"### {title}\n\n{_table(head, rows)}" for title, head, rows in parts]
    drawing = f"```mermaid\n{draw('mermaid', ALL)}\n```"
    return "\n\n".join([tables[0], drawing, *tables[1:]])


def replace_between_marks(text: str, tables: str) -> str:
    """`text` with what stands between the two marks replaced."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{tables}\n\n{END}{after}"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(c.replace("|", "\\|") for c in row) + " |" for row in rows)])


def _summary(edge: Conversion) -> str:
    return (type(edge).__doc__ or "").strip().splitlines()[0].partition(". ")[0].rstrip(".")


def _marks(traits: frozenset[Trait]) -> str:
    return ", ".join(t for t in (Trait.SPARSE, Trait.WARM_START) if t in traits)
