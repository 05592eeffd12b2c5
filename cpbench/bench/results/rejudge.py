"""Judges kept answers again, and checks kept proofs: by another measure or tolerance, without a solver."""

from __future__ import annotations

import itertools
import math
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from cpbench import proofs, storage, verification
from cpbench.bench.results import answers
from cpbench.bench.results.answer_files import ENDINGS
from cpbench.bench.results.rows import Row
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError, FormatError, PointError, SealError
from cpbench.formulations.base import Kind, Problem
from cpbench.foundation.plurals import counted

NO_ROUTE = ("", "direct")
"""Routes of an answer made elsewhere, and of a solver of the source problem itself."""


def rejudge_file(path: str | Path, measure: str | None, tolerance: float | None) -> Iterator[str]:
    """Yield one line for every row that is not as a run wrote it and every kept answer or proof whose status changes,
    then a summary. The file is left as it is.

    Raises SealError at the end when there was such a row, an answer that cannot be read,
    or a status that changes by the row's own measure and tolerance.
    """
    with Store(path) as store:
        audit = store.audit()
        yield from (f"not as a run wrote it: {row}" for row in audit.broken)
        yield from (f"{path}: {what}, by another program" for what in audit.changed)
        yield from store.meta().get("seals", [])
        kept = {key: (kind, data) for key, kind, data in store.certificates()}
        formats = store.meta().get("formats", {})
        rows = sorted(store.rows(), key=lambda row: row.address)  # each problem is read once
        changes: Counter[str] = Counter()
        total = unknown = contradicted = unreadable = gone = 0
        for address, group in itertools.groupby(rows, key=lambda row: row.address):
            own, problem, why = list(group), None, "its numbers changed"
            try:
                problem = storage.load(address, format=formats.get(address))
            except FormatError as cause:
                why = str(cause)
            if problem is None or problem.fingerprint not in {row.fingerprint for row in own}:
                gone += 1
                yield f"{address}: is not the problem that was solved ({why}): its {counted(len(own), 'row')} stay"
                continue
            for row in own:
                if problem.fingerprint != row.fingerprint:  # the file held another problem when this row was made
                    continue
                blob = store.ending(row.key)[1]
                if row.status in ENDINGS:  # it came too late, or was reported to: its quality does not matter
                    continue
                if blob is None and row.status not in verification.PROVEN:
                    continue
                try:
                    status, error = _judge(problem, row, blob, kept.get(row.key), measure, tolerance)
                except (zlib.error, ValueError, PointError) as cause:
                    unreadable += 1
                    yield f"{row.problem}  {row.label}: its answer cannot be read ({cause})"
                    continue
                total += 1
                unknown += status in verification.FALSE_CLAIMS and _target(row, 1.0) is None and _exact_route(row)
                if status != row.status:
                    contradicted += tolerance in (None, row.tolerance) and measure in (None, row.measure)
                    changes[f"{row.status} -> {status}"] += 1
                    yield f"{row.problem}  {row.label}: {row.status} -> {status}, error {error:.3g}"
        if unknown:
            yield (
                f"{unknown} of these are {' or '.join(verification.FALSE_CLAIMS)} and came by a conversion of an older "
                "cpbench, which did not measure them on the solver's own problem: the conversion may have lost them"
            )
        listed = ", ".join(f"{n} {change}" for change, n in changes.most_common()) or "no change"
        yield f"{counted(total, 'answer')} judged again{f' by {measure}' if measure else ''}: {listed}"
        faults = {
            f"{len(audit.broken)} rows are not as a run wrote them": len(audit.broken),
            "; ".join(audit.changed): len(audit.changed),
            f"{unreadable} answers cannot be read": unreadable,
            f"{counted(gone, 'problem')} could not be judged again": gone,
            f"{contradicted} statuses change by the row's own measure and tolerance": contradicted,
        }
        if any(faults.values()):
            raise SealError(f"{path}: {', '.join(fault for fault, count in faults.items() if count)}")


def _judge(
    problem: Problem,
    row: Row,
    blob: bytes | None,
    proof: tuple[str, bytes] | None,
    measure: str | None,
    tolerance: float | None,
) -> tuple[str, float]:
    """Return status and error of a kept answer or proof; by the row's own measure and tolerance where none is given."""
    if problem.fingerprint != row.fingerprint:
        raise CpbenchError(f"{row.address}: is not the problem that was solved (its fingerprint changed)")
    asked = tolerance or float(row.tolerance)
    verdict = verification.no_answer(asked)
    if blob is not None:
        point = problem.point_from_vector(answers.unpack(blob))
        verdict = verification.judge(problem, point, asked, measure or row.measure)
    kind, target = Kind(row.kind or Kind.EQUIVALENT), _target(row, asked / float(row.tolerance))
    proven = {f"proven_{one}": _proven(problem, row, one, proof, asked) for one in verification.PROVEN}
    return verification.status(verdict, str(row.claim), kind=kind, target=target, **proven), verdict.error


def _target(row: Row, factor: float) -> verification.Verdict | None:
    """Return what was measured on the solver's own problem, at `factor` times the tolerance that it was asked for.

    None where that was not measured, or where it is the problem that was asked, whose verdict says all.
    """
    error, asked = row.target_error, row.target_tolerance
    if error is None or row.route in NO_ROUTE:
        return None
    tolerance = factor * float(row.tolerance if asked is None else asked)  # an older cpbench measured at the former
    error = math.inf if math.isnan(error) else float(error)
    flags = ("unresolvable",) if verification.TARGET_UNRESOLVABLE in (row.flags or "").split(",") else ()
    return verification.Verdict(tolerance, error <= tolerance and not flags, error, flags=flags)


def _exact_route(row: Row) -> bool:
    """Return whether an exact conversion led to the solver's problem."""
    return (row.route or "") not in NO_ROUTE and Kind(row.kind).exact


def _proven(problem: Problem, row: Row, kind: str, kept: tuple[str, bytes] | None, tolerance: float) -> bool:
    """Return whether the row has this status and its proof holds at the tolerance; one is looked for where an older
    file kept none."""
    if row.status != kind:
        return False
    if kept is None:
        return proofs.prove(problem, kind, tolerance=tolerance).proof is not None
    try:
        proof = proofs.unpacked(*kept)
    except ValueError:
        return False
    return proof.kind == kind and proofs.holds(problem, proof, tolerance)
