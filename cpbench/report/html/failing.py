"""Section of failures: false claims, failures by reason, solvers that could not run."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from cpbench.analysis import participation, reliability
from cpbench.analysis.table import CONTRADICTED
from cpbench.report.claims_section import EXPLAINED, HEAD, TITLE, claim_lines
from cpbench.report.html.markup import Markup, code, element, prose, table
from cpbench.report.methods import LOSSES
from cpbench.report.run import Run, each
from cpbench.report.text import counted, cut, number, solve_command

LISTED = 60
"""The most lines of a list of pairs."""


def false_claims(run: Run) -> Iterator[Markup]:
    """Yield the claims of each solver, counted, then those that are not so, each with the command that runs it again;
    claims of no solution first."""
    counts = claim_lines(run)
    if counts:
        yield element("p", EXPLAINED, class_="scope")
        yield table(TITLE, HEAD, counts, right=range(1, len(HEAD)))
    found = run.false_claims.sort_values(CONTRADICTED, ascending=False, kind="stable")
    if not len(found):
        yield element("p", "No claim of a solver is known to be false.")
        return
    heading = (
        f"{counted(len(found), 'claim')} of an answer whose error is beyond the tolerance, or of no solution where "
        "another solver has a verified answer"
    )
    yield element("p", heading + (f"; the first {LISTED}." if len(found) > LISTED else "."), class_="scope")
    lines = (
        [
            r["problem"],
            r["label"],
            r["claim"],
            "has a verified answer" if r[CONTRADICTED] else r["status"],
            "—" if r[CONTRADICTED] else number(r["error"]),
            f"{r['tolerance']:g}",
            code(_again(run, r)),
        ]
        for _, r in found.head(LISTED).iterrows()
    )
    head = ["problem", "solver", "claim", "verdict", "error", "tolerance", "again with"]
    yield table("False claims", head, lines, right=[4, 5])


def reasons(run: Run) -> Iterator[Markup]:
    """Yield failures that others solved; outcomes and messages that are alike in one line; lost answers; unavailable
    solvers.
    """
    if run.failures:
        yield element("h3", "Failed here, solved there: ", element("span", data_group_name=""))
        yield element("div", data_figure="failed")
    for title, found in (("Started, not solved", run.failures), ("Never started", run.refusals)):
        if not found:
            continue
        yield element("h3", f"{title} ({sum(reason.count for reason in found)})")
        lines = (
            [
                reason.status.replace("_", " ") + (f", {reason.kind} route" if reason.kind else ""),
                reason.count,
                _solvers_of(reason.labels),
                element("div", cut(reason.message, 240) or "—", class_="said"),
                code(_again(run, reason.example)),
            ]
            for reason in found[: 2 * LISTED]
        )
        head = ["outcome", "pairs", "solvers", "message of the first", "first pair again"]
        yield table(title, head, lines, right=[1])
    lost = reliability.losses(run.rows)
    if len(lost):
        yield element("h3", f"Lost on the way back ({lost['lost'].sum()})")
        yield prose(LOSSES)
        head = ["route", "answers lost", "worst factor"]
        lines = ([code(r.route), r.lost, number(r.factor)] for r in each(lost))
        yield table("Conversions that lost answers", head, lines, right=[1, 2])
    planned = participation.left_out_lines(run.meta.get("left_out") or [])
    if planned:
        yield element("h3", "Could not be run")
        yield element("ul", *(element("li", line) for line in planned))
    gone = participation.absences(run.rows)
    if gone:
        yield element("h3", "Not available here")
        lines = (
            [
                one.state,
                cut((one.detail.strip().splitlines() or ["no reason was given"])[-1], 300),
                _solvers_of(one.solvers),
            ]
            for one in gone
        )
        yield table("Solvers that could not run", ["state", "reason", "solvers"], lines)


def _solvers_of(counts: Mapping[str, int]) -> str:
    names = [f"{label} {count}" for label, count in counts.items()]
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")


def _again(run: Run, row: Any) -> str:
    command = solve_command(row, (run.meta.get("solvers") or {}).get(row["label"]))
    return command.replace(str(Path.cwd()) + os.sep, "")
