"""The drawn families give problems, and the automatic choice solves what its members solve."""

from __future__ import annotations

import zlib

import numpy as np
import pytest
import unseen

import cpbench
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge


def drawn(family: str, seed: int, size: int) -> cpbench.formulations.Problem:
    return unseen.FAMILIES[family](np.random.default_rng([seed, zlib.crc32(family.encode())]), size)


@pytest.mark.parametrize("family", unseen.FAMILIES)
def test_every_family_gives_problems_of_its_formulation_whatever_the_size(family: str) -> None:
    nodes = {drawn(family, seed, size).node for seed, size in enumerate((1, 2, 7, 30))}
    assert len(nodes) == 1


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("family", "auto"),
    [("arch", "auto-fc"), ("hand", "auto-fc"), ("ties", "auto-lcp"), ("global-jointed", "auto-gfc")],
)
def test_the_automatic_choice_solves_what_its_members_solve(family: str, auto: str, seed: int) -> None:
    problem = drawn(family, seed, 16)
    budget = Budget(tolerance=1e-8, seconds=30.0)
    member = solvers.get({"fc": "proximal-newton", "lcp": "lemke", "gfc": "admm-gfc"}[problem.node])
    assert member.run(problem, budget).claim is Claim.SOLVED
    output = solvers.get(auto).run(problem, budget)
    assert output.claim is Claim.SOLVED, output.message
    assert judge(problem, output.point, 1e-8).solved
