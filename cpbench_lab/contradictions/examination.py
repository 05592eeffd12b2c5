"""Cross-examination of a run: contradictions between its rows are looked for, and arbitrated by certificates."""

from __future__ import annotations

import importlib.util
import itertools
import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from cpbench import storage
from cpbench.analysis import contradictions
from cpbench.analysis import table as rows_of
from cpbench.analysis.contradictions import Contradiction
from cpbench.bench.results.rows import unpack_answer
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError
from cpbench.formulations.base import Problem
from cpbench.foundation.text import counted
from cpbench.verification import FALSE_CLAIMS, MET_TOLERANCE, VERIFIED
from cpbench_lab.contradictions.answers import COMPARED, Conflict, KeptAnswer, is_one_of, of_answers, suspicious

if TYPE_CHECKING:
    import pandas as pd

SECONDS = 20.0
"""Time for all certificates that arbitrate [s]."""
EACH = 4.0
"""Time for one of them [s]; one exact system may take longer."""
LARGEST = 1000
"""Numbers of the largest answer for which a certificate is sought: exact systems grow fast."""
ROWS = 2
"""The most rows of a contradiction for whose answers one is sought."""


def cross_examine(store: Store, rows: pd.DataFrame, say: Callable[[str], None]) -> list[Contradiction]:
    """Return the contradictions between all rows of a results file. Where python-flint is installed, certificates say
    who is right.

    Parameters
    ----------
    rows : the normalised rows of the store. say : takes a line for a reader: on a problem that could not be read again,
        and before certificates are sought.
    """
    examined = _Problems(store, say)
    conflicts = [*contradictions.of_claims(rows), *_of_answers(store, rows, examined)]
    if conflicts and importlib.util.find_spec("flint") is not None:
        say(f"{counted(len(conflicts), 'contradiction')}: certificates are sought for at most {SECONDS:g} s")
        conflicts = _arbitrated(store, conflicts, rows, examined)
    examined.report()
    return conflicts


class _Problems:
    """The problems of a results file, read again from their files; the last one is kept."""

    def __init__(self, store: Store, say: Callable[[str], None]) -> None:
        self._formats: Mapping[str, str] = store.meta().get("formats", {})
        self._say = say
        self._last: tuple[str, Problem | None] = ("", None)
        self._gone: list[str] = []

    def get(self, address: str, fingerprint: str) -> Problem | None:
        """Return a problem; None, with a line that says why, where its file is gone or holds another."""
        if self._last[0] != fingerprint:
            self._last = fingerprint, self._read(address, fingerprint)
        return self._last[1]

    def _read(self, address: str, fingerprint: str) -> Problem | None:
        try:
            problem = storage.load(address, format=self._formats.get(address))
        except CpbenchError as cause:
            self._gone.append(str(cause))
            return None
        if problem.fingerprint == fingerprint:
            return problem
        self._gone.append(f"{address}: is not the problem that was solved any more")
        return None

    def report(self) -> None:
        """Say how many problems could not be read again, and the reason of the first."""
        if self._gone:
            more = f" ({counted(len(self._gone), 'problem')} in all)" if len(self._gone) > 1 else ""
            self._say(f"answers are not compared: {self._gone[0]}{more}")


def _of_answers(store: Store, rows: pd.DataFrame, problems: _Problems) -> Iterator[Contradiction]:
    """Yield what kept answers contradict; a problem is read only where answers differ, or verdicts on the same."""
    metadata: Mapping[str, Mapping[str, Any]] = store.meta().get("solvers") or {}
    found = _compared(rows).sort_values("fingerprint", kind="stable")
    chosen = found[
        ["fingerprint", "node", "problem", "address", "key", "label", "status", "error", "tolerance", "parts"]
    ]
    for fingerprint, group in itertools.groupby(chosen.itertuples(index=False), key=lambda row: row.fingerprint):
        own = list(group)
        answers = list(_answers(store, own, metadata))
        if not suspicious(own[0].node, answers):
            continue
        problem = problems.get(own[0].address, fingerprint)
        if problem is not None:
            yield from (replace(one, problem=own[0].problem) for one in of_answers(problem, answers))


def _compared(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows whose answers are compared: two or more of a problem, verified or rejected as false claims, by
    the verdict of cpbench and exact routes; only verified ones where something is known of solutions of the node."""
    verified = table["status"].isin(VERIFIED)
    chosen = (verified | table["status"].isin(FALSE_CLAIMS)) & (table["measure"] == "") & rows_of.exact(table)
    rows = table[chosen]
    groups = rows["fingerprint"].groupby(rows["fingerprint"])
    rejected = (~verified[rows.index]).groupby(rows["fingerprint"]).transform("any")
    known = [node for node in rows["node"].unique() if is_one_of(node, COMPARED)]
    return rows[(groups.transform("size") > 1) & (rejected | rows["node"].isin(known))]


def _answers(store: Store, own: Sequence[Any], metadata: Mapping[str, Mapping[str, Any]]) -> Iterator[KeptAnswer]:
    for row in own:
        blob = store.ending(row.key)[1]
        if blob is not None:
            method = str(metadata.get(row.label, {}).get("method", ""))
            objective = json.loads(row.parts or "{}").get("objective")
            vector = unpack_answer(blob)
            yield KeptAnswer(row.key, row.label, row.status, row.error, row.tolerance, method, vector, objective)


def _arbitrated(
    store: Store, found: Sequence[Contradiction], rows: pd.DataFrame, problems: _Problems
) -> list[Contradiction]:
    """Return the contradictions with what certificates of their answers say, those of small answers first, as far as
    the time goes; verified answers before those of solvers that say that there is none."""
    end = time.perf_counter() + SECONDS
    addresses = dict(zip(rows["fingerprint"], rows["address"], strict=True))
    met = set(rows["key"][rows["status"].isin(MET_TOLERANCE)])
    answers = [
        [
            (label, store.ending(key)[1])
            for key, label in sorted(zip(c.rows, c.labels, strict=True), key=lambda row: row[0] not in met)
        ]
        for c in found
    ]
    kept = [[(label, blob) for label, blob in own if blob is not None] for own in answers]
    arbitrated = list(found)
    for place in sorted(range(len(found)), key=lambda place: max((len(blob) for _, blob in kept[place]), default=0)):
        one = found[place]
        words = "none was sought, the time was over"
        if not kept[place]:
            words = "none was sought, no answer is kept"
        elif time.perf_counter() < end:
            problem = problems.get(str(addresses[one.fingerprint]), one.fingerprint)
            words = "" if problem is None else _arbitration(problem, one.kind, kept[place], end)
        arbitrated[place] = replace(one, arbitration=words)
    return arbitrated


def _arbitration(problem: Problem, kind: str, answers: Sequence[tuple[str, bytes]], end: float) -> str:
    """Return what certificates say of the first answers, `end` the time at which no other is sought."""
    if sum(problem.point_sizes.values()) > LARGEST:
        return f"none was sought, the answer has more than {LARGEST} numbers"
    by_words: dict[str, list[str]] = {}
    for label, blob in answers[:ROWS]:
        left = end - time.perf_counter()
        if left <= 0:
            break
        there, words = _certified(problem, unpack_answer(blob), min(EACH, left))
        by_words.setdefault(words, []).append(label)
        if there and kind == Conflict.EXISTENCE:
            return f"{label}: {words}, so that there is a solution"
    return "; ".join(f"{contradictions.named(labels)}: {words}" for words, labels in by_words.items())


def _certified(problem: Problem, answer: Any, seconds: float) -> tuple[bool, str]:
    """Return whether a certificate proves that there is a solution, and what it says of an answer, in a few words."""
    from cpbench_lab.certifying import certify  # few runs have anything to arbitrate

    try:
        certificate = certify(problem, answer, seconds=seconds)
    except (CpbenchError, ArithmeticError, ValueError) as cause:
        return False, f"no certificate ({cause})"
    if certificate and math.isfinite(certificate.distance):
        only = f", the only one ({certificate.unique})" if certificate.unique else ""
        return True, f"a solution{only} is at most {certificate.distance:.2g} away"
    if certificate.level == "refuted":
        return False, "there is no solution"
    return False, f"nothing is proved ({certificate.reason})" if certificate.reason else "nothing is proved"
