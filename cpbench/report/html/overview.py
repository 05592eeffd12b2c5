"""The overview of the page: what was asked and what came of it, formulation by formulation."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

from cpbench.analysis import attendance
from cpbench.analysis import table as rows_of
from cpbench.report.html.columns import KEPT, WHOLE
from cpbench.report.html.markup import Markup, code, element, table
from cpbench.report.run import Run, each, group_name_text
from cpbench.report.text import counted
from cpbench.verification import Status


def overview(run: Run) -> Iterator[Markup]:
    """Numbers of the whole run, its settings, and the place of the ranking."""
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
    for remark in run.remarks:
        yield element("p", f"{remark}.", class_="note warning")
    facts = {
        "pairs solved": f"{int(rows_of.solved(rows).sum())} of {len(rows)}",
        **({"stationary": run.stationary} if run.stationary else {}),
        "problems": rows["fingerprint"].nunique(),
        "solver configurations": rows["label"].nunique(),
        "formulations": rows["node"].nunique(),
        "claims that do not hold": len(run.false_claims),
    }
    told = [element("div", element("dt", name), element("dd", value)) for name, value in facts.items()]
    yield element("dl", *told, class_="facts")
    yield _settings(run)
    yield element("h3", "By formulation")
    groups = [group for group, _ in run.parts]
    lines = []
    for r in each(run.nodes):
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
    tolerances = ", ".join(f"{t:g}" for t in sorted(set(rows["tolerance"].dropna().unique())))
    limits = ", ".join(
        f"{s:g} s" if math.isfinite(s) else "none" for s in sorted(set(rows["seconds"].dropna().unique().tolist()))
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
