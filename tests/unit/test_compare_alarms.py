"""False alarms and missed changes on made-up noise: what a comparison may say of two runs of the same code.

The noise: repeats of a solve are lognormal with 3 to 6 %, the moments of two solves of one problem differ by 1.5 %, the
problems of a family by 1 % on each side, every process by 2 % on all its problems, and one pair in a hundred was
disturbed (half as long again).
"""

from __future__ import annotations

import json
from collections import Counter

import numpy as np
import pandas as pd
import pytest
from synthetic_results import row
from tiers import by_night

from cpbench.analysis.comparison import Comparison, ComparisonSide, PairVerdict, Thresholds, compare, compare_labels

FAMILIES, EACH = 6, 5
MACHINES = {"here": {"cpu": "a processor", "cores": 2}}


def timed(
    label: str, rng: np.random.Generator, size: np.ndarray, factor: float = 1.0, repeats: int = 3, bias: float = 0.02
) -> list[dict]:
    """A solver's rows: `size` is what each problem takes in seconds, without noise."""
    process = rng.normal(0, bias)
    family = np.repeat(rng.normal(0, 0.01, FAMILIES), EACH)
    moment = rng.normal(0, 0.015, len(size)) + np.log(1.5) * (rng.uniform(size=len(size)) < 0.01)
    spread = rng.uniform(0.03, 0.06, (len(size), 1))
    samples = (factor * size * np.exp(process + family + moment))[:, None] * np.exp(
        spread * rng.standard_normal((len(size), repeats))
    )
    return [
        row(
            f"{'abcdef'[k // EACH]}-{k}",
            label,
            "solved",
            float(np.median(own)),
            samples=json.dumps(own.tolist()),
            cpu=float(own[0]),
            solver=label,
            request="exact",
            host="here",
            counters='{"iterations": 10}',
        )
        for k, own in enumerate(samples)
    ]


def references(rng: np.random.Generator) -> list[dict[str, float]]:
    return [{"seconds": float(1e-4 * np.exp(0.03 * rng.standard_normal()))} for _ in range(2)]


def files(seed: int, factor: float) -> Comparison:
    """One solver in two runs, the second `factor` times slower."""
    rng = np.random.default_rng(seed)
    size = np.exp(rng.normal(-5, 1, FAMILIES * EACH))
    sides = (
        ComparisonSide(name, pd.DataFrame(timed("mine", rng, size, times)), {"references": references(rng)}, MACHINES)
        for name, times in (("base", 1.0), ("new", factor))
    )
    return compare(*sides, Thresholds(seed=seed))


def labels(seed: int, factor: float, repeats: int = 3, bias: float = 0.02) -> Comparison:
    """Three builds in one run: the base twice, and one that is `factor` times slower."""
    rng = np.random.default_rng(seed)
    size = np.exp(rng.normal(-5, 1, FAMILIES * EACH))
    builds = {"mine@base": 1.0, "mine@again": 1.0, "mine@head": factor}
    rows = [r for name, times in builds.items() for r in timed(name, rng, size, times, repeats, bias)]
    run = ComparisonSide("run", pd.DataFrame(rows), {"references": references(rng)}, MACHINES)
    return compare_labels(run, "mine@base", "mine@head", Thresholds(seed=seed), ("mine@base", "mine@again"))


def verdicts(made: list[Comparison]) -> Counter[PairVerdict]:
    return Counter(found.verdict for found in made)


@pytest.mark.parametrize(("kind", "number"), [(files, 8), *by_night([(files, 200), (labels, 100)])])
def test_equal_code_is_called_so(kind, number: int) -> None:
    told = verdicts([kind(seed, 1.0) for seed in range(number)])
    assert told[PairVerdict.REGRESSED] + told[PairVerdict.IMPROVED] <= 0.05 * number, told
    assert told[PairVerdict.SAME] >= 0.1 * number, "silence is no answer either"


@pytest.mark.parametrize(("kind", "number"), [(files, 6), *by_night([(files, 200), (labels, 100)])])
def test_a_fifth_more_time_is_found(kind, number: int) -> None:
    told = verdicts([kind(seed, 1.2) for seed in range(number)])
    assert told[PairVerdict.REGRESSED] >= 0.95 * number, told


@pytest.mark.parametrize(("bias", "number"), [(0.04, 8), *by_night([(0.02, 200), (0.04, 200)])])
def test_a_bias_that_equal_builds_show_is_allowed_for(bias: float, number: int) -> None:
    """One of 25 alarms, within two standard errors of so many trials."""
    told = verdicts([labels(seed, 1.0, bias=bias) for seed in range(number)])
    alarms = told[PairVerdict.REGRESSED] + told[PairVerdict.IMPROVED]
    assert alarms <= 0.04 * number + 2 * np.sqrt(0.04 * 0.96 * number), told
    found = labels(0, 1.0, bias=bias)
    assert any("equal builds differ by" in note for note in found.notes)


def test_a_bias_without_evidence_is_called_assumed() -> None:
    assert any("no builds of equal code" in note for note in files(0, 1.0).notes)


@pytest.mark.nightly
def test_more_repeats_raise_no_more_alarms() -> None:
    """Ten repeats of one moment are compared by ranks, and are still of one moment."""
    told = verdicts([labels(seed, 1.0, repeats=10) for seed in range(40)])
    assert told[PairVerdict.REGRESSED] + told[PairVerdict.IMPROVED] <= 0.05 * 40, told
