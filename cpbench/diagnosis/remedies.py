"""Other solvers for a problem that one has failed on: the automatic choice, then other methods."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from cpbench.diagnosis.case import FailedTrial, Remedy
from cpbench.solvers.base import Solver, solvers
from cpbench.solvers.native.automatic import automatic_solvers

NATIVE = "cpbench.solvers.native."


def others(case: FailedTrial) -> Iterator[Remedy]:
    """Yield trials by other solvers, by exact conversions, first the automatic choice of the problem's formulation.

    Then follow our solvers of that formulation, and of the failed solver's, one of each method but the one that failed.
    """
    failed = case.solver.spec
    chosen = automatic_solvers(case.problem.node).get(case.problem.node)
    methods = {failed.method, "automatic choice"}
    if chosen is not None and chosen != failed.name:
        yield _remedy(case, solvers.get(chosen))
    for node in dict.fromkeys((case.problem.node, failed.node)):
        for solver in solvers:
            spec = solver.spec
            own = type(solver).__module__.startswith(NATIVE) and spec.node == node and spec.kind.exact
            if own and spec.by_default and spec.method not in methods:
                methods.add(spec.method)
                yield _remedy(case, solver)


def _remedy(case: FailedTrial, solver: Solver) -> Remedy:
    trial = replace(case.trial, solver=solver.spec.name, via=())
    return Remedy(text=f"{solver.spec.name} ({solver.spec.method})", trial=trial)
