"""The solvers that are registered, by formulation."""

from __future__ import annotations

from cpbench.formulations.base import formulations
from cpbench.solvers.base import SolverSpec, solvers


def list_solvers(node: str | None = None, *, available: bool = True) -> list[SolverSpec]:
    """Return the solvers of a formulation, or of all, by name.

    Parameters
    ----------
    node : formulation (`cpbench list formulations`). available : whether those are left out whose packages are not
        installed here; nothing is imported to see.

    Raises UnknownName on an unknown formulation.

    >>> import cpbench
    >>> "lemke" in [spec.name for spec in cpbench.list_solvers("lcp")]
    True
    """
    from cpbench.bench import checkup

    if node is not None:
        formulations.get(node)
    chosen = [solver for solver in solvers if node in (None, solver.spec.node)]
    return [solver.spec for solver in chosen if not available or checkup.glance(solver).usable]
