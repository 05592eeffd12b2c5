"""Which of the measured labels take a problem on this machine: by what route, or why not."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from cpbench import graph
from cpbench.advice.recommendation import Advice
from cpbench.bench import availability
from cpbench.bench.planning import plan
from cpbench.conversions.base import make
from cpbench.errors import CpbenchError, NoRoute
from cpbench.formulations import Problem
from cpbench.solvers.base import Solver, Trait, solvers


@dataclass(frozen=True)
class Candidate:
    """A label that takes the problem, or why it does not (`obstacle`).

    `route`, `kind` : how the problem gets to the solver, and what that promises. `here` : the state of the solver.
    `options` : of `cpbench solve`, beside the problem.
    """

    advice: Advice
    route: str = ""
    kind: str = ""
    here: str = ""
    options: str = ""
    obstacle: str = ""

    @property
    def summary(self) -> str:
        """Results of the solver on problems like this one, in a sentence."""
        advice = self.advice
        if not advice.measured:
            return "never measured"
        expected = f"about {2**advice.loss:.2g} times the fastest"
        if not advice.similar:
            return f"{expected}; estimated from other problems"
        return (
            f"{expected}; solved {advice.solved} of {advice.similar} like it, {advice.within} within twice the fastest"
        )


def solver_of(label: str, request: str) -> Solver | None:
    """Return the solver of a label as results have it, None for one that is not registered here."""
    name = label.removesuffix(f"@{request}").partition("[")[0]
    return solvers.get(name) if name in solvers else None


def unmeasured(labels: Sequence[str], requests: Mapping[str, str]) -> list[str]:
    """Return solvers registered here that none of the measured labels is of."""
    of_labels = {solver_of(label, requests.get(label, "exact")) for label in labels}
    return [solver.spec.name for solver in solvers if solver not in of_labels]


def applicable(problem: Problem, labels: Sequence[str], requests: Mapping[str, str], warm: bool) -> set[str]:
    """Return the labels whose solver is registered here and has a route from the problem, as far as its first edge
    tells; with `warm`, those that take a starting point."""
    reached: dict[tuple[str, str], bool] = {}
    found: set[str] = set()
    for label in labels:
        request = requests.get(label, "exact")
        solver = solver_of(label, request)
        if solver is None or (warm and Trait.WARM_START not in solver.spec.traits):
            continue
        way = (request, solver.spec.node)
        if way not in reached:
            kinds, via = plan.parse_request(_request(request))
            routes = graph.candidates(problem.node, solver.spec.node, kinds, via)
            reached[way] = any(not r.steps or r.steps[0].obstacle(problem) is None for r in routes)
        if reached[way]:
            found.add(label)
    return found


def examine(
    problem: Problem, ranked: Sequence[Advice], requests: Mapping[str, str], *, missing: bool
) -> Iterator[Candidate]:
    """Yield a candidate for each label, in their order: the problem is converted and the solver asked if it takes it.

    `missing` : solvers that are not installed here are asked too, else they are candidates with an obstacle.
    """
    memory = graph.Memory()
    for advice in ranked:
        asked = requests.get(advice.label, "exact")
        solver = solver_of(advice.label, asked)
        if solver is None:
            continue
        seen = availability.glance(solver)
        if not seen.usable and not missing:
            yield Candidate(advice, obstacle=seen.line)
            continue
        request = _request(asked)
        kinds, via = plan.parse_request(request)
        try:
            arrival = graph.arrive(problem, solver.spec.node, kinds, via, memory)
        except (NoRoute, MemoryError) as refusal:
            yield Candidate(advice, obstacle=str(refusal) or "its route takes more memory than there is")
            continue
        why = solver.obstacle(arrival.problem)
        if why is not None:
            yield Candidate(advice, obstacle=why)
            continue
        kind = max(arrival.kind, solver.spec.kind, key=lambda kind: kind.rank)
        options = ["-s", advice.label.removesuffix(f"@{asked}"), *_options(request)]
        yield Candidate(advice, arrival.route.label, str(kind), "" if seen.usable else seen.line, shlex.join(options))


def _request(name: str) -> plan.Request:
    """Return the request of a name that results give; raises CpbenchError."""
    counts = [int(count) for count in re.findall(r"\d+", name)]
    for request in plan.requests("all", [count for count in counts if count >= 4]):
        if request.name == name:
            return request
    return plan.pinned(name.split("+"), {})


def _options(request: plan.Request) -> list[str]:
    """Return how `cpbench solve` is asked for a request."""
    if request.via:
        labels = [make(name, dict(parameters)).label for name, parameters in request.via]
        return [part for label in labels for part in ("--via", label)]
    return [] if set(request.kinds) <= set(plan.EXACT_KINDS) else ["--routes", "all"]


def require_some(ranked: Sequence[Advice], node: str) -> None:
    """Raise CpbenchError where nothing takes the problem."""
    if not ranked:
        raise CpbenchError(
            f"no solver takes this problem ({node}), neither one that was measured nor another of those registered "
            "here; see what there is with: cpbench list solvers"
        )
