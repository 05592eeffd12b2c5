"""Facet conversions and FCLIB files against what the machine and h5py need: ratios of one run, on one thread.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/conversion_speed.py [SPHERES]

A cubic lattice of SPHERES³ spheres (33: 104,544 contacts, 10.7 blocks a contact) goes through fc-lcp-inner with 8
facets. Printed are the best of interleaved repeats: filling as much fresh memory as the result takes, the conversion,
and the same by SciPy's block matrices; then writing and reading a smaller lattice (9,450 contacts) as FCLIB's HDF5
against h5py's own calls on the same data sets.
"""

from __future__ import annotations

import itertools
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.sparse as sp

from cpbench import storage
from cpbench.conversions import facets, make
from cpbench.formulations import FrictionContact
from cpbench.storage.hdf5_tree import COMPRESS_ABOVE

FACETS = 8


def lattice(n: int) -> FrictionContact:
    """n³ spheres, each in contact with its six neighbours; W = HᵀH with random blocks of H."""
    index = np.arange(n**3).reshape(n, n, n)
    ends = [(index[1:], index[:-1]), (index[:, 1:], index[:, :-1]), (index[:, :, 1:], index[:, :, :-1])]
    bodies = np.sort(np.concatenate([np.stack([a.ravel(), b.ravel()], 1) for a, b in ends]), axis=1)
    rng = np.random.default_rng(0)
    nc = len(bodies)
    blocks: Any = (rng.standard_normal((2 * nc, 3, 6)), bodies.ravel(), np.arange(0, 2 * nc + 1, 2))
    G = sp.bsr_array(blocks, shape=(3 * nc, 6 * n**3))
    W = sp.csr_array(sp.bsr_array(G @ G.T.tobsr((6, 3))).tocsr())
    return FrictionContact(W=W, q=rng.standard_normal(3 * nc), mu=np.full(nc, 0.5))


def fill(like: sp.csr_array) -> None:
    for part in (like.data, like.indices, like.indptr):
        np.empty(part.shape, part.dtype).fill(1)


def by_blocks(problem: FrictionContact) -> sp.csr_array:
    """M with SciPy's BSR: blocks EᵀW_cdE + K, then CSR without zeros."""
    form = facets.congruence(facets.directions(FACETS, 0.0))
    W = problem.W.tobsr((3, 3))
    row = np.repeat(np.arange(problem.nc), np.diff(W.indptr))
    data = np.einsum("ai,bac,cj->bij", form.left, W.data, form.left, optimize=True)
    own = np.flatnonzero(row == W.indices)
    data[own] += np.einsum("cs,sij->cij", facets.coefficients(problem.mu), form.blocks)
    M = sp.csr_array(sp.bsr_array((data, W.indices, W.indptr)).tocsr())
    M.eliminate_zeros()
    return M


def best(calls: dict[str, Callable[[], Any]], repeats: int) -> dict[str, float]:
    """Least seconds of every call, interleaved; results are dropped before the next call."""
    spent: dict[str, list[float]] = {name: [] for name in calls}
    for k in range(repeats + 1):  # the first round warms up
        for name, call in calls.items():
            begun = time.perf_counter()
            result = call()
            if k:
                spent[name].append(time.perf_counter() - begun)
            del result
    return {name: min(values) for name, values in spent.items()}


def conversion(n: int) -> None:
    problem = lattice(n)
    edge = make("fc-lcp-inner", {"facets": FACETS})
    print(
        f"{problem.nc} contacts, {problem.W.nnz / 9 / problem.nc:.1f} blocks a contact: at most {edge.predict(problem)}"
    )
    M = edge.apply(problem)[0].M
    size = M.data.nbytes + M.indices.nbytes + M.indptr.nbytes
    print(f"  n = {M.shape[0]}, {M.nnz} entries, {size / 1e9:.2f} GB, indices {M.indices.dtype}")
    shape = sp.csr_array((M.data, M.indices, M.indptr), shape=M.shape)
    like = sp.csr_array((np.broadcast_to(0.0, M.nnz), shape.indices, shape.indptr), shape=M.shape, copy=False)
    del M, shape
    calls = {"fill": lambda: fill(like), "cpbench": lambda: edge.apply(problem)[0], "scipy": lambda: by_blocks(problem)}
    spent = best(calls, 5)
    for name, seconds in spent.items():
        print(f"  {name:<8} {seconds * 1e3:8.1f} ms  {size / seconds / 1e9:5.2f} GB/s")
    print(f"  cpbench/fill {spent['cpbench'] / spent['fill']:.2f} (goal 1.5)")
    print(f"  scipy/cpbench {spent['scipy'] / spent['cpbench']:.1f} (goal 5)")


def files(n: int) -> None:
    problem = lattice(n)
    with tempfile.TemporaryDirectory() as name:
        fresh = (Path(name) / f"{k}.hdf5" for k in itertools.count())  # replacing a file makes the system write it out
        for compress in (False, True):
            ours, theirs = next(fresh), next(fresh)
            storage.save(problem, ours, compress=compress)
            with h5py.File(ours) as file:
                names: list[str] = []
                file.visit(names.append)
                held = {name: file[name][()] for name in names if isinstance(file[name], h5py.Dataset)}
            packed = {"compression": "gzip", "shuffle": True} if compress else {}

            def write(path: Path | None = None, held: dict[str, Any] = held, packed: dict[str, Any] = packed) -> None:
                with h5py.File(path or next(fresh), "w") as file:
                    for key, value in held.items():
                        file.create_dataset(key, data=value, **(packed if value.nbytes > COMPRESS_ABOVE else {}))

            def read(path: Path = theirs, held: dict[str, Any] = held) -> list[Any]:
                with h5py.File(path) as file:
                    return [file[key][()] for key in held]

            write(theirs)
            spent = best(
                {
                    "h5py write": write,
                    "save": lambda compress=compress: storage.save(problem, next(fresh), compress=compress),
                    "h5py read": read,
                    "load": lambda path=ours: storage.load(path),
                },
                9,
            )
            size = sum(value.nbytes for value in held.values())
            print(f"FCLIB, {problem.nc} contacts, {size / 1e6:.1f} MB, {'gzip' if compress else 'not packed'}")
            for verb, own in (("write", "save"), ("read", "load")):
                theirs_ms, own_ms = spent[f"h5py {verb}"] * 1e3, spent[own] * 1e3
                print(f"  {verb:<6} h5py {theirs_ms:7.1f} ms, cpbench {own_ms:7.1f} ms:", end=" ")
                print(f"{100 * theirs_ms / own_ms:.0f} % of h5py's rate (goal 80)")


if __name__ == "__main__":
    conversion(int(sys.argv[1]) if len(sys.argv) > 1 else 33)
    files(15)
