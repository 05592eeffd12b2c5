"""Products with an inverse, Schur complements and factorizations against NumPy's dense solve."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from tiers import some_by_day

from cpbench.conversions import delassus, elimination
from cpbench.foundation import factorization, matrices
from cpbench.foundation.factorization import Factorization

TOLERANCE = 1e-12


def close(M, reference) -> None:
    M = matrices.dense(M)
    assert M.shape == reference.shape
    assert matrices.max_abs(M - reference) <= TOLERANCE * max(matrices.max_abs(reference), 1e-300)


def bodies(rng, sizes, *, symmetric: bool = True):
    """A block-diagonal matrix with its unknowns shuffled."""
    blocks = []
    for size in sizes:
        G = rng.standard_normal((size, size))
        blocks.append(G @ G.T + size * np.eye(size) if symmetric else G + 2 * size * np.eye(size))
    A = sp.block_diag(list(map(sp.csr_array, blocks)), format="csr")
    shuffle = rng.permutation(A.shape[0])
    return sp.csr_array(A[shuffle][:, shuffle]), np.argsort(shuffle)


def contacts(rng, sizes, place, count, d, *, most: int = 2):
    """H (unknowns x count d): every contact touches one to `most` bodies, with some zeros in its blocks."""
    first = np.concatenate([[0], np.cumsum(sizes)])
    H = np.zeros((first[-1], count * d))
    for c in range(count):
        for b in rng.choice(len(sizes), size=rng.integers(1, most + 1), replace=False):
            block = rng.standard_normal((sizes[b], d))
            block[rng.random(block.shape) < 0.1] = 0.0
            H[place[first[b] : first[b + 1]], c * d : (c + 1) * d] = block
    return sp.csr_array(H)


@pytest.mark.parametrize("d", [1, 2, 3, 5])
@pytest.mark.parametrize("sizes", [[3] * 40, [6] * 40, [1, 2, 3, 6, 7, 20] * 8], ids=["disks", "bodies", "mixed"])
@pytest.mark.parametrize("most", [2, 5])
def test_delassus_operator_is_the_dense_one_and_symmetric(rng, monkeypatch, d, sizes, most):
    monkeypatch.setattr(delassus, "FEW", 0)
    monkeypatch.setattr(factorization, "DENSE_LIMIT", 0)
    A, place = bodies(rng, sizes)
    H = contacts(rng, sizes, place, 60, d, most=most)
    reference = H.toarray().T @ np.linalg.solve(A.toarray(), H.toarray())
    W = elimination.congruence(H, Factorization(A))
    close(W, reference)
    np.testing.assert_array_equal(matrices.dense(W), matrices.dense(W).T)
    close(elimination.product(sp.csr_array(H.T), Factorization(A), H), reference)


@pytest.mark.parametrize("few", [0, 10**9], ids=["blocks", "entries"])
def test_rows_and_columns_of_different_kinds(rng, monkeypatch, few):
    """Nonsymmetric blocks, badly scaled; D in groups of 3, C in none; empty rows, columns and bodies."""
    monkeypatch.setattr(delassus, "FEW", few)
    monkeypatch.setattr(factorization, "DENSE_LIMIT", 0)
    sizes = [1, 3, 6, 4] * 12
    A, place = bodies(rng, sizes, symmetric=False)
    scale = 2.0 ** rng.integers(-40, 40, A.shape[0])
    D = sp.csr_array(contacts(rng, sizes, place, 30, 3).T)
    C = sp.random_array((A.shape[0], 47), density=0.05, rng=rng, format="csr")
    reference = D.toarray() @ np.linalg.solve(A.toarray(), C.toarray())
    close(elimination.product(D, Factorization(A), C), reference)
    scaled = sp.csr_array(sp.diags_array(scale) @ A)
    factor = Factorization(scaled)
    assert not factor.singular
    close(elimination.product(D, factor, sp.csr_array(sp.diags_array(scale) @ C)), reference)


def test_an_indefinite_block_leaves_the_operator_symmetric(rng, monkeypatch):
    monkeypatch.setattr(delassus, "FEW", 0)
    monkeypatch.setattr(factorization, "DENSE_LIMIT", 0)
    A, place = bodies(rng, [6] * 30)
    A = sp.csr_array(A - 40 * sp.eye_array(A.shape[0]))
    H = contacts(rng, [6] * 30, place, 40, 3)
    W = matrices.dense(elimination.congruence(H, Factorization(A)))
    np.testing.assert_array_equal(W, W.T)
    close(W, H.toarray().T @ np.linalg.solve(A.toarray(), H.toarray()))


def network(rng, n, kind):
    """Large connected sparse matrices: a band, a grid, no diagonal, rows permuted, bad units."""
    if kind == "grid":
        side = int(np.sqrt(n))
        line = sp.diags_array([np.full(side, 4.0), -np.ones(side - 1), -np.ones(side - 1)], offsets=[0, 1, -1])
        A = sp.kron(line, sp.eye_array(side)) + sp.kron(sp.eye_array(side), line)
    else:
        A = sp.diags_array([np.full(n, 3.0), -np.ones(n - 1), np.full(n - 1, 0.5)], offsets=[0, 1, -1])
        A = A + sp.coo_array((rng.standard_normal(9), rng.integers(0, n, (2, 9))), shape=(n, n))
    if kind == "no diagonal":
        A = sp.block_array([[None, A], [A.T, sp.random_array(A.shape, density=1 / n, rng=rng)]])
    A = sp.csr_array(A)
    n = A.shape[0]
    if kind == "permuted":
        A = A[rng.permutation(n)][:, rng.permutation(n)]
    if kind == "badly scaled":
        A = sp.diags_array(2.0 ** rng.integers(-60, 60, n)) @ A
    if kind == "two parts":
        A = sp.block_diag([A, A[:200, :200], sp.eye_array(5)])
    return sp.csr_array(A)


@pytest.mark.parametrize(
    "kind", some_by_day(["band", "grid", "no diagonal", "permuted", "badly scaled", "two parts"], 2)
)
@pytest.mark.parametrize("way", ["touched", "bundles", "dense", "chosen"])
def test_large_components(rng, monkeypatch, kind, way):
    if way != "chosen":
        monkeypatch.setattr(elimination, "_full_costs_less", lambda *_: way == "dense")
        monkeypatch.setattr(elimination, "RATIO", 0.1 if way == "touched" else np.inf)
    monkeypatch.setattr(elimination, "BUNDLE", 7)
    A = network(rng, 400, kind)
    n = A.shape[0]
    C = sp.random_array((n, 31), density=0.006, rng=rng, format="csr")
    D = sp.random_array((26, n), density=0.006, rng=rng, format="csr")
    B = sp.random_array((26, 31), density=0.1, rng=rng, format="csr")
    factor = Factorization(A)
    assert not factor.singular
    scale = 1 / abs(A).max(axis=1).toarray().ravel()  # rows of a badly scaled A brought back, for the reference only
    reference = B.toarray() - D.toarray() @ np.linalg.solve(A.toarray() * scale[:, None], C.toarray() * scale[:, None])
    close(elimination.schur(B, D, factor, C), reference)
    close(elimination.schur(B.toarray(), D, factor, C), reference)


@pytest.mark.parametrize("units", [False, True])
def test_a_long_chain_is_cut_where_it_is_touched(rng, units):
    """Parts of a tridiagonal A have two neighbours, so that two right-hand sides serve all; the result is SuperLU's."""
    n, m = 6_000, 200
    A = sp.csr_array(sp.diags_array([np.full(n, 4.0), -np.ones(n - 1), -2 * np.ones(n - 1)], offsets=[0, 1, -1]))
    C = sp.random_array((n, m), density=3 / n, rng=rng, format="csr")
    D = sp.random_array((m, n), density=3 / n, rng=rng, format="csr")
    if units:
        scale = sp.diags_array(2.0 ** rng.integers(-40, 40, n))
        A, C = sp.csr_array(scale @ A), sp.csr_array(scale @ C)
    factor = Factorization(A)
    result = elimination._by_touched(D, factor, C)
    assert result is not None
    close(result, D @ factor.solve(C.toarray()))
    close(elimination.product(D, factor, C), matrices.dense(result))


def test_parts_that_are_worse_conditioned_are_not_eliminated_first(rng):
    """Without its ends the chain would be singular: a part of zeros on the diagonal and one number of unknowns."""
    n = 601
    A = sp.csr_array(sp.diags_array([np.zeros(n), np.ones(n - 1), np.ones(n - 1)], offsets=[0, 1, -1]))
    A = sp.csr_array(A + sp.csr_array(([1.0], ([0], [0])), shape=(n, n)))
    C = sp.csr_array((np.ones(9), (np.zeros(9, int), np.arange(9))), shape=(n, 9))
    factor = Factorization(A)
    assert not factor.singular
    part = Factorization(sp.csr_array(A[1:][:, 1:]))
    assert not part.singular
    touched = sp.csr_array((np.ones(9), (np.ones(9, int), np.arange(9))), shape=(n, 9))
    assert Factorization(sp.csr_array(A[2:][:, 2:])).singular
    assert elimination._by_touched(sp.csr_array(touched.T), factor, touched) is None
    reference = touched.toarray().T @ np.linalg.solve(A.toarray(), touched.toarray())
    close(elimination.product(sp.csr_array(touched.T), factor, touched), reference)
    close(elimination.product(sp.csr_array(C.T), factor, C), C.toarray().T @ np.linalg.solve(A.toarray(), C.toarray()))


@pytest.mark.parametrize(("n", "m", "k"), [(30, 7, 12), (30, 12, 7), (5, 40, 40), (0, 4, 4), (6, 0, 3), (6, 3, 0)])
@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("sparse", [False, True])
def test_schur_complement(rng, n, m, k, order, sparse):
    A = np.asarray(rng.standard_normal((n, n)) + 3 * np.eye(n), order=order)
    B, C, D = (np.asarray(rng.standard_normal(shape), order=order) for shape in ((m, k), (n, k), (m, n)))
    reference = B - D @ np.linalg.solve(A, C) if n else B
    kept = B.copy(), C.copy(), D.copy()
    given = [sp.csr_array(M) for M in (B, D, C)] if sparse else [B, D, C]
    factor = Factorization(sp.csr_array(A) if sparse else A)
    close(elimination.schur(given[0], given[1], factor, given[2]), reference)
    close(elimination.product(given[1], factor, given[2]), B - reference)
    for now, before in zip((B, C, D), kept, strict=True):
        np.testing.assert_array_equal(now, before)


@pytest.mark.parametrize("kind", ["dense", "small sparse", "blocks", "superlu"])
@pytest.mark.parametrize("where", ["rows", "columns", "both"])
def test_units_do_not_make_a_matrix_singular(rng, kind, where):
    """Ratios of 1e30 between rows, columns or units of unknowns: invertible; the same with a repeated row: singular."""
    n = 200 if kind in ("blocks", "superlu") else 20
    if kind == "blocks":
        A, _ = bodies(rng, [4] * (n // 4), symmetric=False)
        A = A.toarray()
    else:
        A = np.diag(np.full(n, 5.0)) + np.diag(rng.standard_normal(n - 1), 1) + np.diag(rng.standard_normal(n - 1), -1)
    row, column = 10.0 ** rng.uniform(-15, 15, (2, n))
    row, column = {"rows": (row, np.ones(n)), "columns": (np.ones(n), column), "both": (row, row)}[where]
    scaled = row[:, None] * A * column
    factor = Factorization(scaled if kind == "dense" else sp.csr_array(scaled))
    assert factor.rcond > 1e-5
    b = rng.standard_normal(n)
    for transpose in (False, True):
        before, after = (column, row) if transpose else (row, column)
        expected = np.linalg.solve(A.T if transpose else A, b)
        found = factor.solve(b * before, transpose=transpose) * after
        np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * np.abs(expected).max())
        both = factor.solve(np.column_stack([b, 2 * b]) * before[:, None], transpose=transpose)
        np.testing.assert_allclose(both[:, 1], 2 * both[:, 0], rtol=1e-14)
    scaled[1] = scaled[0]
    assert Factorization(scaled if kind == "dense" else sp.csr_array(scaled)).singular


@pytest.mark.parametrize("n", [3, 200])
@pytest.mark.parametrize("sparse", [False, True])
def test_a_mass_matrix_with_very_different_masses_is_eliminated(n, sparse):
    masses = np.logspace(-9, 9, n)
    factor = Factorization(sp.diags_array(masses, format="csr") if sparse else np.diag(masses))
    assert elimination.singularity(factor, "M", "give up") is None
    masses[1] = 0.0
    factor = Factorization(sp.csr_array(sp.diags_array(masses)) if sparse else np.diag(masses))
    told = elimination.singularity(factor, "M", "give up")
    assert told is not None
    assert f"rank {n - 1}" in told or n > elimination.RANK_LIMIT
    assert "condition number infinite" in told


@pytest.mark.parametrize(("more", "rest"), [(0.0, 0.0), (1e-7, 1e-7), (-1e-7, -1e-7)])
def test_constants_that_cancel_leave_no_rounding(more: float, rest: float) -> None:
    """Hilbert's matrix of order 5 has a condition of 5e5: 5 − (1, ..., 1) A⁻¹ A(1, ..., 1) is 0, and comes out as 1e-13
    or so; what is larger than rounding stays."""
    A = scipy.linalg.hilbert(5)
    ones = np.ones(5)
    found = elimination.less(np.array([5.0 + more, 7.0]), np.stack([ones, ones]), Factorization(A), A @ ones)
    assert found == pytest.approx([rest, 2.0], rel=1e-3, abs=0.0)
