"""Contact problems solved as micp, cp, vi, qvi and natively: the answers agree, by the error on the contact problem."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from tiers import some_by_day

from cpbench import graph, storage
from cpbench.conversions.base import make
from cpbench.errors import CpbenchError
from cpbench.formulations import FrictionContact, Point, Problem
from cpbench.solvers import Budget, Solver, solvers

REACHED = {"micp": ("micp",), "cp": ("cp", "vi"), "vi": ("vi",), "qvi": ("qvi",)}
"""Nodes whose solvers answer for a node."""
SOLVED, ASKED = 1e-8, 1e-11
BUDGET = Budget(tolerance=ASKED, seconds=60.0)  # whoever ends at all takes a second or two where nobody else is at work
FIRST = ("newton-min-micp", "newton-vi", "newton-qvi")
"""Solvers that are asked before others: they solve nearly all."""
AGAIN = "newton-pfb-micp"
"""Asked once more, from drawn starts, where nobody solves the contact problem from its own: where W is singular, the
box problem may be solved to 1e-11 at a point that is 1e-6 from solving the contact problem."""
SMALL = [
    "Confeti-ex13-4contact-Fc3D-SBM.dat",
    "FC3D_Example1.dat",
    "FrictionContact3D_1c.dat",
    "NESpheres_10_1.dat",
    *(f"Rover{number}.dat" for number in (1039, 1040, 1041, 11211, 3865, 4144, 4396, 4516, 4613, 4622, 9770)),
    "mj_dm_dog-nc12.hdf5",
    "mj_dm_humanoid-nc6.hdf5",
    "mj_dm_humanoid_CMU-nc5.hdf5",
    "mj_shadow_pen-nc3.hdf5",
    "OneObject-i1028-138.hdf5.dat",
    "siconos_box_stack8-nc32.hdf5",
]
"""Real files that are quick."""
STIFF = ["OneObject-i100000-316.hdf5.dat", "fclib_local_problem_test.hdf5"]
"""Those on which Gauss–Seidel ends at 1e-3 and 1e-6."""


def converted(problem: FrictionContact, node: str) -> Iterator[tuple[Solver, Problem]]:
    """Every solver of ours that answers for a node, with the problem that it gets."""
    target = make(f"fc-{node}", {}).step(problem)
    for solver in solvers:
        ours = type(solver).__module__.startswith("cpbench_solvers.")
        if ours and solver.spec.node in REACHED[node]:
            yield solver, graph.arrive(target, solver.spec.node).problem


def error_of(
    problem: FrictionContact, solver: Solver, target: Problem, budget: Budget, start: Point | None = None
) -> float:
    """Of the answer, on the contact problem; ∞ where there is none."""
    try:
        point = solver.run(target, budget, start=start).point
    except CpbenchError:
        return math.inf
    return math.inf if point is None else problem.residuals(graph.lift(target, point)).error


def solved_by(problem, node):
    """The first solver whose answer, lifted, solves the contact problem; else the errors of all of them."""
    errors = {}
    for solver, target in sorted(converted(problem, node), key=lambda pair: pair[0].spec.name not in FIRST):
        error = error_of(problem, solver, target, BUDGET)
        if error <= SOLVED:
            return solver.spec.name, error
        errors[solver.spec.name] = error
    for solver, target in converted(problem, node):
        if solver.spec.name == AGAIN:
            for seed in range(1, 13):
                drawn = target.start * (1 + 0.3 * np.random.default_rng(seed).standard_normal(target.start.size))
                error = error_of(problem, solver, target, BUDGET, target.point_type(drawn))
                if error <= SOLVED:
                    return f"{solver.spec.name} from a drawn start", error
    if not errors:
        pytest.skip(f"does not apply: no solver of ours for {' or '.join(REACHED[node])}")
    pytest.fail(f"as {node} solved by none: {', '.join(f'{name} {error:.0e}' for name, error in errors.items())}")


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("node", some_by_day(REACHED, 3))
@pytest.mark.parametrize("file", some_by_day(SMALL + STIFF, 4))
def test_real_files(node, file, shared_data, record_property):
    problem = storage.load(shared_data / "fc3d_local" / file)
    if file in SMALL:
        assert problem.residuals(solvers.get("nsgs").run(problem, BUDGET).point).error <= SOLVED
    name, error = solved_by(problem, node)
    record_property("solved by", f"{name}, error {error:.1e}")
