"""The sections of a report about all rows together: false claims, failures, refusals, machine."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from cpbench.analysis import summary
from cpbench.analysis import table as rows_of
from cpbench.report.run import Run, each
from cpbench.report.text import code, cut, listed, number, plain, solve_command, table

LISTED = 40
"""The most rows of a list of pairs; the rest is counted, and is in the CSV."""


def run_sections(run: Run) -> Iterator[str]:
    """All of them, in order."""
    sections: Sequence[Callable[[Run], Iterator[str]]] = (
        _false_claims,
        _directions,
        _inexact,
        _failures,
        _not_started,
        _refused,
        _solvers,
        _machine,
    )
    for section in sections:
        yield from section(run)


def _rest(count: int) -> Iterator[str]:
    if count > LISTED:
        yield f"{count - LISTED} more are in `results.csv`."


def _false_claims(run: Run) -> Iterator[str]:
    found = summary.false_claims(run.rows[rows_of.exact(run.rows)])
    yield f"## Claimed, is not ({len(found)})"
    if not len(found):
        yield "On exact routes every claim of a solver held."
        return
    yield table(
        ["problem", "solver", "verdict", "error", "tolerance", "again with"],
        (
            [
                plain(row["problem"]),
                code(row["label"]),
                plain(row["status"]),
                number(row["error"]),
                f"{row['tolerance']:g}",
                code(solve_command(row, run.timeout)),
            ]
            for _, row in found.head(LISTED).iterrows()
        ),
        right=[3, 4],
    )
    yield from _rest(len(found))


def _directions(run: Run) -> Iterator[str]:
    found = summary.flagged(run.rows, "direction")
    if not len(found):
        return
    yield f"## Accepted, but in a wrong direction ({len(found)})"
    yield "These answers meet the tolerance, and yet some contact slips in a direction that the law forbids."
    yield table(
        ["problem", "solver", "verdict", "error", "slip angle [°]", "again with"],
        (
            [
                plain(row["problem"]),
                code(row["label"]),
                plain(row["status"]),
                number(row["error"]),
                number(_part(row["parts"], "slip_angle [deg]")),
                code(solve_command(row, run.timeout)),
            ]
            for _, row in found.head(LISTED).iterrows()
        ),
        right=[3, 4],
    )
    yield from _rest(len(found))


def _part(parts: str, name: str) -> float:
    value = (json.loads(parts) if parts else {}).get(name)
    return math.nan if value is None else float(value)


def _inexact(run: Run) -> Iterator[str]:
    found = summary.inexact_routes(run.rows)
    if not len(found):
        return
    yield "## Routes that promise less than an answer"
    yield (
        "Errors are those on the problem that was asked. *Missed*: the solver solved what it was given, and the answer "
        "is not within the tolerance of the exact law."
    )
    yield table(
        ["solver", "promise", "pairs", "solved", "missed", "median error", "largest error"],
        (
            [
                code(r.label),
                f"**{plain(r.kind)}**",
                str(r.pairs),
                str(r.solved),
                str(r.missed),
                number(r.median),
                number(r.largest),
            ]
            for r in each(found)
        ),
        right=range(2, 7),
    )


def _failures(run: Run) -> Iterator[str]:
    yield "## Failures by reason"
    reasons = summary.failures(run.rows)
    if not reasons:
        yield "Every pair that was started was solved."
        return
    yield "Messages that differ in numbers only are one line; the command runs its first pair again."
    yield _reasons(reasons, run)


def _not_started(run: Run) -> Iterator[str]:
    reasons = summary.failures(run.rows, refused=True)
    if not reasons:
        return
    yield "## Never started"
    yield "Pairs whose solver cannot take the problem, is not installed, or was not reached before the run ended."
    yield _reasons(reasons, run)


def _reasons(reasons: Sequence[summary.Reason], run: Run) -> str:
    return table(
        ["outcome", "pairs", "solvers", "message of the first", "first pair again"],
        (
            [
                reason.status.replace("_", " ") + (f", **{plain(reason.kind)}** route" if reason.kind else ""),
                str(reason.count),
                listed([f"{label} {count}" for label, count in reason.labels.items()], 4),
                plain(cut(reason.message)) or "—",
                code(solve_command(reason.example, run.timeout)),
            ]
            for reason in reasons
        ),
        right=[1],
    )


def _refused(run: Run) -> Iterator[str]:
    refused = [(str(address), str(reason)) for address, reason in run.meta.get("refused") or []]
    yield f"## Refused files ({len(refused)})"
    if not refused:
        yield "Every file was read."
        return
    here = str(Path.cwd()) + os.sep
    yield table(
        ["file", "reason"],
        ([code(a.removeprefix(here)), plain(cut(r.replace(here, ""), 300))] for a, r in sorted(refused)),
    )


def _solvers(run: Run) -> Iterator[str]:
    sheets: Mapping[str, Mapping[str, Any]] = run.meta.get("solvers") or {}
    if not sheets:
        return
    used: dict[str, set[str]] = {}
    for solver, version in zip(run.rows["solver"], run.rows["version"], strict=True):
        used.setdefault(solver, set()).add(version)
    yield "## Solvers"
    rows: dict[str, list[str]] = {}
    for _, sheet in sorted(sheets.items()):
        name = str(sheet.get("name", ""))
        rows[name] = [
            code(name),
            plain(sheet.get("node", "")),
            plain(", ".join(sorted(used.get(name, set()) - {""})) or sheet.get("version", "")) or "—",
            plain(sheet.get("licence", "")) or "—",
            plain(sheet.get("publishing", "")) or "—",
            plain(sheet.get("summary", "")),
        ]
    head = ["solver", "solves", "version", "licence", "restriction on publishing", "method"]
    yield table(head, (rows[name] for name in sorted(rows)))


def _machine(run: Run) -> Iterator[str]:
    yield "## Machine and versions"
    facts: dict[str, Any] = {**(run.meta.get("machine") or {})}
    memory = run.meta.get("memory")
    if memory is not None:
        facts["memory limit of a solve"] = f"{memory} bytes" if memory else "none"
    if run.meta.get("jobs") is not None:
        facts["solves at a time"] = run.meta["jobs"]
    facts |= {f"{name} (package)": version for name, version in sorted((run.meta.get("versions") or {}).items())}
    yield "\n".join(f"- {plain(name)}: {plain(value)}" for name, value in facts.items()) or "Not recorded."
