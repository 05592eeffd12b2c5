"""Checks of a formulation: a class of problems with its point and its residuals."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from cpbench.errors import PointError, ProblemError
from cpbench.formulations import Problem
from cpbench.formulations.expressions import Builder
from cpbench.foundation import matrices
from cpbench.testing import Case, refused
from cpbench.testing.equivalents import renumbered
from cpbench.verification import judge

EXACT = 1e-9


def check_planted_points_have_no_residual(node: type[Problem], cases: list[Case]) -> None:
    for case in cases:
        error = case.problem.residuals(case.point).error
        assert error <= EXACT, f"{case.name}: planted solution has error {error:.1e}"


def check_wrong_points_have_a_residual(node: type[Problem], cases: list[Case]) -> None:
    """Check that shifting every part of a solution by its size shows, unless nothing is unknown."""
    for case in cases:
        parts = {k: v + 1.0 + np.abs(v) for k, v in case.point.arrays().items()}
        if sum(v.size for v in parts.values()):
            error = case.problem.residuals(type(case.point)(**parts)).error
            assert error > 1e-6, f"{case.name}: a shifted solution has error {error:.1e}"


def check_nan_is_not_solved(node: type[Problem], cases: list[Case]) -> None:
    """Check that one NaN or infinity anywhere makes the error infinite, in the residuals themselves."""
    for case in cases:
        for part, value in case.point.arrays().items():
            for bad in (math.nan, math.inf):
                if value.size:
                    broken = value.copy()
                    broken[0] = bad
                    point = dataclasses.replace(case.point, **{part: broken})
                    assert not judge(case.problem, point, 1e3).within, f"{case.name}: {part} = {bad} passes"
                    error = case.problem.residuals(point).error
                    assert error > 1e3, f"{case.name}: {part} = {bad} has error {error:.1e}"


def check_shapes_are_named(node: type[Problem], cases: list[Case]) -> None:
    """Refuse arrays that are one row too long, and name them or what they disagree with; so with a map of
    one unknown more. A dimension that nothing else has may be any."""
    for case in cases:
        for name, value in case.problem.data().items():
            if _has_rows_of_its_own(node, name):
                continue
            longer = np.append(value, 1.0) if value.ndim == 1 else _one_row_more(value)
            with refused(ProblemError, rf"^{node.node}\.\w+: ", f"{case.name}: {name} with one row more"):
                dataclasses.replace(case.problem, **{name: longer})
        for name, F in case.problem.maps().items():
            if F.rows:
                wider = Builder(F.inputs + 1).finish([0] * F.rows)
                with refused(ProblemError, rf"^{node.node}\.\w+: ", f"{case.name}: {name} of one unknown more"):
                    dataclasses.replace(case.problem, **{name: wider})


def _has_rows_of_its_own(node: type[Problem], name: str) -> bool:
    """Return whether the number of rows of a field is a dimension that no other field has."""
    shapes = {f.name: f.metadata.get("shape", f.metadata.get("map", ())) for f in dataclasses.fields(node)}
    symbol = shapes.pop(name)[0]
    return not symbol.isdigit() and not any(symbol in shape for shape in shapes.values())


def _one_row_more(M: matrices.Matrix) -> matrices.Matrix:
    return matrices.block([[M], [matrices.zeros(1, M.shape[1], M)]])


def check_non_finite_data_are_refused(node: type[Problem], cases: list[Case]) -> None:
    for case in cases:
        for name, value in case.problem.data().items():
            if min(value.shape) > 0:
                broken = np.array(matrices.dense(value) if value.ndim == 2 else value)
                broken[(-1,) * broken.ndim] = math.nan
                with refused(ProblemError, rf"^{node.node}\.{name}: ", f"{case.name}: NaN in {name}"):
                    dataclasses.replace(case.problem, **{name: broken})


def check_data_are_read_only(node: type[Problem], cases: list[Case]) -> None:
    for case in cases:
        for name, value in case.problem.data().items():
            parts = (value.data, value.indices, value.indptr) if matrices.is_sparse(value) else (value,)
            assert not any(part.flags.writeable for part in parts), f"{case.name}: {name} can be written"
        for name, value in case.point.arrays().items():
            assert not value.flags.writeable, f"{case.name}: {name} of a point can be written"


def check_fingerprint_is_of_the_content(node: type[Problem], cases: list[Case]) -> None:
    """Check the fingerprint: the same for dense and sparse storage and any name, another one for other data."""
    for case in cases:
        problem = case.problem
        for change in (matrices.sparse, matrices.dense):
            stored = {k: change(v) if v.ndim == 2 else v for k, v in problem.data().items()}
            twin = dataclasses.replace(problem, name="another name", **stored)
            assert twin.fingerprint == problem.fingerprint, f"{case.name}: depends on the storage"
        for name, value in problem.data().items():
            if value.ndim == 1 and value.size and np.isfinite(value).all():
                try:
                    step = 0.5 + 0.5 * np.abs(value)  # seen in a bound of 1e20, too
                    other = dataclasses.replace(problem, **{name: value + (step if name != "lb" else -step)})
                except ProblemError:  # kinds and sizes of cones are not any numbers
                    continue
                assert other.fingerprint != problem.fingerprint, f"{case.name}: does not depend on {name}"
        for name, F in problem.maps().items():
            if F.rows and F.inputs:
                other = dataclasses.replace(problem, **{name: Builder(F.inputs).finish([0] * F.rows)})
                same = other.fingerprint == problem.fingerprint
                assert same == (other.maps()[name] == F), f"{case.name}: does not depend on {name}"


def check_dense_and_sparse_have_the_same_residuals(node: type[Problem], cases: list[Case]) -> None:
    for case in cases:
        shifted = type(case.point)(**{k: v + 0.25 for k, v in case.point.arrays().items()})
        errors = [
            dataclasses.replace(case.problem, **{k: change(v) for k, v in case.problem.data().items() if v.ndim == 2})
            .residuals(shifted)
            .error
            for change in (matrices.sparse, matrices.dense)
        ]
        assert _close(*errors, 1e-12), f"{case.name}: {errors[0]:.3e} when sparse, {errors[1]:.3e} when dense"


def check_renumbering_changes_nothing(node: type[Problem], cases: list[Case]) -> None:
    """Check that unknowns, rows and contacts in another order have the same error, of a solution and of a wrong
    answer."""
    for case in cases:
        other = renumbered(case, seed=1)
        if other is not None:
            for shift in (0.0, 0.25):
                errors = [
                    c.problem.residuals(type(c.point)(**{k: v + shift for k, v in c.point.arrays().items()})).error
                    for c in (case, other)
                ]
                assert _close(*errors, EXACT), f"{case.name}: {errors}"


def _close(a: float, b: float, absolute: float) -> bool:
    return math.isclose(a, b, rel_tol=1e-9, abs_tol=absolute)


def check_points_have_their_sizes(node: type[Problem], cases: list[Case]) -> None:
    """Make a point of a vector of the right length and get it back; refuse one number more."""
    for case in cases:
        flat = case.point.vector
        again = case.problem.point_from_vector(flat)
        assert all(
            np.array_equal(a, b) for a, b in zip(again.arrays().values(), case.point.arrays().values(), strict=True)
        )
        with refused(PointError, "expected", f"{case.name}: an answer with one number more"):
            case.problem.point_from_vector(np.append(flat, 0.0))
