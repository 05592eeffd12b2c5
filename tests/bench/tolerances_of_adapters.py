"""What every installed adapter is asked for and what its answer reaches, in three units:

    python tests/bench/tolerances_of_adapters.py [SOLVER ...]

A planted case of the solver's formulation, its rows in units of 1e-6, 1 and 1e6. Errors are the judge's; a second one
is that of the answer for which the package is asked once more, where its first claim misses.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator

from cpbench.solvers.base import Budget, Solver, solvers
from cpbench.solvers.stopping import second_tolerance
from cpbench.testing import cases
from cpbench.testing.cases import Case
from cpbench.testing.checks_of_tolerances import UNITS, in_units
from cpbench.verification import judge

ASKED, SECONDS = 1e-6, 10.0


def main(names: list[str]) -> None:
    print("solver | unit | is asked for | claim, error | second claim, error")
    print("--- | --- | --- | --- | ---")
    for solver in solvers:
        named = not names or solver.spec.name in names
        if named and solver.stopping(ASKED) is not None and solver.availability().ok:
            for unit, case in zip(UNITS, in_units(solver, cases(solver.spec.node), UNITS), strict=False):
                print(f"{solver.spec.name} | {unit:g} | {' | '.join(_row(solver, case))}", flush=True)


def _row(solver: Solver, case: Case) -> Iterator[str]:
    """Yield the cells of an adapter and a case."""
    stopping = solver.stopping(ASKED, case.problem)
    assert stopping is not None
    yield ", ".join(f"{name} {value:.1e}" for name, value in stopping.settings.items())
    claim, error = _solve(solver, case, ASKED)
    yield f"{claim} {error:.1e}"
    smaller = second_tolerance(solver.stopping, ASKED, claim, error)
    yield "" if smaller is None else "{} {:.1e}".format(*_solve(solver, case, smaller))


def _solve(solver: Solver, case: Case, tolerance: float) -> tuple[str, float]:
    """Return a claim and the judged error of the answer, ∞ without one."""
    try:
        output = solver.run(case.problem, Budget(tolerance=tolerance, seconds=SECONDS))
    except Exception as error:  # a process that ends, or a package that raises
        return type(error).__name__, math.inf
    return str(output.claim), math.inf if output.point is None else judge(case.problem, output.point, ASKED).error


if __name__ == "__main__":
    main(sys.argv[1:])
