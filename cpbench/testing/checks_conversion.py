"""Checks of a conversion: an edge with `apply`, `lift` and, where it has one, `push`."""

from __future__ import annotations

import contextlib
import dataclasses
import inspect
import pickle
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cpbench import graph, matrices, storage
from cpbench.conversions import Conversion
from cpbench.errors import NotApplicable
from cpbench.formulations import Problem, formulations
from cpbench.testing.cases import Case

LIFTED = 1e-7
"""Error of a lifted solution: the conversion may lose digits, not more than half of them."""


def _open(edge: Conversion, cases: list[Case]) -> Iterator[tuple[Case, Problem]]:
    """Cases that take the edge, with the converted problem."""
    for case in cases:
        if edge.obstacle(case.problem) is None:
            try:
                yield case, edge.step(case.problem)
            except NotApplicable:
                continue


def check_some_case_takes_it(edge: Conversion, cases: list[Case]) -> None:
    assert any(True for _ in _open(edge, cases)), "no planted case takes the edge: nothing else is checked"


def check_types_are_those_declared(edge: Conversion, cases: list[Case]) -> None:
    assert formulations.get(edge.source)
    for case, target in _open(edge, cases):
        assert target.node == edge.target, case.name
        assert isinstance(edge.exactness(case.problem), type(edge.kind))


def check_the_input_stays(edge: Conversion, cases: list[Case]) -> None:
    """The data are the same afterwards, bit for bit (they are read-only, but an edge could replace them)."""
    for case in cases:
        before = {k: (id(v), matrices.digest(v)) for k, v in case.problem.data().items()}
        if edge.obstacle(case.problem) is None:
            with contextlib.suppress(NotApplicable):
                edge.apply(case.problem)
        after = {k: (id(v), matrices.digest(v)) for k, v in case.problem.data().items()}
        assert before == after, f"{case.name}: the conversion changed its input"


def check_the_same_twice(edge: Conversion, cases: list[Case]) -> None:
    for case, target in _open(edge, cases):
        assert edge.step(case.problem).fingerprint == target.fingerprint, case.name


def check_obstacles_are_kept(edge: Conversion, cases: list[Case]) -> None:
    """Where there is an obstacle, `apply` raises it and does nothing else."""
    for case in cases:
        why = edge.obstacle(case.problem)
        if why is not None:
            assert why, case.name
            with pytest.raises(NotApplicable):
                edge.apply(case.problem)


def check_lift_undoes_push(edge: Conversion, cases: list[Case]) -> None:
    """An exact edge: a solution pushed forward solves the target, and lifted back solves the source."""
    for case, target in _open(edge, cases):
        if not edge.exactness(case.problem).exact:
            continue
        trace = target.provenance[-1].trace
        there = edge.push(case.point, trace)
        error = target.residuals(there).error
        assert error <= LIFTED, f"{case.name}: the pushed solution has error {error:.1e} on the target"
        back = edge.lift(there, trace)
        error = case.problem.residuals(back).error
        assert error <= LIFTED, f"{case.name}: the lifted solution has error {error:.1e} on the source"


def check_lift_works_in_another_process(edge: Conversion, cases: list[Case]) -> None:
    """What is needed for the way back survives a file and a pickle."""
    with tempfile.TemporaryDirectory() as folder:
        for k, (case, target) in enumerate(_open(edge, cases)):
            path = Path(folder) / f"{k}.h5"
            storage.save(target, path)
            again = storage.load(path)
            copied = pickle.loads(pickle.dumps(target))
            point = again.zero_point()
            lifted = [graph.lift(p, point).arrays() for p in (target, again, copied)]
            for other in lifted[1:]:
                for part, value in lifted[0].items():
                    np.testing.assert_allclose(other[part], value, rtol=1e-12, atol=1e-12, err_msg=case.name)


def check_sparse_as_dense(edge: Conversion, cases: list[Case]) -> None:
    """The same target from sparse and from dense data, to rounding."""
    for case, target in _open(edge, cases):
        for change in (matrices.sparse, matrices.dense):
            stored = {k: change(v) for k, v in case.problem.data().items() if v.ndim == 2}
            twin = edge.step(dataclasses.replace(case.problem, **stored))
            for name, value in target.data().items():
                mine, theirs = (matrices.dense(x) if x.ndim == 2 else x for x in (value, twin.data()[name]))
                top = max(matrices.max_abs(mine), 1e-300)
                np.testing.assert_allclose(
                    np.nan_to_num(theirs, posinf=1e300, neginf=-1e300) / top,
                    np.nan_to_num(mine, posinf=1e300, neginf=-1e300) / top,
                    atol=1e-10, rtol=1e-10, err_msg=f"{case.name}: {name}",
                )  # fmt: skip


def check_the_mathematics_is_written_down(edge: Conversion, cases: list[Case]) -> None:
    """The module says source, target, lift and kind in words and formulas."""
    text = inspect.getdoc(sys.modules[type(edge).__module__]) or ""
    missing = [word for word in ("Source", "Target", "Lift", "Kind") if word not in text]
    assert not missing, f"the module does not say: {', '.join(missing)}"
    assert edge.cost > 0
