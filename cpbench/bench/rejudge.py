"""Judging kept answers again: another measure or tolerance, no solver."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from cpbench import storage, verification
from cpbench.bench.referee import unblob
from cpbench.bench.store import Store
from cpbench.errors import CpbenchError
from cpbench.formulations.base import Problem


def rejudge_file(path: str | Path, measure: str | None, tolerance: float | None) -> Iterator[str]:
    """One line for every kept answer whose status changes, then a summary. The file is left as it is."""
    store = Store(path)
    try:
        formats = store.meta().get("formats", {})
        loaded: dict[str, Problem] = {}
        changes: Counter[str] = Counter()
        total = 0
        for key, blob in store.answers():
            row = store.row(key)
            if row["status"] == "timeout":  # it came too late, whatever it is worth
                continue
            address = str(row["address"])
            if address not in loaded:
                problem = storage.load(address, format=formats.get(address))
                if problem.fingerprint != row["fingerprint"]:
                    raise CpbenchError(f"{address}: is not the problem that was solved (its fingerprint changed)")
                loaded = {address: problem}
            problem = loaded[address]
            asked = tolerance or float(row["tolerance"])
            verdict = verification.judge(problem, problem.point_from_vector(unblob(blob)), asked, measure)
            status = verification.status(verdict, str(row["claim"]), proven_infeasible=row["status"] == "infeasible")
            total += 1
            if status != row["status"]:
                changes[f"{row['status']} -> {status}"] += 1
                yield f"{row['problem']}  {row['label']}: {row['status']} -> {status}, error {verdict.error:.3g}"
        listed = ", ".join(f"{n} {change}" for change, n in changes.most_common()) or "no change"
        yield f"{total} answers judged again{f' by {measure}' if measure else ''}: {listed}"
    finally:
        store.close()
