"""Certificates of problems without a solution: infeasible ones, and programs without a least value."""

from __future__ import annotations

import time

import numpy as np

from cpbench import proofs
from cpbench.formulations.base import Problem
from cpbench_lab.certificates.certificate import INFEASIBLE, TOLERANCE, UNBOUNDED, Certificate


def without_solution(
    problem: Problem, seconds: float = proofs.SECONDS, tolerance: float = TOLERANCE
) -> Certificate | None:
    """Look for a proof that the problem is infeasible or unbounded, for about so many seconds; None without.

    The evidence is the proof, as `proofs.packed` writes it, and R, up to which unknowns of problems within the
    margin of this one are excluded (`cpbench.proofs.margins`).
    """
    began = time.perf_counter()
    for kind in (INFEASIBLE, UNBOUNDED):
        attempt = proofs.prove(problem, kind, seconds=seconds / 2, tolerance=tolerance)
        if attempt.proof is not None:
            evidence = {
                "proof": np.frombuffer(proofs.packed(attempt.proof), dtype=np.uint8),
                "reach": proofs.reach(problem, attempt.proof),
            }
            return Certificate(
                problem.node,
                problem.fingerprint,
                kind,
                np.zeros(0),
                evidence=evidence,
                seconds=time.perf_counter() - began,
                tolerance=tolerance,
                margin=attempt.margin,
            )
    return None
