"""The page of what each solver is asked for, and by which test it ends: read off the adapters."""

from __future__ import annotations

import math
from collections import defaultdict

from page_parts import table

from cpbench.formulations import formulations
from cpbench.solvers.base import Solver, solvers
from cpbench.solvers.stopping import Stopping

ASKED = (1e-4, 1e-6, 1e-8)
INTRODUCTION = f"""# What your tolerance means to each solver

The tolerance of a run is one number, without a unit: the largest error, as [the verdict](verdict.md) measures it, of an
answer that counts as solved. Packages end by tests of their own, in norms and units of their own. An adapter translates
your tolerance into the package's settings, by these rules:

- no setting is looser than your tolerance, nor than the package's own default;
- only data of the problem enter, never where it starts;
- where a test of a package can pass too early in the units of a problem, the table says by what ("does not see").

Below are the settings for {", ".join(f"{asked:g}" for asked in ASKED)} and data of size one, in this order, and the
package's own defaults. A dash is a test that is off by default.

A package that claims an answer which misses the tolerance is asked once more, for a hundredth of the tolerance over
the factor by which it missed; then the row is written, with the flag *twice* and both results in its message. The row
has the run that it reports, with the time of that run alone: the second where its answer is right, else the first. The
second run has the limits of the first. A package whose settings would be the same is not asked again.

Solvers of cpbench end by an error of their own formulation, by rows and connected parts, at your tolerance. A program
that you declare is given your tolerance as it is."""


def page() -> str:
    """Return the page, a table a formulation."""
    of_node: dict[str, list[Solver]] = defaultdict(list)
    for solver in solvers:
        if solver.stopping(ASKED[0]) is not None:
            of_node[solver.spec.node].append(solver)
    parts = [INTRODUCTION]
    for node in (cls.node for cls in formulations if cls.node in of_node):
        rows = (_row(solver) for solver in of_node[node])
        parts += [f"## {node}", table(["solver", "is asked for", "its own default", "ends by", "does not see"], rows)]
    return "\n\n".join(parts)


def _row(solver: Solver) -> list[str]:
    asked = [found for found in map(solver.stopping, ASKED) if found is not None]
    one = asked[0]
    settings = "; ".join(f"`{name}` {_values(name, asked)}" for name in one.settings)
    defaults = "; ".join(f"`{name}` {_number(value)}" for name, value in one.defaults.items())
    return [f"`{solver.spec.name}`", settings or "nothing", defaults, one.test, one.differs]


def _values(name: str, asked: list[Stopping]) -> str:
    return ", ".join(_number(one.settings[name]) for one in asked)


def _number(value: float) -> str:
    return "—" if math.isinf(value) else f"{value:.2g}"
