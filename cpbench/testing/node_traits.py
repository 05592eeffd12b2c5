"""What a formulation has and what it lacks: attributes of its class, and its entries in the tables of packages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from cpbench.formulations.base import Problem, formulations
from cpbench.foundation.extensions import HOOKS, added, hook
from cpbench.foundation.text import counted, some_of
from cpbench.registry import NodeTable

STATES = PRESENT, DERIVED, MISSING = "present", "derived", "missing"
"""States of a trait: given; made of others; absent."""

SHOWN = 6
"""Names of solvers, conversions or formats that are listed; the others are counted."""


@dataclass(frozen=True)
class NodeTrait:
    """One thing that cpbench may know of a formulation.

    Attributes
    ----------
    name : of the trait. state : present, derived or missing. detail : what there is, or what does not work without it.
    """

    name: str
    state: str
    detail: str


def node_traits(node: str) -> list[NodeTrait]:
    """Return every trait of a formulation; raises UnknownName."""
    kind = formulations.get(node)
    return [*_of_class(kind), *_of_registries(node), *_of_tables(node, tables()), *_of_testing(node)]


def trait_table(node: str) -> tuple[str, list[tuple[str, str, str]]]:
    """Return a line about a formulation, and its traits as rows, with their heads; raises UnknownName."""
    traits = node_traits(node)
    lacking = sum(trait.state == MISSING for trait in traits)
    rows = [(one.name, one.state, one.detail) for state in STATES for one in traits if one.state == state]
    line = f"{node}: {formulations.get(node).title}; {lacking} of {counted(len(traits), 'trait')} missing"
    return line, [("trait", "state", "what there is, or what does not work without it"), *rows]


def tables() -> tuple[NodeTable[Any], ...]:
    """Return the tables of cpbench, and those of installed packages (``cpbench.hooks``: `node_tables`)."""
    from cpbench.storage import formats
    from cpbench.verification.rows import ROWS, STACKED
    from cpbench.verification.systems import BOUNDS

    others: tuple[NodeTable[Any], ...] = hook("node_tables")() if "node_tables" in added(HOOKS) else ()
    written = {one.table.trait: one.table for one in formats if one.table is not None}
    return (ROWS, STACKED, BOUNDS, *written.values(), *others)


def _of_class(kind: type[Problem]) -> Iterator[NodeTrait]:
    """Yield what the class declares, and what its base would do instead."""
    for name, without in (
        ("title", "tables name it by its node alone"),
        ("equation", "tables have no reference"),
        ("relations", "info and show have no formulas"),
    ):
        given = getattr(kind, name, "")
        text = given if isinstance(given, str) else "; ".join(given)
        yield NodeTrait(name, PRESENT if given else MISSING, text or without)
    shapes = kind.shapes()
    yield NodeTrait("data", PRESENT if shapes else MISSING, ", ".join(shapes) or "it has no fields, and no file")
    yield NodeTrait("file", DERIVED if shapes else MISSING, "native format (.h5), from the declared data")
    for name, what, without in (
        ("check", "conditions beyond shapes", "shapes and finite numbers are all that is checked"),
        ("slacks", "values that follow from a point", "info and answers show the unknowns alone"),
        ("certifies_infeasibility", "a proof that there is no solution", "no certificate of a solver is accepted"),
    ):
        own = getattr(kind, name) is not getattr(Problem, name)
        yield NodeTrait(name, PRESENT if own else MISSING, what if own else without)
    terms = [f"{vector}: {'+' if sign > 0 else '-'} {name} {part}" for vector, sign, name, part in kind.terms]
    without = "explain shifts no matrix of it; reduce holds what it leaves out at 0"
    yield NodeTrait("terms", PRESENT if terms else MISSING, ", ".join(terms) or without)
    many = f"{kind.primal}, beside multipliers" if kind.primal else "none: all of an answer is compared"
    yield NodeTrait("primal", PRESENT if kind.primal else DERIVED, many)


def _of_registries(node: str) -> Iterator[NodeTrait]:
    """Yield how many solvers, conversions, formats and problems it has."""
    from cpbench.generators import generators
    from cpbench.graph import edges
    from cpbench.solvers.base import solvers
    from cpbench.storage import formats

    entries = {
        "generator": (
            [one.name for one in generators if one.node == node],
            "no problem with a known solution: the conformance checks fail",
        ),
        "conversions from it": (
            sorted({edge.target for edge in edges() if edge.source == node} - {node}),
            "only solvers of this formulation can solve it",
        ),
        "conversions to it": (
            sorted({edge.source for edge in edges() if edge.target == node} - {node}),
            "its solvers run on its own problems alone",
        ),
        "solvers": ([s.spec.name for s in solvers if s.spec.node == node], "it is solved by conversion, or not at all"),
        "other formats": (
            [f.name for f in formats if node in f.writes and f.name != "native"],
            "it is written as .h5 alone; other formats refuse it by name",
        ),
    }
    for name, (items, without) in entries.items():
        yield NodeTrait(name, PRESENT if items else MISSING, some_of(items, SHOWN) or without)


def _of_tables(node: str, known: Sequence[NodeTable[Any]]) -> Iterator[NodeTrait]:
    """Yield its entries in the tables of packages."""
    for table in known:
        entry = table.get(node)
        what = getattr(entry, "__module__", "") if callable(entry) else str(getattr(entry, "value", "yes"))
        yield NodeTrait(table.trait, PRESENT if node in table else MISSING, what if node in table else table.without)


def _of_testing(node: str) -> Iterator[NodeTrait]:
    """Yield what the conformance checks have of it."""
    from cpbench.testing.cases import is_shipped
    from cpbench.testing.equivalents import CHANGES, SYMBOLS

    given = is_shipped(node)
    what = "a file of cases" if given else "the problems of its generators"
    yield NodeTrait("planted cases", PRESENT if given else DERIVED, what)
    yield from _of_tables(node, (SYMBOLS, CHANGES))
