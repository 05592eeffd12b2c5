"""Processor time of the native QP solvers beside the installed backends, through one interface, on planted problems.

    python benchmarks/qp_against_backends.py [--tolerance 1e-6] [--repeats 5] [--seeds 2] [--only n=20] [--all]

Each family is solved by turns, A B C A B C, set-up and solve together, one thread; the least time of each solver on a
problem counts. A time stands only where the judged error is within the tolerance. The ratio is the best backend's time
over the best native one's, geometric mean over the problems of a family; losses come first.
"""

from __future__ import annotations

import os

os.environ.update({"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"})

import argparse
import math
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import one_race
import scipy.sparse as sp

from cpbench.formulations import QP
from cpbench.solvers import Budget, solvers
from cpbench.verification import judge

sys.path.append(str(Path(__file__).parents[1] / "tests" / "unit"))
import planted

NATIVE = ("dual-active-set", "proximal-active-set", "interior-point-qp", "augmented-lagrangian")
BACKENDS = ("piqp", "proxqp", "quadprog", "daqp", "osqp", "clarabel", "highs", "qpalm", "cvxopt")
LARGE = ("interior-point-qp", "augmented-lagrangian", "piqp", "osqp", "clarabel", "qpalm", "cvxopt")
"""Who is asked for sparse problems of 2000 unknowns: the others are dense."""
SLOW = 10.0
"""Who takes this many times the best of the first round is not asked again."""


def around(rng: np.random.Generator, Q: Any, A: Any, C: Any) -> QP:
    """A QP around a strictly complementary solution: n/3 rows (half of them at most) and n/5 bounds are active."""
    n, m = Q.shape[0], A.shape[0]
    z, mu = rng.standard_normal(n), rng.standard_normal(C.shape[0])
    lam, nu, slack = np.zeros(m), np.zeros(n), rng.uniform(0.5, 2.0, m)
    rows = rng.permutation(m)[: min(m // 2, n // 3)]
    lam[rows], slack[rows] = rng.uniform(0.5, 2.0, rows.size), 0.0
    lb, ub = z - rng.uniform(0.5, 2.0, n), z + rng.uniform(0.5, 2.0, n)
    at = rng.permutation(n)[: n // 5]
    low, high = at[: at.size // 2], at[at.size // 2 :]
    lb[low], nu[low] = z[low], rng.uniform(0.5, 2.0, low.size)
    ub[high], nu[high] = z[high], -rng.uniform(0.5, 2.0, high.size)
    return QP.build(Q, A.T @ lam + C.T @ mu + nu - Q @ z, A, A @ z - slack, C, C @ z, lb, ub)


def dense(n: int, m: int, rank: int = 0) -> Callable[[np.random.Generator], QP]:
    """Q = GGᵀ/n + I/100, or of a rank."""

    def make(rng: np.random.Generator) -> QP:
        G = rng.standard_normal((n, rank or n))
        Q = G @ G.T / n + (0.0 if rank else 0.01) * np.eye(n)
        return around(rng, (Q + Q.T) / 2, rng.standard_normal((m, n)), rng.standard_normal((n // 10, n)))

    return make


def sparse(n: int, m: int, reach: int) -> Callable[[np.random.Generator], QP]:
    """Rows of four entries among `reach` neighbours: narrow bands, or a pattern that fills in."""

    def rows(rng: np.random.Generator, count: int) -> sp.csr_array:
        first = rng.integers(0, n - reach + 1, (count, 1))
        columns = (first + rng.integers(0, reach, (count, 4))).ravel()
        made = sp.csr_array(
            (rng.standard_normal(4 * count), (np.repeat(np.arange(count), 4), columns)), shape=(count, n)
        )
        made.sum_duplicates()
        return made

    def make(rng: np.random.Generator) -> QP:
        G = rows(rng, n)
        Q = sp.csr_array(G.T @ G * 0.25 + 0.01 * sp.eye_array(n))
        return around(rng, sp.csr_array((Q + Q.T) / 2), rows(rng, m), rows(rng, n // 10))

    return make


FAMILIES: dict[str, Callable[[np.random.Generator], QP]] = {
    **{f"dense n={n} m={m}": dense(n, m) for n in (20, 50, 200) for m in (n // 2, n, 2 * n)},
    **{f"degenerate n={n} m={n}": (lambda rng, n=n: planted.qp(rng, n, n, n // 10)[0]) for n in (20, 50, 200)},
    **{f"semidefinite n={n} m={n}": dense(n, n, n // 2) for n in (20, 50, 200)},
    "banded n=2000 m=1000": sparse(2000, 1000, 20),
    "banded n=2000 m=2000": sparse(2000, 2000, 20),
    "filling n=2000 m=1000": sparse(2000, 1000, 2000),
}


def compared(problem: QP, names: list[str], tolerance: float, repeats: int) -> dict[str, float]:
    """Least processor time of each solver that met the tolerance."""
    budget, best, out = Budget(tolerance=tolerance, seconds=20.0), {}, set[str]()
    for turn in range(repeats):
        for name in names:
            solver = solvers.get(name)
            if name in out or (turn == 0 and solver.obstacle(problem) is not None):
                out.add(name)
                continue
            options = solver.spec.options()
            before = time.process_time()
            try:
                output = solver.solve(solver.setup(problem, budget, options), budget, options)
            except Exception:
                out.add(name)
                continue
            seconds = time.process_time() - before
            if output.point is None or not judge(problem, output.point, tolerance).solved:
                out.add(name)
                continue
            best[name] = min(seconds, best.get(name, math.inf))
        out |= {name for name, seconds in best.items() if seconds > SLOW * min(best.values())}
    return best


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tolerance", type=float, default=1e-6)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--only", default="", help="families whose name contains this")
    parser.add_argument("--all", action="store_true", help="print the times of every solver")
    parser.add_argument("--json", type=Path, help="write the ratios there, too")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    one_race.hold()
    known = set(solvers.names())
    names = [n for n in (*NATIVE, *BACKENDS) if n in known and solvers.get(n).availability().ok]
    for name in names:
        solvers.get(name).warmup()
    lines: list[tuple[float, str]] = []
    races: list[one_race.Race] = []
    for family, make in FAMILIES.items():
        if arguments.only not in family:
            continue
        logs: list[float] = []
        winners: list[str] = []
        pairs: list[tuple[str, str]] = []
        size = 0
        for seed in range(arguments.seeds):
            problem = make(np.random.default_rng(seed))
            asked = [n for n in names if problem.p.size < 1000 or n in LARGE]
            times = compared(problem, asked, arguments.tolerance, arguments.repeats)
            ours = min((n for n in times if n in NATIVE), key=times.__getitem__, default="nobody")
            theirs = min((n for n in times if n not in NATIVE), key=times.__getitem__, default="nobody")
            logs.append(math.log(times.get(theirs, math.inf) / times[ours]) if ours in times else -math.inf)
            pairs.append((theirs, ours))
            size = problem.p.size
            winners.append(
                f"{ours} {1e3 * times.get(ours, math.inf):.3g} ms, {theirs} {1e3 * times.get(theirs, math.inf):.3g} ms"
            )
            if arguments.all:
                for name in sorted(times, key=times.__getitem__):
                    print(f"  {family} seed {seed}: {name} {1e3 * times[name]:.3g} ms", flush=True)
        ratio = math.exp(sum(logs) / len(logs))
        lines.append((ratio, f"{family:26}  {winners[-1]}"))
        theirs, ours = ("/".join(dict.fromkeys(names)) for names in zip(*pairs, strict=True))
        races.append(one_race.race("qp best", family, size, ratio, theirs, ours, tolerance=arguments.tolerance))
    one_race.write(arguments.json, races)
    print("backend / native  family, best native, best backend (last seed)")
    for ratio, line in sorted(lines):
        print(f"{ratio:16.2f}  {line}{'   LOSS' if ratio < 1.0 else ''}")


if __name__ == "__main__":
    main()
