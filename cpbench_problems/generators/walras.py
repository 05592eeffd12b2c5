"""Exchange economies: prices p at which nobody wants more than there is.

Consumer h owns e_h and spends the share α_hj of the income p·e_h on good j (Cobb and Douglas). Prices are planted: what
everybody consumes at p* comes first, then endowments that differ from it by trades of equal value. Prices and shares
are powers of two, so that all is exact. F has degree 0 in p and is not defined at p = 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.formulations.nonlinear import NCP, MiCP, MiCPPoint, NCPPoint
from cpbench.foundation.matrices import Dense, Vector
from cpbench.generators.base import Instance, collection, generator
from cpbench_problems.generators.symbols import Symbol, mapped, product, unknowns

PRICES = (0.25, 1.0, 4.0)
SHARES = 16
"""Shares are whole numbers over this one."""


@collection(
    "walras",
    "ncp",
    "Cobb–Douglas exchange economies, solved by a ray of prices",
    "Arrow and Debreu 1954, Econometrica 22:265; Mathiesen 1987, Math. Prog. 37:1; planted by cpbench",
)
def build() -> list[Instance]:
    return [cobb_douglas(goods, people) for goods, people in ((4, 3), (10, 5), (40, 12), (30, 4), (60, 8))]


@collection(
    "scarf-activities",
    "micp",
    "economies with production by linear activities, the price of the first good given",
    "Scarf 1973, The Computation of Economic Equilibria, Yale; Mathiesen 1985, Math. Prog. Study 23:144; planted by "
    "cpbench",
)
def build_activities() -> list[Instance]:
    return [activities(goods, people, k) for goods, people, k in ((4, 2, 3), (12, 5, 10), (30, 6, 24), (20, 6, 16))]


@collection(
    "walras-large",
    "ncp",
    "Cobb–Douglas exchange economies of up to 2000 goods",
    "Arrow and Debreu 1954, Econometrica 22:265; planted by cpbench",
    tier="standard",
)
def build_large() -> list[Instance]:
    return [cobb_douglas(goods, people) for goods, people in ((200, 20), (1000, 70), (2000, 130))]


class _Economy:
    """Prices p* (goods,), shares α (people, goods) with rows of sum 1, consumption x and endowments e ≥ 0 at p*.

    Everything is wanted by somebody; `people` times SHARES must be at least `goods`.
    """

    def __init__(self, goods: int, people: int, seed: int) -> None:
        self.rng = rng = generator(seed)
        self.p = rng.choice(PRICES, goods)
        self.p[0] = 1.0
        marks = rng.integers(0, goods, (people, SHARES))
        marks.reshape(-1)[:goods] = rng.permutation(goods)
        self.shares = np.array([np.bincount(m, minlength=goods) for m in marks]) / SHARES
        income = rng.integers(2, 9, people) * 32.0
        self.x = self.shares * income[:, None] / self.p
        self.e = self.x + self._trades(goods, people)

    def _trades(self, goods: int, people: int) -> Dense:
        """Draw endowments: everybody owns some of what the next one eats most, for as much, by value, of what it eats
        itself.
        """
        trade = np.zeros((people, goods))
        best = self.shares.argmax(axis=1)
        for h in range(people):
            other = (h + 1) % people
            for good, eater, owner in ((best[h], h, other), (best[other], other, h)):
                trade[[eater, owner], good] += np.array([-1.0, 1.0]) / self.p[good]
        return trade

    def income(self, p: list[Symbol]) -> list[Symbol]:
        return product(self.e, p)


def _demand(shares: Dense, income: list[Symbol], p: list[Symbol]) -> list[Symbol]:
    """Return the demand of Cobb and Douglas, good by good."""
    spent = product(shares.T, income)
    return [amount / price for amount, price in zip(spent, p, strict=True)]


def _excess(supply: Vector, demand: list[Symbol]) -> list[Any]:
    return [s - d for s, d in zip(supply.tolist(), demand, strict=True)]


def cobb_douglas(goods: int, people: int) -> Instance:
    """Build 0 ≤ p ⟂ supply − demand(p) ≥ 0; with p*, every t p* with t > 0 is a solution, F′ is singular there."""
    economy = _Economy(goods, people, 100 * goods + people)
    p = unknowns(goods)
    F = mapped(p, _excess(economy.e.sum(axis=0), _demand(economy.shares, economy.income(p), p)))
    problem = NCP(F=F, start=np.ones(goods), name=f"cobb-douglas-{goods}-{people}")
    facts = {"class": "homogeneous, singular", "ray": "t·solution, t > 0"}
    return Instance(problem, NCPPoint(z=economy.p), "planted", properties=facts)


def activities(goods: int, people: int, k: int) -> Instance:
    """Build 0 ≤ y ⟂ −Aᵀp ≥ 0, 0 ≤ p ⟂ supply + Ay − demand(p) ≥ 0, p₁ = 1; two of three activities are in use."""
    economy = _Economy(goods, people, 100 * goods + people + k)
    rng, p_star = economy.rng, economy.p
    used = np.arange(k) % 3 != 2
    y_star = np.where(used, rng.integers(1, 5, k) / 8.0, 0.0)
    A = np.zeros((goods, k))
    for a in range(k):
        output, input_ = rng.choice(goods, 2, replace=False)
        A[output, a] = 1.0
        A[input_, a] = -p_star[output] / p_star[input_] * (1.0 if used[a] else 1.5)
    e = economy.e.copy()
    for a in np.flatnonzero(used):  # worth nothing at p*, so that incomes stay
        e[economy.x[:, A[:, a] > 0].argmax()] -= A[:, a] * y_star[a]
    z = unknowns(k + goods)
    y, p = z[:k], z[k:]
    demand = _demand(economy.shares, product(e, p), p)
    produced = product(A, y)
    profit = [0.0 - worth for worth in product(A.T, p)]
    net = [s + m - d for s, m, d in zip(e.sum(axis=0).tolist(), produced, demand, strict=True)]
    lb, ub = np.zeros(k + goods), np.full(k + goods, np.inf)
    lb[k] = ub[k] = 1.0
    start = np.concatenate([np.zeros(k), np.ones(goods)])
    problem = MiCP(F=mapped(z, profit + net), lb=lb, ub=ub, start=start, name=f"activities-{goods}-{people}-{k}")
    facts = {"class": "not monotone", "fixed_unknowns": 1, "activities_in_use": int(used.sum())}
    return Instance(problem, MiCPPoint(z=np.concatenate([y_star, p_star])), "planted", properties=facts)
