"""What a nonlinear map costs beside the same function written by hand in NumPy and SciPy.

The obstacle problem of Bratu's equation on a square of k×k points: 0 ≤ z ⟂ Az − λh² exp(z) ≥ 0, A the 5-point
Laplacian. By hand F is a sparse product and one exponential, its Jacobian a copy of A with another diagonal.

    python tests/bench/nonlinear_maps.py [--side 100]
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse as sp

from cpbench import storage
from cpbench.formulations import NCP

LAMBDA = 4.0


def laplacian(side: int) -> Any:
    """h²Δ with the sign turned, (side², side²)."""
    ones = np.ones(side)
    line = sp.diags_array([-ones[1:], 2.0 * ones, -ones[1:]], offsets=[-1, 0, 1])
    unit = sp.eye_array(side)
    return sp.csr_array(sp.kron(line, unit) + sp.kron(unit, line))


class ByHand:
    """F and F′ as one would write them for this problem."""

    def __init__(self, side: int) -> None:
        self.A = laplacian(side)
        self.A.sort_indices()
        self.factor = LAMBDA / (side + 1) ** 2
        rows = np.repeat(np.arange(side**2), np.diff(self.A.indptr))
        self.diagonal = np.flatnonzero(self.A.indices == rows)

    def value(self, z: Any) -> Any:
        return self.A @ z - self.factor * np.exp(z)

    def jacobian(self, z: Any) -> Any:
        J = self.A.copy()
        J.data[self.diagonal] -= self.factor * np.exp(z)
        return J


def best(call: Callable[[], Any], repeats: int = 50) -> float:
    """Seconds of the fastest of several calls."""
    times: list[float] = []
    for _ in range(repeats):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--side", type=int, default=100, help="points a side; n is their square")
    side: int = parser.parse_args().side
    hand, z = ByHand(side), ca.SX.sym("z", side**2)
    F = ca.DM(sp.csc_matrix(hand.A)) @ z - hand.factor * ca.exp(z)
    began = time.perf_counter()
    problem = NCP.from_casadi(z, F, name="bratu")
    print(f"n = {side**2}: {problem.F.operations} operations")
    print(f"of CasADi               {time.perf_counter() - began:8.3f} s")
    at = np.random.default_rng(0).uniform(0.0, 1.0, side**2)
    with tempfile.TemporaryDirectory() as folder:
        for suffix in (".mof.json", ".h5"):
            path = Path(folder) / f"p{suffix}"
            storage.save(problem, path)
            seconds = best(lambda path=path: storage.load(path), 5)
            print(f"loading {suffix:<15} {seconds:8.3f} s  ({path.stat().st_size / 1e6:.1f} MB; asked: 2 s)")
            loaded = storage.load(path)
            assert loaded.fingerprint == problem.fingerprint
    began = time.perf_counter()
    loaded.F(at)
    print(f"first value             {time.perf_counter() - began:8.3f} s")
    began = time.perf_counter()
    loaded.F.jacobian(at)
    print(f"first Jacobian          {time.perf_counter() - began:8.3f} s")
    assert np.allclose(loaded.F(at), hand.value(at), rtol=1e-13, atol=1e-13)
    assert abs(loaded.F.jacobian(at) - hand.jacobian(at)).max() <= 1e-13
    for name, mine, theirs in (
        ("value", lambda: loaded.F(at), lambda: hand.value(at)),
        ("Jacobian", lambda: loaded.F.jacobian(at), lambda: hand.jacobian(at)),
    ):
        ours, others = best(mine), best(theirs)
        print(f"{name:<15} {1e6 * ours:8.0f} µs, by hand {1e6 * others:6.0f} µs: {ours / others:.2f} times (asked: 3)")


if __name__ == "__main__":
    main()
