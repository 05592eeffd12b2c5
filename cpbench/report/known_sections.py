"""Known limitations of a run, in brief: claims and false claims, lost answers, failures by kind."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from cpbench.analysis import failures, participation, reliability
from cpbench.analysis.failures import Reason
from cpbench.report.claims_section import claims_section
from cpbench.report.details import WHOLE_RUN
from cpbench.report.imported_section import imported
from cpbench.report.run import Run
from cpbench.report.run_sections import again, false_claims, refused, warm_against_cold
from cpbench.report.text import code, counted, cut, listed, number, plain, table
from cpbench.verification import Status

LISTED = 8
"""The most lines of a list; the details have more."""


def known_sections(run: Run) -> Iterator[str]:
    """Yield all sections, in order; empty ones are left out, but for false claims and failures."""
    yield from claims_section(run)
    yield from false_claims(run, LISTED)
    yield from _remarks(run)
    yield from warm_against_cold(run, LISTED)
    yield from imported(run)
    yield from _failures(run)
    yield from _never_started(run)
    yield from refused(run, LISTED)


def _remarks(run: Run) -> Iterator[str]:
    """Yield a line each on directions, on what conversions lost, and on routes that promise less than an answer."""
    sentences: list[str] = []
    wrong = failures.flagged(run.rows, "direction")
    if len(wrong):
        labels = _most_first(wrong["label"])
        sentences.append(
            f"**Accepted, but in a wrong direction ({len(wrong)})**: these answers meet the tolerance, and yet some "
            f"contact slips in a direction that the law forbids: {listed(labels, 4)}."
        )
    lost = reliability.losses(run.rows)
    if len(lost):
        first = ", ".join(f"{code(r.route)} {r.lost}" for r in lost.head(4).itertuples(index=False))
        sentences.append(
            f"**Lost on the way back ({lost['lost'].sum()})**: the solver met its target, and the answer that the "
            f"conversion carried back does not meet the tolerance; no solver is charged: {first}."
        )
    inexact = reliability.inexact_routes(run.rows)
    if len(inexact):
        sentences.append(
            f"**Routes that promise less than an answer**: {listed([str(label) for label in inexact['label']], 4)} "
            f"solved {inexact['solved'].sum()} and missed {inexact['missed'].sum()} problems; largest error "
            f"{number(float(inexact['largest'].max()))}."
        )
    if sentences:
        yield "## Answers to be careful with"
        yield "\n".join(f"- {line}" for line in sentences)


def _failures(run: Run) -> Iterator[str]:
    yield "## Failures by kind"
    if not run.failures:
        yield "Every pair that was started was solved."
        return
    yield "The message and the command are those of the most frequent reason of a kind."
    yield table(
        ["outcome", "pairs", "solvers", "most frequent message", "its first pair again"],
        (_kind(run, status, own) for status, own in _by_status(run.failures).items()),
        right=[1],
    )


def _by_status(reasons: list[Reason]) -> dict[str, list[Reason]]:
    reasons_of: dict[str, list[Reason]] = {}
    for reason in reasons:
        reasons_of.setdefault(reason.status, []).append(reason)
    return reasons_of


def _kind(run: Run, status: str, own: list[Reason]) -> list[str]:
    labels: dict[str, int] = {}
    for reason in own:
        for label, count in reason.labels.items():
            labels[label] = labels.get(label, 0) + count
    first = max(own, key=lambda reason: reason.count)
    ordered = sorted(labels, key=lambda label: (-labels[label], label))
    return [
        status.replace("_", " "),
        str(sum(labels.values())),
        listed([f"{label} {labels[label]}" for label in ordered], 3),
        plain(cut(first.message, 120)) or "—",
        code(again(run, first.example)),
    ]


def _never_started(run: Run) -> Iterator[str]:
    """Yield what could not be run, in a line a reason; it counts against no solver."""
    lines: list[str] = []
    for one in participation.absences(run.rows):
        why = cut((one.detail.strip().splitlines() or ["no reason was given"])[-1], 160)
        lines.append(f"- {one.state or 'unavailable'}: {listed(list(one.solvers), 6)}: {plain(why)}")
    refusals = [reason for reason in run.refusals if reason.status != Status.NOT_RUN]
    for reason in sorted(refusals, key=lambda reason: -reason.count):
        solvers = listed(list(reason.labels), 3)
        lines.append(f"- {reason.status}: {counted(reason.count, 'pair')} of {solvers}: {plain(cut(reason.message))}")
    lines += [f"- {plain(line)}" for line in participation.left_out_lines(run.meta.get("left_out") or [])]
    if not lines:
        return
    yield "## Could not be run"
    yield "\n".join(lines[: 2 * LISTED])
    if len(lines) > 2 * LISTED:
        yield f"{len(lines) - 2 * LISTED} more reasons are in [{WHOLE_RUN}]({WHOLE_RUN})."


def _most_first(labels: pd.Series[str]) -> list[str]:
    counts = labels.value_counts()
    return [str(label) for label in sorted(counts.index, key=lambda label: (-int(counts[label]), str(label)))]
