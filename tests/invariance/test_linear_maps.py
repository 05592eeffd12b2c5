"""One answer to one linear problem has one verdict, whatever the formulation that the problem is written in."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from judges import Judge, cpbench_judge, rows_one_by_one
from linear_maps import KINDS, beside_a_curve, written

FAST = range(2)
SEEDS = range(40)


def _failures(judge: Judge, kind: str, seed: int) -> tuple[Counter[str], list[str]]:
    """How often a formulation was asked about, and verdicts that are not right."""
    rng = np.random.default_rng([seed, sum(map(ord, kind))])
    asked, failures = Counter[str](), []
    for answer in KINDS[kind](rng):
        for other in (answer, *written(answer)):
            asked[other.problem.node] += 1
            # beside a curve rows are measured one by one: the tail of what decays has no digits of its own, and what
            # grows hides a miss in its own terms
            curve = other.problem.node == "ncp" and kind not in ("decaying", "growing")
            whole = [other, beside_a_curve(other, rng)] if curve else [other]
            for case in whole:
                solved, error = judge(case.problem, case.point, case.tolerance)
                if solved is not case.right:
                    failures.append(f"{kind}, seed {seed}, {case.problem.node} via {case.via}: error {error:.1e}")
    return asked, failures


@pytest.mark.parametrize("seed", [s if s in FAST else pytest.param(s, marks=pytest.mark.nightly) for s in SEEDS])
@pytest.mark.parametrize("kind", KINDS)
def test_the_verdict_is_the_same_in_all_formulations(kind: str, seed: int) -> None:
    asked, failures = _failures(cpbench_judge, kind, seed)
    assert {"micp", "vi"} <= asked.keys(), asked
    assert not failures, "\n".join(failures)


@pytest.mark.parametrize("kind", ["growing", "decaying"])
def test_a_judge_of_single_rows_is_caught(kind: str) -> None:
    """By answers that it is right about in a linear formulation."""
    _, failures = _failures(rows_one_by_one, kind, FAST[0])
    assert any(" ncp " in failure for failure in failures)
    assert not any(" lcp " in failure for failure in failures)
