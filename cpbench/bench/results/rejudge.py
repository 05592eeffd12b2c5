"""Judges kept answers again, and checks kept proofs: without a solver, by their own or another measure or tolerance.

A row whose status or error does not follow from its answer was changed after the run, or the run judged wrongly.
"""

from __future__ import annotations

import itertools
import json
import math
import sys
import zlib
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from cpbench import proofs, storage, verification
from cpbench.bench.results.rows import Row, unpack_answer
from cpbench.bench.results.store import NOT_KEPT, Store
from cpbench.errors import FormatError, PointError
from cpbench.formulations.base import Kind, Problem
from cpbench.foundation.text import counted, summary

NO_ROUTE = ("", "direct")
"""Routes of a solver of the source problem itself."""
SAME = 1e-6
"""Relative difference of two measurements of one error: another machine adds in another order. An answer that was
changed, or is another row's, differs by much more."""
ROUNDING = 64 * sys.float_info.epsilon
"""Errors below this are nothing but rounding."""
OTHER_ERROR, UNREADABLE = "another error", "unreadable"
"""Changes that are none of a status."""


def rejudge_file(path: str | Path, measure: str | None, tolerance: float | None, say: Callable[[str], None]) -> bool:
    """Say in a line each which rows do not follow from their answer or proof, then a summary; return whether all do.

    The file is left as it is.

    Parameters
    ----------
    measure, tolerance : in place of each row's own, None for that. What changes by another one is said, and is no
        fault.
    """
    with Store(path) as store:
        store.require_whole()
        kept = {key: (kind, data) for key, kind, data in store.certificates() if kind in verification.PROVEN}
        meta = store.meta()
        formats, kept_all = meta.get("formats", {}), bool(meta.get("kept_all"))
        rows = sorted(store.rows(), key=lambda row: row.address)  # each problem is read once
        changes: Counter[str] = Counter()
        without: Counter[str] = Counter()
        total = faults = 0
        for address, group in itertools.groupby(rows, key=lambda row: row.address):
            own, problem, why = list(group), None, "its numbers changed"
            try:
                problem = storage.load(address, format=formats.get(address))
            except FormatError as cause:
                why = str(cause)
            if problem is None or problem.fingerprint not in {row.fingerprint for row in own}:
                faults += 1
                say(f"{address}: is not the problem that was solved ({why}): its {counted(len(own), 'row')} stay")
                continue
            for row in own:
                blob = store.ending(row.key)[1]
                if problem.fingerprint != row.fingerprint:  # the file held another problem when this row was made
                    without["of what its file held before"] += 1
                elif blob is None and row.key not in kept and not _needs_answer(row, kept_all):
                    without[row.status] += 1
                else:
                    as_run = tolerance in (None, row.tolerance) and measure in (None, row.measure)
                    total += 1
                    change, description = _change(problem, row, blob, kept.get(row.key), measure, tolerance)
                    if change and (as_run or change != OTHER_ERROR):
                        changes[change] += 1
                        faults += as_run or change == UNREADABLE
                        say(f"{row.problem}  {row.label}: {description}")
        listed = ", ".join(f"{n} {change}" for change, n in changes.most_common()) or "no change"
        say(f"{counted(total, 'answer')} judged again{f' by {measure}' if measure else ''}: {listed}")
        if without:
            say(f"{counted(without.total(), 'row has', 'rows have')} no answer to judge: {summary(without)}")
        say(f"SHA-256 of the file: {store.sha256()}")
    return not faults


def _needs_answer(row: Row, kept_all: bool) -> bool:
    """Return whether the status of a row has to follow from something kept; kept_all : whether every run into its file
    kept all answers."""
    dropped = not kept_all or NOT_KEPT in (row.message or "")
    return row.status in verification.PROVEN or (row.status in verification.MET_TOLERANCE and not dropped)


def _change(
    problem: Problem,
    row: Row,
    blob: bytes | None,
    proof: tuple[str, bytes] | None,
    measure: str | None,
    tolerance: float | None,
) -> tuple[str, str]:
    """Return what of a row does not follow from what is kept of it, short and in full; '' where all does."""
    try:
        status, error = _judge(problem, row, blob, proof, measure, tolerance)
        same_status = status == row.status or _ended_so(row, blob)
        noted = math.inf if row.error is None else float(row.error)
    except (zlib.error, EOFError, ValueError, TypeError, PointError) as cause:  # bytes, or numbers, may be anything
        return UNREADABLE, f"it or its answer cannot be read ({cause})"
    if not same_status:
        change = f"{row.status} -> {status}"
        return change, f"{change}, error {error:.3g}"
    if noted == error or math.isclose(noted, error, rel_tol=SAME, abs_tol=ROUNDING):
        return "", ""
    return OTHER_ERROR, f"{row.status} with error {noted:.7g}, that of its answer is {error:.7g}"


def _judge(
    problem: Problem,
    row: Row,
    blob: bytes | None,
    proof: tuple[str, bytes] | None,
    measure: str | None,
    tolerance: float | None,
) -> tuple[str, float]:
    """Return status and error of a kept answer or proof; by the row's own measure and tolerance where none is given."""
    wanted = tolerance or float(row.tolerance)
    verdict = verification.no_answer(wanted)
    if blob is not None:
        point = problem.point_from_vector(unpack_answer(blob))
        verdict = verification.judge(problem, point, wanted, measure or row.measure)
    kind, target = Kind(row.kind or Kind.EQUIVALENT), _target(row, wanted / float(row.tolerance))
    proven = {f"proven_{one}": _proven(problem, one, proof, wanted) for one in verification.PROVEN}
    status = verification.status(verdict, str(row.claim), kind=kind, target=target, **proven)
    return str(status), math.inf if math.isnan(verdict.error) else verdict.error


def _ended_so(row: Row, blob: bytes | None) -> bool:
    """Return whether a row has an answer, and a status without a claim all the same: an answer that came too late."""
    if blob is None or row.status != verification.Status.TIMEOUT:
        return False
    seconds = [*json.loads(row.samples or "[]"), row.solve or 0.0]
    return (row.setup or 0.0) + max(seconds) > row.seconds


def _target(row: Row, factor: float) -> verification.Verdict | None:
    """Return what was measured on the solver's own problem, at `factor` times the tolerance that it was asked for.

    None where that was not measured, or where it is the problem that was asked, whose verdict says all.
    """
    error, target_tolerance = row.target_error, row.target_tolerance
    if error is None or target_tolerance is None or row.route in NO_ROUTE:
        return None
    tolerance = factor * float(target_tolerance)
    error = math.inf if math.isnan(error) else float(error)
    flags = ("unresolvable",) if verification.TARGET_UNRESOLVABLE in (row.flags or "").split(",") else ()
    return verification.Verdict(tolerance, error <= tolerance and not flags, error, flags=flags)


def _proven(problem: Problem, kind: str, kept: tuple[str, bytes] | None, tolerance: float) -> bool:
    """Return whether there is a proof of this kind that holds at the tolerance."""
    if kept is None or kept[0] != kind:
        return False
    try:
        proof = proofs.unpacked(*kept)
    except ValueError:
        return False
    return proof.kind == kind and proofs.holds(problem, proof, tolerance)
