"""Markdown tables of what is registered: the README's, and whoever else wants them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from cpbench.conversions import Conversion
from cpbench.formulations import formulations
from cpbench.graph import ALL, edges
from cpbench.report.graph_drawing import draw, promise
from cpbench.solvers.base import SolverSpec, Trait, solvers
from cpbench.storage import formats

BEGIN, END = "<!-- tables from the registries: begin -->", "<!-- tables from the registries: end -->"


def registry_tables() -> str:
    """Write formulations, conversions, solvers and formats, each a heading and a table, and the graph of the first
    two.

    Solvers that run only when they are named are counted by family.
    """
    usual = [s.spec for s in solvers if s.spec.by_default]
    named = [s.spec for s in solvers if not s.spec.by_default]
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
            ([f"`{s.name}`", s.node, s.summary, _marks(s.traits), s.licence] for s in usual),
        ),
        (
            "File formats",
            ["format", "files", "content"],
            ([f"`{f.name}`", ", ".join(f.suffixes), f.summary] for f in formats),
        ),
    ]
    tables = [f"### {title}\n\n{_table(head, rows)}" for title, head, rows in parts]
    if named:
        tables[2] += f"\n\nAnd {len(named)} that run only when they are named: {_families(named)}."
    drawing = f"```mermaid\n{draw('mermaid', ALL)}\n```"
    return "\n\n".join([tables[0], drawing, *tables[1:]])


def replace_between_marks(text: str, tables: str) -> str:
    """Replace the text between the two marks."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{tables}\n\n{END}{after}"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(c.replace("|", "\\|") for c in row) + " |" for row in rows)])


def _summary(edge: Conversion) -> str:
    return (type(edge).__doc__ or "").strip().splitlines()[0].partition(". ")[0].rstrip(".")


def _families(specs: Iterable[SolverSpec]) -> str:
    """Count each family, which is the name up to the first hyphen."""
    found: dict[str, list[str]] = {}
    for spec in specs:
        found.setdefault(spec.name.partition("-")[0], []).append(spec.name)
    return ", ".join(f"{len(n)} `{family}-*`" if len(n) > 1 else f"`{n[0]}`" for family, n in found.items())


def _marks(traits: frozenset[Trait]) -> str:
    return ", ".join(t for t in (Trait.SPARSE, Trait.WARM_START) if t in traits)
