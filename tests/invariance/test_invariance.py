"""A verdict depends on the problem and the answer only, not on how either is written."""

from __future__ import annotations

import pytest
from judges import BROKEN, COMPONENTWISE, cpbench_judge
from rewritten import INVARIANCES, PAIRS, examine

SEEDS = (1, 2)


@pytest.mark.parametrize(("variant", "invariance"), PAIRS, ids=lambda name: name.replace(" ", "-"))
def test_the_verdict_stays(variant: str, invariance: str) -> None:
    results = [examine(cpbench_judge, variant, invariance, seed) for seed in SEEDS]
    counted = sum(count for count, _ in results)
    assert counted or invariance == "representation", (
        "nothing was judged"
    )  # edges are equivalent for some problems only
    failures = [str(failure) for _, failed in results for failure in failed]
    assert not failures, "\n".join(failures)


@pytest.mark.parametrize("invariance", INVARIANCES)
def test_some_judge_passes(invariance: str) -> None:
    """The measure written a second time, for small problems: no case asks for what cannot be."""
    for variant, name in PAIRS:
        if name == invariance:
            _, failures = examine(COMPONENTWISE, variant, invariance, SEEDS[0])
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
