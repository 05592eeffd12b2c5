"""Answers that pass by the natural residual and are far from the solution, which is proved to be the only one.

    python tests/bench/far_answers.py [--seed 1] [--problems 12] [--report FOLDER]

LCPs with a positive definite matrix of condition 1e5 to 1e8 and a planted solution are run with `measure =
"natural"` and certified: an answer passes if ‖min(z, Mz + q)‖₂ ≤ 1e-6 ‖q‖₂, which was the verdict of earlier
versions and is that of Siconos. Listed are those that pass and are 1e-2 or more of the solution's size from it, with
the backward error that is the verdict now.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np

import cpbench as cp
from cpbench.analysis import certainty
from cpbench.analysis.table import normalised
from cpbench.bench.results.store import Store
from cpbench_lab.certifying import certify_rows

SOLVERS = ("pgs", "psor", "mprgp", "interior-point-lcp", "newton-fb", "clarabel", "osqp", "nesterov-qp", "admm-coneqp")


def problem(rng: np.random.Generator, number: int) -> cp.LCP:
    """Return an LCP with a planted solution; its matrix is positive definite, of a drawn condition number."""
    n = int(rng.integers(10, 40))
    basis = np.linalg.qr(rng.standard_normal((n, n)))[0]
    condition = 10.0 ** rng.uniform(5.0, 8.0)
    M = basis @ np.diag(np.geomspace(1.0 / condition, 1.0, n)) @ basis.T
    M = (M + M.T) / 2.0
    z = np.where(rng.random(n) < 0.5, rng.uniform(0.5, 2.0, n), 0.0)
    return cp.LCP(M=M, q=np.where(z == 0.0, rng.uniform(0.5, 2.0, n), 0.0) - M @ z, name=f"conditioned-{number}")


def main() -> None:
    """Print the answers, the farthest first."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--problems", type=int, default=12)
    parser.add_argument("--report", type=Path)
    asked = parser.parse_args()
    rng = np.random.default_rng(asked.seed)
    problems = [problem(rng, k) for k in range(asked.problems)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "far.sqlite"
        cp.run(problems, SOLVERS, measure="natural", repeats=1, seconds=5.0, out=path)
        with Store(path, create=True) as store:
            count = sum(1 for _ in certify_rows(store))
            table = normalised(store.table())
        if asked.report is not None:
            cp.Results(path).report(asked.report)
    far = certainty.far(table)
    for row in far.itertuples(index=False):
        backward = json.loads(str(row.parts))["backward"]
        unique = "the only solution" if "unique" in str(row.certificate) else "a solution"
        print(f"{row.problem} {row.label}: natural {row.error:.1e}, {row.distance:.2g} from {unique}, {backward=:.1e}")
    passed = (table["status"] == "solved").sum()
    print(
        f"{len(far)} of {passed} answers that pass are {certainty.FAR:g} or more from the solution; {count} certified"
    )


if __name__ == "__main__":
    main()
