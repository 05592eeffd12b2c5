"""A verdict depends on the problem and the answer only, not on how either is written."""

from __future__ import annotations

import pytest
from judges import BROKEN, cpbench_judge
from rewritten import PAIRS, examine

SEEDS = (1, 2)


@pytest.mark.parametrize("seed", [SEEDS[0], *(pytest.param(seed, marks=pytest.mark.nightly) for seed in SEEDS[1:])])
@pytest.mark.parametrize(("variant", "invariance"), PAIRS, ids=lambda name: name.replace(" ", "-"))
def test_the_verdict_stays(variant: str, invariance: str, seed: int) -> None:
    counted, failures = examine(cpbench_judge, variant, invariance, seed)
    # edges are equivalent for some problems only
    assert counted or invariance == "representation", "nothing was judged"
    assert not failures, "\n".join(map(str, failures))


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_judge_is_caught_by_its_invariance(name: str) -> None:
    """Some answer that it is right about is judged otherwise as it is written in another way."""
    broken = BROKEN[name]
    assert any(
        failure.plain.solved is failure.answer.right
        for seed in SEEDS
        for variant, invariance in PAIRS
        if invariance == broken.invariance
        for failure in examine(broken.judge, variant, invariance, seed)[1]
    )
