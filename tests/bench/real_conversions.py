"""Every problem file of a folder along every exact route: where it goes, what refuses it, and what comes back.

    python tests/bench/real_conversions.py FOLDER [--seconds 10] [--routes 4] [--megabytes 200] [--explain]

A solver's answer to the file itself is carried to the end of every route and lifted back; both errors are printed. A
file that no solver answers within its time is converted all the same, and its zero point goes there and back.
"""

from __future__ import annotations

import itertools
import time
from dataclasses import dataclass, field
from pathlib import Path

import click

from cpbench import graph, storage
from cpbench.conversions import Conversion
from cpbench.errors import CpbenchError, NoRoute, NotApplicable
from cpbench.formulations import Problem
from cpbench.graph import checking

TOLERANCE = 1e-6


@dataclass
class Outcome:
    """What became of one file.

    Attributes
    ----------
    taken : labels of the routes that were taken. refused : edges with their obstacles.
    answer : error of the answer on the file, None without one. there, back : its worst errors after a route.
    """

    node: str = ""
    taken: list[str] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)
    answer: float | None = None
    there: float = 0.0
    back: float = 0.0
    seconds: float = 0.0
    failure: str = ""


class Within(graph.Memory):
    """Conversions done once each; what would take more than `limit` bytes is refused with its size."""

    def __init__(self, limit: float) -> None:
        super().__init__()
        self.limit = limit

    def __call__(self, edge: Conversion, problem: Problem) -> Problem:
        size = edge.predict(problem)
        if size is not None and size.bytes > self.limit:
            raise NotApplicable(edge.label, f"would make {size}")
        return super().__call__(edge, problem)


def examine(address: str, seconds: float = 10.0, routes: int = 4, megabytes: float = 200.0) -> Outcome:
    """Convert one file along at most `routes` exact routes to every formulation."""
    begun = time.perf_counter()
    try:
        problem = storage.load(address)
    except CpbenchError as refusal:
        return Outcome(failure=str(refusal))
    outcome = Outcome(node=problem.node)
    found = next(checking.answers(problem, TOLERANCE, [], seconds=seconds), None) if seconds > 0 else None
    point = problem.zero_point() if found is None else found.point
    outcome.answer = None if found is None else found.error
    memory = Within(1e6 * megabytes)
    for target in graph.reachable(problem.node):
        if target == problem.node:
            continue
        for arrival in itertools.islice(graph.arrivals(problem, target, apply=memory), routes):
            outcome.taken.append(arrival.route.label)
            outcome.refused |= {end.edge: end.obstacle for end in arrival.dead_ends}
            there, back = there_and_back(problem, arrival.problem, point)
            outcome.there, outcome.back = max(outcome.there, there), max(outcome.back, back)
        try:
            outcome.refused |= {end.edge: end.obstacle for end in graph.explain(problem, target, apply=memory)}
        except NoRoute as refusal:
            outcome.refused[target] = str(refusal)
    outcome.seconds = time.perf_counter() - begun
    return outcome


def there_and_back(problem: Problem, converted: Problem, point: object) -> tuple[float, float]:
    """Errors of an answer carried to a converted problem, and of what is lifted from there."""
    there = graph.push(converted, point, len(converted.provenance) - len(problem.provenance))
    back = graph.lift(converted, there, len(converted.provenance) - len(problem.provenance))
    return converted.residuals(there).error, problem.residuals(back).error


@click.command()
@click.argument("folders", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path))
@click.option("--seconds", default=10.0, show_default=True, help="Time for each solver to answer a file; 0: none.")
@click.option("--routes", default=4, show_default=True, help="Most routes to one formulation.")
@click.option("--megabytes", default=200.0, show_default=True, help="Largest result of one conversion.")
@click.option("--explain", is_flag=True, help="Print the obstacles too.")
def main(folders: tuple[Path, ...], seconds: float, routes: int, megabytes: float, explain: bool) -> None:
    click.echo("file | node | routes | refusals | error | after routes | back | seconds")
    for folder in folders:
        for address in storage.problem_files([folder]):
            o = examine(address, seconds, routes, megabytes)
            name = Path(address).name
            if o.failure:
                click.echo(f"{name} | refused: {o.failure}")
                continue
            errors = f"{o.answer:.0e} | {o.there:.0e} | {o.back:.0e}" if o.answer is not None else "- | - | -"
            click.echo(f"{name} | {o.node} | {len(o.taken)} | {len(o.refused)} | {errors} | {o.seconds:.1f}")
            if explain:
                for edge, obstacle in sorted(o.refused.items()):
                    click.echo(f"    {edge}: {obstacle}")


if __name__ == "__main__":
    main()
