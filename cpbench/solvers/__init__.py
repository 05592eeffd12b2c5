"""Solvers: native ones (`native`, hot loops in `kernels`) and third-party packages (`adapters`)."""

from cpbench.solvers.base import (
    Availability,
    Budget,
    Claim,
    NoOptions,
    Record,
    Solver,
    SolverOutput,
    SolverSpec,
    Trait,
    parse_options,
    register,
    solvers,
)

__all__ = [
    "Availability",
    "Budget",
    "Claim",
    "NoOptions",
    "Record",
    "Solver",
    "SolverOutput",
    "SolverSpec",
    "Trait",
    "parse_options",
    "register",
    "solvers",
]
