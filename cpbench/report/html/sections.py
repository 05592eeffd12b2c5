"""The sections of the page: headings, places for figures, and what does not depend on any filter."""

from __future__ import annotations

from collections.abc import Iterator

from cpbench.analysis import participation
from cpbench.report.claims_section import claims_section
from cpbench.report.conditions import conditions
from cpbench.report.html.markup import Markup, element, prose
from cpbench.report.html.overview import overview
from cpbench.report.html.sheets import problems
from cpbench.report.methods import METHODS
from cpbench.report.participation_sections import absent
from cpbench.report.run import Run
from cpbench.report.run_sections import failed_pairs, false_claims, losses, not_started, refused, solver_sheets
from cpbench.report.text import plain

INTRODUCTIONS = {
    "budget": "What a solver solves within a given budget, whatever others do.",
    "pairs": "Two solvers at a time: their order does not depend on a third.",
    "matrix": "What came of every pair that was planned.",
    "errors": "How good the iterates were on the way to the answer.",
    "size": "How cost grows with the problems.",
    "sequences": "Recorded trajectories step by step, and what a start from the step before gains.",
}
LISTED = 60
"""The most lines of the list of false claims; reasons of failures are twice as many."""
FIGURES = {
    "budget": (("budget", "Data profile"),),
    "pairs": (("pairwise", "Who is ahead of whom"), ("scatter", "Two solvers, problem by problem")),
    "matrix": (("matrix", "Problems by solvers"),),
    "errors": (("precision", "Over the problems"), ("convergence", "On one problem")),
    "size": (("scaling", "Cost against size"),),
    "sequences": (("sequence", "Step by step"), ("warm", "Warm over cold")),
}
TITLES = {
    "budget": "Within a budget",
    "pairs": "Two by two",
    "matrix": "Problems by solvers",
    "errors": "Error against time",
    "size": "Cost against size",
    "sequences": "Sequences",
    "problems": "Problems, their source and licence",
    "methods": "Methods",
}
LINKS = {
    "overview": "Answer", "budget": "Budget", "pairs": "Pairs", "matrix": "Matrix",
    "errors": "Errors", "size": "Size", "sequences": "Sequences",
    "claims": "False claims", "failures": "Failures", "solvers": "Solvers", "problems": "Problems",
    "machine": "Machine", "methods": "Methods",
}  # fmt: skip


def sections(run: Run, title: str) -> tuple[Markup, Markup]:
    """Return all sections, and the links to them."""
    there = dict(_present(run))
    elements: list[Markup] = []
    for name, inside in there.items():
        heading = [element("h1", title)] if name == "overview" else []
        heading = [element("h2", TITLES[name])] if name in TITLES else heading
        elements.append(element("section", *heading, *inside, id=name))
    links = [element("li", element("a", LINKS[name], href=f"#{name}")) for name in there]
    return Markup("\n".join(elements)), Markup("".join(links))


def _present(run: Run) -> Iterator[tuple[str, list[Markup]]]:
    """Yield the sections that are not empty: figures, and those of report.md and its details."""
    yield "overview", list(overview(run))
    without = set() if len(run.histories) else {"errors"}
    without |= set() if (run.rows["sequence"] != "").any() or run.rows["start"].nunique() > 1 else {"sequences"}
    for name in FIGURES if len(run.rows) else ():
        if name not in without:
            yield name, list(_figures(name))
    written = {
        "claims": _claims(run),
        "failures": _failures(run),
        "solvers": _solvers(run),
    }
    for name, blocks in written.items():
        text = "\n\n".join(blocks)
        if text:
            failed = list(_failed()) if name == "failures" and run.failures else []
            yield name, [prose(text), *failed]
    if inside := list(problems(run)):
        yield "problems", inside
    yield "machine", [prose("\n\n".join([*conditions(run), *refused(run)]))]
    yield "methods", [element("div", prose(METHODS), class_="columns")]


def _claims(run: Run) -> Iterator[str]:
    yield from claims_section(run)
    yield from false_claims(run, LISTED)


def _failures(run: Run) -> Iterator[str]:
    yield from failed_pairs(run, 2 * LISTED)
    yield from not_started(run, 2 * LISTED)
    yield from losses(run)
    left_out = participation.left_out_lines(run.meta.get("left_out") or [])
    if left_out:
        yield "## Could not be run"
        yield "\n".join(f"- {plain(line)}" for line in left_out)
    yield from absent(run)


def _failed() -> Iterator[Markup]:
    yield element("h3", "Failed here, solved there: ", element("span", data_group_name=""))
    yield element("div", data_figure="failed")


def _solvers(run: Run) -> Iterator[str]:
    yield from solver_sheets(run)


def _figures(name: str) -> Iterator[Markup]:
    yield element("p", INTRODUCTIONS[name], " Shown: ", element("span", data_group_name=""), ".", class_="scope")
    for figure, title in FIGURES[name]:
        if len(FIGURES[name]) > 1:
            yield element("h3", title)
        yield element("div", data_figure=figure)
