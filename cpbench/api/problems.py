"""Problems from files and to files, in other formulations, and answers measured on them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.api.solution import Solution
from cpbench.formulations.base import Kind, Point, Problem
from cpbench.formulations.primal import Primal, primal_of

if TYPE_CHECKING:
    from cpbench.graph import Apply, Arrival
    from cpbench.verification import Verdict


@dataclass(frozen=True, eq=False, repr=False)
class Converted:
    """A problem in another formulation, and the way back.

    Attributes
    ----------
    source : the problem that was converted. arrival : what became of it, and how (`graph.Arrival`).
    """

    source: Problem
    arrival: Arrival

    @property
    def problem(self) -> Problem:
        """The problem in its new formulation."""
        return self.arrival.problem

    @property
    def route(self) -> str:
        """The conversions, in their order."""
        return self.arrival.route.label

    @property
    def kind(self) -> Kind:
        """The worth on `source` of an answer to `problem`."""
        return self.arrival.kind

    def lift(self, answer: Solution | Point | Sequence[float]) -> Any:
        """Carry an answer to `problem` back to `source`; returns a point of `source`.

        Parameters
        ----------
        answer : a solution of `problem`, a point of it, or a vector of shape (n,) with its parts one after the other.

        Raises PointError when it is no answer to `problem`.
        """
        from cpbench import graph

        return graph.lift(self.problem, point_of(self.problem, answer), len(self.arrival.route.steps))

    def __repr__(self) -> str:
        return f"Converted by {self.route} ({self.kind}):\n{self.problem}"

    def _repr_html_(self) -> str:
        from cpbench.report.show import problem_html

        return problem_html(self.problem)


def load(path: str | Path, *, format: str | None = None) -> Problem:
    """Read a problem from a file, or one of the built-in problems.

    Parameters
    ----------
    path : a file, ``FILE::NAME`` in a pack, or ``builtin/lcp/american-put.h5::american-put-100``.
    format : a name from `cpbench list formats`; None: by what the file holds.

    Raises FormatError where the file cannot be read, UnknownName on an unknown format.

    >>> import cpbench
    >>> cpbench.load("builtin/lcp/american-put.h5::american-put-100").sizes()
    {'n': 100}
    """
    from cpbench import storage
    from cpbench.bench.planning.places import located
    from cpbench.generators.collection import builtin_folder

    return storage.load(located(str(path), builtin_folder), format=format)


def convert(
    problem: Problem,
    to: str | None = None,
    via: str | Sequence[str] | None = None,
    *,
    kinds: frozenset[Kind] | None = None,
    apply: Apply | None = None,
) -> Converted:
    """Convert a problem to another formulation, by the cheapest route whose every answer is an answer.

    Parameters
    ----------
    to : the formulation to reach (`cpbench list formulations`); None: where `via` leads.
    via : conversions that the route must take, by name or its end, with knobs: ``"inner[facets=16]"``. They are taken
        whatever they promise.
    kinds : the promises that other steps may have, None for exact ones. apply : takes each step (see `graph.arrive`).

    Raises NoRoute with the obstacles met, UnknownName.

    >>> import cpbench
    >>> lcp = cpbench.LCP(M=[[2.0, 1.0], [1.0, 2.0]], q=[-5.0, -6.0])
    >>> qp = cpbench.convert(lcp, "qp")
    >>> qp.route, qp.lift(cpbench.solve(qp.problem)).z.round(6).tolist()
    ('lcp-qp', [1.333333, 2.333333])
    """
    from cpbench import graph
    from cpbench.conversions.base import Conversion

    pinned: tuple[Conversion, ...] = ()
    if via:
        from cpbench.bench.planning import plan

        request = plan.pinned([via] if isinstance(via, str) else list(via))
        pinned = plan.parse_request(request)[1]
    if to is not None:
        graph.formulations.get(to)
    target = to or (pinned[-1].target if pinned else problem.node)
    return Converted(problem, graph.arrive(problem, target, kinds or graph.EXACT, pinned, apply or Conversion.step))


def explain(problem: Problem, to: str) -> list[str]:
    """Return in words why a problem does not get somewhere: to a formulation, or to an answer by a solver.

    Parameters
    ----------
    to : a formulation: a line on each exact route that refuses, and one on what leads there. Or a solver: the
        confirmed cause of its failure, or those suspected, with what was tried against it, as `cpbench explain` says
        it (`cpbench.diagnose` returns the same as data).

    Raises UnknownName where it is neither.

    >>> import cpbench
    >>> for line in cpbench.explain(cpbench.LCP(M=[[2.0, 1.0], [0.0, 2.0]], q=[-5.0, -6.0]), "qp"):
    ...     print(line)
    lcp-qp refuses: M is not symmetric, asymmetry = 5.0e-01; use lcp-qp-nonsymmetric
    lcp-avi > avi-qp: avi-qp refuses: M is not symmetric, asymmetry = 5.0e-01: it is no gradient; use avi-mlcp
    lcp-qp-nonsymmetric leads there (equivalent)
    """
    from cpbench import graph
    from cpbench.errors import NoRoute
    from cpbench.foundation.extensions import function
    from cpbench.foundation.text import read_brackets
    from cpbench.solvers.base import solvers

    if to not in graph.formulations and read_brackets("solver", to)[0] in solvers:
        return list(function("diagnose")(problem, to).lines())
    graph.formulations.get(to)
    dead = [str(end) for end in graph.explain(problem, to)]
    try:
        arrival = graph.arrive(problem, to)
    except NoRoute:
        return [*dead, f"no exact route from {problem.node} to {to}"]
    return [*dead, f"{arrival.route.label} leads there ({arrival.kind})"]


def verify(
    problem: Problem,
    answer: Solution | Point | Primal | Sequence[float],
    *,
    tolerance: float = 1e-6,
    measure: str | None = None,
) -> Verdict:
    """Measure an answer from anywhere on a problem; the verdict is true in a condition where the answer solves it.

    A stationary point of a problem that is not known to be convex does not: its verdict has `within` and the flag
    `stationary`. An answer without multipliers gets those that suit it best; the flag `multipliers completed` says so.

    Parameters
    ----------
    answer : a point, a vector of shape (n,) with the parts of a point one after the other or with its unknowns alone,
        without multipliers, or a solution.
    tolerance : the largest error that passes. measure : one published number that decides instead of the backward error
        (``"natural"``, ``"fclib2018"``, ...).

    Raises PointError when it has not the shape of an answer or its multipliers cannot be computed, UnknownName on a
    measure that is not of this formulation.

    >>> import cpbench
    >>> lcp = cpbench.LCP(M=[[2.0, 1.0], [1.0, 2.0]], q=[-5.0, -6.0])
    >>> cpbench.verify(lcp, [4 / 3, 7 / 3]).solved, cpbench.verify(lcp, [1.0, 2.0]).solved
    (True, False)
    >>> qp = cpbench.QP.build(Q=[[2.0, 1.0], [1.0, 2.0]], p=[-5.0, -6.0], lb=[0.0, 0.0])
    >>> cpbench.verify(qp, [4 / 3, 7 / 3]).flags
    ('multipliers completed',)
    """
    from cpbench import verification
    from cpbench.bench import multipliers

    given = answer if isinstance(answer, Solution | Point | Primal) else primal_of(problem, answer) or answer
    whole = given if isinstance(given, Primal) else point_of(problem, given)
    point, completed = multipliers.whole(problem, whole, tolerance)
    verdict = verification.judge(problem, point, tolerance, measure)
    return multipliers.marked(verdict) if completed else verdict


def point_of(problem: Problem, answer: Solution | Point | Sequence[float]) -> Any:
    """Return an answer as a point of the problem; raises PointError when it does not fit the problem, or there is
    none."""
    from cpbench.errors import PointError

    if isinstance(answer, Solution):
        if answer.point is None:
            raise PointError(f"{problem.node}: the solution has no answer ({answer.status}: {answer.message})")
        answer = answer.point
    point = answer if isinstance(answer, Point) else problem.point_from_vector(answer)
    problem.check_point(point)
    return point


@dataclass(frozen=True, eq=False, repr=False)
class Modelled:
    """A problem that was made of a model, and the way back to the unknowns of the model.

    Attributes
    ----------
    problem : the problem, for all functions that take one. back : makes the unknowns of the model of a point.
    """

    problem: Problem
    back: Callable[[Any], Any]

    def lift(self, answer: Solution | Point | Sequence[float]) -> Any:
        """Return the unknowns of the model from an answer to `problem`, as the function that made it says.

        Parameters
        ----------
        answer : a solution, a point, or a vector of the unknowns with or without multipliers.

        Raises PointError where it is not an answer to `problem`.
        """
        given = answer if isinstance(answer, Solution | Point) else primal_of(self.problem, answer)
        if isinstance(given, Primal):
            zero = self.problem.zero_point().arrays()
            return self.back(self.problem.point_type(**{**zero, given.name: given.values}))
        return self.back(point_of(self.problem, answer))

    def __repr__(self) -> str:
        return f"Modelled as {self.problem}"
