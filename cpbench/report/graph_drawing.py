"""The graph of formulations and conversions, with the solvers on each node, as text, Mermaid or DOT."""

from __future__ import annotations

import re
from collections.abc import Iterable

from cpbench.conversions import Conversion
from cpbench.formulations import Kind, formulations
from cpbench.graph import best_kind, edges
from cpbench.solvers.base import solvers

FORMATS = ("text", "mermaid", "dot")
WRAP = 3
"""Solvers a line in the box of a node."""


def draw(form: str, kinds: frozenset[Kind]) -> str:
    """Draw the nodes, and the edges that may be of one of `kinds`, in one of FORMATS."""
    shown = [edge for edge in edges() if best_kind(edge) in kinds]
    return {"text": _text, "mermaid": _mermaid, "dot": _dot}[form](shown)


def solvers_of(node: str, *, usual: bool = False) -> list[str]:
    """Return the names of the registered solvers of a node, with `usual` of those that run by default; one that drops a
    term of the law is marked.
    """
    specs = [solver.spec for solver in solvers if solver.spec.node == node and (solver.spec.by_default or not usual)]
    return [spec.name if spec.kind.exact else f"{spec.name} ({spec.kind})" for spec in specs]


def promise(edge: Conversion) -> str:
    """Return `equivalent, one-way or necessary` where the promise depends on the problem, else the one word."""
    kind, best = edge.kind, best_kind(edge)
    return str(kind) if kind == best else f"{', '.join([best, *edge.between])} or {kind}"


def _text(shown: list[Conversion]) -> str:
    wide = max((len(edge.name) for edge in shown), default=0)
    across = max(len(name) for name in formulations.names())
    loops = sum(edge.source == edge.target for edge in shown)
    alone = f", {loops} of them from a node to itself (taken only with --via)" if loops else ""
    lines = [f"{len(formulations)} formulations, {len(shown)} conversions{alone}, {len(solvers)} solvers"]
    for cls in formulations:
        lines.append(f"{cls.node}: {cls.title} {cls.equation}".rstrip())
        lines.append(f"  solvers: {', '.join(solvers_of(cls.node)) or 'none'}")
        lines += [
            f"  -> {edge.target:<{across}}  {edge.name:<{wide}}  {promise(edge)}  {edge.equation}".rstrip()
            for edge in _by_target(shown, cls.node)
        ]
    return "\n".join(lines)


def _mermaid(shown: list[Conversion]) -> str:
    lines = ["flowchart LR"]
    lines += [f'  {_id(name)}["{"<br/>".join(_box(name))}"]' for name in formulations.names()]
    for edge in shown:
        arrow = "-->" if best_kind(edge).exact else "-.->"
        lines.append(f'  {_id(edge.source)} {arrow}|"{"<br/>".join(_words(edge))}"| {_id(edge.target)}')
    return "\n".join(lines)


def _dot(shown: list[Conversion]) -> str:
    lines = ["digraph cpbench {", "  rankdir=LR;", "  node [shape=box];"]
    lines += [f"  {_quoted(name)} [label={_quoted(*_box(name))}];" for name in formulations.names()]
    for edge in shown:
        style = "solid" if best_kind(edge).exact else "dashed"
        ends = f"{_quoted(edge.source)} -> {_quoted(edge.target)}"
        lines.append(f"  {ends} [label={_quoted(*_words(edge))}, style={style}];")
    return "\n".join([*lines, "}"])


def _by_target(shown: Iterable[Conversion], source: str) -> list[Conversion]:
    return sorted((edge for edge in shown if edge.source == source), key=lambda e: (e.target, e.name))


def _box(node: str) -> list[str]:
    """Return the lines of a node's box: its name, then its solvers; those that run only when they are named are
    counted.
    """
    names = solvers_of(node, usual=True)
    more = len(solvers_of(node)) - len(names)
    lines = [node, *(", ".join(names[k : k + WRAP]) for k in range(0, len(names), WRAP))]
    return [*lines, f"and {more} more"] if more else lines


def _words(edge: Conversion) -> list[str]:
    return [edge.name, f"{promise(edge)} {edge.equation}".rstrip()]


def _id(node: str) -> str:
    """Return a name that Mermaid takes for a node, which is none of its words, such as `end`."""
    return "node_" + re.sub(r"\W", "_", node)


def _quoted(*lines: str) -> str:
    escaped = (line.replace("\\", "\\\\").replace('"', '\\"') for line in lines)
    return '"' + "\\n".join(escaped) + '"'
