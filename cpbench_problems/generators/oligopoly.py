"""Cournot's oligopoly: every firm produces what is best for it, given what the others produce."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cpbench.formulations.nonlinear import NCP, NCPPoint
from cpbench.foundation.matrices import Vector
from cpbench.generators.base import Instance, collection, generator
from cpbench_problems.generators.ncp_classics import points
from cpbench_problems.generators.symbols import mapped, total, unknowns

FIVE = (36.93251081573577, 41.818141660437625, 43.706578522274214, 42.659239743305115, 39.17895251662502)
"""Equilibrium of the five firms, published as 36.93, 41.82, 43.71, 42.66, 39.18; digits by mpmath with 50 of them."""
TEN = (
    7.441546697058734, 4.097810447347321, 2.590643747438953, 0.9353857680722274, 17.94895234200661,
    4.097810447347321, 1.304725757680007, 5.590082543557631, 3.2221794538246153, 1.677094316839327,
)  # fmt: skip
"""Of the ten firms, published to four digits after the point."""
TEN_STARTS = (
    (1.0,) * 10,
    (10.0,) * 10,
    (1.0, 1.2, 1.4, 1.6, 1.8, 2.1, 2.3, 2.5, 2.7, 2.9),
    (7.0, 4, 3, 1, 18, 4, 1, 6, 3, 2),
)
"""Those of MCPLIB's nash."""


@collection(
    "nash-cournot",
    "ncp",
    "Cournot–Nash equilibria of 5, 10 and more firms",
    "Murphy, Sherali, Soyster 1982, Math. Prog. 24:92 (5 firms); Harker 1988, Math. Prog. 41:29 (10 firms); larger "
    "ones planted by cpbench",
)
def build() -> list[Instance]:
    return [five(), ten(), *(firms(n) for n in (20, 100, 30, 40, 60))]


@collection(
    "nash-cournot-large",
    "ncp",
    "Cournot–Nash equilibria of up to 5000 firms, whose Jacobian is dense",
    "planted by cpbench, after Murphy, Sherali, Soyster 1982, Math. Prog. 24:92",
    tier="standard",
)
def build_large() -> list[Instance]:
    return [firms(n) for n in (500, 1000, 2000, 5000)]


def market(
    c: Sequence[float], scale: float, power: Sequence[float], gamma: float, demand: float, start: Vector, name: str
) -> NCP:
    """Build F_i(q) = c_i + (scale q_i)^power_i − p(Q) + q_i p(Q)/(γQ), p(Q) = (demand/Q)^(1/γ), Q = Σ q_i.

    Not defined at q = 0. With power_i < 1 the cost has an infinite slope at q_i = 0.
    """
    q = unknowns(len(c))
    Q = total(q)
    price = (demand / Q) ** (1.0 / gamma)
    drop = price / (gamma * Q)
    rows = [c_i + (scale * q_i) ** k - price + q_i * drop for c_i, q_i, k in zip(c, q, power, strict=True)]
    return NCP(F=mapped(q, rows), start=start, name=name)


def five() -> Instance:
    """Build the five firms of Murphy, Sherali and Soyster: marginal costs c + (q/5)^(1/β), p = (5000/Q)^(1/1.1)."""
    beta = (1.2, 1.1, 1.0, 0.9, 0.8)
    problem = market((10.0, 8, 6, 4, 2), 0.2, [1.0 / b for b in beta], 1.1, 5000.0, np.full(5, 10.0), "nash-cournot-5")
    facts = {"class": "P0 near the solution", "degenerate": False}
    return Instance(problem, NCPPoint(z=FIVE), "published", None, facts, points(problem.start))


def ten() -> Instance:
    """Build the ten firms of Harker: marginal costs c + (10q)^(1/β), p = (5000/Q)^(1/1.2)."""
    beta = (1.2, 1.0, 0.9, 0.6, 1.5, 1.0, 0.7, 1.1, 0.95, 0.75)
    c = (5.0, 3, 8, 5, 1, 3, 7, 4, 6, 3)
    start = np.array(TEN_STARTS[0])
    problem = market(c, 10.0, [1.0 / b for b in beta], 1.2, 5000.0, start, "nash-cournot-10")
    facts = {"class": "P0 near the solution", "degenerate": False}
    return Instance(problem, NCPPoint(z=TEN), "published", None, facts, points(*TEN_STARTS))


def firms(n: int) -> Instance:
    """Build n firms, every fifth of which stays out of the market: quantities first, then the c that make them best."""
    rng = generator(n)
    gamma, scale = 4.0 / 3.0, 0.25
    q = np.where(np.arange(n) % 5 == 4, 0.0, rng.integers(4, 33, n) / 4.0)
    power = rng.choice([1.0, 1.5, 2.0], n)
    demand = 64.0 * n
    Q = q.sum()
    root = np.sqrt(demand / Q)
    price = root * np.sqrt(root)  # powers by roots, which round alike on every machine
    s = scale * q
    cost = np.select([power == 1.0, power == 1.5], [s, s * np.sqrt(s)], s * s)
    c = price - q * price / (gamma * Q) - cost + np.where(q > 0, 0.0, rng.integers(1, 9, n) / 4.0)
    problem = market(c.tolist(), scale, power.tolist(), gamma, demand, np.full(n, 4.0), f"nash-cournot-{n}")
    facts = {"class": "convex costs", "out_of_the_market": int((q == 0).sum())}
    return Instance(problem, NCPPoint(z=q), "planted to rounding", properties=facts)
