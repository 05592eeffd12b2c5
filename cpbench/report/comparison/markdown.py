"""A comparison as the summary of a CI job: the verdict in the first line, then what regressed and how to see it."""

from __future__ import annotations

from typing import Any

import pandas as pd

from cpbench.analysis.comparison import Comparison, PairVerdict
from cpbench.analysis.comparison.noise import BIAS
from cpbench.report.comparison import words
from cpbench.report.templating import Table, rendered
from cpbench.report.text import counted, cut, listed, plain

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
    undecided = comparison.with_verdict(PairVerdict.INCONCLUSIVE)
    by_time = undecided["gate"] == "time"
    single = undecided.loc[by_time, "label_new"].value_counts().sort_index().to_dict()
    return rendered(
        "comparison.md.j2",
        {
            "comparison": comparison,
            "words": words,
            "mark": MARKS[comparison.verdict],
            "regressed": _pairs(comparison, PairVerdict.REGRESSED),
            "improved": _pairs(comparison, PairVerdict.IMPROVED),
            "inconclusive": _pairs(comparison, PairVerdict.INCONCLUSIVE),
            "suites": _suites(comparison),
            "timed": any(suite.timed for suite in comparison.suites),
            "bias": f"{BIAS:.0%}",
            "single": single,
            "single_labels": [f"{label} {count}" for label, count in single.items()],
            "notes": _notes(comparison),
        },
    )


def _pairs(comparison: Comparison, verdict: PairVerdict) -> dict[str, Any]:
    """Return the pairs of a verdict, after the labels whose times have it: their table, how many there are, and how
    many are not shown. Pairs that their time alone leaves open are not among them."""
    pairs = comparison.with_verdict(verdict)
    labels = [suite for suite in comparison.suites if suite.time == verdict]
    if verdict == PairVerdict.INCONCLUSIVE:
        pairs, labels = pairs[pairs["gate"] != "time"], []
    forms = {"problem": "text", "solver": "code", "kind": "text", "what happened": "text"}
    if verdict == PairVerdict.REGRESSED:
        forms["again with"] = "code"
    rows: list[list[str]] = []
    for suite in labels:
        slowest = words.again(comparison, words.slowest(comparison, suite.label)) if suite.time else ""
        what = f"{words.times_of(suite)} times the time"
        rows.append([f"all {suite.timed} timed", suite.label, "time", what, slowest][: len(forms)])
    for _, pair in pairs.head(LISTED).iterrows():
        cells = [pair["problem"], _label(pair), pair["kind"], cut(pair["why"]), words.again(comparison, pair)]
        rows.append(cells[: len(forms)])
    counts = [counted(len(pairs), "pair")] * bool(len(pairs)) + [counted(len(labels), "label")] * bool(labels)
    return {"table": Table.of(forms, rows), "counts": ", ".join(counts), "more": max(0, len(pairs) - LISTED)}


def _suites(comparison: Comparison) -> Table:
    names = ("pairs", "solved", *map(str, words.ORDER), "time, new / base", "timed")
    forms = {"solver": "code", **dict.fromkeys(names, "cell"), "verdict on time": "text"}
    return Table.of(
        forms,
        (
            [
                suite.label,
                suite.pairs,
                f"{suite.solved_base} → {suite.solved_new}",
                *(suite.counts[verdict] for verdict in words.ORDER),
                words.times_of(suite),
                f"{suite.timed} ({counted(suite.families, 'family', 'families')})" if suite.timed else "—",
                words.on_time(suite),
            ]
            for suite in comparison.suites
        ),
    )


def _notes(comparison: Comparison) -> list[str]:
    notes = [plain(cut(note, 400)) for note in comparison.notes]
    for pairs, side in ((comparison.only_base, "base"), (comparison.only_new, "new")):
        if len(pairs):
            names = sorted({f"{p}, {label}" for p, label in zip(pairs["problem"], pairs["label"], strict=True)})
            notes.append(f"only in {side} ({len(pairs)}): {listed(names)}")
    return notes


def _label(pair: pd.Series) -> str:
    if pair["label_base"] == pair["label_new"]:
        return str(pair["label_new"])
    return f"{pair['label_base']} → {pair['label_new']}"
