"""The tables of a report, each computed once, as numbers, for all of its documents.

A report has those of the whole run by name (`of_run`) and those of each formulation (`of_group`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import (
    bootstrap,
    certainty,
    failures,
    histories,
    means,
    participation,
    reliability,
    starts,
    summary,
)
from cpbench.analysis import table as rows_of
from cpbench.analysis.failures import Reason
from cpbench.analysis.ranking import RankedSolver, Ranking
from cpbench.analysis.table import CONTRADICTED, ResultGroup
from cpbench.report.figures import EMPHASISED
from cpbench.report.run import ComparedTimes, ProblemOrigin, Run
from cpbench.report.templating import Table
from cpbench.report.text import cut, number, seconds
from cpbench.verification import BESIDE, OPTIMALITY_GAP, Status

NOWHERE = ProblemOrigin("", "")
LISTED = 40
"""The most rows of a list of pairs; the rest is counted, and is in the CSV."""
DECADES = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
"""Errors that the table of error against time has columns for."""


def of_run(run: Run) -> dict[str, Table]:
    """Return the tables about all rows together by name; those about nothing are empty."""
    levels, far, unproved = _certainty(run)
    return {
        "grid": _grid(run),
        "contradictions": _contradictions(run),
        "false": _false_claims(run),
        "claims": _claims(run),
        "hardest": _hardest(run),
        "levels": levels,
        "far": far,
        "unproved": unproved,
        "directions": _directions(run),
        "inexact": _inexact(run),
        "losses": _losses(run),
        "warm": _warm(run),
        "failures": _reasons(run, run.failures),
        "never": _reasons(run, run.refusals),
        "absent": _absent(run),
        "refused": _refused(run),
        "solvers": _solvers(run),
        "origins": _origins(run),
    }


def of_group(run: Run, group: ResultGroup, rows: pd.DataFrame, ranking: Ranking | None) -> dict[str, Table]:
    """Return the tables about a formulation by name; those about nothing are empty."""
    solvers = ranking.rows if ranking is not None else ()
    order = [row.solver for row in solvers]
    return {
        "ranking": ranking_table(solvers),
        "times": _times(rows, order, run.compared[group]),
        "verdicts": _verdicts(rows, order),
        "beside": _beside(group, rows, order, BESIDE.get(group.node, "")),
        "optima": _beside(group, rows, order, OPTIMALITY_GAP),
        "families": _families(rows),
        "precision": precision(rows, run.histories),
    }


def ranking_table(solvers: Sequence[RankedSolver]) -> Table:
    """Return what each solver solved and how fast, the best first."""
    forms = {
        "solver": "code", "solved": "cell", "lost": "some", "stationary": "some", "false": "some", "alone": "some",
        "fastest": "some", "median": "seconds", "× fastest": "number", "error": "power", "route": "text",
        "remarks": "blank",
    }  # fmt: skip
    return Table.of(
        forms,
        (
            [one.solver, f"{one.solved} of {one.counted}", one.lost, one.stationary, one.false, one.alone, one.fastest,
             one.median, one.factor, one.error, one.route + (f" and {one.others} more" if one.others else ""),
             ", ".join(one.warnings)]
            for one in solvers
        ),
    )  # fmt: skip


def precision(rows: pd.DataFrame, kept: pd.DataFrame) -> Table:
    """Return the median times to some errors, of the solvers whose iterates were kept (`analysis.histories`)."""
    curves = histories.work_precision(rows, kept) if len(kept) else pd.DataFrame({"label": [], "error": []})
    wanted = [error for error in DECADES if (curves["error"] <= error).any()]
    problems = rows["fingerprint"].nunique()

    def cell(curve: pd.DataFrame, error: float) -> str:
        met = curve[curve["error"] <= error].head(1)
        if met.empty:
            return "—"
        reached = int(met["reached"].iloc[0])
        return seconds(float(met["seconds"].iloc[0])) + (f" ({reached})" if reached < problems else "")

    forms = {"solver": "code", **{f"to {error:g}": "cell" for error in wanted}}
    lines = ([label, *(cell(curve, error) for error in wanted)] for label, curve in curves.groupby("label"))
    return Table.of(forms, lines)


def sizes_text(text: str) -> str:
    """Write the dimensions of a problem.

    >>> sizes_text('{"n": 3, "m": 2}')
    'n 3, m 2'
    """
    return ", ".join(f"{symbol} {size:g}" for symbol, size in json.loads(text or "{}").items())


def _grid(run: Run) -> Table:
    """Return solvers × formulations: solved of what was started, × fastest, and the number of false claims.

    Where the machine was busy, nothing is said of times.
    """
    ranked = [ranking for ranking in run.rankings if ranking.rows]
    cells: dict[str, dict[str, str]] = {}
    solved: dict[str, int] = {}
    for ranking in ranked:
        for one in ranking.rows:
            factor = "" if run.disturbance or math.isnan(one.factor) else f" ×{number(one.factor)}"
            lies = f", {one.false} false" if one.false else ""
            cells.setdefault(one.solver, {})[ranking.formulation] = f"{one.solved}/{one.counted}{factor}{lies}"
            solved[one.solver] = solved.get(one.solver, 0) + one.solved
    names = [ranking.formulation for ranking in ranked]
    order = sorted(cells, key=lambda label: (-solved[label], label))
    forms = {"solver": "code", **dict.fromkeys(names, "cell")}
    return Table.of(forms, ([label, *(cells[label].get(name, "") for name in names)] for label in order))


def _contradictions(run: Run) -> Table:
    forms = dict.fromkeys(("problem", "kind", "what contradicts what", "certificates"), "text")
    return Table.of(forms, ([c.problem, c.kind, c.words, c.arbitration] for c in run.contradictions))


def _false_claims(run: Run) -> Table:
    """Return claims of a solution that is none, and of none where there is one, the latter first."""
    rows = run.false_claims.sort_values(CONTRADICTED, ascending=False, kind="stable")
    forms = {"problem": "text", "formulation": "text", "size": "text", "solver": "code", "claim": "text",
             "verdict": "text", "error": "number", "tolerance": "cell", "again with": "code"}  # fmt: skip
    lines = [
        [row["problem"], row["node"], sizes_text(row["sizes"]), row["label"], row["claim"],
         "has a verified answer" if row[CONTRADICTED] else row["status"],
         math.nan if row[CONTRADICTED] else row["error"], f"{row['tolerance']:g}", run.again(row)]
        for _, row in rows.head(LISTED).iterrows()
    ]  # fmt: skip
    return Table.of(forms, lines)


def _claims(run: Run) -> Table:
    """Return what became of the claims of each solver with a claim: those of cpbench first, then in order of name."""
    counts = reliability.claim_counts(run.read)
    counts = counts[counts["made"] > 0].reset_index()
    native = [bool((run.meta.get("solvers") or {}).get(label, {}).get("native")) for label in counts["label"]]
    counts = counts.assign(foreign=[not one for one in native]).sort_values(["foreign", "label"], kind="stable")
    names = {"made": "claims made", "confirmed": "confirmed", "near": "near", "false": "false",
             "nonexistence": "false: no solution", "open": "undecided"}  # fmt: skip
    frame = counts[["label", *names]].rename(columns={"label": "solver", **names})
    return Table(frame, {"solver": "code", **dict.fromkeys(names.values(), "some")})


def _hardest(run: Run) -> Table:
    """Return the problems that fewest of the solvers solve which were started on them, those of none first; of problems
    that were proved to have no solution none."""
    hard = failures.hardest(run.rows)
    forms = {"problem": "text", "formulation": "text", "size": "text", "solved": "cell", "least error": "number",
             "by": "code", "source": "text", "licence": "text", "file": "code"}  # fmt: skip
    lines: list[list[Any]] = []
    for one in hard.itertuples(index=False):
        origin = run.origins.get(str(one.family), NOWHERE)
        lines.append(
            [one.name, one.node, sizes_text(str(one.sizes)), f"{one.solved} of {one.started}", one.error,
             one.label if math.isfinite(float(one.error)) else "", cut(origin.source, 80), cut(origin.licence, 40),
             one.address]
        )  # fmt: skip
    return Table.of(forms, lines)


def _certainty(run: Run) -> tuple[Table, Table, Table]:
    """Return levels of certificates by solver, accepted answers that are far from the solution that is known, and
    problems without a proof."""
    forms = {"solver": "code", **dict.fromkeys(("verified", *certainty.LEVELS), "count"), "median distance": "number",
             "largest": "number", "false claims": "count", "disproved": "count"}  # fmt: skip
    labels = certainty.by_label(run.rows)
    levels = Table.of(forms, labels.itertuples(index=False, name=None))
    forms = {"problem": "text", "solver": "code", "measure": "text", "error": "number", "distance": "number",
             "the only solution, for the matrix is": "text"}  # fmt: skip
    far = [
        [row["problem"], row["label"], row["measure"] or "backward error", row["error"], row["distance"],
         _only(row["certificate"])]
        for _, row in certainty.far(run.rows).iterrows()
    ]  # fmt: skip
    problems = certainty.by_problem(run.rows)
    rest = problems[~problems["level"].isin(certainty.KNOWN)][["problem", "node", "reason"]]
    names = dict.fromkeys(("problem", "formulation", "what stops a proof"), "text")
    return levels, Table.of(forms, far), Table.of(names, rest.itertuples(index=False, name=None))


def _only(certificate: str) -> str:
    """Return the fact that makes the solution unique; a word where none is known."""
    uniqueness = next((part for part in certificate.split("; ") if part.startswith("unique: ")), "")
    return uniqueness.removeprefix("unique: ") or "not known"


def _directions(run: Run) -> Table:
    """Return answers that are accepted although a contact slips in a direction that the law forbids."""
    flagged = failures.flagged(run.rows, "direction")
    forms = {"problem": "text", "solver": "code", "verdict": "text", "error": "number", "slip angle [°]": "number",
             "again with": "code"}  # fmt: skip
    lines = [
        [row["problem"], row["label"], row["status"], row["error"],
         float(json.loads(row["parts"] or "{}").get("slip_angle [deg]", math.nan)), run.again(row)]
        for _, row in flagged.head(LISTED).iterrows()
    ]  # fmt: skip
    return Table.of(forms, lines)


def _inexact(run: Run) -> Table:
    names = ("solver", "promise", "pairs", "solved", "missed", "median error", "largest error")
    forms = dict(zip(names, ("code", "text", "count", "count", "count", "number", "number"), strict=True))
    return Table(reliability.inexact_routes(run.rows).set_axis(list(names), axis=1), forms)


def _losses(run: Run) -> Table:
    forms = {"route": "code", "answers lost": "count", "worst factor": "number"}
    return Table(reliability.losses(run.rows).set_axis(list(forms), axis=1), forms)


def _warm(run: Run) -> Table:
    forms = {"formulation": "text", "solver": "code", "start": "code", "pairs": "count", "solved warm": "count",
             "solved cold": "count", "fell back": "count", "time": "number", "iterations": "number"}  # fmt: skip
    return Table(starts.paired(run.read).set_axis(list(forms), axis=1), forms)


def _reasons(run: Run, reasons: Sequence[Reason]) -> Table:
    """Return why pairs were not solved, or not started; messages that differ in numbers only are one line."""
    forms = {"outcome": "text", "pairs": "count", "solvers": "codes", "message of the first": "text",
             "first pair again": "code"}  # fmt: skip
    lines = (
        [reason.status.replace("_", " ") + (f", {reason.kind} route" if reason.kind else ""), reason.count,
         [f"{label} {count}" for label, count in reason.labels.items()], cut(reason.message), run.again(reason.example)]
        for reason in reasons
    )  # fmt: skip
    return Table.of(forms, lines)


def _absent(run: Run) -> Table:
    """Return why solvers could not run here, each reason once."""
    forms = {"state": "text", "reason": "text", "solvers": "codes", "pairs": "count"}
    lines = (
        [state or "unavailable", cut((detail.strip().splitlines() or ["no reason was given"])[-1], 300),
         list(solvers), sum(solvers.values())]
        for (state, detail), solvers in participation.absences(run.rows).items()
    )  # fmt: skip
    return Table.of(forms, lines)


def _refused(run: Run) -> Table:
    """Return the files that could not be read, with the reason."""
    files = sorted((str(address), str(reason)) for address, reason in run.meta.get("refused") or [])
    return Table.of({"file": "code", "reason": "text"}, ([run.local(a), cut(run.local(r), 300)] for a, r in files))


def _solvers(run: Run) -> Table:
    """Return versions, licences, methods and citations of the solvers that are here."""
    metadata: Mapping[str, Mapping[str, Any]] = run.meta.get("solvers") or {}
    here = run.rows.loc[run.rows["status"] != str(Status.UNAVAILABLE), ["solver", "version"]]
    used = here.groupby("solver")["version"].agg(lambda versions: ", ".join(sorted(set(versions) - {""})))
    forms = {"solver": "code", "solves": "text", "version": "text", "licence": "text",
             "restriction on publishing": "text", "method and source": "text"}  # fmt: skip
    by_name = {str(one.get("name", "")): one for _, one in sorted(metadata.items())}
    lines = (
        [name, one.get("node", ""), used[name] or one.get("version", ""), one.get("licence", ""),
         one.get("publishing", "") or "",
         ". ".join(filter(None, (one.get("summary", ""), one.get("citation", ""))))]
        for name, one in sorted(by_name.items())
        if name in used.index
    )  # fmt: skip
    return Table.of(forms, lines)


def _origins(run: Run) -> Table:
    """Return families of problems with their source and licence, where the files of some give them."""
    forms = {"family": "text", "formulation": "text", "problems": "count", "source": "text", "licence": "text"}
    if not any(any(origin) for origin in run.origins.values()):
        return Table.of(forms, [])
    counts = run.rows.groupby(["family", "node"], sort=True)["fingerprint"].nunique()
    lines = (
        [family or "(none)", node, count, *(text or "not given" for text in run.origins.get(str(family), NOWHERE))]
        for (family, node), count in counts.items()  # type: ignore[misc]
    )
    return Table.of(forms, lines)


def _times(rows: pd.DataFrame, order: Sequence[str], compared: ComparedTimes) -> Table:
    """Return the times of the solvers that solve something: quantiles, means with what they hang on, and the distance
    to the virtual best."""
    times, lost, limit = compared.times, compared.lost, rows_of.limit(rows)
    if not np.isfinite(times.to_numpy(dtype=float)).any():
        return Table.of({"solver": "code"}, [])
    leading = compared.profile.leading(EMPHASISED)
    every = means.means(times, limit=limit, lost=lost)
    common = means.means(times, shift=every.shift, limit=limit, common=leading)
    families = bootstrap.families_of(rows)
    around = bootstrap.mean_time(times, every.shift, every.charge, lost, families)
    gap = means.gaps(times, lost=lost)
    columns: dict[str, tuple[str, pd.Series]] = {
        "p95": ("seconds", summary.quantile(times, 0.95)),
        "p99": ("seconds", summary.quantile(times, 0.99)),
        "slowdown": ("number", gap["median"]),
        "within 2 times": ("share", gap["within"]),
        f"mean over all {every.problems}": ("seconds", every.mean),
        "95 % interval": ("cell", _interval(around)),
        f"mean over {common.problems} in common": ("seconds", common.mean),
        "best without it": ("number", gap["marginal"]),
    }
    if bootstrap.clusters(times.index, families)[1] < bootstrap.FEW:  # an interval says nothing there
        del columns["95 % interval"]
    done = [label for label in order if label in gap.index and gap.at[label, "solved"]]
    frame = pd.DataFrame({name: values.reindex(done) for name, (_, values) in columns.items()}, index=done)
    forms = {"solver": "code", **{name: form for name, (form, _) in columns.items()}}
    price = f"is charged {seconds(every.charge)}" if math.isfinite(every.charge) else "leaves none (no limit was set)"
    note = f"Means: shift {seconds(every.shift)} (median of all times); a problem not solved {price}."
    return Table(frame.rename_axis("solver").reset_index(), forms, note)


def _interval(ends: pd.DataFrame) -> pd.Series[str]:
    texts = [
        "—" if math.isnan(low) else f"{seconds(low)} to {seconds(high)}"
        for low, high in zip(ends["low"], ends["high"], strict=True)
    ]
    return pd.Series(texts, index=ends.index, dtype=object)


def _verdicts(rows: pd.DataFrame, order: Sequence[str]) -> Table:
    counts = summary.verdicts(rows)
    labels = [*order, *(label for label in counts.index if label not in set(order))]
    frame = counts.loc[labels].rename(columns=lambda status: str(status).replace("_", " "))
    return Table(
        frame.rename_axis("solver").reset_index(), {"solver": "code", **dict.fromkeys(map(str, frame), "some")}
    )


def _beside(group: ResultGroup, rows: pd.DataFrame, order: Sequence[str], name: str) -> Table:
    """Return how the errors of each solver's answers compare with another number of them."""
    forms = {"solver": "code", "answers": "count", "median error": "number", f"median {name}": "number",
             "pass both": "count", "pass the error only": "count", f"pass {name} only": "count"}  # fmt: skip
    compared = summary.beside(rows.head(0) if group.measure else rows, name, group.tolerance)
    shown = compared.loc[[label for label in order if label in compared.index]]
    return Table(shown.reset_index().set_axis(list(forms), axis=1), forms)


def _families(rows: pd.DataFrame) -> Table:
    """Return what is solved of each family of problems, where there are several."""
    families = summary.families(rows)
    forms = {"family": "text", "problems": "count", "solved by some": "count", "pairs": "count",
             "solved pairs": "count", "most solved": "count", "by": "codes"}  # fmt: skip
    families["family"] = families["family"].replace("", "(none)")
    return Table((families if len(families) > 1 else families.head(0)).set_axis(list(forms), axis=1), forms)
