"""Contradictions of a run: rows on one problem that cannot all be right: a solver is wrong, or the judge.

A run has many answers to one problem, and what they say together is more than each verdict by itself. What rows alone
say is here; what answers say, in `contradicted_answers`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.formulations import AVI, LCP, MLCP, QP
from cpbench.formulations.base import Problem, formulations
from cpbench.formulations.coneqp import ConeQP
from cpbench.formulations.relay import Relay
from cpbench.foundation.plurals import some_of
from cpbench.verification import FALSE_CLAIMS, MET_TOLERANCE, PROVEN, VERIFIED

META = "contradictions"
"""Name under which results keep them among their facts."""
LABELS = 4
"""The most solvers that a sentence names."""
PROGRAMS = (QP, ConeQP)
"""Formulations with a quadratic objective."""
COMPARED = (*PROGRAMS, LCP, MLCP, Relay, AVI)
"""Formulations of which verified answers are compared with each other."""


class Conflict(StrEnum):
    """Kinds of contradictions."""

    EXISTENCE = "existence"
    """A claim or a proof that there is no solution, beside a verified answer."""
    OBJECTIVE = "objective"
    """Verified answers of a convex program with different objectives."""
    SOLUTION = "solution"
    """Different verified answers of a problem that has one solution."""
    VERDICT = "verdict"
    """Answers that are the same to rounding, with different verdicts; or all rejected, though methods agree on them."""


@dataclass(frozen=True)
class Contradiction:
    """Rows on one problem of which some must be wrong.

    Attributes
    ----------
    kind : what contradicts what (`Conflict`). rows : keys of the rows, labels : of the same rows.
    words : what is contradicted, in a sentence without the name of the problem.
    measured : the difference that was found, allowed : the largest that right rows may have; both without units, NaN
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


def as_data(found: Iterable[Contradiction]) -> list[dict[str, Any]]:
    """Return contradictions as the results keep them."""
    return [asdict(one) for one in found]


def of_results(meta: Mapping[str, Any], table: pd.DataFrame) -> list[Contradiction]:
    """Return the contradictions that results keep among their facts (`meta`); of results of an older cpbench, which
    did not look for them, those of claims alone.

    Parameters
    ----------
    table : the rows, normalised. Contradictions of rows that it does not have are left out.
    """
    if META not in meta:
        return list(of_claims(table))
    found = kept(meta)
    keys = set(table["key"]) if found else set()
    return [one for one in found if keys.issuperset(one.rows)]


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
    claims = table["claim"].where(~proved, table["status"])
    deniers = table[rows_of.contradicted(table) | proved]
    met = table[table["status"].isin(MET_TOLERANCE) & table["fingerprint"].isin(deniers["fingerprint"].unique())]
    answered = dict(list(met.groupby("fingerprint", sort=False)))
    for fingerprint, rows in deniers.groupby("fingerprint", sort=False):
        if fingerprint not in answered:
            continue
        with_answer = answered[fingerprint]
        parts = [
            f"it is proved to be {what} (row of {named(own['label'])})"
            if by_proof
            else f"{named(own['label'])} claim{'s' if own['label'].nunique() == 1 else ''} that it is {what}"
            for (by_proof, what), own in rows.groupby([proved[rows.index], claims[rows.index]], sort=True)
        ]
        have = "has" if with_answer["label"].nunique() == 1 else "have"
        words = f"{' and '.join(parts)}; {named(with_answer['label'])} {have} a verified answer."
        both = pd.concat([rows, with_answer])
        yield Contradiction(
            kind=str(Conflict.EXISTENCE),
            problem=str(rows["problem"].iloc[0]),
            fingerprint=str(fingerprint),
            rows=tuple(map(str, both["key"])),
            labels=tuple(map(str, both["label"])),
            words=words,
        )


def compared(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows whose answers are compared: two or more of a problem, verified or rejected as false claims, by
    the verdict of cpbench and exact routes; only verified ones where something is known of solutions of the node."""
    verified = table["status"].isin(VERIFIED)
    chosen = (verified | table["status"].isin(FALSE_CLAIMS)) & (table["measure"] == "") & rows_of.exact(table)
    rows = table[chosen]
    groups = rows["fingerprint"].groupby(rows["fingerprint"])
    rejected = (~verified[rows.index]).groupby(rows["fingerprint"]).transform("any")
    known = [node for node in rows["node"].unique() if is_one_of(node, COMPARED)]
    return rows[(groups.transform("size") > 1) & (rejected | rows["node"].isin(known))]


def is_one_of(node: str, classes: tuple[type[Problem], ...]) -> bool:
    """Return whether a node is a formulation of these, or a plugin's that derives from one."""
    return node in formulations and issubclass(formulations.get(node), classes)


def named(labels: Iterable[str]) -> str:
    """Return the names of solvers, the first of many.

    >>> named(["b", "a", "b"]), named("abcdef")
    ('a and b', 'a, b, c, d and 2 more')
    """
    names = sorted(set(map(str, labels)))
    if 1 < len(names) <= LABELS:
        return f"{', '.join(names[:-1])} and {names[-1]}"
    return some_of(names, LABELS)


def involving(found: Iterable[Contradiction], keys: Iterable[str]) -> list[Contradiction]:
    """Return the contradictions in which one of the rows has a part."""
    known = set(keys)
    return [one for one in found if known.intersection(one.rows)]
