"""Answers of many solvers to real QPs: none is falsely judged, in whatever way the QP is written.

Thresholds are those by which a reader would call a verdict false; they are not those of the judge.
"""

from __future__ import annotations

import functools
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import qp_rewritings
import real_files
from equivalent_edges import WRONG, carried, qp_case
from measure import EPSILONS, measured
from qp_literature import Reference, unknown_sizes
from qp_references import Answers, collect

SEED = 31
NAMED = ("QSC205.mat", "QAFIRO.mat", "GOULDQP2.mat")
"""Files on which a judge has accepted answers whose objective was off by a tenth and more."""
DRAWN = 5
"""Further files of the fast tests, drawn by SEED from the small ones."""
SMALL_FILE = 9_000
"""Largest file that the fast tests draw [bytes]."""
INVARIANT = {"units by powers of two": 2.0, "equalities as pairs of rows": 2.0}
"""Ways of writing in which the error of an answer is the same but for this factor."""
OTHER_SIZES = {
    "QSC205.mat": ("pᵀz as an unknown",),
    "GOULDQP2.mat": ("bounds as rows",),
    "OBSTCLAE-n529.npz": ("pᵀz as an unknown",),
}
"""Files and ways of writing in which rows have the size of larger ones: by how much is said in docs/methods/verdict.md.
Which answers are compared depends on how far methods come in their time."""
SLACK = 10.0
"""An answer that is solved in one way has at most this many ε in the others."""


def _names() -> list[str]:
    """Return the files of the fast tests, then all others as nightly ones."""
    if not real_files.DATA.is_dir():
        return list(NAMED)
    every = [(file.name, file.stat().st_size) for file in real_files.files("qp", "box_qp")]
    small = [name for name, size in every if size < SMALL_FILE and name not in NAMED]
    return [*NAMED, *random.Random(SEED).sample(small, DRAWN)]


def _cases() -> list[Any]:
    fast = _names()
    if not real_files.DATA.is_dir():
        return fast
    others = [file.name for file in real_files.files("qp", "box_qp") if file.name not in fast]
    return [*fast, *(pytest.param(name, marks=pytest.mark.nightly) for name in others)]


CASES = _cases()


@functools.cache
def _answered(name: str) -> tuple[Any, Answers, Reference]:
    """Return a QP, answers to it, and its reference; skips what is no convex QP or has no reference."""
    problem = next((problem for _, problem in real_files.convex_qps([name])), None)
    if problem is None:
        pytest.skip("does not apply: no convex QP of at most 2,000 unknowns")
    answers, reference = collect(problem, 0.5 if name in _names() else 3.0)
    if reference is None:
        pytest.skip("does not apply: no two methods agree on an optimal value with terms")
    return problem, answers, reference


@pytest.mark.parametrize("name", CASES)
def test_no_answer_is_falsely_solved(shared_data: Path, name: str) -> None:
    """Solved answers have their objective, rows and bounds within 10 ε of their terms."""
    problem, answers, reference = _answered(name)
    sizes = unknown_sizes(problem, reference)
    rows = [row for label, x in answers for row in measured(name, problem, label, x, reference, sizes, EPSILONS)]
    assert sum(row.solved for row in rows) > 0
    false = [str(row) for row in rows if row.falsely_solved]
    assert not false, f"{len(false)} of {len(rows)} verdicts:\n" + "\n".join(false[:20])


@pytest.mark.parametrize("name", CASES)
def test_no_right_answer_is_rejected(shared_data: Path, name: str) -> None:
    """Answers whose literature's numbers are all within ε/100, row by row, are solved."""
    problem, answers, reference = _answered(name)
    sizes = unknown_sizes(problem, reference)
    rows = [row for label, x in answers for row in measured(name, problem, label, x, reference, sizes, EPSILONS)]
    right = [row for row in rows if row.right(by_row=True)]
    false = [str(row) for row in right if not row.solved]
    assert not false, f"{len(false)} of {len(right)} right answers:\n" + "\n".join(false[:20])


@pytest.mark.parametrize("name", CASES)
def test_right_and_wrong_answers_keep_their_verdicts_behind_edges(shared_data: Path, name: str) -> None:
    """Right answers are solved, answers off by 1000 ε are not: on the QP and behind every equivalent edge."""
    problem, answers, reference = _answered(name)
    fast = name in _names()
    case = qp_case(name, problem, answers, reference, WRONG * 1e-6, 2 if fast else 6)
    if case is None:
        pytest.skip("does not apply: no answer is right to 1e-9")
    rows = list(carried(case, 1e-6, depth=1 if fast else 2))
    assert sum(row.right for row in rows) > 0
    false = [
        f"{row.edge or '(source)'} {row.label}: right {row.right}, {row.error:.1e}"
        for row in rows
        if row.false and not row.known
    ]
    assert not false, f"{len(false)} of {len(rows)} verdicts:\n" + "\n".join(false[:20])


@pytest.mark.parametrize("name", CASES)
def test_the_verdict_does_not_depend_on_the_way_of_writing(shared_data: Path, name: str) -> None:
    problem, answers, _ = _answered(name)
    chosen = [answers[k] for k in np.random.default_rng(SEED).permutation(len(answers))[:12]]
    false: list[str] = []
    for row in qp_rewritings.compared(name, problem, chosen, 1e-6):
        if row.how in INVARIANT:
            held = row.ratio <= INVARIANT[row.how]
        else:
            known = row.how in OTHER_SIZES.get(name, ())
            held = known or not row.apart or max(row.first, row.second) <= SLACK * 1e-6
        if not held:
            false.append(f"{row.label} {row.how}: {row.first:.1e} -> {row.second:.1e}")
    assert not false, "\n".join(false[:20])
