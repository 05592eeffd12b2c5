"""What Acary, Brémond and Huber found of solvers of frictional contact, asked again of ours: who is ahead where.

    python tests/bench/published_ordering.py FOLDER [FILE ...] [--seconds 10] [--siconos /usr/bin/python3]

"On solving contact problems with Coulomb friction: formulations and numerical comparisons" (2018, Springer LNACM
92:205, sections 9 to 12) orders NSGS, nonsmooth Newton and proximal points by the rank of W and by the accuracy. Every
problem in space that the files hold is solved here at 1e-4 and 1e-8, in processor time of set-up and solve, the median
of some solves where one is short; an answer counts where all numbers of `residuals` are within the tolerance. Limits
are of processor time, too, so that a busy machine fails nobody. Who does not solve a problem at 1e-4 is not asked for
1e-8. With --siconos its NSGS, NSN_AC and PROX are asked,
too, as they are delivered, and finer where that leaves an answer that we do not accept.

A claim is reproduced where it holds on more files than not; less than a tenth is a tie and counts for nobody.
"""

from __future__ import annotations

import argparse
import functools
import math
import os
import statistics
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import contact_against_siconos as guest

COARSE, FINE = 1e-4, 1e-8
BUSY = 4.0  # seconds that may go by in one of the guest's processor time
TIE, SHORT, SOLVES = 1.1, 0.3, 5
"""Ratio of two times that are one; seconds below which a solve is repeated, and how often it is done."""
OURS: dict[str, tuple[str, dict[str, Any]]] = {
    "nsgs": ("nsgs", {}),
    "newton": ("newton-alart-curnier", {}),
    "newton jm": ("newton-jean-moreau", {}),
    "pure newton": ("newton-alart-curnier", {"sweeps": 0}),
    "prox newton": ("proximal-newton", {}),
    "prox nsgs": ("proximal-nsgs", {}),
    "auto": ("auto-fc", {}),
}
"""Label -> registered solver and options. `newton` begins with sweeps (the hybrid method of the paper), `pure` not."""
THEIRS = ("NSGS", "NSN_AC", "PROX")


@dataclass(frozen=True)
class Row:
    """A file: contacts, rank of W, and label -> tolerance -> seconds."""

    name: str
    nc: int
    rank: int
    seconds: dict[str, dict[float, float]] = field(default_factory=dict)

    @property
    def full(self) -> bool:
        return self.rank == 3 * self.nc

    def __str__(self) -> str:
        times = [by[t] for by in self.seconds.values() for t in (COARSE, FINE)]
        cells = " ".join(f"{1e3 * s:9.2f}" if math.isfinite(s) else f"{'-':>9s}" for s in times)
        return f"{self.name[:32]:32s} {self.nc:4d} {self.rank:5d} {3 * self.nc / max(self.rank, 1):5.2f} {cells}"


def ranked(W: Any) -> int:
    """Numerical rank, threshold nε‖W‖₂."""
    import numpy as np

    from cpbench.foundation.matrices import dense

    full = dense(W)
    symmetric = np.allclose(full, full.T, rtol=0.0, atol=1e-14 * np.abs(full).max())
    values = np.abs(np.linalg.eigvalsh(full)) if symmetric else np.linalg.svd(full, compute_uv=False)
    return int((values > W.shape[0] * np.finfo(float).eps * values.max()).sum())


def ours(label: str, problem: Any, limit: float, tolerance: float) -> float:
    """Processor seconds of set-up and solve by one of `OURS`; infinite where the answer is not within the tolerance."""
    from cpbench.solvers import Budget, solvers
    from cpbench.verification import judge

    name, given = OURS[label]
    solver = solvers.get(name)
    options, budget = solver.spec.options(**given), Budget(tolerance=tolerance, seconds=limit)
    times: list[float] = []
    while len(times) < SOLVES and (not times or times[0] < SHORT):
        before = time.process_time()
        output = solver.solve(solver.setup(problem, budget, options), budget, options)
        times.append(time.process_time() - before)
        if output.point is None or not judge(problem, output.point, tolerance).solved:
            return math.inf
    return statistics.median(times)


def theirs(siconos: guest.Siconos, file: str, solver: str, problem: Any, limit: float, tolerance: float) -> float:
    side = guest.theirs_on(siconos, file, solver, problem, tolerance, None)
    return side.seconds if side.solved and side.seconds <= limit else math.inf


def asked(solve: Callable[[float], float]) -> dict[float, float]:
    coarse = solve(COARSE)
    return {COARSE: coarse, FINE: solve(FINE) if math.isfinite(coarse) else math.inf}


def rows(paths: list[Path], limit: float, siconos: guest.Siconos | None) -> Iterator[Row]:
    from cpbench import storage
    from cpbench.solvers import solvers

    for name, _ in OURS.values():
        solvers.get(name).warmup()
    for name, problem in guest.read(paths):
        row = Row(name, problem.nc, ranked(problem.W))
        for label in OURS:
            row.seconds[label] = asked(functools.partial(ours, label, problem, limit))
        if siconos is not None:
            with warnings.catch_warnings(action="ignore"):  # it cannot be lifted, and need not be
                storage.save(problem, siconos.folder / (copy := f"{name}.dat"), force=True)
            for label in THEIRS:
                row.seconds[label] = asked(functools.partial(theirs, siconos, copy, label, problem, limit))
        print(row, flush=True)
        yield row


# ---------------------------------------------------------------- what was published


def duel(rows: list[Row], ahead: str, behind: str, tolerance: float) -> str:
    """On how many files `ahead` is faster than `behind`, or alone; and by how much where both solve."""
    pairs = [(row.seconds[ahead][tolerance], row.seconds[behind][tolerance]) for row in rows]
    open_ = [(a, b) for a, b in pairs if math.isfinite(min(a, b))]
    wins, losses = sum(a * TIE < b for a, b in open_), sum(b * TIE < a for a, b in open_)
    both = [b / a for a, b in open_ if math.isfinite(max(a, b))]
    mean = f"{statistics.geometric_mean(both):.2f} times as fast" if both else "never both"
    alone = f"alone on {sum(math.isinf(b) for _, b in open_)}, {behind} on {sum(math.isinf(a) for a, _ in open_)}"
    verdict = ("undecided", "reproduced", "CONTRADICTED")[(wins > losses) - (wins < losses)]
    return f"{verdict:12s} {ahead} before {behind}: {wins} of {len(open_)}, after it {losses}; {mean}; {alone}"


def solved(rows: list[Row], label: str) -> int:
    return sum(math.isfinite(row.seconds[label][FINE]) for row in rows)


def summary(rows: list[Row]) -> Iterator[str]:
    full, hyper = [r for r in rows if r.full], [r for r in rows if not r.full]
    theirs = [label for label in THEIRS if label in rows[0].seconds]
    for least in (1, 20):
        some, many = ([r for r in group if r.nc >= least] for group in (full, hyper))
        yield f"--- files of at least {least} contacts: W has full rank in {len(some)}, not in {len(many)}"
        yield "Newton is ahead of NSGS at 1e-8 where W has full rank"
        for label in ("newton", "newton jm", "pure newton"):
            yield "  " + duel(some, label, "nsgs", FINE)
        if theirs:
            yield "  " + duel(some, "NSN_AC", "NSGS", FINE)
        yield "NSGS is ahead of Newton at 1e-4 where W is rank deficient"
        for label in ("newton", "newton jm", "pure newton"):
            yield "  " + duel(many, "nsgs", label, COARSE)
        if theirs:
            yield "  " + duel(many, "NSGS", "NSN_AC", COARSE)
        yield "proximal points are robust at 1e-8 where W is rank deficient, and Newton alone is not: files solved"
        counts = {label: solved(many, label) for label in [*OURS, *theirs]}
        for proximal, others in (("prox newton", ("nsgs", "pure newton")), ("PROX", ("NSGS", "NSN_AC"))):
            if many and proximal in counts:
                most = all(counts[proximal] >= counts[other] for other in others) and 2 * counts[proximal] > len(many)
                told = ", ".join(f"{label} {counts[label]}" for label in (proximal, *others))
                yield f"  {'reproduced' if most else 'CONTRADICTED':12s} {told}, of {len(many)}"
        for group in (some, many):
            told = ", ".join(f"{label} {solved(group, label)}" for label in counts)
            yield f"  solved at 1e-8 where W {'has' if group is some else 'has not'} full rank ({len(group)}): {told}"


def main(paths: list[Path], limit: float, python: str) -> None:
    guest.PATIENCE = BUSY * limit
    with tempfile.TemporaryDirectory() as folder:
        siconos = guest.Siconos(python, Path(folder)) if python else None
        labels = [*OURS, *(THEIRS if python else ())]
        print(f"{'[ms]':32s} {'nc':>4s} {'rank':>5s} {'n/rk':>5s} " + "".join(f"{label:>19s} " for label in labels))
        print(" " * 50 + f"{'1e-4':>9s} {'1e-8':>9s} " * len(labels))
        found = list(rows(paths, limit, siconos))
        if siconos is not None:
            siconos.close()
    for line in summary(found):
        print(line)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="+", type=Path, help="files, or folders of files")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--siconos", default="", metavar="PYTHON", help="the interpreter that has siconos")
    arguments = parser.parse_args()
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[variable] = "1"
    time.monotonic = time.process_time  # by which solvers look at their limits
    files = [f for p in arguments.paths for f in (sorted(p.iterdir()) if p.is_dir() else [p])]
    main(files, arguments.seconds, arguments.siconos)
