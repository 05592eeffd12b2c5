"""Tables of solvers, and everything known of one of them, as text."""

from __future__ import annotations

import dataclasses
import inspect
import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from cpbench.bench.availability import SolverState
from cpbench.cli.terminal import table
from cpbench.solvers.base import Solver, SolverSpec, solvers
from cpbench.solvers.options import choices, written

HEAD = ("solver", "node", "method", "version", "licence")
WIDTH = 110
LICENCE = 24
"""Characters of a licence that a table shows; the sheet of the solver has all."""
GLANCED = {
    "installed": "its packages are there and were not imported; --check imports them, as cpbench doctor does",
    "untried": "not checked: external program (use --check, or cpbench doctor)",
}
"""The meaning of a state that was read without importing anything."""


def cells(spec: SolverSpec, seen: SolverState) -> tuple[str, ...]:
    """Return name, node, kind of method, version and licence; * marks figures whose publishing is restricted."""
    licence = spec.licence if len(spec.licence) <= LICENCE else f"{spec.licence[: LICENCE - 1]}…"
    return spec.name, spec.node, spec.method, seen.version or "-", licence + ("*" if spec.publishing else "")


def family(spec: SolverSpec) -> str:
    """Return what solvers of one origin have in common: the name up to its first hyphen.

    >>> family(SolverSpec(name="siconos-lcp-lemke", node="lcp", summary="", method=""))
    'siconos'
    """
    return spec.name.partition("-")[0]


def families(specs: Iterable[SolverSpec]) -> str:
    """Return how many solvers there are of each family.

    >>> families(SolverSpec(name=name, node="lcp", summary="", method="") for name in ("a-x", "a-y", "b"))
    '2 a-*, b'
    """
    specs = list(specs)
    counts = Counter(family(spec) for spec in specs)
    single = {family(spec): spec.name for spec in specs}
    return ", ".join(f"{n} {name}-*" if n > 1 else single[name] for name, n in sorted(counts.items()))


def folded_names(names: Sequence[str], width: int = WIDTH) -> list[str]:
    """Return names with the nodes they solve, on indented lines of at most `width` characters."""
    text = ", ".join(f"{name} ({solvers.get(name).spec.node})" for name in names)
    return textwrap.wrap(text, width, initial_indent="      ", subsequent_indent="      ", break_on_hyphens=False)


def sheet(solver: Solver, seen: SolverState, width: int = WIDTH) -> Iterator[str]:
    """Yield everything known of one solver, in lines of at most `width` characters."""
    spec = solver.spec
    yield f"{spec.name} {seen.version}".rstrip()
    facts = {
        "solves": f"{spec.node}{'' if spec.kind.exact else f' ({spec.kind}: its answers may not be answers)'}",
        "method": f"{spec.method}: {spec.summary}",
        "can": ", ".join(sorted(spec.traits)),
        "source": spec.citation,
        "licence": spec.licence,
        "publishing": spec.publishing,
        "availability": _indented(seen.detail.strip() or GLANCED.get(seen.state, ""), seen.state),
        "in a run": "by default" if spec.by_default else f"when named: --solver {spec.name}, or --solver all",
    }
    for title, value in facts.items():
        if value:
            yield from _folded(f"  {title:<13}", value, width)
    yield from _options(spec, width)
    if spec.known_failures:
        yield "  known failures"
        for check, reason in sorted(spec.known_failures.items()):
            yield from _folded(f"    {check}: ", reason, width)


def as_data(solver: Solver, seen: SolverState) -> dict[str, Any]:
    """Return everything known of one solver as data for programs."""
    spec = solver.spec
    return {
        "name": spec.name,
        "node": spec.node,
        "method": spec.method,
        "kind": str(spec.kind),
        "summary": spec.summary,
        "citation": spec.citation,
        "version": seen.version,
        "licence": spec.licence,
        "publishing": spec.publishing,
        "by_default": spec.by_default,
        "traits": sorted(spec.traits),
        "requires": list(spec.requires),
        "install": spec.install,
        "availability": {"state": seen.state, "detail": seen.detail},
        "options": [
            {
                "name": f.name,
                "type": type(f.default).__name__,
                "default": f.default,
                "choices": list(choices(spec.options, f.name)),
            }
            for f in dataclasses.fields(spec.options)
        ],
        "known_failures": dict(spec.known_failures),
    }


def _options(spec: SolverSpec, width: int) -> Iterator[str]:
    fields = dataclasses.fields(spec.options)
    if not fields:
        yield "  options       none"
        return
    yield f"  options       as in --solver '{spec.name}[{fields[0].name}={written(fields[0].default)}]'"
    head = ("    option", "type", "default", "choices")
    rows = [
        (f"    {f.name}", type(f.default).__name__, written(f.default), " | ".join(map(written, among)) or "any")
        for f, among in ((f, choices(spec.options, f.name)) for f in fields)
    ]
    yield from table([head, *rows])
    text = inspect.getdoc(spec.options) or ""
    if not text.startswith(f"{spec.options.__name__}("):  # what a dataclass without a docstring says
        yield from textwrap.wrap(text, width, initial_indent="    ", subsequent_indent="    ")


def _indented(text: str, state: str) -> str:
    lines = text.splitlines()
    if len(lines) < 2:
        return f"{state}: {text}" if text else state
    return "\n".join([state, *(f"    {line}" for line in lines)])


def _folded(title: str, text: str, width: int) -> Iterator[str]:
    if "\n" in text:
        yield f"{title} {text}"
    else:
        rest = " " * min(len(title) + 1, 16)
        yield from textwrap.wrap(f"{title} {text}", width, subsequent_indent=rest, break_long_words=False)
