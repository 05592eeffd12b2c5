"""Traffic that nobody can better: every used way from an origin to its destination costs the least (Wardrop)."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.expressions import Map
from cpbench.formulations.nonlinear import MiCP, MiCPPoint
from cpbench.foundation.matrices import Dense, Vector
from cpbench.generators.base import Instance, collection, generator
from cpbench_problems.generators.symbols import Symbol, mapped, total, unknowns

CONGESTION = 0.15
"""Of the Bureau of Public Roads: time = free time · (1 + 0.15 (flow/capacity)⁴)."""


@collection(
    "traffic-grid",
    "micp",
    "grids of two-way streets, by flows on arcs to every destination",
    "Beckmann, McGuire, Winsten 1956; Bureau of Public Roads 1964; Ferris, Meeraus, Rutherford 1999, OMS 10:1; planted "
    "by cpbench",
)
def build_grids() -> list[Instance]:
    return [grid(side, destinations) for side, destinations in ((3, 1), (4, 3), (6, 4), (3, 2))]


@collection(
    "traffic-grid-large",
    "micp",
    "the same with 5368 unknowns",
    "Beckmann, McGuire, Winsten 1956; Bureau of Public Roads 1964; planted by cpbench",
    tier="standard",
)
def build_large() -> list[Instance]:
    return [grid(12, 8)]


class _Grid:
    """Arcs (tail, head), both ways between neighbours; whole-numbered times at equilibrium."""

    def __init__(self, side: int, seed: int) -> None:
        self.rng = generator(seed)
        self.nodes = side * side
        number = np.arange(self.nodes).reshape(side, side)
        pairs = [*zip(number[:, :-1].flat, number[:, 1:].flat, strict=True)]
        pairs += [*zip(number[:-1].flat, number[1:].flat, strict=True)]
        self.arcs = [(int(a), int(b)) for i, j in pairs for a, b in ((i, j), (j, i))]
        self.time = self.rng.integers(1, 5, len(self.arcs)).astype(float)

    def distances(self, destination: int) -> Vector:
        """Return the least times to the destination, exact: they are whole numbers."""
        far = np.full(self.nodes, np.inf)
        far[destination] = 0.0
        for _ in range(self.nodes):
            for (tail, head), time in zip(self.arcs, self.time.tolist(), strict=True):
                far[tail] = min(far[tail], time + far[head])
        return far

    def routed(self, destination: int, demand: Vector, far: Vector) -> Vector:
        """Return flows on arcs that bring `demand` (nodes,) there on shortest ways; two equal ones are used alike."""
        flow, waiting = np.zeros(len(self.arcs)), demand.copy()
        for node in np.argsort(-far, kind="stable").tolist():
            if node == destination:
                continue
            best = [k for k, (a, b) in enumerate(self.arcs) if a == node and far[a] == self.time[k] + far[b]][:2]
            for k in best:
                flow[k] = waiting[node] / len(best)
                waiting[self.arcs[k][1]] += flow[k]
        return flow


def grid(side: int, destinations: int) -> Instance:
    """Build side × side crossings; z = for every destination d the flows on the arcs, then the costs π_i^d from i ≠ d.

    0 ≤ x_a^d ⟂ t_a(Σ_d x_a^d) − π_tail^d + π_head^d ≥ 0 for every arc, and Σ_out x − Σ_in x = demand_i^d with π free.
    The times at equilibrium and shortest ways come first, free times from them. Monotone; the flows to one destination
    need not be unique where several ways cost the same, flows on arcs and costs are.
    """
    net = _Grid(side, 10 * side + destinations)
    goals = net.rng.choice(net.nodes, destinations, replace=False).tolist()
    demand = np.zeros((destinations, net.nodes))
    for d, goal in enumerate(goals):
        origins = net.rng.choice([i for i in range(net.nodes) if i != goal], net.nodes // 3, replace=False)
        demand[d, origins] = net.rng.integers(1, 5, origins.size)
    far = np.array([net.distances(goal) for goal in goals])
    flow = np.array([net.routed(goal, demand[d], far[d]) for d, goal in enumerate(goals)])
    load = flow.sum(axis=0)
    capacity = 2.0 ** net.rng.integers(1, 4, load.size)
    free = net.time / (1.0 + CONGESTION * ((load / capacity) ** 2) ** 2)
    F, lb = _conditions(net, goals, demand, free, capacity)
    problem = MiCP(F=F, lb=lb, ub=np.full(lb.size, np.inf), name=f"traffic-grid-{side}x{side}-{destinations}")
    solution = [part for d, goal in enumerate(goals) for part in (flow[d], np.delete(far[d], goal))]
    facts = {"class": "monotone", "arcs": load.size, "destinations": destinations}
    return Instance(problem, MiCPPoint(z=np.concatenate(solution)), "planted to rounding", properties=facts)


def _conditions(net: _Grid, goals: list[int], demand: Dense, free: Vector, capacity: Vector) -> tuple[Map, Vector]:
    """Return F and the lower bounds."""
    arcs, each = len(net.arcs), len(net.arcs) + net.nodes - 1
    z = unknowns(len(goals) * each)
    flow = [z[d * each : d * each + arcs] for d in range(len(goals))]
    times = [
        t * (1.0 + CONGESTION * (total(x[a] for x in flow) / c) ** 4)
        for a, (t, c) in enumerate(zip(free.tolist(), capacity.tolist(), strict=True))
    ]
    rows: list[Symbol] = []
    for d, goal in enumerate(goals):
        names = [i for i in range(net.nodes) if i != goal]
        cost = dict(zip(names, z[d * each + arcs : (d + 1) * each], strict=True))
        for a, (tail, head) in enumerate(net.arcs):
            ahead = times[a] + cost[head] if head != goal else times[a]
            rows.append(ahead - cost[tail] if tail != goal else ahead)
        for i in names:
            out = total(flow[d][a] for a, (tail, _) in enumerate(net.arcs) if tail == i)
            back = total(flow[d][a] for a, (_, head) in enumerate(net.arcs) if head == i)
            rows.append(out - back - float(demand[d, i]))
    bounds = np.concatenate([np.zeros(arcs), np.full(net.nodes - 1, -np.inf)])
    return mapped(z, rows), np.tile(bounds, len(goals))
