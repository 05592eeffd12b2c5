"""Judges a solver's answer: lifts it, measures it on the source problem, and gives it a status."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from cpbench import graph, proofs, verification
from cpbench.errors import PointError
from cpbench.formulations.base import Kind, Point, Problem
from cpbench.formulations.programs import QP

PROOF_SECONDS = 20.0
"""Longest search, in seconds, for a proof that the problem has no solution."""
PACKAGE = Path(__file__).resolve().parents[1]
TABLES = PACKAGE / "problems/optima.csv", PACKAGE.parent / "reports/optima/table.csv"
"""Proved optima in an installed package, and in a checkout (`cpbench certify --all` writes such a table)."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """The worth of an answer.

    Attributes
    ----------
    status : of the pair. point : the answer to the problem that was asked, None where there is none.
    verdict : on that problem. target : on the solver's own problem, None where that is not known.
    message : why there is no answer, or no proof. proof : that there is no solution, where one was found.
    lift, verify : seconds.
    """

    status: verification.Status
    point: Point | None
    verdict: verification.Verdict
    target: verification.Verdict | None = None
    message: str = ""
    proof: proofs.Proof | None = None
    lift: float = 0.0
    verify: float = 0.0

    @property
    def flags(self) -> list[str]:
        """Flags of the verdict, and whether rounding decides on the solver's own problem."""
        beyond = self.target is not None and self.target is not self.verdict and "unresolvable" in self.target.flags
        return [*self.verdict.flags, *([verification.TARGET_UNRESOLVABLE] if beyond else [])]


def judge_answer(
    source: Problem,
    converted: Problem,
    steps: int,
    answer: Mapping[str, Any] | None,
    *,
    tolerance: float,
    claim: str,
    kind: Kind = Kind.EQUIVALENT,
    promise: Kind = Kind.EQUIVALENT,
    measure: str | None = None,
    prove: Callable[[str], proofs.ProofAttempt | None] = lambda _: None,
) -> Judgement:
    """Lift an answer to `converted` by its last `steps` conversions and measure it on `source`.

    It is measured on the solver's own problem too: an error there is the solver's, any further error the route's. A
    solver whose `promise` is less than exact drops a term, so that its own problem is not known here.

    Parameters
    ----------
    answer : the vectors of the point by name, None where the solver has none. claim : a `solvers.Claim` value.
    kind : the promise of the route. prove : looks for a proof that a claim of no solution is right; called with the
        claim where the answer fails, and with `unbounded` where it is stationary in a program that is not convex.
    """
    lifted = verified = 0.0
    point: Point | None = None
    message = ""
    verdict, target = verification.no_answer(tolerance), None
    if answer is not None:
        try:
            begun = time.perf_counter()  # the check of the answer's shape is part of the lift
            own_point = converted.point_type(**answer)
            converted.check_point(own_point)
            point = graph.lift(converted, own_point, steps)
            between = time.perf_counter()
            verdict = verification.judge(source, point, tolerance, measure)
            lifted, verified = between - begun, time.perf_counter() - between
            verdict = with_others(verdict, source, point)
            if promise.exact:
                wanted = graph.tolerance(converted, tolerance, steps)
                target = verification.judge(converted, own_point, wanted) if steps else verdict
        except (PointError, TypeError) as refusal:
            message, point = f"the answer is not valid: {refusal}", None
    attempt = None
    if verdict.within and not verdict.solved:  # a stationary point
        attempt = prove(verification.Status.UNBOUNDED)
        attempt = attempt if attempt and attempt.proof else None  # the solver claimed nothing of the kind
    elif not verdict.within:
        attempt = prove(claim)
    proof = attempt.proof if attempt else None
    status = verification.status(
        verdict,
        claim,
        kind=max(kind, promise, key=lambda kind: kind.rank),
        target=target,
        proven_infeasible=proof is not None and proof.kind == verification.Status.INFEASIBLE,
        proven_unbounded=proof is not None and proof.kind == verification.Status.UNBOUNDED,
    )
    return Judgement(
        verification.Status.ERROR if message else status,
        point,
        verdict,
        target,
        message or (attempt.message if attempt else ""),
        proof,
        lifted,
        verified,
    )


def with_others(verdict: verification.Verdict, problem: Problem, point: Any) -> verification.Verdict:
    """Return the verdict with the number of others that reports print beside its error, which decides nothing."""
    return replace(verdict, parts={**verdict.parts, **verification.beside(problem, point)}) if point.finite else verdict


def optimality_gap(problem: Problem, point: Any) -> dict[str, float]:
    """Return how far the objective of an answer is from the proved optimal value, over the size of that where it is
    above 1, by name; nothing where none is proved. A problem is known by its fingerprint, which takes longer than to
    judge a small one: `run` has it, and `solve` does not ask."""
    if not (isinstance(problem, QP) and point is not None and point.finite and problem.fingerprint in proved_optima()):
        return {}
    low, high = proved_optima()[problem.fingerprint]
    with np.errstate(all="ignore"):
        value = problem.objective(point.z)
    gap = max(low - value, value - high, 0.0) / max(1.0, abs(low))
    return {verification.OPTIMALITY_GAP: gap if math.isfinite(value) else math.inf}


@cache
def proved_optima() -> Mapping[str, tuple[float, float]]:
    """Return doubles around the proved optimal value of quadratic programs by fingerprint, without the constant that a
    file may have; empty where neither of TABLES is there."""
    for table in filter(Path.is_file, TABLES):
        with table.open(newline="", encoding="utf-8") as file:
            rows = [row for row in csv.DictReader(file) if row["bare_low"] and row["convex"]]
        return {row["fingerprint"]: (float(row["bare_low"]), float(row["bare_high"])) for row in rows}
    return {}


def look_for_proof(
    prove: Callable[[str, Any, float], proofs.ProofAttempt],
    direct: bool,
    claim: str,
    certificate: Any,
    seconds: float,
) -> proofs.ProofAttempt | None:
    """Look for a proof of a claim that the source problem has no solution; None without such a claim.

    A certificate holds for the solver's own problem: that of a converted one (not `direct`) is about other data. Nor
    is the claim the same there: the optimality conditions of an unbounded program are infeasible.

    Parameters
    ----------
    prove : takes the kind of claim, a certificate or None, and seconds.
    """
    kind = claim if claim in verification.PROVEN or certificate is None else str(verification.Status.INFEASIBLE)
    if kind not in verification.PROVEN:
        return None
    if direct:
        return prove(kind, certificate, seconds)
    attempts = [prove(kind, None, seconds / 2)]
    if attempts[0].proof is None:
        attempts += [prove(other, None, seconds / 2) for other in verification.PROVEN if other != kind]
    return attempts[-1] if attempts[-1].proof is not None else attempts[0]
