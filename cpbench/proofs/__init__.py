"""Proofs that a problem has no solution, or no least objective, in rational arithmetic; knows no solver."""

from cpbench.proofs.certificates import (
    SECONDS,
    Infeasible,
    Proof,
    ProofAttempt,
    Unbounded,
    certified_infeasible,
    holds,
    packed,
    prove,
    unpacked,
)
from cpbench.proofs.polyhedra import conditions, objective

__all__ = [
    "SECONDS",
    "Infeasible",
    "Proof",
    "ProofAttempt",
    "Unbounded",
    "certified_infeasible",
    "conditions",
    "holds",
    "objective",
    "packed",
    "prove",
    "unpacked",
]
