"""The sections about all rows together, whole: false claims, failures, refusals, solvers (`details.md`)."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from cpbench.analysis import failures, reliability, starts
from cpbench.analysis.table import CONTRADICTED
from cpbench.report.certainty_section import certainties
from cpbench.report.imported_section import imported
from cpbench.report.methods import LOSSES
from cpbench.report.participation_sections import absent
from cpbench.report.run import Run, each
from cpbench.report.text import code, counted, cut, listed, number, plain, solve_command, table
from cpbench.verification import Status

DRIFT = 1.1
"""A machine that was this many times slower at one time than at another spoils ratios."""
LISTED = 40
"""The most rows of a list of pairs; the rest is counted, and is in the CSV."""
CONFLICTS = (
    "Rows on one problem that cannot all be right: a solver is wrong, or the verdict. *Existence*: a row claims "
    "that there is no solution, beside a verified answer. *Objective*: verified answers of a convex program with "
    "different objectives. *Solution*: different verified answers where the solution is unique. *Verdict*: answers "
    "that are the same to rounding with different verdicts, or rejected although different methods have the same."
)


def run_sections(run: Run) -> Iterator[str]:
    """Yield all of them, in order."""
    sections: Sequence[Callable[[Run], Iterator[str]]] = (
        contradictions,
        false_claims,
        certainties,
        _directions,
        _inexact,
        losses,
        warm_against_cold,
        imported,
        failed_pairs,
        absent,
        not_started,
        refused,
        solver_sheets,
    )
    for section in sections:
        yield from section(run)


def rest(run: Run, count: int, most: int = LISTED) -> Iterator[str]:
    """Yield a sentence about the rows that a list of `most` leaves out."""
    if count > most:
        yield f"{count - most} more are in {run.all_rows}."


def contradictions(run: Run, most: int | None = None) -> Iterator[str]:
    """Yield the contradictions, at most so many of them; nothing where there is none."""
    conflicts = run.contradictions
    if not conflicts:
        return
    yield f"## {counted(len(conflicts), 'contradiction').capitalize()}"
    yield CONFLICTS
    yield table(
        ["problem", "kind", "what contradicts what", "certificates"],
        (
            [plain(cell) or "—" for cell in (one.problem, one.kind, one.words, one.arbitration)]
            for one in conflicts[:most]
        ),
    )
    if most is not None and len(conflicts) > most:
        yield f"{len(conflicts) - most} more are in the details."


def false_claims(run: Run, most: int = LISTED) -> Iterator[str]:
    """Yield claims of a solution that is none, and of none where there is one, at most so many of them; the latter
    first. Claims of no solution that nothing proves or contradicts are counted."""
    claims = run.false_claims.sort_values(CONTRADICTED, ascending=False, kind="stable")
    yield f"## False claims: claims that do not hold ({len(claims)})"
    unproved = reliability.unproved(run.rows)
    if not len(claims):
        yield "No claim of a solver is known to be false."
    if len(unproved):
        yield (
            f"{counted(len(unproved), 'claim')} that there is no solution: neither proved, nor contradicted by a "
            f"verified answer ({listed(sorted(set(unproved['label'])), 4)})."
        )
    if not len(claims):
        return
    yield table(
        ["problem", "solver", "claim", "verdict", "error", "tolerance", "again with"],
        (
            [
                plain(row["problem"]),
                code(row["label"]),
                f"**{plain(row['claim'])}**" if row[CONTRADICTED] else plain(row["claim"]),
                "has a verified answer" if row[CONTRADICTED] else plain(row["status"]),
                "—" if row[CONTRADICTED] else number(row["error"]),
                f"{row['tolerance']:g}",
                code(again(run, row)),
            ]
            for _, row in claims.head(most).iterrows()
        ),
        right=[4, 5],
    )
    yield from rest(run, len(claims), most)


def _directions(run: Run) -> Iterator[str]:
    flagged = failures.flagged(run.rows, "direction")
    if not len(flagged):
        return
    yield f"## Accepted, but in a wrong direction ({len(flagged)})"
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
                code(again(run, row)),
            ]
            for _, row in flagged.head(LISTED).iterrows()
        ),
        right=[3, 4],
    )
    yield from rest(run, len(flagged))


def _part(parts: str, name: str) -> float:
    value = (json.loads(parts) if parts else {}).get(name)
    return math.nan if value is None else float(value)


def _inexact(run: Run) -> Iterator[str]:
    inexact_routes = reliability.inexact_routes(run.rows)
    if not len(inexact_routes):
        return
    yield "## Routes that promise less than an answer"
    yield (
        "Errors are those on the problem that was asked. *Missed*: the solver solved what it was given (measured "
        "there too), and the answer is not within the tolerance of the exact law."
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
            for r in each(inexact_routes)
        ),
        right=range(2, 7),
    )


def losses(run: Run) -> Iterator[str]:
    """Yield the conversions that lost answers."""
    lost = reliability.losses(run.rows)
    if not len(lost):
        return
    yield f"## Lost on the way back ({lost['lost'].sum()})"
    yield LOSSES
    yield table(
        ["route", "answers lost", "worst factor"],
        ([code(r.route), str(r.lost), number(r.factor)] for r in each(lost)),
        right=[1, 2],
    )


def failed_pairs(run: Run, most: int | None = None) -> Iterator[str]:
    """Yield why pairs that were started were not solved, at most so many reasons; similar ones are one line."""
    yield "## Failures by reason"
    reasons = run.failures
    if not reasons:
        yield "Every pair that was started was solved."
        return
    yield "Messages that differ in numbers only are one line; the command runs its first pair again."
    yield _reasons(run, reasons[:most])


def not_started(run: Run, most: int | None = None) -> Iterator[str]:
    """Yield why pairs were not started, at most so many reasons."""
    reasons = run.refusals
    if not reasons:
        return
    yield "## Never started"
    yield "Pairs whose solver cannot take the problem, or was not reached before the run ended."
    yield _reasons(run, reasons[:most])


def again(run: Run, row: Any) -> str:
    """Return the command that runs a row's pair again, without folders of this machine."""
    here = str(Path.cwd()) + os.sep
    return solve_command(row, (run.meta.get("solvers") or {}).get(row["label"])).replace(here, "")


def _reasons(run: Run, reasons: Sequence[failures.Reason]) -> str:
    return table(
        ["outcome", "pairs", "solvers", "message of the first", "first pair again"],
        (
            [
                reason.status.replace("_", " ") + (f", **{plain(reason.kind)}** route" if reason.kind else ""),
                str(reason.count),
                listed([f"{label} {count}" for label, count in reason.labels.items()], 4),
                plain(cut(reason.message)) or "—",
                code(again(run, reason.example)),
            ]
            for reason in reasons
        ),
        right=[1],
    )


def refused(run: Run, most: int | None = None) -> Iterator[str]:
    """Yield the files that could not be read, with the reason; nothing when every file was."""
    files = sorted((str(address), str(reason)) for address, reason in run.meta.get("refused") or [])
    if not files:
        return
    yield f"## Refused files ({len(files)})"
    here = str(Path.cwd()) + os.sep
    yield table(
        ["file", "reason"],
        ([code(a.removeprefix(here)), plain(cut(r.replace(here, ""), 300))] for a, r in files[:most]),
    )


def solver_sheets(run: Run) -> Iterator[str]:
    """Yield versions, licences, methods and citations of the solvers."""
    sheets: Mapping[str, Mapping[str, Any]] = run.meta.get("solvers") or {}
    if not sheets:
        return
    used: dict[str, set[str]] = {}
    for one in each(run.rows[["solver", "version"]].drop_duplicates()):
        used.setdefault(one.solver, set()).add(one.version)
    yield "## Solvers"
    rows: dict[str, list[str]] = {}
    here = set(run.rows.loc[run.rows["status"] != str(Status.UNAVAILABLE), "solver"].unique())
    for _, sheet in sorted(sheets.items()):
        name = str(sheet.get("name", ""))
        if name not in here:
            continue
        rows[name] = [
            code(name),
            plain(sheet.get("node", "")),
            plain(", ".join(sorted(used.get(name, set()) - {""})) or sheet.get("version", "")) or "—",
            plain(sheet.get("licence", "")) or "—",
            plain(sheet.get("publishing", "")) or "—",
            plain(". ".join(filter(None, (sheet.get("summary", ""), sheet.get("citation", ""))))),
        ]
    head = ["solver", "solves", "version", "licence", "restriction on publishing", "method and source"]
    yield table(head, (rows[name] for name in sorted(rows)))


def warm_against_cold(run: Run, most: int | None = None) -> Iterator[str]:
    """Yield what warm starts gain, a line a formulation, solver and start; at most so many lines."""
    paired = starts.paired(run.read)
    if not len(paired):
        return
    yield "## Warm against cold"
    yield (
        "The same solver, problem and tolerance from two starts, pair by pair. Below 1, the warm start is ahead. "
        "*Fell back*: there was nothing to start from, so that the solve was a cold one."
    )
    yield table(
        ["formulation", "solver", "start", "pairs", "solved warm", "solved cold", "fell back", "time", "iterations"],
        (
            [
                plain(r.node),
                code(r.label),
                code(r.start),
                str(r.pairs),
                str(r.warm),
                str(r.cold),
                str(r.fell_back),
                number(r.time),
                number(r.iterations),
            ]
            for r in each(paired[:most])
        ),
        right=range(3, 9),
    )
    yield "Time and iterations: geometric mean of warm over cold, over the pairs that both solved."
