"""Checks of a conversion: an edge with `apply`, `lift` and, where it has one, `push`."""

from __future__ import annotations

import dataclasses
import inspect
import pickle
import re
import tempfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np

from cpbench import graph, storage
from cpbench.conversions import Conversion
from cpbench.errors import NotApplicable
from cpbench.formulations import Problem, formulations
from cpbench.foundation import matrices
from cpbench.testing import Case, refused

LIFTED = 1e-7
"""Error of a lifted solution: the conversion may lose digits, not more than half of them."""
KEPT = 512
"""Problems that are kept as an edge converts them, so that its checks do not convert again."""


def _open(edge: Conversion, cases: list[Case]) -> Iterator[tuple[Case, Problem]]:
    """Yield cases that take the edge, with the converted problem."""
    for case in cases:
        if edge.obstacle(case.problem) is None:
            yield case, _converted(edge, case.problem)


@lru_cache(maxsize=KEPT)
def _converted(edge: Conversion, problem: Problem) -> Problem:
    return edge.step(problem)


def check_some_case_takes_it(edge: Conversion, cases: list[Case]) -> None:
    assert any(True for _ in _open(edge, cases)), "no planted case takes the edge: nothing else is checked"


def check_types_are_those_declared(edge: Conversion, cases: list[Case]) -> None:
    assert formulations.get(edge.source)
    for case, target in _open(edge, cases):
        assert target.node == edge.target, case.name
        assert isinstance(edge.exactness(case.problem), type(edge.kind))


def check_promises_agree(edge: Conversion, cases: list[Case]) -> None:
    """Check that an edge declares what it promises for a problem; no solver is asked for less."""
    declared = {graph.best_kind(edge), *edge.between, edge.kind}
    for case, target in _open(edge, cases):
        promise = edge.exactness(case.problem)
        assert promise in declared, f"{case.name}: {promise}, declared {', '.join(sorted(declared))}"
        assert target.provenance[-1].kind == promise, f"{case.name}: the step says {target.provenance[-1].kind}"
        for tolerance in (1e-4, 1e-8):
            wanted = edge.tolerance(tolerance, target.provenance[-1].trace)
            assert 0.0 < wanted <= tolerance, f"{case.name}: asks a solver for {wanted:.0e} to get {tolerance:.0e}"


def check_the_input_stays(edge: Conversion, cases: list[Case]) -> None:
    """Check that the data stay the same bit for bit (an edge could replace read-only arrays)."""
    for case in cases:
        before = _content(case.problem)
        if edge.obstacle(case.problem) is None:
            edge.apply(case.problem)
        assert before == _content(case.problem), f"{case.name}: the conversion changed its input"


def _content(problem: Problem) -> dict[str, tuple[int, bytes]]:
    """Return identity and digest of matrices, vectors and maps; the digest of a map is kept, so of a copy."""
    data = {k: (id(v), matrices.digest(v)) for k, v in problem.data().items()}
    return data | {k: (id(F), dataclasses.replace(F).digest) for k, F in problem.maps().items()}


def check_the_same_twice(edge: Conversion, cases: list[Case]) -> None:
    for case, target in _open(edge, cases):
        assert edge.step(case.problem).fingerprint == target.fingerprint, case.name


def check_obstacles_are_kept(edge: Conversion, cases: list[Case]) -> None:
    """Check that `apply` refuses where there is an obstacle, for that reason, and nowhere else."""
    for case in cases:
        why = edge.obstacle(case.problem)
        if why is not None:
            assert why, f"{case.name}: an obstacle without a word"
            with refused(NotApplicable, re.escape(why), case.name):
                edge.apply(case.problem)
        else:
            try:
                edge.apply(case.problem)
            except NotApplicable as refusal:
                raise AssertionError(f"{case.name}: no obstacle was told, and yet: {refusal}") from refusal


def check_lift_undoes_push(edge: Conversion, cases: list[Case]) -> None:
    """Check that a solution pushed over an exact edge solves the target, and lifted back the source."""
    for case, target in _open(edge, cases):
        if not edge.exactness(case.problem).exact:
            continue
        trace = target.provenance[-1].trace
        pushed = edge.push(case.point, trace)
        error = target.residuals(pushed).error
        assert error <= LIFTED, f"{case.name}: the pushed solution has error {error:.1e} on the target"
        back = edge.lift(pushed, trace)
        error = case.problem.residuals(back).error
        assert error <= LIFTED, f"{case.name}: the lifted solution has error {error:.1e} on the source"


def check_lift_works_in_another_process(edge: Conversion, cases: list[Case]) -> None:
    """Check that a new instance with the trace out of a file or a pickle lifts as the first one does."""
    with tempfile.TemporaryDirectory() as folder:
        for k, (case, target) in enumerate(_open(edge, cases)):
            path = Path(folder) / f"{k}.h5"
            storage.save(target, path)
            zero = target.zero_point()
            point = type(zero)(**{part: value + 1.0 for part, value in zero.arrays().items()})
            lifted = edge.lift(point, target.provenance[-1].trace).arrays()
            for other in (storage.load(path), pickle.loads(pickle.dumps(target))):
                try:
                    again = type(edge)(**edge.parameters).lift(point, other.provenance[-1].trace).arrays()
                except Exception as failure:
                    raise AssertionError(f"{case.name}: the trace alone does not lift: {failure!r}") from failure
                for part, value in lifted.items():
                    top = max(matrices.max_abs(value), 1e-300)
                    np.testing.assert_allclose(again[part] / top, value / top, atol=1e-12, err_msg=case.name)


def check_sparse_as_dense(edge: Conversion, cases: list[Case]) -> None:
    """Check that sparse and dense data give the same target, to rounding."""
    for case, target in _open(edge, cases):
        for change in (matrices.sparse, matrices.dense):
            stored = {k: change(v) for k, v in case.problem.data().items() if v.ndim == 2}
            twin = edge.step(dataclasses.replace(case.problem, **stored)).data()
            for name, value in target.data().items():
                mine, theirs = (matrices.dense(x) if x.ndim == 2 else x for x in (value, twin[name]))
                finite = np.isfinite(mine)
                same = mine.shape == theirs.shape and np.array_equal(mine[~finite], theirs[~finite])
                assert same, f"{case.name}: {name} has another shape or other infinite bounds when stored otherwise"
                off, top = matrices.max_abs(mine[finite] - theirs[finite]), matrices.max_abs(mine[finite])
                assert off <= 1e-10 * top, f"{case.name}: {name} is {off:.1e} off when stored otherwise"


def check_the_mathematics_is_written_down(edge: Conversion, cases: list[Case]) -> None:
    """Check that the docstring says source, target, lift and kind in words and formulas."""
    text = inspect.getdoc(type(edge)) or ""
    missing = [word for word in ("Source", "Target", "Lift", "Kind") if word not in text]
    assert not missing, f"the docstring does not say: {', '.join(missing)}"
    assert edge.cost > 0
