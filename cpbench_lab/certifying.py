"""Answers with a proof: certificates as the façade and its command make them."""

from __future__ import annotations

import importlib.util
import itertools
import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cpbench.api.problems import point_of, verify
from cpbench.api.solution import Solution
from cpbench.api.solving import solve
from cpbench.errors import CpbenchError
from cpbench.formulations.base import Point, Problem
from cpbench.verification import PROVEN
from cpbench_lab.certificate_text import summary

if TYPE_CHECKING:
    from cpbench.bench.results.store import Store
    from cpbench_lab.certificates.certificate import Certificate

SECONDS = 60.0
"""Time for the search of a proof [s]."""
ROW_SECONDS = 10.0
"""The same for each answer of a run [s]."""
TOLERANCE = 1e-8
"""Tolerance of a solver where no answer is given: active sets are read off what it returns."""
FINER, ACCEPTED = 1e-10, 1e-6
"""Tolerance of the solvers after the automatic choice, and the one that an answer has to meet, in error and in distance
from a proved solution."""
SOLVE_SECONDS = 20.0
"""Time for each of them [s]."""
METHODS = (
    "dual active set", "active set", "pivoting", "Josephy-Newton", "semismooth Newton", "Newton with pivoting",
)  # fmt: skip
"""Methods of which answers are looked at first."""


def certify(
    problem: Problem,
    answer: Solution | Point | Sequence[float] | None = None,
    *,
    seconds: float = SECONDS,
    tolerance: float = ACCEPTED,
) -> Certificate:
    """Look for a proof that an answer is a solution of the problem, or that the problem has none.

    Parameters
    ----------
    answer : a point, a vector of shape (n,) with the parts of a point one after the other, or a solution; None: of the
        verified answers of several methods (`verified_answers`) the first that is proved or enclosed, or a proof that
        there is no solution.
    seconds : limit of the search [s]; one exact system may take longer.
    tolerance : distance from a proved solution, over its size, up to which the answer is that solution.

    Returns
    -------
    Certificate : its `level` is `proved`, `enclosed`, `stationary`, `distant`, `refuted` or `measured` for an answer,
        `infeasible` or `unbounded` for a problem without a solution; its `reason` says what stops a proof. It is true
        in a condition where the answer is proved or enclosed, or that there is no solution.

    Raises CpbenchError without python-flint, or where no solver has an answer; PointError when `answer` is none.

    >>> import cpbench
    >>> lcp = cpbench.LCP(M=[[2.0, 1.0], [1.0, 2.0]], q=[-5.0, -6.0])
    >>> proved = cpbench.certify(lcp, [1.33, 2.33], tolerance=0.01)
    >>> proved.level, proved.unique, round(proved.distance, 6)
    ('proved', 'P-matrix', 0.001429)
    >>> cpbench.certify(lcp, [1.33, 2.33]).level
    'distant'
    """
    require_flint()
    from cpbench_lab.certificates.certify import certify as certified

    if answer is not None:
        return certified(problem, point_of(problem, answer), seconds, tolerance)
    return certify_first(problem, seconds, tolerance)[1]


def certify_first(
    problem: Problem, seconds: float = SECONDS, tolerance: float = ACCEPTED
) -> tuple[Solution | Point | None, Certificate]:
    """Return the first answer that is proved or enclosed, with its certificate, or else the exact solution near one,
    rounded; without a verified answer, or where the first is stationary in a program that has no least value, the proof
    that there is no solution; else the first answer. `seconds` : limit of all searches together [s].

    Of polyhedral problems the active set of each answer is tried as it is, before any is changed by pivots.

    Raises CpbenchError where no solver has an answer.
    """
    require_flint()
    from cpbench_lab.certificates.certify import at_solution
    from cpbench_lab.certificates.certify import certify as certified
    from cpbench_lab.certificates.mixed import POLYHEDRAL
    from cpbench_lab.certificates.no_solution import without_solution

    deadline, polyhedral = time.perf_counter() + seconds, problem.node in POLYHEDRAL

    def left() -> float:
        return max(deadline - time.perf_counter(), 1.0)

    answers = list[Solution]()
    first: tuple[Solution, Certificate] | None = None
    for pivots in (False, True) if polyhedral else (True,):
        for solution in answers if pivots and polyhedral else _answers(problem, deadline):
            if first is not None and time.perf_counter() > deadline:
                break
            if not pivots:
                answers.append(solution)
            elif not _verified(solution):
                continue
            if not first and "stationary" in solution.verdict.flags:
                none = without_solution(problem, left(), tolerance)
                if none is not None:
                    return solution, none
            certificate = certified(problem, point_of(problem, solution), left(), tolerance, pivots=pivots)
            if certificate or certificate.level == "stationary":
                return solution, certificate
            if certificate.exact is not None and polyhedral:
                return at_solution(problem, certificate)
            if _verified(solution):
                first = first or (solution, certificate)
    if first is not None:
        return first
    none = without_solution(problem, left(), tolerance)
    if none is not None:
        return None, none
    given = solve(problem, tolerance=TOLERANCE)
    return given, certify(problem, given, seconds=seconds, tolerance=tolerance)


def _answers(problem: Problem, deadline: float) -> Iterator[Solution]:
    """Yield answers by the automatic choice, at 1e-8, 1e-6 and 1e-10, then by each solver; none of a problem that the
    first solve proves to have no solution.

    Solvers are those of the formulation that the automatic choice was found in, which are here; METHODS come first,
    which end at a basis or at the zero of an active set's system, from which a proof is read most easily. `deadline` :
    of `time.perf_counter` [s].
    """
    from cpbench.solvers.base import solvers

    given = _answer(problem, None, TOLERANCE, deadline)
    if given is not None and given.status in PROVEN:
        return
    names: list[tuple[str | None, float]] = [(None, FINER)] if _verified(given) else [(None, ACCEPTED), (None, FINER)]
    node = problem.node if given is None or given.solver not in solvers else solvers.get(given.solver).spec.node
    specs = [solver.spec for solver in solvers if solver.spec.node == node and solver.availability().ok]
    exact = [spec for spec in specs if spec.by_default and spec.kind.exact]
    exact.sort(key=lambda spec: METHODS.index(spec.method) if spec.method in METHODS else len(METHODS))
    asked = (*names, *((spec.name, FINER) for spec in exact))
    for answer in itertools.chain([given], (_answer(problem, *one, deadline) for one in asked)):
        if answer is not None and answer.point is not None and answer.point.finite:
            yield answer


def _answer(problem: Problem, solver: str | None, tolerance: float, deadline: float) -> Solution | None:
    seconds = min(SOLVE_SECONDS, deadline - time.perf_counter())
    if seconds <= 0.0:
        return None
    try:
        return solve(problem, solver, tolerance=tolerance, seconds=seconds)
    except CpbenchError:
        return None


def _verified(found: Solution | None) -> Solution | None:
    if found is None or found.point is None:
        return None
    return found if verify(found.problem, found, tolerance=ACCEPTED).within else None


def require_flint() -> None:
    """Raise CpbenchError without python-flint."""
    if importlib.util.find_spec("flint") is None:
        raise CpbenchError("certificates need python-flint: pip install 'cpbench[certify]'")


def certify_rows(store: Store, seconds: float = ROW_SECONDS) -> Iterator[str]:
    """Look for certificates of all kept answers of a results file that have none yet; yields a line for each. Rows get
    the level and the distance.

    The file is open for writing. `seconds` : limit of each search [s].

    Raises CpbenchError without python-flint, or where a problem's file has changed since the run.
    """
    from cpbench import storage
    from cpbench.bench.results.rows import unpack_answer

    formats = store.meta().get("formats", {})
    loaded: tuple[str, Problem] | None = None
    for row in sorted(store.rows(), key=lambda row: row.address):
        blob = store.ending(row.key)[1] if row.certainty is None else None
        if blob is None:
            continue
        if loaded is None or loaded[0] != row.address:
            loaded = row.address, storage.load(row.address, format=formats.get(row.address))
        problem = loaded[1]
        if problem.fingerprint != row.fingerprint:
            raise CpbenchError(f"{row.address}: is not the problem that was solved (its fingerprint changed)")
        found = certify(problem, unpack_answer(blob), seconds=seconds, tolerance=float(row.tolerance))
        distance = found.distance if math.isfinite(found.distance) else None
        store.note_certificate(row.key, found.level, distance, summary(found))
        yield f"{row.problem}  {row.label}: {found.level}" + ("" if distance is None else f", within {distance:.2g}")


def save_certificate(certificate: Certificate, problem: Problem, path: str | Path, *, force: bool = False) -> None:
    """Write a certificate with its problem's data; raises FormatError where the file exists (unless `force`)."""
    from cpbench_lab.certificates.certificate import save

    save(path, certificate, problem, force=force)
