"""Markdown tables of what is registered: the README's, and whoever else wants them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from cpbench.conversions import Conversion
from cpbench.formulations import formulations
from cpbench.graph import best_kind, edges
from cpbench.solvers.base import Trait, solvers
from cpbench.storage import formats

BEGIN, END = "<!-- tables from the registries: begin -->", "<!-- tables from the registries: end -->"


def registry_tables() -> str:
    """Formulations, conversions, solvers and formats, each a heading and a table."""
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
    return "\n\n".join(f"### {title}\n\n{_table(head, rows)}" for title, head, rows in parts)


def replace_between_marks(text: str, tables: str) -> str:
    """`text` with what stands between the two marks replaced."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{tables}\n\n{END}{after}"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(c.replace("|", "\\|") for c in row) + " |" for row in rows)])


def promise(edge: Conversion) -> str:
    """`equivalent or necessary` where the promise depends on the problem, else the one word."""
    kind, best = edge.kind, best_kind(edge)
    return str(kind) if kind == best else f"{best} or {kind}"


def _summary(edge: Conversion) -> str:
    return (type(edge).__doc__ or "").strip().splitlines()[0].partition(". ")[0].rstrip(".")


def _marks(traits: frozenset[Trait]) -> str:
    return ", ".join(t for t in (Trait.SPARSE, Trait.WARM_START) if t in traits)
