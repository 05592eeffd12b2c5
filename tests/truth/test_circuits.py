"""Circuits whose conductances lie fifteen decades apart: what a weak conductance joins hides no wrong answer."""

from __future__ import annotations

import equivalent_edges
import numpy as np
import pytest
import unseen_algebra
from drawn_problems import LEAST, MOST

from cpbench.verification import judge

pytestmark = pytest.mark.needs("cpbench_solvers")

EPSILON = 1e-6
HIDDEN = (4002, 4012, 4023, 4032)
"""Circuits whose wrong answers least-squares logarithms with weights that vanish have passed."""
OTHERS = [seed for seed in range(4000, 4040) if seed not in HIDDEN]


@pytest.mark.parametrize("seed", [*HIDDEN, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in OTHERS)])
def test_wrong_currents_and_voltages_are_not_solved(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = unseen_algebra.circuit(rng, int(rng.integers(LEAST, MOST)))
    case = equivalent_edges.pair_case(f"circuit-{seed}", problem, equivalent_edges.WRONG * EPSILON, 6)
    assert case is not None
    assert case.wrong
    assert all(judge(problem, point, EPSILON).solved for _, point in case.right)
    accepted = [label for label, point in case.wrong if judge(problem, point, EPSILON).solved]
    assert not accepted
