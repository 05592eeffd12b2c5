"""Other solvers for a problem that one has failed on, in families: the automatic choice, other methods, other nodes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from cpbench import graph
from cpbench.formulations.base import Problem
from cpbench.solvers.base import Solver, automatic_solver, missing, solvers
from cpbench_lab.diagnosis.case import FailedTrial, Remedy

TRIES = 3
"""Remedies of a family that are tried at most."""


def choice(problem: Problem) -> str | None:
    """Return the automatic choice for a problem's formulation; None where there is none."""
    return automatic_solver(problem.node)


def families(case: FailedTrial, foreign: bool) -> Iterator[Iterator[Remedy]]:
    """Yield families of solvers, by exact conversions, each to be tried until one of it works.

    They are the automatic choice of the problem's formulation; one solver of each other method of this formulation and
    of the failed solver's; and one of each method that is still missing, of formulations that an exact route leads to,
    the nearest first. Where all are asked (`foreign`) those installed are taken, else those of cpbench alone.
    """
    failed, own = case.solver.spec, choice(case.problem)
    if own is not None and own != failed.name:
        yield iter([_remedy(case, solvers.get(own))])
    near = tuple(dict.fromkeys((case.problem.node, failed.node)))
    methods = {failed.method, "automatic choice"}
    yield _of_nodes(case, near, methods, foreign)
    yield _of_nodes(case, _other_nodes(case, near), methods, foreign)


def _of_nodes(case: FailedTrial, nodes: tuple[str, ...], methods: set[str], foreign: bool) -> Iterator[Remedy]:
    """Yield one solver of each method that is not in `methods` yet, which grows."""
    for node in nodes:
        for solver in solvers:
            spec = solver.spec
            fits = spec.node == node and spec.kind.exact and spec.by_default and spec.method not in methods
            if fits and (solver.origin == "native" or (foreign and not missing(spec))):
                methods.add(spec.method)
                yield _remedy(case, solver)


def _other_nodes(case: FailedTrial, near: tuple[str, ...]) -> tuple[str, ...]:
    """Return the other formulations that an exact route leads to, those at the cheapest routes first."""
    source = case.problem.node
    others = [node for node in graph.reachable(source) if node not in near]
    routes = {node: graph.candidates(source, node) for node in others}
    return tuple(sorted((node for node in others if routes[node]), key=lambda node: routes[node][0].cost))


def _remedy(case: FailedTrial, solver: Solver) -> Remedy:
    trial = replace(case.trial, solver=solver.spec.name, via=())
    there = "" if solver.spec.node == case.problem.node else f", of {solver.spec.node}"
    return Remedy(text=f"{solver.spec.name} ({solver.spec.method}{there})", trial=trial)
