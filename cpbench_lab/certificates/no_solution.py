"""Certificates of problems without a solution: infeasible ones, and programs without a least value."""

from __future__ import annotations

import time

import numpy as np

from cpbench import proofs
from cpbench.formulations.base import Problem
from cpbench.proofs.margins import contradiction, optimality
from cpbench.proofs.part_sizes import Sizes
from cpbench_lab.certificates.certificate import INFEASIBLE, TOLERANCE, UNBOUNDED, Certificate


def without_solution(
    problem: Problem, seconds: float = proofs.SECONDS, tolerance: float = TOLERANCE
) -> Certificate | None:
    """Look for a proof that the problem is infeasible or unbounded, for about so many seconds; None without.

    The evidence is the proof, as `proofs.packed` writes it, by how much `sides` and `bounds` change at a margin of 1
    besides their own size, and R (`reach`), up to which solutions are excluded then (`cpbench.proofs.margins`).
    """
    began = time.perf_counter()
    for kind in (INFEASIBLE, UNBOUNDED):
        attempt = proofs.prove(problem, kind, seconds=seconds / 2, tolerance=tolerance)
        if attempt.proof is not None:
            sizes = _sizes(problem, attempt.proof)
            evidence = {
                "proof": np.frombuffer(proofs.packed(attempt.proof), dtype=np.uint8),
                "sides": sizes.rows,
                "bounds": sizes.unknowns,
                "reach": sizes.reach,
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


def _sizes(problem: Problem, proof: proofs.Proof) -> Sizes:
    """Return the sizes in which the margin of a proof is measured: those of the conditions, or of those of optimality;
    none of a ray along which the objective curves down."""
    known, goal = proofs.conditions(problem), proofs.objective(problem)
    if known is not None and isinstance(proof, proofs.Infeasible):
        return known.sizes
    if known is not None and goal is not None and isinstance(proof, proofs.Unbounded):
        optimal = optimality(known, goal)
        if contradiction(optimal, proof.ray) > 0:
            return optimal.sizes
    return Sizes(*[np.zeros(0)] * 3)
