"""Real files of the other formulations: answers behind edges, corrupted contacts, complementary bases."""

from __future__ import annotations

import functools
import random
from pathlib import Path
from typing import Any

import complementary_bases
import contact_corruptions
import drawn_problems
import pytest
import real_files
from equivalent_edges import OTHERS, WRONG, carried, pair_case

from cpbench import storage
from cpbench.errors import CpbenchError

SEED = 31
EPSILON = 1e-6
UNKNOWNS = 700
SMALL_FILE = 40_000
"""Largest file that the fast tests draw [bytes]."""


def _drawn(count: int, *folders: str) -> list[Any]:
    """Return `count` small files of the folders, drawn by SEED, and all others as nightly cases."""
    if not real_files.DATA.is_dir():
        return ["(absent)"]
    every = [f"{file.parent.name}/{file.name}" for file in real_files.files(*folders)]
    small = [name for name in every if (real_files.DATA / name).stat().st_size < SMALL_FILE]
    fast = random.Random(SEED).sample(small, count)
    return [*fast, *(pytest.param(name, marks=pytest.mark.nightly) for name in every if name not in fast)]


@functools.cache
def _loaded(name: str) -> Any:
    """Return the problem of a file; skips what cpbench does not read, and what is large."""
    try:
        problem: Any = storage.load(real_files.DATA / name)
    except CpbenchError:
        pytest.skip("does not apply: no file of a problem")
    if sum(problem.point_sizes.values()) > UNKNOWNS:
        pytest.skip(f"does not apply: more than {UNKNOWNS} unknowns")
    return problem


@pytest.mark.parametrize("name", _drawn(10, *OTHERS))
def test_right_and_wrong_answers_keep_their_verdicts_behind_edges(shared_data: Path, name: str) -> None:
    case = pair_case(name, _loaded(name), WRONG * EPSILON, 3)
    if case is None:
        pytest.skip("does not apply: no answer is right to rounding")
    rows = list(carried(case, EPSILON, depth=2))
    assert sum(row.right for row in rows) > 0
    false = [
        f"{row.edge or '(source)'} {row.label}: right {row.right}, {row.error:.1e}"
        for row in rows
        if row.false and not row.known
    ]
    assert not false, f"{len(false)} of {len(rows)} verdicts:\n" + "\n".join(false[:20])


@pytest.mark.parametrize("name", _drawn(8, "fc2d_local", "fc3d_local"))
def test_no_corrupted_contact_passes_unflagged(shared_data: Path, name: str) -> None:
    """No contact misses its law by more than 5 % in an answer that is accepted at 1e-6 without a remark."""
    problem = _loaded(name)
    r = contact_corruptions.right_answer(problem)
    if r is None:
        pytest.skip("does not apply: no answer is right to 1e-8")
    rows = list(contact_corruptions.corruptions(name, problem, r, EPSILON))
    assert rows or not r.any()
    false = [
        f"contact {row.contact} {row.kind}: {row.error:.1e}, law {row.missed:.2g}" for row in rows if row.unflagged
    ]
    assert not false, f"{len(false)} of {len(rows)} corruptions:\n" + "\n".join(false[:20])


def _bases(name: str, problem: Any) -> None:
    rows = list(complementary_bases.judged(name, problem, EPSILON, 12))
    false = [f"{row.label}: right {row.right}, {row.error:.1e}" for row in rows if row.false and not row.known]
    assert not false, f"{len(false)} of {len(rows)} points:\n" + "\n".join(false[:20])


@pytest.mark.parametrize("name", _drawn(10, "lcp", "mlcp"))
def test_points_of_complementary_bases(shared_data: Path, name: str) -> None:
    """The point of a basis is solved where it is a solution, and not where a neighbour of it is wrong by 1000 ε."""
    _bases(name, _loaded(name))


@pytest.mark.nightly
def test_points_of_complementary_bases_of_qps(shared_data: Path) -> None:
    for name, problem in complementary_bases.problems(600):
        _bases(name, problem)


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(31, 35))
def test_drawn_problems(seed: int) -> None:
    """Problems that are no files, under the checks of the files."""
    lines = drawn_problems.check(seed, EPSILON, 2.0)
    assert not lines, "\n".join(lines[:20])
