"""The automatic choice of a formulation: by its name, which is `auto-NODE`."""

from __future__ import annotations

from cpbench.formulations.base import formulations
from cpbench.solvers.base import solvers


def automatic_solver(node: str) -> str | None:
    """Return the name of the automatic choice of a formulation, None where it has none; modules of other solvers are
    not imported."""
    name = f"auto-{node}"
    return name if solvers.knows(name) else None


def automatic_solvers() -> dict[str, str]:
    """Return the automatic choice of each formulation that has one, by formulation."""
    found = ((node, automatic_solver(node)) for node in formulations.names())
    return {node: name for node, name in found if name is not None}
