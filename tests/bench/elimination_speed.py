"""Times of the eliminations beside plain SciPy and the rate of dgemm, as ratios in one run, one thread.

    OPENBLAS_NUM_THREADS=1 python tests/bench/elimination_speed.py [--small]

Both sides of a ratio are measured in turn, and the least time of each counts. M and A are factored beforehand on both
sides of the first and third comparison; 'with factoring' adds ours. SciPy's dense right-hand sides are extrapolated
from COLUMNS columns.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from cpbench.conversions import elimination
from cpbench.foundation.factorization import Factorization

COLUMNS = 64
SECONDS = 4.0
"""Time given to one comparison."""


def least_times(*actions: Callable[[], object]) -> list[float]:
    """Seconds of the fastest run of each, in turn, after one that is not counted."""
    for action in actions:
        action()
    times: list[list[float]] = [[] for _ in actions]
    begun = time.perf_counter()
    while len(times[0]) < 3 or (time.perf_counter() - begun < SECONDS and len(times[0]) < 200):
        for action, taken in zip(actions, times, strict=True):
            before = time.perf_counter()
            result = action()
            taken.append(time.perf_counter() - before)
            del result
    return [min(taken) for taken in times]


def packing(count: int, size: int, *, bodies: int, ordered: bool) -> tuple[sp.csr_array, sp.csr_array]:
    """M and H of `count` contacts, each between a body and one of the next 50 (bodies of `size` unknowns)."""
    rng = np.random.default_rng(count + size)
    G = rng.standard_normal((bodies, size, size))
    M = sp.csr_array(sp.block_diag(list(map(sp.csr_array, G @ G.transpose(0, 2, 1) + np.eye(size))), format="csr"))
    first = rng.integers(0, bodies, count)
    if ordered:
        first.sort()
    second = (first + rng.integers(1, min(50, bodies), count)) % bodies
    row = (np.stack([first, second])[:, :, None, None] * size + np.arange(size)[:, None]) + np.zeros(3, dtype=int)
    column = np.broadcast_to(np.arange(3 * count).reshape(count, 1, 3), row.shape)
    H = sp.csr_array((rng.standard_normal(row.size), (row.ravel(), column.ravel())), shape=(bodies * size, 3 * count))
    return M, H


def delassus(counts: list[int]) -> None:
    print("Delassus operator HᵀM⁻¹H: ours ms | H.T @ (M⁻¹ @ H): ratio, sorted as CSR must be: ratio, with factoring")
    for count in counts:
        for size in (3, 6):
            for per_body, ordered in ((2.5, True), (5, True), (5, False)):
                M, H = packing(count, size, bodies=int(count / per_body), ordered=ordered)
                factor = Factorization(M)
                assert not factor.singular
                inverse = sp.csr_array(
                    sp.block_diag(list(map(sp.csr_array, factor.block_inverses[0].values)), format="csr")
                )

                def plain(H=H, inverse=inverse):
                    return H.T @ (inverse @ H)

                def canonical(H=H, inverse=inverse):
                    W = sp.csr_array(H.T @ (inverse @ H))
                    W.sum_duplicates()
                    return W

                def ours(H=H, factor=factor):
                    return elimination.congruence(H, factor)

                def factored(H=H, M=M):
                    return elimination.congruence(H, Factorization(M))

                W = ours()
                error = abs(W - canonical()).max() / abs(W).max()
                assert error < 1e-12, error
                assert (W != W.T).nnz == 0
                mine, theirs, sorted_too, all_of_it = least_times(ours, plain, canonical, factored)
                print(
                    f"  {count:7d} contacts, bodies of {size}, {W.nnz / 9 / count:4.1f} blocks a contact, "
                    f"{'ordered ' if ordered else 'shuffled'} {1e3 * mine:8.2f} | {theirs / mine:5.2f} "
                    f"{sorted_too / mine:5.2f} {sorted_too / all_of_it:5.2f}"
                )


def dense_schur(sizes: list[tuple[int, int]]) -> None:
    print(
        "Dense Schur complement: ours ms, share of dgemm's rate (1000 x 1000 x 1000), NumPy's B - D solve(A, C): ratio"
    )
    rng = np.random.default_rng(0)
    P = rng.standard_normal((2, 1000, 1000))
    for n, m in sizes:
        A = rng.standard_normal((n, n)) + 2 * np.sqrt(n) * np.eye(n)
        C, D, B = rng.standard_normal((n, m)), rng.standard_normal((m, n)), rng.standard_normal((m, m))

        def ours(A=A, B=B, C=C, D=D):
            return elimination.schur(B, D, Factorization(A), C)

        def numpy(A=A, B=B, C=C, D=D):
            return B - D @ np.linalg.solve(A, C)

        assert np.abs(ours() - numpy()).max() < 1e-11 * np.abs(numpy()).max()
        mine, gemm, theirs = least_times(ours, lambda: P[0] @ P[1], numpy)
        rate = (2 / 3 * n**3 + 2 * n**2 * m + 2 * n * m**2) / mine
        print(f"  n = {n:4d}, m = {m:4d} {1e3 * mine:8.2f} {100 * rate * gemm / 2e9:5.1f} % {theirs / mine:5.2f}")


def sparse_schur(cases: list[tuple[str, int, int]]) -> None:
    print(
        f"Sparse Schur complement: ours ms, SciPy's dense right-hand sides extrapolated from {COLUMNS} columns s, ratio"
    )
    rng = np.random.default_rng(0)
    for kind, n, m in cases:
        if kind in ("fading", "tridiagonal"):  # A⁻¹ fades from the diagonal on, until it underflows; or hardly
            diagonal = 8.0 if kind == "fading" else 2.0001
            A = sp.diags_array([np.full(n, diagonal), -np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1, -1])
        elif kind == "grid":
            side = int(np.sqrt(n))
            line = sp.diags_array([np.full(side, 4.0), -np.ones(side - 1), -np.ones(side - 1)], offsets=[0, 1, -1])
            A = sp.kron(line, sp.eye_array(side)) + sp.kron(sp.eye_array(side), line)
        else:
            A = 8 * sp.eye_array(n) + sp.coo_array((np.full(2 * n, 0.5), rng.integers(0, n, (2, 2 * n))), shape=(n, n))
        A = sp.csr_array(A)
        n = A.shape[0]
        C = sp.csr_array(
            (rng.standard_normal(4 * m), (rng.integers(0, n, 4 * m), np.repeat(np.arange(m), 4))), shape=(n, m)
        )
        C.sum_duplicates()
        D = sp.csr_array(C.T)
        factor = Factorization(A)
        assert not factor.singular
        lu = spla.splu(sp.csc_array(A))
        some = sp.csc_array(C)[:, :COLUMNS]

        def theirs(D=D, lu=lu, some=some):
            return D @ lu.solve(some.toarray())

        def ours(D=D, factor=factor, C=C):
            return elimination.product(D, factor, C)

        reference, result = theirs(), ours()
        found = (result.toarray() if sp.issparse(result) else result)[:, :COLUMNS]
        assert np.abs(found - reference).max() < 1e-10 * np.abs(reference).max()
        mine, some_columns = least_times(ours, theirs)
        whole = some_columns * m / COLUMNS
        print(f"  {kind:11s} n = {n:6d}, m = {m:4d} {1e3 * mine:9.1f} {whole:7.2f} {whole / mine:6.1f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--small", action="store_true", help="leave the largest sizes out")
    small = parser.parse_args().small
    delassus([1000, 10_000] if small else [1000, 10_000, 100_000])
    dense_schur([(50, 50), (500, 500), (1000, 1000), (2000, 500), (500, 2000)])
    sparse_schur(
        [("tridiagonal", 10_000, 500), ("grid", 10_000, 1000), ("random", 3000, 1000)]
        + ([] if small else [("fading", 100_000, 3000), ("tridiagonal", 100_000, 3000)])
    )
