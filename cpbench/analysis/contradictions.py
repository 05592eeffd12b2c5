"""Contradictions of a run: rows on one problem that cannot all be right: a solver is wrong, or the judge.

A claim that there is no solution beside a verified answer is found here. What answers say together is looked for by
the hook ``cross_examine`` of a package, as that of the laboratory, after a run.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.foundation.text import some_of
from cpbench.verification import MET_TOLERANCE, PROVEN

META = "contradictions"
"""Name under which results keep them among their facts."""
EXISTENCE = "existence"
"""The kind of a claim or a proof that there is no solution, beside a verified answer."""
LABELS = 4
"""The most solvers that a sentence names."""


@dataclass(frozen=True)
class Contradiction:
    """Rows on one problem of which some must be wrong.

    Attributes
    ----------
    kind : what contradicts what. rows : keys of the rows, labels : of the same rows.
    words : what is contradicted, in a sentence without the name of the problem.
    measured : the difference that was found, allowed : the largest that right rows may have; both without units, None
        where there is no number.
    arbitration : what a certificate says of it, '' where none was sought.
    """

    kind: str
    problem: str
    fingerprint: str
    rows: tuple[str, ...]
    labels: tuple[str, ...]
    words: str
    measured: float | None = None
    allowed: float | None = None
    arbitration: str = ""

    def __str__(self) -> str:
        return f"{self.problem}: {self.words}" + (f" Certificate: {self.arbitration}." if self.arbitration else "")


def of_results(meta: Mapping[str, Any], table: pd.DataFrame) -> list[Contradiction]:
    """Return the contradictions that results keep among their facts (`meta`), or those of claims where none were looked
    for; without those of rows that `table`, normalised, does not have."""
    contradictions = kept(meta) if META in meta else list(of_claims(table))
    keys = set(table["key"]) if contradictions else set()
    return [one for one in contradictions if keys.issuperset(one.rows)]


def kept(meta: Mapping[str, Any]) -> list[Contradiction]:
    """Return the contradictions among the facts of results."""
    return [
        Contradiction(**{**one, "rows": tuple(one["rows"]), "labels": tuple(one["labels"])})
        for one in meta.get(META) or ()
    ]


def of_claims(table: pd.DataFrame) -> Iterator[Contradiction]:
    """Yield a contradiction for each problem with a verified answer that a row says to have no solution; `table` is
    normalised.

    A claim counts as `table.contradicted` says, a proof beside every answer that meets the tolerance.
    """
    proved = table["status"].isin(PROVEN)
    facts = table[["key", "label", "fingerprint", "problem"]].assign(
        proved=proved, claim=table["claim"].where(~proved, table["status"])
    )
    deniers = facts[rows_of.contradicted(table) | proved]
    met = facts[table["status"].isin(MET_TOLERANCE) & facts["fingerprint"].isin(deniers["fingerprint"])]
    answered = dict(list(met.groupby("fingerprint", sort=False)))
    for fingerprint, rows in deniers.groupby("fingerprint", sort=False):
        if fingerprint not in answered:
            continue
        parts = [
            f"it is proved to be {what} (row of {named(answers['label'])})"
            if by_proof
            else f"{named(answers['label'])} claim{'s' if answers['label'].nunique() == 1 else ''} that it is {what}"
            for (by_proof, what), answers in rows.groupby(["proved", "claim"], sort=True)
        ]
        both = pd.concat([rows, answered[fingerprint]])
        labels = answered[fingerprint]["label"]
        have = "has" if labels.nunique() == 1 else "have"
        words = f"{' and '.join(parts)}; {named(labels)} {have} a verified answer."
        name = str(rows["problem"].iloc[0])
        yield Contradiction(EXISTENCE, name, str(fingerprint), tuple(both["key"]), tuple(both["label"]), words)


def named(labels: Iterable[str]) -> str:
    """Return the names of solvers, the first of many.

    >>> named(["b", "a", "b"]), named("abcdef")
    ('a and b', 'a, b, c, d and 2 more')
    """
    names = sorted(set(map(str, labels)))
    if 1 < len(names) <= LABELS:
        return f"{', '.join(names[:-1])} and {names[-1]}"
    return some_of(names, LABELS)


def involving(contradictions: Iterable[Contradiction], keys: Iterable[str]) -> list[Contradiction]:
    """Return the contradictions in which one of the rows has a part."""
    key_set = set(keys)
    return [one for one in contradictions if key_set.intersection(one.rows)]
