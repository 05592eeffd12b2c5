"""Judging kept answers again: another measure or tolerance, no solver."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from cpbench import storage, verification
from cpbench.bench.results import answers
from cpbench.bench.results.answer_files import ENDINGS
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError
from cpbench.formulations.base import Problem


def rejudge_file(path: str | Path, measure: str | None, tolerance: float | None) -> Iterator[str]:
    """One line for every kept answer whose status changes, then a summary. The file is left as it is."""
    with Store(path) as store:
        formats = store.meta().get("formats", {})
        rows = sorted(store.rows(), key=lambda row: row["address"])  # each problem is read once
        changes: Counter[str] = Counter()
        total = 0
        for address, group in itertools.groupby(rows, key=lambda row: row["address"]):
            problem: Problem | None = None
            for row in group:
                blob = store.ending(row["key"])[1]
                if (
                    blob is None or row["status"] in ENDINGS
                ):  # that came too late, or so it was told: whatever its worth
                    continue
                problem = problem or storage.load(address, format=formats.get(address))
                status, error = _judge(problem, row, blob, measure, tolerance)
                total += 1
                if status != row["status"]:
                    changes[f"{row['status']} -> {status}"] += 1
                    yield f"{row['problem']}  {row['label']}: {row['status']} -> {status}, error {error:.3g}"
        listed = ", ".join(f"{n} {change}" for change, n in changes.most_common()) or "no change"
        yield f"{total} answers judged again{f' by {measure}' if measure else ''}: {listed}"


def _judge(
    problem: Problem, row: Mapping[str, Any], blob: bytes, measure: str | None, tolerance: float | None
) -> tuple[str, float]:
    """Status and error of a kept answer; by the row's own measure and tolerance where none is given."""
    if problem.fingerprint != row["fingerprint"]:
        raise CpbenchError(f"{row['address']}: is not the problem that was solved (its fingerprint changed)")
    point = problem.point_from_vector(answers.unpack(blob))
    verdict = verification.judge(problem, point, tolerance or float(row["tolerance"]), measure or row["measure"])
    proven = row["status"] == "infeasible"
    return verification.status(verdict, str(row["claim"]), proven_infeasible=proven), verdict.error
