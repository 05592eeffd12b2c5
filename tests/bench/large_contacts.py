"""Gauss–Seidel on a problem beyond the caches: what it keeps beside W, and a sweep against reading W once.

    python tests/bench/large_contacts.py [--size 32] [--sweeps 5] [--rounds 11] [--siconos]

Spheres on a disturbed lattice of `size`³ (32: 95232 contacts). Memory is the high-water mark of the resident set of a
fresh process during set-up and three sweeps, less what was resident before, when the problem was in memory and the
kernels had been used on a small one. Times are processor times, least and median of rounds that take turns; the floor
is a compiled sum over an array. A sweep is measured without the evaluation of the error that ends a call.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import race_rows
import scipy.sparse as sp
from numba import njit
from sphere_lattice import lattice

from cpbench.formulations.fc import FrictionContact
from cpbench.foundation.matrices import sparse
from cpbench.solvers import Budget, solvers
from cpbench_solvers.contact.nsgs_coloured import Coloured, ColouredSweeps, helpers
from cpbench_solvers.contact.nsgs_global import Bodies, VelocitySweeps
from cpbench_solvers.contact.sweeps import Sweeps, block_rows

MB = 1e6


@njit("float64(float64[::1])", fastmath=True)
def read(numbers: Any) -> float:
    total = 0.0
    for i in range(numbers.size):
        total += numbers[i]
    return total


def size_of(*arrays: Any) -> int:
    return sum(a.nbytes for a in arrays)


def stored(W: Any) -> int:
    return size_of(W.data, W.indices, W.indptr)


def condensed(problem: Any) -> FrictionContact:
    """W with the least indices that hold it, as a file or a conversion brings it."""
    inverse = sp.diags_array(1.0 / problem.M.diagonal())
    W = sp.csr_array(problem.H.T @ inverse @ problem.H)
    W.sort_indices()
    W = sp.csr_array((W.data, W.indices.astype(np.int32), W.indptr.astype(np.int32)), shape=W.shape)
    return FrictionContact(W=W, q=problem.H.T @ (inverse @ problem.f), mu=problem.mu)


def resident(which: str) -> int:
    """Bytes that /proc tells of this process."""
    (line,) = [x for x in Path("/proc/self/status").read_text().splitlines() if x.startswith(which)]
    return 1024 * int(line.split()[1])


def memory(solver_name: str, path: str) -> None:
    """The child: prints how many bytes set-up and three sweeps took at most."""
    data = np.load(path)
    n = data["q"].size
    W = sp.csr_array((data["data"], data["indices"], data["indptr"]), shape=(n, n))
    problem = FrictionContact(W=W, q=data["q"], mu=data["mu"])
    solver = solvers.get(solver_name)
    solver.warmup()
    del W, data
    Path("/proc/self/clear_refs").write_text("5")  # the high-water mark starts again
    before = resident("VmRSS")
    solver.run(problem, Budget(tolerance=1e-12, iterations=3))
    print(resident("VmHWM") - before)


def least(rounds: int, works: dict[str, Callable[[], object]]) -> dict[str, tuple[float, float]]:
    """Least and median processor seconds of each, in turns."""
    for work in works.values():
        work()
    times: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(rounds):
        for name, work in works.items():
            before = time.process_time()
            work()
            times[name].append(time.process_time() - before)
    return {name: (min(t), float(np.median(t))) for name, t in times.items()}


def load() -> str:
    return f"{os.getloadavg()[0]:.1f} processes on {os.cpu_count()} cores in the last minute"


def coloured_sweeps(coloured: Coloured, threads: int, sweeps: int) -> float:
    """Seconds of one sweep on the clock, without the start of the threads."""
    with helpers(threads) as pool:
        method = ColouredSweeps(coloured, np.zeros(coloured.problem.q.size), threads, pool)
        method.step(1, 1.0, 1.0)
        before = time.perf_counter()
        method.step(sweeps, 1.0, 1.0)
        return (time.perf_counter() - before) / sweeps


def least_wall(rounds: int, works: list[Callable[[], float]]) -> list[float]:
    """Least of what each returns, in turns."""
    return np.min([[work() for work in works] for _ in range(rounds)], axis=0).tolist()


def main(size: int, sweeps: int, rounds: int, siconos: bool, path_of_races: Path | None) -> None:
    bodies = lattice(size)
    problem = condensed(bodies)
    W = sparse(problem.W)
    solvers.get("nsgs").warmup()
    solvers.get("nsgs-gfc").warmup()
    rows = block_rows(problem)
    kept = size_of(rows.start, rows.column, rows.blocks, rows.diagonal, rows.local)
    swept = size_of(rows.start, rows.column, rows.blocks)
    print(f"contacts {problem.nc}, blocks {rows.column.size + problem.nc}, W as CSR {stored(W) / MB:.1f} MB")
    print(
        f"kept by the solver {kept / MB:.1f} MB = {kept / stored(W):.2f} of W; its rows of blocks {swept / MB:.1f} MB"
    )
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/problem.npz"
        np.savez(path, data=W.data, indices=W.indices, indptr=W.indptr, q=problem.q, mu=problem.mu)
        told = subprocess.run(
            [sys.executable, __file__, "--memory", "nsgs", path], check=True, capture_output=True, text=True
        )
        added = int(told.stdout)
    added /= stored(W)
    print(f"set-up and three sweeps add at most {added:.2f} of W, {1 + added:.2f} with it")

    whole, part = np.ones(stored(W) // 8), np.ones(swept // 8)
    r, way = np.zeros(problem.q.size), Sweeps(rows)
    on_bodies = Bodies.of(bodies)
    moves = VelocitySweeps(on_bodies, np.zeros(problem.q.size))
    times = least(
        rounds,
        {
            "read": lambda: read(whole),
            "read part": lambda: read(part),
            "judged": lambda: rows.judged_error(r),
            "sweeps": lambda: way.sweep(r, sweeps, 0.0),
            "set-up": lambda: block_rows(problem),
            "bodies": lambda: moves.step(sweeps, 1.0, 1.0),
        },
    )
    (floor, floor_2), (own, own_2) = times["read"], times["read part"]
    sweep, sweep_2 = ((t - times["judged"][k]) / sweeps for k, t in enumerate(times["sweeps"]))
    setup, setup_2 = times["set-up"]
    print(
        f"reading the bytes of W {1e3 * floor:.2f} ms (median {1e3 * floor_2:.2f}), {stored(W) / floor / 1e9:.0f} GB/s;"
    )
    print(f"  those of the rows of blocks {1e3 * own:.2f} ms (median {1e3 * own_2:.2f})")
    print(f"sweep {1e3 * sweep:.2f} ms (median {1e3 * sweep_2:.2f}): {sweep / floor:.2f} of reading W, ", end="")
    print(f"{sweep / own:.2f} of reading the rows of blocks")
    print(f"set-up {1e3 * setup:.0f} ms (median {1e3 * setup_2:.0f}): {setup / floor:.0f} passes over W")
    what, nc = f"lattice of {size}³", problem.nc
    memory_kept, memory_peak = kept / stored(W), added
    races = [
        race_rows.race("large floor", what, nc, floor / sweep, "reading W", "nsgs", par=0.5),
        race_rows.race("large memory", what, nc, 1.3 / max(memory_kept, memory_peak), "1.3 W", "nsgs"),
    ]
    race_rows.write(path_of_races, races)
    on = size_of(on_bodies.start, on_bodies.unknown, on_bodies.A, on_bodies.diagonal, on_bodies.local)
    velocity = times["bodies"][0] / sweeps
    print(
        f"on the velocities of the bodies {1e3 * velocity:.2f} ms a sweep, {on / MB:.1f} MB = {on / stored(W):.2f} of W"
    )
    coloured = Coloured.of(problem)
    halves = least_wall(rounds, [lambda k=k: coloured_sweeps(coloured, k, sweeps) for k in (1, 2)])
    print(f"by {coloured.bounds.size - 1} colours {1e3 * halves[0]:.2f} ms a sweep, by two threads ", end="")
    print(f"{1e3 * halves[1]:.2f} ms: {halves[0] / halves[1]:.2f} times as fast (wall clock, {load()})")
    if siconos:
        theirs = siconos_sweep(problem)
        print(f"Siconos' nsgs {1e3 * theirs:.0f} ms a sweep: {theirs / sweep:.1f} of ours")


def siconos_sweep(problem: FrictionContact) -> float:
    """Seconds that Siconos reports for 25 sweeps, less those for five, over 20."""
    solver = solvers.get("siconos-fc3d-nsgs")
    seconds = [solver.run(problem, Budget(tolerance=1e-14, iterations=k)).reported for k in (5, 25)]
    return (seconds[1] - seconds[0]) / 20


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=32)
    parser.add_argument("--sweeps", type=int, default=5)
    parser.add_argument("--rounds", type=int, default=11)
    parser.add_argument("--json", type=Path, help="write the ratios there, too")
    parser.add_argument("--siconos", action="store_true")
    parser.add_argument("--memory", nargs=2, metavar=("SOLVER", "FILE"), help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.memory:
        memory(*asked.memory)
    else:
        main(asked.size, asked.sweeps, asked.rounds, asked.siconos, asked.json)
