"""Every constant of the verdict is pinned from both sides by a test, or decides nothing."""

from __future__ import annotations

import pinned_constants
import pytest
from pinned_constants import EFFORT, GIVEN, PINNED


def test_every_constant_of_the_verdict_is_listed() -> None:
    assert sorted(name for name, _ in pinned_constants.constants()) == sorted([*PINNED, *EFFORT, *GIVEN])


@pytest.mark.parametrize("factor", [2.0, 0.5])
@pytest.mark.parametrize("name", ["linear.BALANCED", *(pytest.param(n, marks=pytest.mark.nightly) for n in PINNED)])
def test_a_constant_that_decides_is_pinned(name: str, factor: float) -> None:
    assert not pinned_constants.passes(name, factor)


@pytest.mark.nightly
@pytest.mark.parametrize("factor", [2.0, 0.5])
@pytest.mark.parametrize("name", EFFORT)
def test_a_constant_of_the_computation_decides_nothing(name: str, factor: float) -> None:
    assert pinned_constants.passes(name, factor)
