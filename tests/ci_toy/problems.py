"""`python problems.py FOLDER`: LCPs that projected Gauss-Seidel solves, three kinds, three of each."""

import sys
from pathlib import Path

import numpy as np

from cpbench import storage
from cpbench.formulations import LCP


def spd(rng, n):
    B = rng.standard_normal((n, n))
    return B @ B.T + 0.05 * n * np.eye(n)


def chain(rng, n):
    return np.diag(np.full(n, 2.1)) - np.eye(n, k=1) - np.eye(n, k=-1)


def skewed(rng, n):
    B = rng.standard_normal((n, n))
    return 2.2 * np.sqrt(n) * np.eye(n) + (B - B.T)


def main(folder: Path) -> None:
    rng = np.random.default_rng(7)
    folder.mkdir(parents=True, exist_ok=True)
    for make, n in ((spd, 80), (chain, 50), (skewed, 120)):
        for k in range(3):
            problem = LCP(M=make(rng, n), q=rng.standard_normal(n), name=f"{make.__name__}-{k}")
            storage.save(problem, folder / f"{make.__name__}-{k}.h5")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
