"""The base of all solvers, their registry, and programs as solvers (`external`)."""

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
