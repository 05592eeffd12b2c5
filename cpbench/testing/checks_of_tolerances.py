"""Checks of what an adapter makes of a tolerance: `Solver.stopping`, and what it is worth in other units."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

from cpbench.errors import Ended
from cpbench.formulations import Kind
from cpbench.solvers.base import Budget, Claim, Solver
from cpbench.solvers.external.session import ProgramError
from cpbench.solvers.stopping import Stopping
from cpbench.testing import Case, only_for
from cpbench.testing.equivalents import in_unit
from cpbench.verification import judge

ASKED = (1e-2, 1e-4, 1e-6, 1e-8)
UNITS = (1e-6, 1.0, 1e6)
TOLERANCE = 1e-6
SECONDS = 60.0
"""Limit of a case that takes far less."""
SLACK = 1.001
"""A claim at the tolerance may be rounded; nothing beyond that."""


def check_tolerances_are_no_looser(solver: Solver, cases: list[Case]) -> None:
    """Check that no value that a package is asked for is looser than its default or than the tolerance, that a smaller
    tolerance never loosens one, and that none depends on where a problem starts."""
    only_for(solver.stopping(TOLERANCE) is not None, "adapters, whose packages have tests of their own")
    for problem in (None, *(case.problem for case in cases)):
        asked = [(tolerance, _stopping(solver, tolerance, problem)) for tolerance in ASKED]
        for tolerance, one in asked:
            assert one.test, "what the package compares is not said"
            assert one.factor == 1.0 or one.differs, f"factor {one.factor:g}, and not said why"
            assert one.settings.keys() == one.defaults.keys(), f"{[*one.settings]}, defaults {[*one.defaults]}"
            for name, value in one.settings.items():
                most = min(tolerance, one.defaults[name])
                assert 0.0 <= value <= most, f"{name} = {value:g} for {tolerance:g}, at most {most:g}"
        for (_, before), (tolerance, after) in pairwise(asked):
            for name, value in after.settings.items():
                assert value <= before.settings[name], f"{name} grows where the tolerance falls to {tolerance:g}"
        if problem is not None and hasattr(problem, "start"):
            elsewhere = dataclasses.replace(problem, start=problem.start + 1e3)
            assert _stopping(solver, TOLERANCE, elsewhere).settings == _stopping(solver, TOLERANCE, problem).settings


def check_claims_hold_in_other_units(solver: Solver, cases: list[Case], units: Sequence[float] = UNITS) -> None:
    """Check that an answer that is claimed to be solved misses the tolerance, as the judge measures it, by no more than
    the adapter declares."""
    only_for(solver.stopping(TOLERANCE) is not None, "adapters, whose packages have tests of their own")
    only_for(solver.spec.kind is not Kind.RELAXATION, "solvers of the whole law")
    taken = list(in_units(solver, cases, units))
    only_for(bool(taken), "solvers that take a planted case in every unit")
    for case in taken:
        try:
            output = solver.run(case.problem, Budget(tolerance=TOLERANCE, seconds=SECONDS))
        except (Ended, ProgramError):  # a process that ends has claimed nothing
            continue
        if output.claim is Claim.SOLVED:
            most = SLACK * TOLERANCE * _stopping(solver, TOLERANCE, case.problem).factor
            error = math.inf if output.point is None else judge(case.problem, output.point, TOLERANCE).error
            assert error <= most, f"{case.name}: claims solved, error {error:.1e}, at most {most:.1e} is declared"


def in_units(solver: Solver, cases: list[Case], units: Sequence[float]) -> Iterator[Case]:
    """Yield the first case that a solver takes and does not excuse, and that 0 does not solve, in other units."""
    for case in cases:
        zero = judge(case.problem, case.problem.zero_point(), TOLERANCE).within
        if zero or f"case-{case.name}" in solver.spec.known_failures:
            continue
        scaled = [in_unit(case, unit) for unit in units]
        taken = [one for one in scaled if one is not None and solver.obstacle(one.problem) is None]
        if len(taken) == len(units):
            yield from taken
            return


def _stopping(solver: Solver, tolerance: float, problem: Any) -> Stopping:
    result = solver.stopping(tolerance, problem)
    assert result is not None
    return result
