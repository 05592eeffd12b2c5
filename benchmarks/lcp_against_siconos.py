"""Ratio tables, Siconos' time over ours on the same LCPs: interleaved, medians, one thread, losses first.

    python benchmarks/lcp_against_siconos.py [--python /usr/bin/python3] [--sizes 5,50,1000] [--families pd,psd]

Siconos lives in the system's Python (NumPy 1): the script starts itself there and sends it one line a measurement.
Both processes are warm; theirs, ours, theirs, ours ... are measured in turn, never at once, in processor time, and a
ratio is the median of the ratios of neighbours. A measurement of a small problem is a loop over several different
ones. What is set up once a problem (their object, our scaling) is not in it; the loop in Python is, on both sides,
and so is the final check of our solvers. Every answer is measured by us, `natural` = ‖min(z, w)‖/‖q‖, the
number their tests use: a time counts only where all answers of a side are within TOLERANCE.

`lemke` and `pivot` measure our lemke as it is delivered: up to 250 unknowns it begins at w = q as theirs do, beyond
at the basis that a few sweeps point to.
`best` takes on each side the fastest that solved, chosen afterwards, and names it. `kernel` is the compiled loop of
lemke from M and q to z, called as Siconos' function is called.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import one_race

TOLERANCE = 1e-8
SWEEPS = 2_000
"""Who needs more is not the fastest."""
PAIRS = 7
SHORTEST = 2e-3
"""Seconds that one measurement lasts at least: problems are solved again until then."""
LONGEST = 12.0
"""Seconds for the pairs of one row; one pair is measured at least."""
FAMILIES = ("pd", "nonsymmetric", "p", "ill-conditioned", "psd")
SIZES = (5, 10, 20, 50, 200, 1000)
SICONOS = {
    "lexicolemke": ("SICONOS_LCP_LEMKE", "lcp_lexicolemke", 0),
    "pivot": ("SICONOS_LCP_PIVOT", "lcp_pivot", 0),
    "newton_min": ("SICONOS_LCP_NEWTONMIN", "lcp_newton_min", 0),
    "newton_FB": ("SICONOS_LCP_NEWTON_FB_FBLSA", "lcp_newton_FB", 0),
    "newton_minFB": ("SICONOS_LCP_NEWTON_MIN_FBLSA", "lcp_newton_minFB", 0),
    "pgs": ("SICONOS_LCP_PGS", "lcp_pgs", SWEEPS),
}
"""Their name -> number, function, iterations (0: their default); dparam[0] is TOLERANCE, the rest as delivered."""
OURS = {"lemke": 0, "bpp": 0, "newton-min": 0, "pgs": SWEEPS}
"""Our name -> iterations (0: its default); the budget's tolerance is TOLERANCE, options as delivered."""


def problem_data(family: str, n: int, seed: int):
    """(M, q): positive definite, nonsymmetric positive definite, P but not PSD (row diagonally dominant, columns
    scaled), condition about 1e4, and W = HHᵀ of rank 0.6 n with q in its range but for gaps, as contacts have it."""
    import numpy as np

    rng = np.random.default_rng([seed, n, FAMILIES.index(family)])
    if family == "psd":
        rank = max(2, 6 * n // 10)
        H = np.zeros((n, rank))
        for row in H:
            row[rng.choice(rank, min(4, rank), replace=False)] = rng.standard_normal(min(4, rank))
        return H @ H.T, H @ rng.standard_normal(rank) + 0.05 * abs(rng.standard_normal(n))
    if family == "p":
        B = rng.uniform(-1, 1, (n, n))
        np.fill_diagonal(B, 0.0)
        M = (B + np.diag(1.02 * abs(B).sum(axis=1))) * np.exp(rng.uniform(-3, 3, n))
        return M, rng.standard_normal(n)
    A, B = rng.standard_normal((2, n, n))
    shift = {"pd": 1.0, "nonsymmetric": 0.1, "ill-conditioned": 1e-4}[family]
    M = A @ A.T / n + shift * np.eye(n)
    if family == "nonsymmetric":
        M += (B - B.T) / math.sqrt(n)
    return M, rng.standard_normal(n)


def how_many(n: int) -> int:
    """Different problems in one measurement."""
    return max(1, min(64, 640 // n)) if n < 1000 else 1


def loop(solve_all: Callable[[], object], count: int, repeats: int) -> float:
    """Seconds of processor time per problem of `repeats` rounds over all of them."""
    before = time.process_time()
    for _ in range(repeats):
        solve_all()
    return (time.process_time() - before) / (repeats * count)


# ---------------------------------------------------------------- their side, under the system's Python


def serve(folder: Path) -> None:
    """Answers lines {"set", "solver", "repeats"} by {"seconds"}; answers are kept in z-SET-SOLVER.npy."""
    import numpy as np
    import siconos.numerics as sn  # pyright: ignore[reportMissingImports]

    sn.numerics_set_verbose(0)
    # their C code prints to our standard output: replies go to a copy of it
    replies = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    loaded: dict[str, list] = {}
    for line in sys.stdin:
        asked = json.loads(line)
        label, solver = asked["set"], asked["solver"]
        if label not in loaded:
            loaded.clear()
            data = np.load(folder / f"{label}.npz")
            loaded[label] = [
                (sn.LCP(M, q), np.zeros(q.size), np.zeros(q.size)) for M, q in zip(*data.values(), strict=True)
            ]
        identifier, function, iterations = SICONOS[solver]
        options = sn.SolverOptions(getattr(sn, identifier))
        options.dparam[0] = TOLERANCE
        if iterations:
            options.iparam[0] = iterations
        call = getattr(sn, function)

        def solve_all(
            items: list[Any] = loaded[label], call: Callable[..., int] = call, options: Any = options
        ) -> None:
            for problem, z, w in items:
                z[:] = 0.0
                w[:] = 0.0
                call(problem, z, w, options)

        seconds = loop(solve_all, len(loaded[label]), asked["repeats"])
        np.save(folder / f"z-{label}-{solver}.npy", np.array([z for _, z, _ in loaded[label]]))
        replies.write(json.dumps({"seconds": seconds}) + "\n")
        replies.flush()


# ---------------------------------------------------------------- our side


@dataclass
class Side:
    """One solver on one set of problems: `measure(repeats)` gives seconds per problem, `error` the worst answer."""

    name: str
    measure: Callable[[int], float]
    answers: Callable[[], Any]
    error: float = math.inf
    seconds: float = math.inf

    def probe(self, problems: list) -> None:
        """One round that is not counted, one that says how long a round takes, and the measured error."""
        from cpbench.formulations import LCPPoint
        from cpbench.verification import judge

        self.measure(1)
        answers = self.answers()
        verdicts = [judge(p, LCPPoint(z=z), TOLERANCE, "natural") for p, z in zip(problems, answers, strict=True)]
        self.error = max(v.error for v in verdicts)
        if self.solved:
            self.seconds = self.measure(1)

    @property
    def solved(self) -> bool:
        return self.error <= TOLERANCE


@dataclass
class Row:
    """One line of the table."""

    what: str
    family: str
    n: int
    theirs: Side
    ours: Side
    ratios: list[float] = field(default_factory=list)

    @property
    def ratio(self) -> float:
        return statistics.median(self.ratios) if self.ratios else math.nan

    def race(self, count: int) -> None:
        """Theirs and ours in turn."""
        if not (self.theirs.solved and self.ours.solved):
            return
        repeats = [max(1, math.ceil(SHORTEST / (s.seconds * count))) for s in (self.theirs, self.ours)]
        times: list[tuple[float, float]] = []
        end = time.monotonic() + LONGEST
        while len(times) < PAIRS and (not times or time.monotonic() < end):
            times.append((self.theirs.measure(repeats[0]), self.ours.measure(repeats[1])))
        self.ratios = [a / b for a, b in times]
        self.theirs.seconds, self.ours.seconds = (statistics.median(column) for column in zip(*times, strict=True))

    def as_data(self) -> one_race.Race:
        ratio = None if math.isnan(self.ratio) else self.ratio
        lost = self.theirs.solved and (ratio is None or ratio < 1.0)
        names = self.theirs.name, self.ours.name
        return one_race.Race(f"lcp {self.what}", f"{self.family} n={self.n}", self.n, TOLERANCE, ratio, lost, *names)

    def __str__(self) -> str:
        shown = [
            f"{1e6 * s.seconds:11.1f} ({s.error:.0e})" if s.solved else f"{'not solved':>11s} ({s.error:.0e})"
            for s in (self.theirs, self.ours)
        ]
        spread = f"{min(self.ratios):.2f} to {max(self.ratios):.2f}" if self.ratios else ""
        start = f"{self.ratio:8.2f}  {spread:18s} {self.what:11s} {self.family:16s} {self.n:5d}"
        return f"{start}  {shown[0]} {shown[1]}  {self.theirs.name} / {self.ours.name}"


class Siconos:
    """Their process."""

    def __init__(self, python: str, folder: Path) -> None:
        self._folder = folder
        self._process = subprocess.Popen(
            [python, __file__, "--serve", str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def side(self, label: str, solver: str) -> Side:
        import numpy as np

        def measure(repeats: int) -> float:
            assert self._process.stdin
            assert self._process.stdout
            asked = {"set": label, "solver": solver, "repeats": repeats}
            self._process.stdin.write(json.dumps(asked) + "\n")
            self._process.stdin.flush()
            return json.loads(self._process.stdout.readline())["seconds"]

        return Side(f"lcp_{solver}", measure, lambda: np.load(self._folder / f"z-{label}-{solver}.npy"))

    def close(self) -> None:
        assert self._process.stdin
        self._process.stdin.close()
        self._process.wait(timeout=30)


def registered(name: str, problems: list, iterations: int) -> tuple[Callable[[int], float], list]:
    """How a registered solver is measured, called as the runner does without `setup`, and where its points will be."""
    from cpbench.solvers import Budget, solvers

    solver = solvers.get(name)
    options = solver.spec.options()
    budget = Budget(tolerance=TOLERANCE, iterations=iterations or None)
    prepared = [solver.setup(p, budget, options) for p in problems]
    results: list = []

    def solve_all() -> None:
        results[:] = [solver.solve(p, budget, options).point for p in prepared]

    return lambda repeats: loop(solve_all, len(problems), repeats), results


def native(name: str, problems: list) -> Side:
    """One of OURS."""
    import numpy as np

    measure, results = registered(name, problems, OURS[name])

    def answers() -> Any:
        return [np.full(p.q.size, math.nan) if z is None else z.z for z, p in zip(results, problems, strict=True)]

    return Side(name, measure, answers)


def kernel(problems: list) -> Side:
    """Lemke's compiled loop, one call a problem."""
    import numpy as np

    from cpbench_solvers.kernels.pivoting import lemke

    limit = 50 * problems[0].q.size + 1000
    data = [(np.array(p.M), np.array(p.q), np.zeros(p.q.size)) for p in problems]

    def solve_all() -> None:
        for M, q, z in data:
            lemke(M, q, z, limit, 1e-11, 1e-13)

    return Side("kernel", lambda repeats: loop(solve_all, len(data), repeats), lambda: [z for _, _, z in data])


RACES = {
    "lemke": (("lexicolemke",), ("lemke",)),
    "pivot": (("pivot",), ("lemke",)),
    "kernel": (("lexicolemke",), ("kernel",)),
    "best": (tuple(SICONOS), tuple(OURS)),
}
"""Race -> their candidates, ours."""


def rows_of(family: str, n: int, races: list[str], siconos: Siconos, folder: Path) -> Iterator[Row]:
    """All races on one set of problems."""
    import numpy as np

    from cpbench.formulations import LCP

    data = [problem_data(family, n, seed) for seed in range(how_many(n))]
    label = f"{family}-{n}"
    np.savez(folder / f"{label}.npz", M=np.array([M for M, _ in data]), q=np.array([q for _, q in data]))
    problems = [LCP(M=M, q=q) for M, q in data]
    probed: dict[tuple[bool, str], Side] = {}

    def fastest(names: tuple[str, ...], is_ours: bool) -> Side:
        for name in names:
            if (is_ours, name) in probed:
                continue
            ours_by = kernel if name == "kernel" else partial(native, name)
            side = ours_by(problems) if is_ours else siconos.side(label, name)
            side.probe(problems)
            probed[is_ours, name] = side
        return replace(min((probed[is_ours, name] for name in names), key=lambda side: side.seconds))

    for what in races:
        if n >= 1000 and what == "kernel":
            continue  # there lemke is more than one compiled loop
        theirs, ours = RACES[what]
        row = Row(what, family, n, fastest(theirs, False), fastest(ours, True))
        row.race(len(problems))
        yield row


def main(python: str, families: list[str], sizes: list[int], races: list[str], path: Path | None) -> None:
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as name:
        siconos = Siconos(python, Path(name))
        for n in sizes:
            for family in families:
                for row in rows_of(family, n, races, siconos, Path(name)):
                    rows.append(row)
                    print(f"# {row}", file=sys.stderr, flush=True)
        siconos.close()
    one_race.write(path, [row.as_data() for row in rows])
    rows.sort(key=lambda row: (not math.isnan(row.ratio), row.ratio >= 1.0))
    head = f"{'ratio':>8s}  {'least to most':18s} {'race':11s} {'family':16s} {'n':>5s}"
    print(f"{head}  {'theirs [us] (error)':>19s} {'ours [us] (error)':>19s}  theirs / ours")
    for row in rows:
        print(row)
    for what in dict.fromkeys(row.what for row in rows):
        for n in sizes:
            ratios = [row.ratio for row in rows if row.what == what and row.n == n and not math.isnan(row.ratio)]
            if ratios:
                mean = statistics.geometric_mean(ratios)
                print(f"{what} n={n}: geometric mean {mean:.2f}, least {min(ratios):.2f}, most {max(ratios):.2f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", default="/usr/bin/python3", help="the interpreter that has siconos")
    parser.add_argument("--families", default=",".join(FAMILIES), help="of " + ", ".join(FAMILIES))
    parser.add_argument("--sizes", default=",".join(map(str, SIZES)), help="numbers of unknowns")
    parser.add_argument("--races", default=",".join(RACES), help="of " + ", ".join(RACES))
    parser.add_argument("--json", type=Path, help="write the races there, too")
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    one_race.hold()
    if arguments.serve:
        serve(Path(arguments.serve))
    else:
        chosen = [text.split(",") for text in (arguments.families, arguments.sizes, arguments.races)]
        main(arguments.python, chosen[0], [int(n) for n in chosen[1]], chosen[2], arguments.json)
