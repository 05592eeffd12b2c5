"""The pages of what is registered: formulations, conversions, solvers and formats, and the definitions of a report."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from page_parts import table, verbatim

from cpbench.conversions.base import Conversion, mathematics
from cpbench.formulations import Problem, formulations
from cpbench.formulations.exchange import exchanges
from cpbench.graph import edges, promise
from cpbench.report.documents import METHODS
from cpbench.solvers.base import SolverSpec, Trait, solvers
from cpbench.storage import formats

RATIOS = Path(__file__).with_name("method_ratios.toml")
NEAR = 3
"""Times the fastest method that still counts as near."""


def formulations_page() -> str:
    """Return the page of the formulations: each with its law, data and unknowns."""
    head = ["node", "problem", "in the lecture"]
    rows = ([f"[{c.node}](#{c.node})", c.title, c.equation] for c in formulations)
    return "\n\n".join(
        [
            "# Formulations",
            "A formulation is a class of `cpbench`; its *node* is its short name in files and options.",
            table(head, rows),
            *(_formulation(cls) for cls in formulations),
        ]
    )


def conversions_page() -> str:
    """Return the page of the conversions: the map, a table, and the mathematics of each as its docstring has it."""
    head = ["conversion", "from", "to", "promise", "in the lecture", "what it does"]
    rows = (
        [f"[`{e.name}`](#{e.name})", e.source, e.target, promise(e), e.equation, _first_sentence(e)] for e in edges()
    )
    return "\n\n".join(
        [
            "# Conversions",
            "*Equivalent* and *one-way* conversions are exact: every answer of the target is one of the source. "
            "The others promise less, and are taken only when they are asked for.",
            "![Formulations and conversions](conversions.svg)",
            "Blue: exact for every problem, or for some. Dashed: approximations and relaxations only.",
            table(head, rows),
            *(_conversion(edge) for edge in edges()),
        ]
    )


def solvers_page() -> str:
    """Return the page of the solvers, a table a formulation."""
    of_node: dict[str, list[SolverSpec]] = defaultdict(list)
    for solver in solvers:
        of_node[solver.spec.node].append(solver.spec)
    head = ["solver", "method", "traits", "licence", "needs"]
    parts = [
        "# Solvers",
        f"{len(solvers)} solvers. One with a * runs only when it is named (`-s NAME`, `-s all`). "
        "`cpbench list solvers NAME` shows its options, `cpbench doctor` how to get what it needs.",
    ]
    for cls in formulations:
        if cls.node in of_node:
            parts += [f"## {cls.node}", table(head, map(_solver, of_node[cls.node]))]
    return "\n\n".join([*parts, _beside_the_fastest()])


def _beside_the_fastest() -> str:
    """Return the section on methods of cpbench that are never near the fastest one."""
    measured = tomllib.loads(RATIOS.read_text("utf-8"))
    date = measured.pop("date")
    rows = [
        [f"`{name}`", node, solvers.get(name).spec.method, f"{ratio:.2g}", _yes(solvers.get(name).spec.by_default)]
        for node, ratios in measured.items()
        for name, ratio in ratios.items()
        if ratio > NEAR
    ]
    return "\n\n".join(
        [
            "## Methods that are never among the fastest",
            f"On no built-in problem do these methods of cpbench come within {NEAR} times the fastest one of their "
            f"formulation (processor time, tolerance 1e-6, {date}). Those that do not on larger problems either run "
            "only when they are named. They are there to be read and compared.",
            table(["method", "node", "kind", "least ratio to the fastest", "runs by default"], rows),
        ]
    )


def formats_page() -> str:
    """Return the page of the file formats, and of the exchanges with programs."""
    return "\n\n".join(
        [
            "# File formats",
            "Nothing in a file is executed. What a format holds of a problem is on [File schemas](schemas.md).",
            table(
                ["format", "files", "content", "writes"],
                ([f"`{f.name}`", ", ".join(f.suffixes), f.summary, ", ".join(sorted(f.writes))] for f in formats),
            ),
            "## Exchanges with programs",
            "How a declared solver gets a problem and hands back its answer: the key `exchange` of its table.",
            table(["exchange", "content"], ([f"`{e.name}`", e.summary] for e in exchanges)),
        ]
    )


def statistics_page() -> str:
    """Return the definitions that end every report."""
    return f"# Statistics\n\nThese definitions end every report.\n\n{METHODS}"


def _formulation(cls: type[Problem]) -> str:
    data = [
        [f"`{f.name}`", " × ".join(f.metadata["shape"]), "" if f.default is dataclasses.MISSING else "optional"]
        for f in dataclasses.fields(cls)
        if "shape" in f.metadata
    ] + [[f"`{f.name}`", "map", ""] for f in dataclasses.fields(cls) if "map" in f.metadata]
    point = ", ".join(f"`{f.name}`" for f in dataclasses.fields(cls.point_type) if f.init)
    return "\n\n".join(
        [
            f"## {cls.node}",
            f"`cpbench.{cls.__name__}`: {cls.title}. An answer (`{cls.point_type.__name__}`) has {point}.",
            verbatim("\n".join(cls.relations)) if cls.relations else "",
            table(["data", "shape", ""], data),
        ]
    )


def _conversion(edge: Conversion) -> str:
    return f"## {edge.name}\n\n{verbatim(chr(10).join(mathematics(type(edge))))}"


def _solver(spec: SolverSpec) -> list[str]:
    traits = [str(t) for t in (Trait.SPARSE, Trait.WARM_START, Trait.LAUNCHES) if t in spec.traits]
    name = f"`{spec.name}`" + ("" if spec.by_default else " *")
    return [name, spec.summary, ", ".join(traits), spec.licence, ", ".join(_words(spec))]


def _words(spec: SolverSpec) -> Iterator[str]:
    yield from (f"`{package}`" for package in spec.requires)


def _first_sentence(edge: Conversion) -> str:
    first = (type(edge).__doc__ or "").strip().splitlines()[0]
    return re.split(r"\.\s|\.$", first)[0]


def _yes(value: bool) -> str:
    return "yes" if value else "no"
