"""The sections of a report about one group: a formulation at one tolerance, start and number of threads."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from cpbench.analysis import bootstrap, cautions, failures, means, pairwise, profiles, reliability, summary
from cpbench.analysis import table as rows_of
from cpbench.analysis.table import ResultGroup
from cpbench.report import convergence, figures
from cpbench.report.matrix import legend, matrix
from cpbench.report.mean_sections import below_floor, gap_section, mean_section
from cpbench.report.run import Run, each
from cpbench.report.text import code, counted, listed, number, plain, seconds, table
from cpbench.verification import BESIDE

MATRIX_PROBLEMS = 60
"""The most problems of a formulation for which the matrix is printed."""


def slug_of(run: Run, group: ResultGroup) -> str:
    """Return the group's part of names of files: its formulation, with its settings where some formulation has
    several.
    """
    slug = re.sub(r"[^a-z0-9]+", "-", group.node.lower()).strip("-") or "problems"
    if len(run.parts) == run.rows["node"].nunique():
        return slug
    settings = (f"{group.tolerance:g}", group.start, str(group.threads), group.set, group.measure)
    return "-".join([slug, *(re.sub(r"[^a-z0-9.-]+", "-", part.lower()) for part in settings if part)])


def group_sections(run: Run, group: ResultGroup, rows: pd.DataFrame) -> Iterator[str]:
    """Yield all of them, in order; figures go into the folder of the run."""
    problems = rows["fingerprint"].nunique()
    compared = rows_of.only_ranked(rows)
    times, lost = rows_of.times(compared), rows_of.lost(compared)
    most = rows_of.limit(rows)
    counts = summary.solve_counts(rows, means.charge(times, means.LIMIT, most))
    labels = [str(label) for label in counts["label"]]
    sizes = ", ".join(
        f"{plain(k)} {a}" if a == b else f"{plain(k)} {a} to {b}" for k, (a, b) in summary.size_ranges(rows).items()
    )
    yield (
        f"{counted(problems, 'problem')}{f' ({sizes})' if sizes else ''}, "
        f"{counted(len(labels), 'solver configuration')}, {counted(len(rows), 'pair')}."
    )
    notes = cautions.footnotes(rows, run.meta.get("solvers") or {})
    yield from _times(counts, times, problems, notes)
    if len(times.columns):
        ranked = [label for label in labels if label in times.columns]
        leading = profiles.performance_profile(times, lost=lost).leading(figures.EMPHASISED)
        yield from mean_section(times, lost, bootstrap.families_of(rows), most, ranked, leading)
        yield from gap_section(times, lost, ranked, leading)
        yield from _figures(run, group, rows, times, lost)
    yield from _verdicts(rows, labels)
    yield from _beside(group, rows, labels)
    yield from _matrix(run, rows, labels, problems)
    yield from _families(rows)
    yield from _unsolved(rows)


def _times(
    counts: pd.DataFrame, times: pd.DataFrame, problems: int, notes: Sequence[cautions.Footnote]
) -> Iterator[str]:
    floor, short = seconds(profiles.FLOOR), below_floor(times)
    yield "### Solved and times"
    head = ["solver", "route", "solved", "lost", "stationary", "ran", "false claims", "fastest"]
    head += ["median of solved", "p95", "p99", "slowdown of solved", f"below {floor}"]
    yield table(
        head,
        (
            [
                code(r.label) + cautions.marks(r.label, notes),
                f"**{r.kind}**" if r.kind in figures.INEXACT else r.kind or "—",
                str(r.solved),
                str(r.lost),
                str(r.stationary),
                str(r.ran),
                str(r.false),
                str(r.fastest) if r.ranked else "—",
                seconds(r.median),
                seconds(r.p95),
                seconds(r.p99),
                number(r.slowdown),
                short.get(r.label, "—"),
            ]
            for r in each(counts)
        ),
        right=range(2, 13),
    )
    yield from (plain(f"{note.mark} {note.sentence}") for note in notes)
    yield (
        f"Ran: of the {counted(problems, 'problem')} those that the solver was started on; problems that it "
        "cannot handle are not counted. Lost: answers that a conversion lost. It is charged with them, and they are "
        "not among the problems of the solver in curves, means and intervals."
    )
    yield f"Slowdown: median ratio to the fastest solver of each problem; times below {floor} are set to {floor}."
    yield "p95, p99: the time within which 95 % and 99 % of all problems were solved; ∞ where fewer were."
    if not counts["ranked"].all():
        yield (
            "Labels with `@imported` name answers that were made elsewhere: they are judged here, their times are of "
            "another machine and are not ranked."
        )


def _figures(
    run: Run, group: ResultGroup, rows: pd.DataFrame, times: pd.DataFrame, lost: pd.DataFrame
) -> Iterator[str]:
    profile = profiles.performance_profile(times, lost=lost)
    kinds = rows_of.label_kinds(rows)
    slug = slug_of(run, group)
    most = rows_of.limit(rows)
    limit = f"limit {most:g} s" if math.isfinite(most) else "no limit"
    start = f", start {group.start}" if group.start else ""
    title = f"{group.node}: {counted(profile.problems, 'problem')}, tolerance {group.tolerance:g}{start}, {limit}"
    if profile.compares:
        yield "### Performance profile"
        name = f"profile-{slug}"
        figures.save(figures.profile_figure(profile, title, kinds, run.looks), run.folder, name)
        yield f"[![Performance profile, {plain(title)}]({name}.png)]({name}.svg)"
        marks = ", ".join(f"{mark} {kind}" for kind, mark in figures.MARKS.items())
        yield (
            f"*{figures.profile_guide(profile.problems)} Times below {seconds(profile.floor)} are set to that. "
            f"Dashed: routes that promise less than an answer ({marks}).*"
        )
    swapped = pairwise.reversals(times, profile.leading(figures.EMPHASISED))
    if swapped:
        yield "*Caution.* At τ = 2 these are in this order only because of the other solvers; pairwise, it reverses:"
        yield "\n".join(f"- {code(one)} is above {code(other)} here, below it pairwise" for one, other in swapped)
    yield from convergence.section(run, rows, title, f"errors-{slug}")


def _verdicts(rows: pd.DataFrame, labels: Sequence[str]) -> Iterator[str]:
    found, claims = summary.verdicts(rows), reliability.claims(rows)
    statuses = [str(status) for status in found.columns]

    def holding(label: str) -> str:
        share, low, high = (float(claims.at[label, column]) for column in ("correct", "low", "high"))
        return "—" if math.isnan(share) else f"{share:.0%} ({low:.0%} to {high:.0%})"

    yield "### Verdicts"
    yield table(
        ["solver", *(s.replace("_", " ") for s in statuses)],
        (
            [code(label), *(str(found.at[label, s]) if found.at[label, s] else "·" for s in statuses)]
            for label in labels
        ),
        right=range(1, 1 + len(statuses)),
    )
    yield "### Claims against verdicts"
    yield table(
        ["solver", "true claims", "false claims", "not claimed, solved", "neither", "claims that hold"],
        (
            [
                code(label),
                *(str(claims.at[label, c]) for c in ("true", "false", "modest", "honest")),
                holding(label),
            ]
            for label in labels
        ),
        right=range(1, 6),
    )
    yield (
        "Counted are the pairs where the solver came back within its limits. A claim is about the problem that the "
        "solver was given, and is held against what was measured there; a solver that drops a term has none."
    )


def _beside(group: ResultGroup, rows: pd.DataFrame, labels: Sequence[str]) -> Iterator[str]:
    """Yield how the errors of each solver's answers compare with what the field measures of them."""
    name = BESIDE.get(group.node, "")
    theirs = rows["parts"].map(lambda parts: json.loads(parts or "{}").get(name, math.nan)).astype(float)
    both = rows.assign(theirs=theirs)[theirs.notna() & np.isfinite(rows["error"])]
    if both.empty or group.measure:
        return
    passes = both.assign(ours=both["error"] <= group.tolerance, they=both["theirs"] <= group.tolerance)
    yield f"### Error and {code(name)}"
    yield table(
        [
            "solver",
            "answers",
            "median error",
            f"median {name}",
            "pass both",
            "pass the error only",
            f"pass {name} only",
        ],
        (
            [
                code(label),
                str(len(of)),
                number(of["error"].median()),
                number(of["theirs"].median()),
                *(str(int((of["ours"].eq(a) & of["they"].eq(b)).sum())) for a, b in ((1, 1), (1, 0), (0, 1))),
            ]
            for label in labels
            if len(of := passes[passes["label"] == label])
        ),
        right=range(1, 7),
    )
    yield f"The error gives the verdict; {code(name)} is the measure of others that is best known, and decides nothing."


def _matrix(run: Run, rows: pd.DataFrame, labels: Sequence[str], problems: int) -> Iterator[str]:
    yield "### Problem by solver"
    if problems > MATRIX_PROBLEMS:
        yield f"{problems} problems are too many for this page (at most {MATRIX_PROBLEMS}): see {run.all_rows}."
        return
    yield matrix(rows, labels)
    yield legend(rows)


def _families(rows: pd.DataFrame) -> Iterator[str]:
    families = summary.families(rows)
    if len(families) < 2:
        return
    yield "### By family"
    head = ["family", "problems", "solved by some", "pairs", "solved pairs", "most solved", "by"]
    yield table(
        head,
        (
            [
                plain(r.family) or "(none)",
                str(r.problems),
                str(r.some),
                str(r.pairs),
                str(r.solved),
                str(r.most),
                listed(r.best, 4) if r.best else "—",
            ]
            for r in each(families)
        ),
        right=range(1, 6),
    )


def _unsolved(rows: pd.DataFrame) -> Iterator[str]:
    unsolved = failures.unsolved(rows)
    if not len(unsolved):
        return
    yield "### Solved by none"
    yield table(
        ["problem", "least error", "by", "file"],
        (
            [
                plain(r.name) + (" (proven to have no solution)" if r.proven else ""),
                number(r.error),
                code(r.label) if math.isfinite(r.error) else "—",
                code(r.address),
            ]
            for r in each(unsolved)
        ),
        right=[1],
    )
