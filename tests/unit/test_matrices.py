"""Facts about matrices against NumPy's dense decompositions; factorizations that survive pickling; cones."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench import cones, matrices
from cpbench.errors import ProblemError
from cpbench.factorization import Factorization, sparse_lu


@pytest.mark.parametrize("n", [2, 5, 40, 350])
@pytest.mark.parametrize("sparse", [False, True])
def test_semidefiniteness_is_that_of_the_eigenvalues(rng: np.random.Generator, n: int, sparse: bool) -> None:
    G = rng.standard_normal((n, max(1, n // 2)))
    low = G @ G.T
    for M, expected in ((low, True), (low + np.eye(n), True), (low - 0.1 * np.abs(low).max() * np.eye(n), False)):
        skew = np.triu(rng.standard_normal((n, n)), 1)
        whole = M + skew - skew.T
        assert (np.linalg.eigvalsh((whole + whole.T) / 2)[0] > -1e-8 * np.abs(whole).max()) == expected
        assert matrices.is_psd(sp.csr_array(whole) if sparse else whole) == expected


@pytest.mark.parametrize("sparse", [False, True])
def test_factorizations_solve_both_ways_and_survive_pickling(rng: np.random.Generator, sparse: bool) -> None:
    A = rng.standard_normal((30, 30)) + 6 * np.eye(30)
    b, B = rng.standard_normal(30), rng.standard_normal((30, 4))
    factor = Factorization(sp.csr_array(A) if sparse else A)
    for f in (factor, pickle.loads(pickle.dumps(factor))):
        np.testing.assert_allclose(f.solve(b), np.linalg.solve(A, b), rtol=1e-10)
        np.testing.assert_allclose(f.solve(B), np.linalg.solve(A, B), rtol=1e-9)
        np.testing.assert_allclose(f.solve(b, transpose=True), np.linalg.solve(A.T, b), rtol=1e-9)
        assert f.rcond == pytest.approx(1 / np.linalg.cond(A, 1), rel=0.9)
        assert not f.singular


@pytest.mark.parametrize("sparse", [False, True])
def test_singular_is_told_and_not_died_of(rng: np.random.Generator, sparse: bool) -> None:
    """Structurally (a zero block of a KKT matrix, of which SuperLU has died), by rank, and wholly."""
    C = rng.standard_normal((12, 5))
    structural = np.block([[np.zeros((5, 5)), C.T], [C, np.zeros((12, 12))]])
    low = C @ C.T
    for A in (structural, low, np.zeros((4, 4))):
        assert Factorization(sp.csr_array(A) if sparse else A).singular


def test_what_comes_in_sparse_is_canonical_and_frozen() -> None:
    triplet = sp.coo_array(([1.0, 2.0, 4.0], ([1, 0, 1], [0, 1, 0])), shape=(2, 2))
    M = matrices.matrix(triplet)
    assert M.toarray().tolist() == [[0.0, 2.0], [5.0, 0.0]]
    with pytest.raises(ValueError, match="read-only"):
        M.data[0] = 1.0
    with pytest.raises(ProblemError, match="non-finite"):
        matrices.matrix(np.array([[np.inf]]))


def test_digests_see_content_only() -> None:
    M = np.array([[0.0, 1.5], [-0.0, 2.0]])
    explicit = sp.csr_array((np.array([0.0, 1.5, 2.0]), np.array([0, 1, 1]), np.array([0, 2, 3])), shape=(2, 2))
    assert matrices.digest(M) == matrices.digest(explicit)
    assert matrices.digest(M) != matrices.digest(M.T)


@pytest.mark.parametrize("d", [2, 3])
def test_cone_projections_are_the_nearest_points(rng: np.random.Generator, d: int) -> None:
    """Against a fine sample of each cone: nothing in it is nearer; and Moreau's decomposition holds."""
    x = rng.standard_normal((200, d)) * 3
    mu = np.where(rng.random(200) < 0.2, 0.0, rng.uniform(0, 2, 200))
    p = cones.project_friction_cone(x, mu)
    assert (cones.tangential_norm(p) <= mu * p[:, 0] + 1e-12).all()
    normal = np.linspace(0, 8, 60)
    for k in range(0, 200, 10):
        directions = rng.standard_normal((40, d - 1))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        share = np.linspace(0, 1, 8)
        grid = np.array([[n, *(s * mu[k] * n * e)] for n in normal for s in share for e in directions[:10]])
        assert np.linalg.norm(grid - x[k], axis=1).min() >= np.linalg.norm(p[k] - x[k]) - 1e-12
    polar = x - p
    assert np.abs(np.einsum("ij,ij->i", p, polar)).max() < 1e-10
    assert np.allclose(cones.distance_to_dual_cone(-polar, mu), 0, atol=1e-12)


@pytest.mark.parametrize("small", [False, True])
def test_an_lu_of_symmetric_structure_is_an_lu(rng: np.random.Generator, small: bool) -> None:
    """On a grid whose values are not symmetric: less fill than by columns, and small diagonals are passed over."""
    T = sp.diags_array([np.ones(29), np.ones(30), np.ones(29)], offsets=[-1, 0, 1])
    A = sp.csc_array(sp.kron(T, T))
    A.data = rng.uniform(0.1, 1.0, A.nnz)
    A.setdiag(np.where(np.arange(900) % 7 == 0, 1e-14, 2.0) if small else np.full(900, 2.0))
    b = rng.standard_normal(900)
    preferring, by_columns = (sparse_lu(A, symmetric_structure=flag) for flag in (True, False))
    assert preferring is not None
    assert by_columns is not None
    np.testing.assert_allclose(A @ preferring.solve(b), b, atol=1e-9)
    assert small or preferring.nnz < 0.8 * by_columns.nnz
    assert sparse_lu(sp.csc_array((3, 3)), symmetric_structure=True) is None
