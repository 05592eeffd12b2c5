"""The sections of the page: headings, places for figures, and what does not depend on any filter."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from cpbench.analysis import attendance, failures, reliability, summary
from cpbench.analysis import table as rows_of
from cpbench.report.html.columns import KEPT, WHOLE
from cpbench.report.html.markup import Markup, code, element, prose, table, text
from cpbench.report.methods import METHODS
from cpbench.report.run import Run, each, group_name_text, tunings
from cpbench.report.run_sections import DRIFT
from cpbench.report.text import counted, cut, number, seconds, solve_command
from cpbench.verification import Status

LISTED = 60
"""The most lines of a list of pairs."""
INTRODUCTIONS = {
    "profile": "How far each solver is from the best of those shown. Choose problems, solvers, cost and tolerance in "
    "the column of filters: ratios are computed again for what is left.",
    "budget": "What a solver solves within a given budget, whoever else there is.",
    "pairs": "Two solvers at a time: their order does not depend on a third.",
    "matrix": "What came of every pair that was planned.",
    "errors": "How good the iterates were on the way to the answer.",
    "size": "How cost grows with the problems.",
    "sequences": "Recorded trajectories step by step, and what a start from the step before gains.",
    "deadlines": "How often an answer would have come too late.",
}
FIGURES = {
    "profile": (("profile", "Performance profile"),),
    "budget": (("budget", "Data profile"),),
    "pairs": (("pairwise", "Who is ahead of whom"), ("scatter", "Two solvers, problem by problem")),
    "matrix": (("matrix", "Problems by solvers"),),
    "errors": (("precision", "Over the problems"), ("convergence", "On one problem")),
    "size": (("scaling", "Cost against size"),),
    "sequences": (("sequence", "Step by step"), ("warm", "Warm over cold")),
    "deadlines": (("deadlines", "Deadlines"),),
}
TITLES = {
    "overview": "Overview",
    "profile": "Performance profile",
    "budget": "Within a budget",
    "pairs": "Two by two",
    "matrix": "Problems by solvers",
    "errors": "Error against time",
    "size": "Cost against size",
    "sequences": "Sequences",
    "deadlines": "Deadlines",
    "claims": "Claimed, is not",
    "failures": "Failures by reason",
    "solvers": "Solvers",
    "machine": "Machine and versions",
    "methods": "Methods",
}
LINKS = {
    "overview": "Overview", "profile": "Profile", "budget": "Budget", "pairs": "Pairs", "matrix": "Matrix",
    "errors": "Errors", "size": "Size", "sequences": "Sequences", "deadlines": "Deadlines", "claims": "Claims",
    "failures": "Failures", "solvers": "Solvers", "machine": "Machine", "methods": "Methods",
}  # fmt: skip


def sections(run: Run, title: str) -> tuple[Markup, Markup]:
    """All sections, and the links to them."""
    there = dict(_present(run))
    made: list[Markup] = []
    for name, inside in there.items():
        heading = element("h1", title) if name == "overview" else element("h2", TITLES[name])
        made.append(element("section", heading, *inside, id=name))
    links = [element("li", element("a", LINKS[name], href=f"#{name}")) for name in there]
    return Markup("\n".join(made)), Markup("".join(links))


def _present(run: Run) -> Iterator[tuple[str, list[Markup]]]:
    """Those that have something to say."""
    yield "overview", list(_overview(run))
    absent = set() if len(run.histories) else {"errors"}
    absent |= set() if (run.rows["sequence"] != "").any() or run.rows["start"].nunique() > 1 else {"sequences"}
    for name in FIGURES if len(run.rows) else ():
        if name not in absent:
            yield name, list(_figures(name))
    parts: Mapping[str, Callable[[Run], Iterator[Markup]]] = {
        "claims": _claims,
        "failures": _failures,
        "solvers": _solvers,
        "machine": _machine,
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


def _overview(run: Run) -> Iterator[Markup]:
    rows = run.rows
    if not len(rows):
        yield element("p", "No pair was planned: no solver is reached from the problems that were read.")
        return
    yield from _publishing(run)
    if len(rows) > WHOLE:
        told = (
            f"{len(rows)} rows are too many to keep every fact of every pair on this page. Costs and verdicts of all "
            "of them are here, to seven digits, so that each figure is computed from all; messages, residuals and "
            f"commands are those of at most {KEPT} failures, and the matrix is one of families."
        )
        yield element("p", told, class_="note")
    waiting = int((rows["status"] == str(Status.NOT_RUN)).sum())
    if waiting:
        told = f"Incomplete: {waiting} of {counted(len(rows), 'pair')} not run yet."
        yield element("p", told, class_="note warning")
    facts = {
        "pairs solved": f"{int(rows_of.solved(rows).sum())} of {len(rows)}",
        "problems": rows["fingerprint"].nunique(),
        "solver configurations": rows["label"].nunique(),
        "formulations": rows["node"].nunique(),
        "claims that do not hold": len(reliability.false_claims(rows)),
    }
    told = [element("div", element("dt", name), element("dd", value)) for name, value in facts.items()]
    yield element("dl", *told, class_="facts")
    yield _settings(run)
    yield element("h3", "By formulation")
    groups = [group for group, _ in rows_of.groups(rows)]
    lines = []
    for r in each(summary.nodes(rows)):
        name, place = group_name_text(run, r.group), groups.index(r.group)
        open_it = element(
            "button", name, type="button", class_="link", data_choose=str(place), title=f"show {name} in all figures"
        )
        best = ", ".join(r.best[:3]) + (f" and {len(r.best) - 3} more" if len(r.best) > 3 else "")
        lines.append([open_it, r.problems, r.labels, r.pairs, r.some, r.none, r.most, best or "—"])
    head = ["formulation", "problems", "solvers", "pairs", "solved by some", "by none", "most solved", "by"]
    yield table("Solved, by formulation", head, lines, right=range(1, 7))
    yield element("h3", "Ranking: ", element("span", data_group_name=""))
    yield element("div", data_figure="ranking")


def _settings(run: Run) -> Markup:
    rows, meta = run.rows, run.meta
    tolerances = ", ".join(f"{t:g}" for t in sorted(set(rows["tolerance"].dropna())))
    limits = ", ".join(
        f"{s:g} s" if math.isfinite(s) else "none" for s in sorted(set(rows["seconds"].dropna().tolist()))
    )
    command = str(meta.get("command", "")).replace(str(Path.cwd()) + os.sep, "")
    parts = [f"Tolerance {tolerances}", f"limit {limits} a solve" if limits else "", str(meta.get("date", ""))]
    return element("p", ". ".join(part for part in parts if part) + ". ", code(command) if command else "")


def _publishing(run: Run) -> Iterator[Markup]:
    if run.left_out:
        names = ", ".join(sorted(run.left_out))
        yield element("p", f"Left out, since publishing their figures is restricted: {names}.", class_="note")
    found = attendance.restricted(run.rows, run.meta.get("solvers") or {})
    if found:
        terms: dict[str, list[str]] = {}
        for name, said in found.items():
            terms.setdefault(said, []).append(name)
        told = " ".join(f"{', '.join(names)}: {said}." for said, names in terms.items())
        first = "Not to be published as it is; --publishable leaves these out. "
        yield element("p", element("strong", first), told, class_="note warning")


def _claims(run: Run) -> Iterator[Markup]:
    found = reliability.false_claims(run.rows)
    if not len(found):
        yield element("p", "Every claim of a solver held on the problem it was given.")
        return
    told = f"{counted(len(found), 'answer')} that a solver called right, and whose error is beyond the tolerance"
    yield element("p", told + (f"; the first {LISTED}." if len(found) > LISTED else "."), class_="scope")
    lines = (
        [r["problem"], r["label"], r["status"], number(r["error"]), f"{r['tolerance']:g}", code(_again(run, r))]
        for _, r in found.head(LISTED).iterrows()
    )
    head = ["problem", "solver", "verdict", "error", "tolerance", "again with"]
    yield table("Claims that do not hold", head, lines, right=[3, 4])


def _failures(run: Run) -> Iterator[Markup]:
    started = run.rows["status"] != str(Status.UNAVAILABLE)
    for title, rows, refused in (
        ("Started, not solved", run.rows, False),
        ("Never started", run.rows[started], True),
    ):
        reasons = failures.failures(rows, refused=refused)
        if not reasons:
            continue
        yield element("h3", f"{title} ({sum(reason.count for reason in reasons)})")
        lines = (
            [
                reason.status.replace("_", " ") + (f", {reason.kind} route" if reason.kind else ""),
                reason.count,
                _solvers_of(reason.labels),
                cut(reason.message, 240) or "—",
                code(_again(run, reason.example)),
            ]
            for reason in reasons[: 2 * LISTED]
        )
        head = ["outcome", "pairs", "solvers", "message of the first", "first pair again"]
        yield table(title, head, lines, right=[1])
    gone = attendance.absences(run.rows)
    if gone:
        yield element("h3", "Not available here")
        lines = (
            [one.state, cut((one.detail.strip().splitlines() or ["not told"])[-1], 300), _solvers_of(one.solvers)]
            for one in gone
        )
        yield table("Solvers that could not run", ["state", "reason", "solvers"], lines)


def _solvers_of(counts: Mapping[str, int]) -> str:
    names = [f"{label} {count}" for label, count in counts.items()]
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")


def _again(run: Run, row: Any) -> str:
    command = solve_command(row, (run.meta.get("solvers") or {}).get(row["label"]))
    return command.replace(str(Path.cwd()) + os.sep, "")


def _solvers(run: Run) -> Iterator[Markup]:
    sheets: Mapping[str, Mapping[str, Any]] = run.meta.get("solvers") or {}
    here = set(run.rows.loc[run.rows["status"] != str(Status.UNAVAILABLE), "solver"])
    used = run.rows[run.rows["version"] != ""].groupby("solver")["version"].unique()
    by_name = {str(sheet.get("name", "")): sheet for _, sheet in sorted(sheets.items())}
    lines = []
    for name in sorted(set(by_name) & here):
        sheet = by_name[name]
        versions = ", ".join(sorted(used.get(name, []))) or sheet.get("version", "")
        restriction = sheet.get("publishing", "")
        licence = sheet.get("licence", "") or "—"
        method = [sheet.get("summary", ""), element("br"), element("span", sheet.get("citation", ""), class_="scope")]
        told = f"{licence}; publishing: {restriction}" if restriction else licence
        lines.append([name, sheet.get("node", ""), versions or "—", told, Markup("".join(map(text, method)))])
    if lines:
        yield table("Solvers", ["solver", "solves", "version", "licence", "method and source"], lines)
    found = tunings(run)
    if found:
        yield element("h3", "Tuned")
        names = run.rows.groupby("label")["fingerprint"].unique()
        told = (
            [
                label,
                record.get("method", ""),
                record.get("configurations", ""),
                seconds(float(record.get("spent", math.nan))),
                f"{len(set(record.get('problems', ())) & set(names.get(label, ())))} of {len(names.get(label, ()))}",
            ]
            for label, record in sorted(found.items())
        )
        yield element("p", "Their options were searched for on problems before this run.", class_="scope")
        head = ["solver", "search", "configurations", "took", "problems of this report it has seen"]
        yield table("Tuned solvers", head, told, right=[2, 3])


def _machine(run: Run) -> Iterator[Markup]:
    facts: dict[str, Any] = {**(run.meta.get("machine") or {})}
    hosts = sorted(set(run.rows["host"]) - {""})
    facts |= {"hosts": ", ".join(hosts)} if hosts else {}
    facts |= {f"{name} (package)": version for name, version in sorted((run.meta.get("versions") or {}).items())}
    if facts:
        yield table("Machine and versions", ["what", "value"], ([name, value] for name, value in facts.items()))
    took = [float(r["seconds"]) for r in run.meta.get("references") or [] if r["seconds"] == r["seconds"]]
    if len(took) > 1:
        spread = max(took) / min(took)
        told = (
            f"A solve that is always the same was repeated {len(took)} times during the run: it took "
            f"{seconds(min(took))} to {seconds(max(took))}, a drift of the machine by a factor {spread:.2f}."
        )
        if spread > DRIFT:
            yield element("p", told, " Ratios of times nearer to 1 than that are the machine's.", class_="note warning")
        else:
            yield element("p", told)
    refused = [(str(address), str(reason)) for address, reason in run.meta.get("refused") or []]
    if refused:
        here = str(Path.cwd()) + os.sep
        yield element("h3", f"Refused files ({len(refused)})")
        lines = ([a.removeprefix(here), cut(r.replace(here, ""), 300)] for a, r in sorted(refused))
        yield table("Refused files", ["file", "reason"], lines)
