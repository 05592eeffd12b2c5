"""Ratio tables on mixed problems, Siconos' time over ours: interleaved, medians, one thread, losses first.

    python benchmarks/mlcp_against_siconos.py [--python /usr/bin/python3] [--data DIR_OF_DAT_FILES]

As benchmarks/lcp_against_siconos.py, from which it has its measurements: both processes are warm, theirs and ours are
timed in turn in processor time, a ratio is the median of the ratios of neighbours, and what is set up once a problem
is not in it. Siconos gets A, B, C, D, a and b (and M with q, as its own files have both); its drivers change what they
are given, so every call of theirs has z and w put to zero first, as ours start from zero. Every answer is measured by
our judge, all three judged numbers: a time counts only where it is within TOLERANCE.

Their DIRECT solvers keep the index sets of the last answer and would only confirm it here: they are left out. Files of
data are named by --data; a process of theirs that a call ends is begun again.

The races: `lemke`, `newton`, `pgs` and `enum` the same method on both sides, `best` the fastest of each side,
`kernel` their fastest against the compiled call of lemke-mlcp from scaled data to x and its error, called as their
driver is: the rest of our time on problems of a few unknowns is the frozen answer that Python makes of it.
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
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
import one_core
import race_rows
from lcp_against_siconos import TOLERANCE, Row, Side, loop, registered

SWEEPS = 2_000
SICONOS = {
    "lcp_lemke": ("SICONOS_MLCP_LCP_LEMKE", 0),
    "fb": ("SICONOS_MLCP_FB", 0),
    "pgs": ("SICONOS_MLCP_PGS", SWEEPS),
    "rpgs": ("SICONOS_MLCP_RPGS", SWEEPS),
    "psor": ("SICONOS_MLCP_PSOR", SWEEPS),
    "enum": ("SICONOS_MLCP_ENUM", 0),
}
"""Their name -> number, iterations (0: their default); dparam[0] is TOLERANCE, the rest as delivered."""
OURS = {
    "lemke-mlcp": 0,
    "newton-min-mlcp": 0,
    "newton-fb-mlcp": 0,
    "interior-point-mlcp": 0,
    "pgs-mlcp": SWEEPS,
    "enumeration-mlcp": 0,
}
RACES = {
    "lemke": (("lcp_lemke",), ("lemke-mlcp",)),
    "newton": (("fb",), ("newton-min-mlcp", "newton-fb-mlcp")),
    "pgs": (("pgs", "rpgs", "psor"), ("pgs-mlcp",)),
    "enum": (("enum",), ("enumeration-mlcp",)),
    "best": (tuple(SICONOS), tuple(OURS)),
    "kernel": (tuple(SICONOS), ("kernel",)),
}
"""Race -> their candidates, ours."""
LARGEST_ENUMERATION = 16
LARGEST_KERNEL = 48
"""Unknowns up to which lemke-mlcp is one compiled call."""
FAMILIES = ("pd", "kkt", "singular")
SIZES = ((1, 1), (3, 4), (10, 10), (40, 40), (200, 200), (500, 500))


def problem_data(family: str, n: int, m: int, seed: int) -> dict[str, Any]:
    """A, B, C, D, a, b: all of it positive definite; the optimality conditions of a strictly convex QP with m
    inequalities (B = 0, C = −Dᵀ); the same where the last free unknown is without curvature, so that A is singular."""
    import numpy as np

    rng = np.random.default_rng([seed, n, m, FAMILIES.index(family)])
    N = n + m
    if family == "pd":
        G = rng.standard_normal((N, N))
        K = G @ G.T / N + np.eye(N)
    else:
        G = rng.standard_normal((n, n))
        A = G @ G.T / n + np.eye(n)
        if family == "singular" and n > 1:
            A[-1] = A[:, -1] = 0.0
        D = rng.standard_normal((m, n)) / math.sqrt(n)
        K = np.block([[A, -D.T], [D, np.zeros((m, m))]])
    u = rng.standard_normal(n)
    positive = rng.random(m) < min(0.5, n / (2 * m))
    v, w = np.where(positive, rng.uniform(0.5, 2.0, m), 0.0), np.where(positive, 0.0, rng.uniform(0.5, 2.0, m))
    k = np.concatenate([np.zeros(n), w]) - K @ np.concatenate([u, v])
    return {"A": K[:n, :n], "B": K[n:, n:], "C": K[:n, n:], "D": K[n:, :n], "a": k[:n], "b": k[n:]}


def serve(folder: Path) -> None:
    """Answers lines {"set", "solver", "repeats"} by {"seconds"}; answers are kept in z-SET-SOLVER.npy."""
    import numpy as np

    # how cpbench's adapters bring a problem into their memory
    sys.path.insert(0, str(Path(__file__).parents[1] / "cpbench_adapters" / "guests"))
    import siconos_problems  # pyright: ignore[reportMissingImports]
    from siconos_memory import LIBRARY, numerics  # pyright: ignore[reportMissingImports]

    numerics.numerics_set_verbose(0)
    replies = os.fdopen(os.dup(1), "w")  # their C code prints to our standard output
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    ready: dict[tuple[str, str], list[Any]] = {}
    for line in sys.stdin:
        asked = json.loads(line)
        label, solver = asked["set"], asked["solver"]
        if (label, solver) not in ready:
            ready[label, solver] = list(_prepared(siconos_problems, LIBRARY, numerics, folder / f"{label}.npz", solver))
        items = ready[label, solver]

        def solve_all(items: list[Any] = items, driver: Any = LIBRARY.mlcp_driver) -> None:
            for z, w, arguments, _ in items:
                z[:] = 0.0
                w[:] = 0.0
                driver(*arguments)

        seconds = loop(solve_all, len(items), asked["repeats"])
        np.save(folder / f"z-{label}-{solver}.npy", np.array([z for z, *_ in items]))
        replies.write(json.dumps({"seconds": seconds}) + "\n")
        replies.flush()


def _prepared(problems: Any, library: Any, numerics: Any, file: Path, solver: str) -> Iterator[Any]:
    """z, w, the arguments of their driver, and what has to be kept alive; initialised as their driver wants it."""
    import ctypes

    import numpy as np

    identifier, iterations = SICONOS[solver]
    stacked = np.load(file)
    for i in range(len(stacked["a"])):
        loaded = problems.load("mlcp", {name: stacked[name][i] for name in stacked.files}, "dense", 0)
        options = numerics.SolverOptions(getattr(numerics, identifier))
        options.dparam[numerics.SICONOS_DPARAM_TOL] = TOLERANCE
        if iterations:
            options.iparam[numerics.SICONOS_IPARAM_MAX_ITER] = iterations
        address, settings = ctypes.c_void_p(loaded.address), ctypes.c_void_p(int(options.this))
        library.mlcp_driver_init(address, settings)
        z, w = loaded.arrays
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (z, w)]
        yield z, w, (address, *pointers, settings), (loaded, options)


# ---------------------------------------------------------------- our side


@dataclass
class MixedSide(Side):
    """A side whose answers are (u, v) in one vector."""

    def probe(self, problems: list) -> None:
        from cpbench.verification import judge

        try:
            self.measure(1)
            verdicts = [
                judge(p, p.point_from_vector(x), TOLERANCE) for p, x in zip(problems, self.answers(), strict=True)
            ]
        except Ended:
            return
        self.error = max(verdict.error for verdict in verdicts)
        if self.solved:
            self.seconds = min(self.measure(1) for _ in range(5))  # one alone may choose whom the machine spared


class Ended(Exception):
    """Their process has died of a call."""


class Siconos:
    """Their process, begun again where a solver has ended it."""

    def __init__(self, python: str, folder: Path) -> None:
        self._python, self._folder = python, folder
        self._begin()

    def _begin(self) -> None:
        self._process = subprocess.Popen(
            [self._python, __file__, "--serve", str(self._folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def side(self, label: str, solver: str) -> MixedSide:
        import numpy as np

        def measure(repeats: int) -> float:
            assert self._process.stdin
            assert self._process.stdout
            try:
                self._process.stdin.write(json.dumps({"set": label, "solver": solver, "repeats": repeats}) + "\n")
                self._process.stdin.flush()
                return json.loads(self._process.stdout.readline())["seconds"]
            except (OSError, ValueError):
                self._process.kill()
                self._process.wait()
                self._begin()
                raise Ended from None

        return MixedSide(f"mlcp_{solver}", measure, lambda: np.load(self._folder / f"z-{label}-{solver}.npy"))

    def close(self) -> None:
        assert self._process.stdin
        self._process.stdin.close()
        self._process.wait(timeout=30)


def native(name: str, problems: list) -> MixedSide:
    """One of OURS."""
    import numpy as np

    measure, found = registered(name, problems, OURS[name])

    def answers() -> Any:
        return [
            np.full(p.a.size + p.b.size, math.nan) if x is None else np.concatenate([x.u, x.v])
            for x, p in zip(found, problems, strict=True)
        ]

    return MixedSide(name, measure, answers)


def kernel(problems: list) -> MixedSide:
    """The compiled call of lemke-mlcp, one a problem."""
    import numpy as np

    from cpbench.foundation.kernel_cache import load
    from cpbench.solvers import Budget, solvers

    solver = solvers.get("lemke-mlcp")
    budget, options = Budget(tolerance=TOLERANCE), solver.spec.options()
    pivot = load("cpbench_solvers.kernels.mlcp_pivoting").lemke_mixed
    every = [solver.setup(p, budget, options) for p in problems]
    calls = [(s.data, np.zeros(s.scaled.k.size), s.limit, TOLERANCE) for s in every]

    def solve_all() -> None:
        for arguments in calls:
            arguments[1][:] = 0.0
            pivot(*arguments)

    answers = lambda: [answer for _, answer, *_ in calls]  # noqa: E731
    return MixedSide("kernel", lambda repeats: loop(solve_all, len(calls), repeats), answers)


def rows_of(label: str, problems: list, races: list[str], siconos: Siconos, folder: Path) -> Iterator[Row]:
    """All races on one set of problems."""
    import numpy as np

    from cpbench.foundation.matrices import dense
    from cpbench.solvers import solvers

    stacked = {name: np.array([dense(getattr(p, name)) for p in problems]) for name in "ABCD"}
    stacked |= {name: np.array([getattr(p, name) for p in problems]) for name in "ab"}
    np.savez(folder / f"{label}.npz", **stacked)
    n, m = problems[0].a.size, problems[0].b.size
    probed: dict[str, MixedSide] = {}

    def taken(name: str) -> bool:
        if name == "kernel":
            return n + m <= LARGEST_KERNEL
        if "enum" in name:
            return m <= LARGEST_ENUMERATION
        return name in SICONOS or all(solvers.get(name).obstacle(p) is None for p in problems)

    def fastest(names: tuple[str, ...]) -> Side | None:
        names = tuple(name for name in names if taken(name))
        for name in names:
            if name not in probed:
                made = siconos.side(label, name) if name in SICONOS else None
                probed[name] = made or (kernel(problems) if name == "kernel" else native(name, problems))
                probed[name].probe(problems)
        return replace(min((probed[name] for name in names), key=lambda s: s.seconds)) if names else None

    for what in races:
        theirs, ours = (fastest(names) for names in RACES[what])
        if theirs is None or ours is None:
            continue
        row = Row(what, label, n + m, theirs, ours)
        row.race(len(problems))
        yield row


def sets(families: list[str], data: Path | None) -> Iterator[tuple[str, list]]:
    """Name and problems of each set: drawn ones, and each file."""
    from cpbench import storage
    from cpbench.errors import CpbenchError
    from cpbench.formulations import MLCP

    for file in sorted(data.glob("*.dat")) if data else ():
        try:
            yield file.stem, [storage.load(file)]
        except CpbenchError as cause:
            print(f"# {file.name} left out: {cause}", file=sys.stderr)
    for n, m in SIZES:
        for family in families:
            count = max(1, min(32, 320 // (n + m)))
            yield f"{family}-{n}-{m}", [MLCP(**problem_data(family, n, m, seed)) for seed in range(count)]


def main(python: str, families: list[str], data: Path | None, races: list[str], path: Path | None) -> None:
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as name:
        siconos = Siconos(python, Path(name))
        for label, problems in sets(families, data):
            for row in rows_of(label, problems, races, siconos, Path(name)):
                rows.append(row)
                print(f"# {row}", file=sys.stderr, flush=True)
        siconos.close()
    race_rows.write(path, [row.race_as_data("mlcp") for row in rows])
    rows.sort(key=lambda row: (not math.isnan(row.ratio), row.ratio >= 1.0))
    print(f"{'ratio':>8s}  {'least to most':18s} {'race':8s} {'problems':16s} {'N':>5s}  ", end="")
    print(f"{'theirs [us] (error)':>19s} {'ours [us] (error)':>19s}  theirs / ours")
    for row in rows:
        print(row)
    for what in dict.fromkeys(row.what for row in rows):
        found = [row.ratio for row in rows if row.what == what and not math.isnan(row.ratio)]
        if found:
            mean = statistics.geometric_mean(found)
            print(
                f"{what}: {len(found)} sets, geometric mean {mean:.2f}, least {min(found):.2f}, most {max(found):.2f}"
            )
        for row in rows:
            if row.what == what and row.theirs.solved != row.ours.solved:
                print(f"{what} {row.family}: only {(row.theirs if row.theirs.solved else row.ours).name} solves it")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", default="/usr/bin/python3", help="the interpreter that has siconos")
    parser.add_argument("--families", default=",".join(FAMILIES), help="of " + ", ".join(FAMILIES))
    parser.add_argument("--data", type=Path, help="a directory of Siconos' .dat files, which go first")
    parser.add_argument("--races", default=",".join(RACES), help="of " + ", ".join(RACES))
    parser.add_argument("--json", type=Path, help="write the races there, too")
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    one_core.hold()
    if arguments.serve:
        serve(Path(arguments.serve))
    else:
        named = [text.split(",") if text else [] for text in (arguments.families, arguments.races)]
        main(arguments.python, named[0], arguments.data, named[1], arguments.json)
