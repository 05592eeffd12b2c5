"""The sections of the page: headings, places for figures, and what does not depend on any filter."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from cpbench.report.html.failing import false_claims, reasons
from cpbench.report.html.markup import Markup, element, prose
from cpbench.report.html.overview import overview
from cpbench.report.html.several_starts import several_starts
from cpbench.report.html.sheets import machine, problems, solvers
from cpbench.report.methods import METHODS
from cpbench.report.run import Run

INTRODUCTIONS = {
    "budget": "What a solver solves within a given budget, whatever others do.",
    "pairs": "Two solvers at a time: their order does not depend on a third.",
    "matrix": "What came of every pair that was planned.",
    "errors": "How good the iterates were on the way to the answer.",
    "size": "How cost grows with the problems.",
    "sequences": "Recorded trajectories step by step, and what a start from the step before gains.",
    "deadlines": "How often an answer would have come too late.",
}
FIGURES = {
    "budget": (("budget", "Data profile"),),
    "pairs": (("pairwise", "Who is ahead of whom"), ("scatter", "Two solvers, problem by problem")),
    "matrix": (("matrix", "Problems by solvers"),),
    "errors": (("precision", "Over the problems"), ("convergence", "On one problem")),
    "size": (("scaling", "Cost against size"),),
    "sequences": (("sequence", "Step by step"), ("warm", "Warm over cold")),
    "deadlines": (("deadlines", "Deadlines"),),
}
TITLES = {
    "overview": "Answer",
    "budget": "Within a budget",
    "pairs": "Two by two",
    "matrix": "Problems by solvers",
    "errors": "Error against time",
    "size": "Cost against size",
    "sequences": "Sequences",
    "deadlines": "Deadlines",
    "starts": "Several starts",
    "claims": "False claims",
    "failures": "Failures by reason",
    "solvers": "Solvers",
    "problems": "Problems, their source and licence",
    "machine": "Machine and versions",
    "methods": "Methods",
}
LINKS = {
    "overview": "Answer", "budget": "Budget", "pairs": "Pairs", "matrix": "Matrix",
    "errors": "Errors", "size": "Size", "sequences": "Sequences", "deadlines": "Deadlines", "starts": "Starts",
    "claims": "False claims", "failures": "Failures", "solvers": "Solvers", "problems": "Problems",
    "machine": "Machine", "methods": "Methods",
}  # fmt: skip


def sections(run: Run, title: str) -> tuple[Markup, Markup]:
    """Return all sections, and the links to them."""
    there = dict(_present(run))
    elements: list[Markup] = []
    for name, inside in there.items():
        heading = element("h1", title) if name == "overview" else element("h2", TITLES[name])
        elements.append(element("section", heading, *inside, id=name))
    links = [element("li", element("a", LINKS[name], href=f"#{name}")) for name in there]
    return Markup("\n".join(elements)), Markup("".join(links))


def _present(run: Run) -> Iterator[tuple[str, list[Markup]]]:
    """Yield the sections that are not empty."""
    yield "overview", list(overview(run))
    absent = set() if len(run.histories) else {"errors"}
    absent |= set() if (run.rows["sequence"] != "").any() or run.rows["start"].nunique() > 1 else {"sequences"}
    for name in FIGURES if len(run.rows) else ():
        if name not in absent:
            yield name, list(_figures(name))
    parts: Mapping[str, Callable[[Run], Iterator[Markup]]] = {
        "starts": several_starts,
        "claims": false_claims,
        "failures": reasons,
        "solvers": solvers,
        "problems": problems,
        "machine": machine,
    }
    for name, part in parts.items():
        inside = list(part(run))
        if inside:
            yield name, inside
    yield "methods", [element("div", prose(METHODS), class_="columns")]


def _figures(name: str) -> Iterator[Markup]:
    yield element("p", INTRODUCTIONS[name], " Shown: ", element("span", data_group_name=""), ".", class_="scope")
    for figure, title in FIGURES[name]:
        if len(FIGURES[name]) > 1:
            yield element("h3", title)
        yield element("div", data_figure=figure)
