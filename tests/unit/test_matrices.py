"""Facts about matrices against NumPy's dense decompositions; factorizations that survive pickling; cones."""

from __future__ import annotations

import io
import pickle
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import loadmat, savemat
from scipy.sparse import csgraph

from cpbench import storage
from cpbench.conversions.base import make
from cpbench.errors import ProblemError
from cpbench.foundation import matrices
from cpbench.foundation.factorization import Factorization, has_full_structural_rank, sparse_lu
from cpbench.foundation.matrices import all_pivots_positive, factor_on_diagonal, sparse


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


def _exactly_semidefinite(M: np.ndarray) -> bool:
    """Gauss on the symmetric part in rational arithmetic: a pivot below 0, or 0 in a row that is not, refutes."""
    S = [
        [Fraction(float(a)) + Fraction(float(b)) for a, b in zip(*rows, strict=True)]
        for rows in zip(M, M.T, strict=True)
    ]
    while S:
        pivot, *row = S[0]
        if pivot < 0 or (pivot == 0 and any(row)):
            return False
        S = [[x - line[0] * y / pivot if pivot else x for x, y in zip(line[1:], row, strict=True)] for line in S[1:]]
    return True


@pytest.mark.parametrize("seed", range(60))
def test_definiteness_is_exact_and_has_no_units(seed: int) -> None:
    """Integer matrices, semidefinite, singular or with one eigenvalue pushed below 0, in units of 2^±60 a row."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 7))
    G = rng.integers(-3, 4, (n, max(1, n - int(rng.integers(0, 3))))).astype(float)
    M = G @ G.T - np.diag(rng.integers(0, 2, n) * rng.integers(0, 2))
    skew = np.triu(rng.integers(-5, 6, (n, n)), 1)
    M = M + skew - skew.T if seed % 2 else M
    expected = _exactly_semidefinite(M)
    for _ in range(2):
        unit = np.ldexp(1.0, rng.integers(-60, 61, n))
        scaled = unit[:, None] * M * unit
        for stored in (scaled, sp.csr_array(scaled)):
            assert matrices.is_psd(stored) == expected
            assert matrices.asymmetry(stored) == matrices.asymmetry(M)
            assert matrices.is_symmetric(stored) == (M == M.T).all()


def test_a_sparse_matrix_of_a_diagonal_alone_needs_no_factorization() -> None:
    """It is told from one whose zeros on the diagonal make up for entries beside it, and from stored zeros."""
    for diagonal in ([3.0, 0.0, 1e-9], [3.0, 2.0, 1e-9], [0.0, 0.0, 0.0], [1.0, -1e-9, 2.0]):
        for beside in (0.0, 2.0):
            whole = np.diag(diagonal)
            whole[0, 1] = whole[1, 0] = beside
            stored = sp.csr_array(whole)
            spread = sp.csr_array((np.diag(diagonal).ravel(), np.tile(np.arange(3), 3), [0, 3, 6, 9]), shape=(3, 3))
            for M in (stored, spread) if beside == 0.0 else (stored,):
                assert matrices.is_psd(M) == matrices.is_psd(whole)
                assert matrices.is_definite(M) == matrices.is_definite(whole)


@pytest.mark.parametrize("large", [False, True])
def test_a_small_negative_direction_is_seen_beside_a_large_one(large: bool) -> None:
    """diag(1e9, -1), and the same inside 1000 coupled rows: eigenvalues far below max|M| in size."""
    n = 1000 if large else 0
    chain = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n)) * 1e9 if large else None
    for last, expected in ((-1.0, False), (0.0, True), (1.0, True)):
        tail = sp.csr_array(np.diag([1e9, last]))
        M = sp.csr_array(sp.block_diag([chain, tail])) if large else tail.toarray()
        assert matrices.is_psd(M) == expected
        assert matrices.is_definite(M) == (last > 0)
    hidden = np.array([[1e9, 1e9], [1e9, 1e9 - 1e-3]])  # det < 0 by one part in 1e12, the size of rounding in W: passes
    assert matrices.is_psd(hidden)
    assert not matrices.is_psd(np.array([[1e9, 1e9], [1e9, 1e9 - 1.0]]))
    assert not matrices.is_psd(np.array([[0.0, 1e-30], [1e-30, 1.0]]))


def test_a_skew_block_that_is_skew_to_rounding_is_semidefinite() -> None:
    """K = [[A, C], [-Cᵀ, 0]] with C computed twice: M_ij + M_ji is 1e-17, beside a diagonal of 0."""
    C = np.array([[0.1 + 0.2, 1 / 3], [1e7 / 3, 0.7]])
    K = np.block([[np.eye(2), C], [-C.T * (1 + 2.2e-16), np.zeros((2, 2))]])
    assert (K + K.T)[:2, 2:].any()
    for stored in (K, sp.csr_array(K)):
        assert matrices.is_psd(stored)
    K[0, 2] *= 1 + 1e-9
    assert not matrices.is_psd(K)


def test_asymmetry_of_a_stack_is_that_of_each(rng: np.random.Generator) -> None:
    blocks = rng.standard_normal((5, 3, 3))
    blocks[2] = blocks[2] + blocks[2].T
    blocks[3] *= np.outer([1e9, 1, 1e-9], [1e9, 1, 1e-9])
    each = [matrices.asymmetry(block) for block in blocks]
    assert matrices.block_asymmetry(blocks).tolist() == each
    assert [matrices.asymmetry(sp.csr_array(block)) for block in blocks] == pytest.approx(each, rel=1e-14)
    assert each[2] == 0.0
    # by the definition, in units of the diagonal
    for M, found in zip(blocks, each, strict=True):
        root = np.sqrt(np.abs(np.diag(M)))
        largest = max(
            abs(M[i, j] - M[j, i]) / max(root[i] * root[j], abs(M[i, j]), abs(M[j, i]))
            for i in range(3) for j in range(3)
        )  # fmt: skip
        assert found == pytest.approx(largest, rel=1e-14)


@pytest.mark.parametrize(
    ("name", "size"),
    [("Confeti-ex03-Fc3D-SBM", 1e-7), ("Confeti-ex13-4contact-Fc3D-SBM", 1e-6), ("BoxesStack1-i100000-32.hdf5", 1e-10)],
)
def test_measured_delassus_matrices(shared_data: Path, name: str, size: float) -> None:
    """Confeti's are written with eight digits: not semidefinite as they stand, and so said; others are to 1e-14."""
    W = storage.load(shared_data / "fc3d_local" / f"{name}.dat").W
    D = 1 / np.sqrt(matrices.dense(W).diagonal())
    least = np.linalg.eigvalsh(matrices.dense(W) * np.outer(D, D))[0]
    assert -size < least < (0 if size > 1e-8 else 1)
    assert matrices.is_psd(W) == (size <= matrices.PSD_TOLERANCE)
    assert matrices.is_psd(W, size)
    assert matrices.least_eigenvalue(W) == pytest.approx(least, abs=1e-12)


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
def test_a_singular_matrix_is_reported_without_a_crash(rng: np.random.Generator, sparse: bool) -> None:
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


def test_data_from_a_mat_file_have_the_plain_dtype() -> None:
    buffer = io.BytesIO()
    savemat(buffer, {"v": np.array([[0.5], [1.5]]), "S": sp.csc_matrix(np.diag([0.5, 1.5]))})
    data = loadmat(buffer, spmatrix=False)
    assert memoryview(data["v"].ravel()).format == "<d"  # the case that matters is really there
    for array in (
        matrices.vector(data["v"].ravel()),
        matrices.matrix(data["v"]),
        matrices.matrix(data["S"]).data,
    ):
        assert memoryview(array).format == "d"
        assert not array.flags.writeable


def fresh() -> sp.csr_array:
    return sp.csr_array(np.array([[1.0, 0.0], [2.0, 3.0]]))


def test_an_adopted_matrix_is_shared_and_frozen() -> None:
    M = matrices.adopt(fresh())
    assert matrices.matrix(M) is M
    with pytest.raises(ValueError, match="read-only"):
        M.data[0] = 5.0


def test_a_matrix_once_taken_is_not_copied_again() -> None:
    given = fresh()
    taken = matrices.matrix(given)
    assert not np.shares_memory(taken.data, given.data)
    assert matrices.matrix(taken) is taken


@pytest.mark.parametrize("what", ["thawed", "replaced", "pickled", "copied"])
def test_whoever_touches_it_gets_a_copy(what: str) -> None:
    M = matrices.adopt(fresh())
    if what == "thawed":
        M.data.setflags(write=True)
    elif what == "replaced":
        M.data = np.array([1.0, np.nan, 3.0])
        matrices.freeze(M.data)
    else:
        M = pickle.loads(pickle.dumps(M)) if what == "pickled" else M.copy()
    if what == "replaced":
        with pytest.raises(ProblemError, match="1 non-finite"):
            matrices.matrix(M)
    else:
        assert not np.shares_memory(matrices.matrix(M).data, M.data)


def test_settle_takes_only_what_keeps_the_promise() -> None:
    good = matrices.settle(fresh())
    assert matrices.matrix(good) is good
    doubled = sp.csr_array((np.ones(2), np.array([1, 1]), np.array([0, 2])), shape=(1, 2))
    assert matrices.matrix(matrices.settle(doubled)).nnz == 1
    spoilt = fresh()
    spoilt.data[1] = np.inf
    with pytest.raises(ProblemError, match="non-finite"):
        matrices.matrix(matrices.settle(spoilt))


def test_finite_entries_whose_sum_overflows_are_finite() -> None:
    assert matrices.vector(np.full(3, 1e308)).size == 3
    with pytest.raises(ProblemError, match="2 non-finite entries, the first at 0"):
        matrices.vector([np.inf, -np.inf, 1.0])


def grid(n: int, shift: float) -> Any:
    """The five-point Laplacian on n² points plus `shift`; its least eigenvalue is 8 sin²(π/(2n + 2)) + shift."""
    T = sp.diags_array([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])  # pyright: ignore[reportCallIssue, reportArgumentType]
    return sp.csr_array(sp.kronsum(T, T) + shift * sp.eye_array(n * n))


def test_pivots_on_the_diagonal_tell_definiteness() -> None:
    least = 8 * np.sin(np.pi / 26) ** 2
    assert all_pivots_positive(factor_on_diagonal(grid(12, -0.9 * least)))
    assert not all_pivots_positive(factor_on_diagonal(grid(12, -1.1 * least)))
    assert factor_on_diagonal(sp.csr_array(np.diag([1.0, 0.0]))) is None


WITHOUT_MEMORY = """
import resource, sys
from pathlib import Path
import numpy as np, scipy.sparse as sp
from cpbench.foundation.factorization import Factorization

n = 2000
A = sp.csr_array(sp.diags_array([np.full(n - 1, -1.0), np.full(n, 4.0), np.full(n - 1, -1.0)], offsets=[-1, 0, 1]))
factors, right = Factorization(A), np.ones((n, 5000))
factors.solve(right[:, :2])
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + right.nbytes * 3 // 2,) * 2)  # SuperLU takes two copies
try:
    factors.solve(right)
except MemoryError as cause:
    sys.exit(0 if "SUPERLU" in str(cause) else "not of SuperLU")
sys.exit("solved")
"""


def test_superlu_without_memory_is_out_of_memory() -> None:
    """It says so by a RuntimeError, as it says that a matrix is singular: the status was `error`, or `singular`."""
    done = subprocess.run([sys.executable, "-c", WITHOUT_MEMORY], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1), st.integers(0, 30), st.floats(0.02, 0.3))
def test_agrees_with_scipy(seed, n, density):
    rng = np.random.default_rng(seed)
    A = sp.csr_array(sp.random_array((n, n), density=density, rng=rng) + sp.diags_array((rng.random(n) < 0.8) * 1.0))
    assert has_full_structural_rank(A) == (n == 0 or csgraph.structural_rank(A) == n)


@pytest.mark.parametrize(("name", "full"), [("QBEACONF", False), ("CONT-101", True), ("CVXQP1_M", True)])
def test_optimality_conditions_of_real_programs(shared_data, name, full):
    """QBEACONF's made SuperLU crash, CONT-101's keep SciPy's structural_rank busy for minutes."""
    conditions = make("qp-mlcp").step(storage.load(shared_data / "qp" / f"{name}.mat"))
    assert has_full_structural_rank(sparse(conditions.A)) == full
