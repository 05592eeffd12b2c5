"""Sparse variants of planted families, as the standard tier has them: solutions, and the same numbers as dense ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from cpbench import verification
from cpbench.foundation.matrices import dense
from cpbench.generators.base import Instance, generator
from cpbench_problems.generators import affine_inequalities, belts, cone_maps, contact_nonlinear, rolling, vi_sets
from cpbench_problems.generators.anisotropic import _chain as anisotropic_chain
from cpbench_problems.generators.contact_joints import condensed
from cpbench_problems.generators.contact_planted import chain

MADE: dict[str, Callable[[], Instance]] = {
    "avi": lambda: affine_inequalities._sparse(80, generator(1)),
    "vi box": lambda: vi_sets.box(50, sparse=True),
    "vi balls": lambda: vi_sets.balls(20, sparse=True),
    "vi cones": lambda: vi_sets.cones(20, sparse=True),
    "vi product": lambda: vi_sets.product_set(20, sparse=True),
    "ge": lambda: cone_maps.generalized(20, sparse=True),
    "cp": lambda: cone_maps.cone_complementarity(20, sparse=True),
    "afc": lambda: anisotropic_chain(30),
    "rfc": lambda: rolling._condensed(rolling._planted_global(101)),
    "grfc": lambda: rolling._planted_global(101),
    "nfc": lambda: contact_nonlinear.spinning(102),
    "fcm": lambda: condensed(belts.rope(40, 5, 0.5), sparse=True),
}


@pytest.mark.parametrize("name", MADE)
def test_what_is_planted_solves_the_problem(name: str) -> None:
    made = MADE[name]()
    assert made.solution is not None
    assert verification.judge(made.problem, made.solution, 1e-12).solved


def test_a_tridiagonal_matrix_is_positive_definite_and_not_symmetric() -> None:
    M = affine_inequalities.tridiagonal(generator(3), 40).toarray()
    assert np.linalg.eigvalsh(M + M.T)[0] > 4.0  # of tridiag(−2, 8, −2): above 8 − 4
    assert not np.array_equal(M, M.T)


def test_rows_of_neighbours_have_three_entries_and_are_independent() -> None:
    C = affine_inequalities._neighbours(generator(4), 10, 80)
    assert (np.diff(C.indptr) == 3).all()
    assert np.linalg.matrix_rank(C.toarray()) == 10


def test_the_local_form_of_rolling_balls_is_that_of_the_global_form() -> None:
    """W = HᵀM⁻¹H and q = HᵀM⁻¹f + w in dense arithmetic; all numbers are exact."""
    local, whole = rolling._condensed(rolling._planted_global(101)).problem, rolling._planted_global(101).problem
    H, inverse = dense(whole.H), 1.0 / np.diag(dense(whole.M))
    np.testing.assert_array_equal(dense(local.W), H.T @ (inverse[:, None] * H))
    np.testing.assert_array_equal(local.q, H.T @ (inverse * whole.f) + whole.w)


def test_a_rope_is_the_same_stored_sparse_or_dense() -> None:
    one, other = (condensed(belts.rope(30, 5, 0.25), sparse=sparse).problem for sparse in (False, True))
    assert isinstance(one.W, np.ndarray)
    assert not isinstance(other.W, np.ndarray)
    for name in ("W", "V", "R"):
        np.testing.assert_array_equal(dense(getattr(other, name)), dense(getattr(one, name)))
    np.testing.assert_array_equal(np.concatenate([other.q, other.s]), np.concatenate([one.q, one.s]))


def test_spinning_bodies_are_the_same_stored_sparse_or_dense(monkeypatch: pytest.MonkeyPatch) -> None:
    one = contact_nonlinear.spinning(8).problem
    monkeypatch.setattr(contact_nonlinear, "MOST_DENSE", 0)
    other = contact_nonlinear.spinning(8).problem
    assert isinstance(one.H, np.ndarray)
    assert not isinstance(other.H, np.ndarray)
    np.testing.assert_array_equal(dense(other.H), one.H)
    np.testing.assert_array_equal(other.w, one.w)


def test_a_chain_with_elliptic_friction_has_the_matrix_of_the_chain() -> None:
    np.testing.assert_array_equal(dense(anisotropic_chain(30).problem.W), dense(chain(30).problem.W))
