"""Linear problems with answers, and every formulation in which the same answer can be asked about.

Beside answers right and wrong of the suite: unknowns that grow while they cancel on problems without a solution, and
solutions that decay, whose tail has no digits of its own.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator

import numpy as np
import planted_nonlinear
from answers import RNG, Answer, answers, vector
from side_by_side import together

from cpbench.conversions import base as edges
from cpbench.formulations import LCP, Kind, LCPPoint

NODES = ("lcp", "mlcp", "relay", "avi", "ncp", "micp", "vi", "ge", "cp", "soclcp")
"""Formulations whose answers are measured pair by pair."""
SIZES = (1e3, 1e5, 1e7, 1e10, 1e14, 1e16, 1e30)


def growing(rng: RNG) -> Iterator[Answer]:
    """Answers z + s d to a monotone LCP with Md = 0, Mᵀd = 0 and qᵀd < 0 < d: for any solution 0 ≤ dᵀ(Mz + q) = qᵀd."""
    n = int(rng.integers(2, 6))
    d = rng.integers(1, 4, n).astype(float)
    G = rng.integers(-3, 4, (n, n)).astype(float)
    N = G @ G.T + (G - G.T)
    P = d @ d * np.eye(n) - np.outer(d, d)  # integers: Md is 0 without rounding
    q = -rng.integers(1, 5, n).astype(float)
    problem = LCP(M=P @ N @ P, q=q)
    for size in SIZES:
        point = LCPPoint(z=size * d + rng.uniform(0.0, 1.0, n))
        yield Answer(problem, point, 1e-6, False)


def decaying(rng: RNG) -> Iterator[Answer]:
    """z with 100 zᵢ = zᵢ₋₁ + zᵢ₊₁, about zᵢ₋₁/100, with an error of ε/100 of the largest in each unknown; and with one
    of 0.01."""
    n = int(rng.integers(4, 9))
    M = 100.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)  # its inverse is positive: z > 0
    problem = LCP(M=M, q=-100.0 * np.eye(n)[0])
    z = np.linalg.solve(M, -problem.q)
    for off, right in ((1e-8, True), (1e-2, False)):
        yield Answer(problem, LCPPoint(z=z + off * rng.uniform(0.5, 1.0, n)), 1e-6, right)


KINDS: dict[str, Callable[[RNG], Iterator[Answer]]] = {
    "growing": growing,
    "decaying": decaying,
    **{node: lambda rng, node=node: answers(node, rng) for node in ("lcp", "mlcp", "relay", "avi")},
}


def written(answer: Answer) -> Iterator[Answer]:
    """The answer in every formulation that equivalent edges reach, one after the other, if it comes back as it was."""
    found, queue = {answer.problem.node}, [answer]
    while queue:
        here = queue.pop(0)
        for name in edges.conversions.names():
            edge = edges.make(name)
            if edge.source != here.problem.node or edge.target in found or edge.target not in NODES:
                continue
            if edge.obstacle(here.problem) is not None or edge.exactness(here.problem) is not Kind.EQUIVALENT:
                continue
            target, trace = edge.apply(here.problem)
            point = edge.push(here.point, trace)
            back = vector(here.problem, edge.lift(point, trace))
            if not np.array_equal(back, vector(here.problem, here.point)):
                continue
            found.add(edge.target)
            queue.append(dataclasses.replace(here.of(target, point), via=f"{here.via} {name}".strip()))
            yield queue[-1]


def beside_a_curve(answer: Answer, rng: RNG) -> Answer:
    """An NCP and its answer beside one that is not linear, with a right answer."""
    other = planted_nonlinear.ncp(rng, 3, "monotone")
    return answer.of(*together((answer.problem, answer.point), other))
