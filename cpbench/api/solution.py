"""The result of `cpbench.solve`: an answer with what was measured of it."""

from __future__ import annotations

import html
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from cpbench.formulations.base import Kind, Point, Problem
from cpbench.foundation.matrices import Vector
from cpbench.storage.base import SENSE, offset
from cpbench.verification import MET_TOLERANCE, Status, Verdict, error_text

if TYPE_CHECKING:
    from cpbench.analysis.contact_table import ContactTable


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Solution:
    """An answer to `problem`, measured on it; true in a condition when it meets the tolerance.

    Attributes
    ----------
    problem : the problem that was asked. solver : the label of the solver that answered.
    point : the answer to `problem` by its named parts, None where there is none.
    status : what the answer is worth. claim : what the solver said of it, '' where it did not come so far.
    verdict : all that was measured of the answer. tolerance : what was asked for.
    route, kind : the conversions from `problem` to the solver ('direct' where there are none), and what they promise.
    seconds : wall time of `convert`, `setup`, `solve`, `lift` and `verify`, as far as it came [s].
    counters : iterations, pivots and the like. message : what the solver, or a proof, has to say.
    """

    problem: Problem
    solver: str
    status: Status
    verdict: Verdict
    tolerance: float
    route: str
    kind: Kind
    point: Any = None
    claim: str = ""
    seconds: Mapping[str, float] = field(default_factory=dict)
    counters: Mapping[str, int] = field(default_factory=dict)
    message: str = ""

    def __bool__(self) -> bool:
        return str(self.status) in MET_TOLERANCE

    @property
    def x(self) -> Vector | None:
        """The answer as one vector, its parts one after the other, shape (n,); None where there is none."""
        return None if self.point is None else self.point.vector

    @property
    def contacts(self) -> ContactTable | None:
        """The state of each contact, and the load of each body; None of a problem without contacts, or without a finite
        answer.

        >>> import cpbench
        >>> box = cpbench.FrictionContact(W=[[1.0, 0.0], [0.0, 1.0]], q=[-1.0, 0.3], mu=[0.5], dimension=2)
        >>> table = cpbench.solve(box).contacts
        >>> table.state.tolist(), table.normal.round(6).tolist(), table.friction.round(6).tolist()
        (['stick'], [1.0], [0.6])
        """
        from cpbench.analysis.contact_table import contact_table
        from cpbench.formulations.contact import ContactProblem

        if not isinstance(self.problem, ContactProblem) or self.point is None or not self.point.finite:
            return None
        return contact_table(self.problem, self.point, self.tolerance)

    @property
    def error(self) -> float:
        """The error measured on `problem`, which has no unit; infinite where there is no answer."""
        return self.verdict.error

    @property
    def time(self) -> float:
        """Wall time of set-up and solve, after the warm-up, without conversion and judging [s]."""
        return self.seconds.get("setup", 0.0) + self.seconds.get("solve", 0.0)

    def rows(self) -> dict[str, str]:
        """Return the lines that describe the solution, by name."""
        described = {
            "status": str(self.status),
            "solver": self.solver,
            "route": self.route if self.kind == Kind.EQUIVALENT else f"{self.route} ({self.kind})",
            "error": f"{error_text(self.error)} measured, {self.tolerance:g} asked for",
            "claim": self.claim,
            "flags": ", ".join(self.verdict.flags),
            "time": f"{1e3 * self.time:.3g} ms",
            "message": self.message,
        }
        return {name: text for name, text in described.items() if text}

    def __repr__(self) -> str:
        lines = [f"  {name:<8}{' '.join(text.split())}" for name, text in self.rows().items()]
        return "\n".join([f"Solution of {self.problem.name or 'a problem'} ({self.problem.node})", *lines])

    def _repr_html_(self) -> str:
        colour = "#009E73" if self else "#D55E00"
        rows = "".join(
            f'<tr><th style="text-align:left">{name}</th><td style="text-align:left">{html.escape(text)}</td></tr>'
            for name, text in self.rows().items()
        )
        title = html.escape(f"{self.problem.name or self.problem.node}: {self.status}")
        return f'<b style="color:{colour}">{title}</b><table>{rows}</table>'


def objective_of(problem: Problem, point: Point) -> float | None:
    """Return the value of the objective at an answer, as its file has it: with its constant, and the value of the
    maximum where it was to be maximized; None of a problem without one."""
    value = getattr(problem, "objective", None)
    if value is None or not point.finite:
        return None
    with np.errstate(all="ignore"):
        least = float(value(next(iter(point.arrays().values())))) + offset(problem.info)
    return -least if problem.info.properties.get(SENSE) == "max" else least
