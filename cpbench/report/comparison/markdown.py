"""A comparison as the summary of a CI job: the verdict in the first line, then what regressed and how to see it."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from cpbench.analysis.comparison import Comparison, PairVerdict
from cpbench.analysis.comparison.noise import BIAS
from cpbench.report.comparison import words
from cpbench.report.text import code, counted, cut, listed, plain, table

MARKS = {
    PairVerdict.REGRESSED: "❌",
    PairVerdict.INCONCLUSIVE: "❔",
    PairVerdict.SAME: "✅",
    PairVerdict.IMPROVED: "✅",
}
LISTED = 50
"""The most pairs of a table; a summary of a CI job holds 1 MiB. The rest is counted, and is in the JSON."""


def document(comparison: Comparison) -> str:
    """Write the whole summary."""
    return "\n\n".join(_parts(comparison)) + "\n"


def section(comparison: Comparison) -> Iterator[str]:
    """Yield the summary as a section of a report about the new side."""
    yield f"## Compared with {code(comparison.base.name)}"
    for part in _parts(comparison):
        yield f"#{part}" if part.startswith("## ") else part


def _parts(comparison: Comparison) -> Iterator[str]:
    verdict = f"{MARKS[comparison.verdict]} {str(comparison.verdict).capitalize()}"
    yield f"**{verdict}**: {plain(words.headline(comparison))}."
    yield f"{code(comparison.base.name)} → {code(comparison.new.name)}" + "".join(
        f"; {plain(version)}" for version in words.versions(comparison)
    )
    yield from _section(comparison, PairVerdict.REGRESSED, comparison.with_verdict(PairVerdict.REGRESSED))
    yield from _suites(comparison)
    yield from _section(comparison, PairVerdict.IMPROVED, comparison.with_verdict(PairVerdict.IMPROVED))
    yield from _inconclusive(comparison)
    yield from _notes(comparison)


def _section(comparison: Comparison, verdict: PairVerdict, own: pd.DataFrame) -> Iterator[str]:
    """Yield pairs of a verdict, after the labels whose times have it."""
    labels = [suite for suite in comparison.suites if suite.time == verdict and verdict != PairVerdict.INCONCLUSIVE]
    if not len(own) and not labels:
        return
    counts = [counted(len(own), "pair")] * bool(len(own)) + [counted(len(labels), "label")] * bool(labels)
    yield f"## {str(verdict).capitalize()} ({', '.join(counts)})"
    regressed = verdict == PairVerdict.REGRESSED
    rows: list[list[str]] = []
    for suite in labels:
        cells = [f"all {suite.timed} timed", code(suite.label), "time", f"{words.times_of(suite)} times the time"]
        rows.append(
            [*cells, code(words.again(comparison, words.slowest(comparison, suite.label)))] if regressed else cells
        )
    for _, pair in own.head(LISTED).iterrows():
        cells = [plain(pair["problem"]), code(_label(pair)), plain(pair["kind"]) or "—", plain(cut(pair["why"]))]
        rows.append([*cells, code(words.again(comparison, pair))] if regressed else cells)
    yield table(["problem", "solver", "kind", "what happened", *(["again with"] if regressed else [])], rows)
    if len(own) > LISTED:
        yield f"Not shown: {counted(len(own) - LISTED, 'more pair')}."


def _suites(comparison: Comparison) -> Iterator[str]:
    yield "## By solver"
    yield table(
        ["solver", "pairs", "solved", "regressed", "improved", "same", "inconclusive", "time, new / base", "timed",
         "p", "verdict on time"],
        (
            [
                code(suite.label),
                str(suite.pairs),
                f"{suite.solved_base} → {suite.solved_new}",
                *(str(suite.counts[v]) for v in words.ORDER),
                words.times_of(suite),
                f"{suite.timed} ({counted(suite.families, 'family', 'families')})" if suite.timed else "—",
                f"{suite.p:.2g}" if suite.timed else "—",
                plain(words.on_time(suite)),
            ]
            for suite in comparison.suites
        ),
        right=range(1, 10),
    )  # fmt: skip
    if any(suite.timed for suite in comparison.suites):
        yield (
            "*Time*: geometric mean over the pairs that both sides solved, with a 95 % interval that resamples "
            f"families; {plain(words.margin(comparison))}. *Regressed* or *improved*: p < "
            f"{comparison.settings.alpha:g} "
            "(Wilcoxon's test, and a normal one with the bias of a process; adjusted after Holm), the interval "
            "excludes 1, and the mean is beyond 1 + δ. *Same*: the interval lies within the margin of 1. One worker "
            f"process differs from another by about {BIAS:.0%} on all its problems, which no repetition within a run "
            "shows: a smaller δ would be the process's."
        )


def _inconclusive(comparison: Comparison) -> Iterator[str]:
    own = comparison.with_verdict(PairVerdict.INCONCLUSIVE)
    by_time = own["gate"] == "time"
    yield from _section(comparison, PairVerdict.INCONCLUSIVE, own[~by_time])
    if by_time.any():
        labels = own.loc[by_time, "label_new"].value_counts().sort_index()
        yield (
            f"Times of {counted(int(by_time.sum()), 'single pair')} decide nothing by themselves, and are judged "
            f"together above: {listed([f'{label} {count}' for label, count in labels.items()])}."
        )


def _notes(comparison: Comparison) -> Iterator[str]:
    missing: list[str] = []
    for own, side in ((comparison.only_base, "base"), (comparison.only_new, "new")):
        if len(own):
            names = sorted({f"{p}, {label}" for p, label in zip(own["problem"], own["label"], strict=True)})
            missing.append(f"- only in {side} ({len(own)}): {listed(names)}")
    notes = [f"- {plain(cut(note, 400))}" for note in comparison.notes]
    if notes or missing:
        yield "## Notes"
        yield "\n".join([*notes, *missing])


def _label(pair: pd.Series) -> str:
    if pair["label_base"] == pair["label_new"]:
        return str(pair["label_new"])
    return f"{pair['label_base']} → {pair['label_new']}"
