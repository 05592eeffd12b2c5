"""Phases of a sequence: planted changes of what a warm start saves."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from cpbench.analysis.phases import Stretch, medians, phases


def planted(ratios: dict[str, list[tuple[int, float]]], noise: float, seed: int) -> pd.DataFrame:
    """Rows with ratios around the planted ones, of solvers whose (number of steps, ratio) follow one another."""
    draw = np.random.default_rng(seed)
    rows = []
    for label, parts in ratios.items():
        values = np.repeat([ratio for _, ratio in parts], [count for count, _ in parts])
        values = values * np.exp(noise * draw.standard_normal(values.size))
        rows += [{"step": step, "label": label, "ratio": value} for step, value in enumerate(values)]
    return pd.DataFrame(rows)


@pytest.mark.parametrize("seed", range(4))
def test_a_planted_change_is_seen_at_its_step(seed: int) -> None:
    """Nothing is saved until step 57, then a factor of 12 and of 3, with a noise of 15 %."""
    found = phases(planted({"a": [(57, 1.0), (90, 1 / 12)], "b": [(57, 1.1), (90, 1 / 3)]}, 0.15, seed))
    assert found == [Stretch(0, 56), Stretch(57, 146)]


@pytest.mark.parametrize("seed", range(4))
def test_noise_alone_is_one_phase(seed: int) -> None:
    assert phases(planted({"a": [(120, 0.4)], "b": [(120, 0.9)]}, 0.3, seed)) == [Stretch(0, 119)]


def test_three_phases_and_their_medians() -> None:
    found = planted({"a": [(30, 0.9), (40, 0.1), (30, 0.6)]}, 0.05, 9)
    parts = phases(found)
    assert parts == [Stretch(0, 29), Stretch(30, 69), Stretch(70, 99)]
    of = medians(found, parts)
    assert of["median"].to_numpy() == pytest.approx([0.9, 0.1, 0.6], rel=0.05)
    assert of["steps"].tolist() == [30, 40, 30]
    assert (of["low"] < of["median"]).all()
    assert (of["median"] < of["high"]).all()


def test_steps_without_a_ratio_say_nothing() -> None:
    found = planted({"a": [(20, 1.0), (20, 0.2)]}, 0.02, 3)
    found.loc[[4, 19, 31], "ratio"] = np.nan
    assert phases(found)[1].first == 20
    assert phases(found.assign(ratio=np.nan)) == []
