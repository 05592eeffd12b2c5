"""The page of the friction laws of physics engines: the conversion that has each law, and how far its answers are from
those of Coulomb's law on three scenes. All numbers are computed here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from page_parts import table

import cpbench
from cpbench.conversions import conversions
from cpbench.formulations import FrictionContact

SCENES = ("one-slide", "full-rank-30", "light-beside-heavy-12")
"""Scenes of `builtin/fc/contact-planted-3d.h5`: one sliding contact; 30 contacts of 20 bodies; 12 of 8 bodies."""
FILE = "builtin/fc/contact-planted-3d.h5"
TOLERANCE = 1e-8


@dataclass(frozen=True)
class Law:
    """A law: its `name`, the `engines` that have it, what it `says`, and the conversion `via` to it ("": by arrays)."""

    name: str
    engines: str
    says: str
    via: str


LAWS = (
    Law(
        "box",
        "ODE quickstep, Bullet without its implicit friction cone, DART (PGS), PhysX's anchors under its PGS solver",
        "|t₁| ≤ μn, |t₂| ≤ μn, in two fixed directions, each row for itself; n is the normal force of the answer",
        "fc-mlcp-outer[facets=4,angle=0]",
    ),
    Law(
        "box, bounds taken once",
        "ODE `dWorldStep`, DART and Bullet by their Dantzig solvers",
        "the same with the normal forces n of the rows before the first friction row, where all friction is 0",
        "",
    ),
    Law(
        "pyramid",
        "MuJoCo `cone=pyramidal` without its softness, Stewart and Trinkle's LCP with four directions",
        "|t₁| + |t₂| ≤ μn: nonnegative sums of the edges n ± μt₁, n ± μt₂ (of MuJoCo, the convex law of the next rows)",
        "fc-lcp-inner[facets=4,angle=0]",
    ),
    Law(
        "convex cone",
        "Chrono (cone complementarity), the rigid limit of MuJoCo `cone=elliptic` and of Drake's SAP",
        "the dual cone for (u_N, u_T) in place of u_N ≥ 0: a contact that slides at speed s opens at speed μs",
        "fc-coneqp",
    ),
    Law(
        "soft convex cone, hardest",
        "MuJoCo `cone=elliptic` with impedance 0.9999; the model of Drake's SAP has another regularization",
        "the convex cone, and every contact gives way by a fraction of its own mobility",
        "fc-coneqp-compliant[compliance=0.0001]",
    ),
    Law(
        "soft convex cone, default",
        "MuJoCo `cone=elliptic` with impedance 0.9, that of `solimp` at no penetration",
        "the same, (1 − 0.9)/0.9 of the mobility",
        "fc-coneqp-compliant[compliance=0.111]",
    ),
    Law(
        "threshold",
        "Drake's lagged approximation, one step, from the normal forces of the step before",
        "‖t‖ ≤ μg in a disk, g given (here of each contact alone, the default of the conversion)",
        "fc-coneqp-tresca",
    ),
    Law("octagon", "Coulomb's law by 8 facets, for comparison", "a circumscribed octagon", "fc-lcp-outer[facets=8]"),
)
INTRODUCTION = """# Which engine's law is which route

Whether an engine's answers satisfy its own law, step by step, is what [`cpbench audit`](../guides/engines.md) tells.
Bullet's default is none of the rows below: a disk of friction, but friction against D⁻¹u, D the mobilities of the rows.

Physics engines do not solve Coulomb's law but one near it. cpbench has a conversion for each of these laws, so that
you can ask what an engine would answer if it solved its own law exactly, and measure that answer on Coulomb's law.
What an engine makes of it within its iterations is another matter, and so are its stabilization and the softness of
its contacts, except where a row names it.

The sign of boxed LCPs is that of ODE's `lcp.cpp`, "solve A*x = b+w": w = Ax − b. DART's and Bullet's Dantzig solvers
descend from that file. When it reaches the first row with a friction index, it sets the bounds of all such rows to
hi·|x_j| of the normal forces found so far, once; projected Gauss-Seidel sets them anew in each sweep, so that its
limit is the law of the first row below. Files with A, b, lo, hi, findex are read as that law:
[the guide](../guides/simulation-engineer.md#boxed-lcps-of-ode-dart-bullet-and-gazebo) shows them."""
COMMANDS = """## Commands

Each command writes the law of one scene as a problem; `cpbench solve` and `cpbench convert --lift` lead back to the
forces of its contacts."""
DISTANCES = """## Distance from Coulomb's law

The scenes are those of {file}: {scenes}. A cell has the largest difference of the velocities at the contacts, in
percent of the largest velocity without contact forces, then the error that the verdict measures on Coulomb's law."""
ONCE = """The second law needs two solves, as in those engines: with the friction rows held at 0, then with the bounds
that follow.

```python
import cpbench
import numpy as np

A, b, findex = np.eye(3), np.array([2.0, -3.0, -0.4]), np.array([-1, 0, 0])
lo, hi = np.array([0.0, -0.5, -0.5]), np.array([np.inf, 0.5, 0.5])
friction = findex >= 0
first = cpbench.from_boxed_lcp(A, b, np.where(friction, 0.0, lo), np.where(friction, 0.0, hi))
x = first.lift(cpbench.solve(first.problem))
bound = np.where(friction, np.where(friction, hi, 0.0) * np.abs(x[findex]), hi)
second = cpbench.from_boxed_lcp(A, b, np.where(friction, -bound, lo), bound)
x = second.lift(cpbench.solve(second.problem))
```"""


def page() -> str:
    """Return the page."""
    laws = table(["law", "engines", "what it says"], ([law.name, law.engines, law.says] for law in LAWS))
    parts = [INTRODUCTION, laws, COMMANDS]
    parts.append("```sh\n" + "\n".join(command(law) for law in LAWS if law.via) + "\n```")
    parts += [ONCE, DISTANCES.format(file=f"`{FILE}`", scenes=", ".join(f"`{name}`" for name in SCENES))]
    problems = [cpbench.load(f"{FILE}::{name}") for name in SCENES]
    rows = [[law.name, *(cell(law, problem) for problem in problems)] for law in LAWS]
    return "\n\n".join([*parts, table(["law", *SCENES], rows)])


def command(law: Law) -> str:
    """Return the command that writes the law of the second scene."""
    name = law.name.replace(",", "").replace(" ", "-")
    node = conversions.get(law.via.partition("[")[0]).target
    return f"cpbench convert {FILE}::{SCENES[1]} {name}.h5 --to {node} --via '{law.via}'"


def cell(law: Law, problem: Any) -> str:
    """Return the two distances of a law's answer, or what became of it where it is not solved."""
    try:
        velocity, error = distances(problem, reactions(law, problem))
    except ArithmeticError as cause:
        return str(cause)
    return f"{velocity:.2g} %, {error:.1e}"


def reactions(law: Law, problem: FrictionContact) -> Any:
    """Return the reactions r (3 nc,) by a law; raises ArithmeticError where cpbench does not solve it."""
    if law.via:
        converted = cpbench.convert(problem, via=law.via)
        return converted.lift(solved(converted.problem)).r
    nc = problem.mu.size
    normal = np.arange(3 * nc) % 3 == 0
    first = cpbench.from_boxed_lcp(problem.W, -problem.q, np.zeros(3 * nc), np.where(normal, np.inf, 0.0))
    forces = first.lift(solved(first.problem))[normal]
    bound = np.where(normal, np.inf, np.repeat(problem.mu * forces, 3))
    second = cpbench.from_boxed_lcp(problem.W, -problem.q, np.where(normal, 0.0, -bound), bound)
    return second.lift(solved(second.problem))


def distances(problem: FrictionContact, r: Any) -> tuple[float, float]:
    """Return the largest difference of the velocities from those of Coulomb's law [% of max|q|], and the error of r."""
    coulomb = solved(problem).point.r
    difference = np.abs(problem.W @ (r - coulomb)).max() / np.abs(problem.q).max()
    return 100.0 * float(difference), cpbench.verify(problem, r).error


def solved(problem: Any) -> Any:
    """Return a solution whose error is at most 1e-6; raises ArithmeticError."""
    for tolerance in (TOLERANCE, 1e-10, 1e-6):
        solution = cpbench.solve(problem, tolerance=tolerance)
        if solution.error <= 1e-6:
            return solution
    raise ArithmeticError(f"{problem.node} {problem.name}: {solution.status}, error {solution.error:.1e}")
