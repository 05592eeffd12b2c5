"""Ratio tables, Siconos' time over ours on the same contact problems: interleaved, medians, one thread, losses first.

    python benchmarks/contact_against_siconos.py FOLDER [FILE ...] [--races auto,nsgs,sweep] [--tolerances 1e-4,1e-8]

Every problem in space that the folder or the files hold is asked of Siconos, which lives in the system's Python
(--python), and of us, theirs, ours, theirs, ours ... in processor time, both warm. Both are judged by us, by all the
numbers of `residuals`; as they stop on one of these, `natural`, they are asked for less and less until the others are
within the tolerance, too. With --natural they are judged by that one alone, and we still by all.

`auto` is auto-fc against the fastest of eight of their solvers, chosen afterwards for every problem and tolerance,
`nsgs` is NSGS with the error evaluated in full against nsgs, and `sweep` the time of a sweep of both.
Their object and our `setup` are made once and are not in the time; what `setup` takes is printed beside it.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import selectors
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import one_race
from lcp_against_siconos import LONGEST, PAIRS, SHORTEST, loop

FINER = (("", 1.0), (" /10", 0.1), (" /100", 1e-2), (" /1000", 1e-3))
"""What they are asked for until our measure of their answer is within the tolerance: (label, its share)."""
PATIENCE = 8.0
"""Seconds after which one of their solves is stopped: not solved."""
SLOW = 0.5
"""A solve that takes longer than this is raced in fewer pairs."""
SWEEPS = 20_000
MEASURED_SWEEPS, FEWEST = 120, 12
"""Sweeps of the longer of two runs whose difference is the time of sweeps, the shorter has a sixth; less where one side
comes to rest earlier, and there is no race where that takes less than FEWEST."""
NSGS, FULL = "SICONOS_FRICTION_3D_NSGS", {"SICONOS_FRICTION_3D_IPARAM_ERROR_EVALUATION": 0}
"""0 is SICONOS_FRICTION_3D_NSGS_ERROR_EVALUATION_FULL; as delivered it is a light one, in full at the end."""
LIGHT = {"SICONOS_FRICTION_3D_IPARAM_ERROR_EVALUATION": 1}
LOCAL = "SICONOS_FRICTION_3D_ONECONTACT_ProjectionOnConeWithLocalIteration"
SICONOS: dict[str, tuple[str, dict[str, int], str, int]] = {
    "NSGS": (NSGS, {}, "", SWEEPS),
    "NSGS full": (NSGS, FULL, "", SWEEPS),
    "NSGS projection": (NSGS, {}, LOCAL, SWEEPS),
    "NSN_AC": ("SICONOS_FRICTION_3D_NSN_AC", {}, "", 0),
    "NSN_FB": ("SICONOS_FRICTION_3D_NSN_FB", {}, "", 0),
    "ADMM": ("SICONOS_FRICTION_3D_ADMM", {}, "", SWEEPS),
    "PROX": ("SICONOS_FRICTION_3D_PROX", {}, "", 0),
    "ACLMFP": ("SICONOS_FRICTION_3D_ACLMFP", {}, "", 0),
}
"""Their name -> number, integer parameters, one-contact solver, iterations (0: as delivered)."""
RACES = {"auto": ("auto-fc", tuple(SICONOS)), "nsgs": ("nsgs", ("NSGS full",)), "sweep": ("nsgs", ("NSGS sweep",))}


# ---------------------------------------------------------------- their side, under the system's Python


def serve(folder: Path) -> None:
    """Answers lines {"file", "solver", "tolerance", "repeats"} by {"seconds", "iterations"}; the last answer is in
    r.npy."""
    import numpy as np
    import siconos.numerics as sn  # pyright: ignore[reportMissingImports]

    sn.numerics_set_verbose(0)
    # their C code prints to our standard output: replies go to a copy of it
    replies = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    loaded: dict[str, Any] = {}

    def made(solver: str, tolerance: float) -> Any:
        sweeps = 0
        if solver.startswith("NSGS sweep"):
            constant, parameters, inner, sweeps = NSGS, LIGHT, "", int(solver.split()[-1])
        else:
            constant, parameters, inner, sweeps = SICONOS[solver]
        options = sn.SolverOptions(getattr(sn, constant))
        options.dparam[0] = tolerance
        if sweeps:
            options.iparam[0] = sweeps
        for name, value in parameters.items():
            options.iparam[getattr(sn, name)] = value
        if inner:
            sn.solver_options_update_internal(options, 0, getattr(sn, inner))
        return options

    for line in sys.stdin:
        asked = json.loads(line)
        if asked["file"] not in loaded:
            loaded.clear()
            loaded[asked["file"]] = sn.frictionContact_new_from_filename(str(folder / asked["file"]))
        problem = loaded[asked["file"]]
        r, u = np.zeros((2, problem.dimension * problem.numberOfContacts))
        # solvers write into their options, so that every solve has fresh ones
        every = [made(asked["solver"], asked["tolerance"]) for _ in range(asked["repeats"])]
        fresh = iter(every)
        call = sn.fc3d_nsgs if asked["solver"].startswith("NSGS") else sn.fc3d_driver

        def solve(call: Any = call, problem: Any = problem, r: Any = r, u: Any = u, fresh: Any = fresh) -> None:
            r[:] = 0.0
            u[:] = 0.0
            call(problem, r, u, next(fresh))

        seconds = loop(solve, 1, asked["repeats"])
        np.save(folder / "r.npy", r)
        done = int(every[-1].iparam[sn.SICONOS_IPARAM_ITER_DONE])
        replies.write(json.dumps({"seconds": seconds, "iterations": done}) + "\n")
        replies.flush()


class Siconos:
    """Their process, started anew when it ended or took too long."""

    def __init__(self, python: str, folder: Path) -> None:
        self.folder, self.iterations = folder, 0
        self._command = [python, __file__, "--serve", str(folder)]
        self._process: subprocess.Popen[str] | None = None

    def measure(self, file: str, solver: str, tolerance: float, repeats: int) -> float:
        """Seconds a solve; infinite where there was none."""
        if self._process is None:
            pipe = subprocess.PIPE
            self._process = subprocess.Popen(self._command, stdin=pipe, stdout=pipe, text=True)
        process = self._process
        assert process.stdin and process.stdout  # noqa: PT018
        process.stdin.write(
            json.dumps({"file": file, "solver": solver, "tolerance": tolerance, "repeats": repeats}) + "\n"
        )
        process.stdin.flush()
        with selectors.DefaultSelector() as ready:
            ready.register(process.stdout, selectors.EVENT_READ)
            reply = process.stdout.readline() if ready.select(PATIENCE + repeats * SHORTEST) else ""
        if not reply:
            process.kill()
            process.wait()
            self._process = None
            return math.inf
        told = json.loads(reply)
        self.iterations = told["iterations"]
        return told["seconds"]

    def close(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()


# ---------------------------------------------------------------- both sides of a race


@dataclass
class Side:
    """One solver on one problem: seconds a solve and the error of its answer, judged by us."""

    name: str
    measure: Any
    seconds: float = math.inf
    error: float = math.inf
    solved: bool = False
    told: str = ""


@dataclass
class Row:
    """One line of the table."""

    what: str
    problem: str
    nc: int
    tolerance: float
    theirs: Side
    ours: Side
    ratio: float = math.nan
    spread: str = ""
    setup: float = 0.0

    def race(self) -> None:
        """Theirs and ours in turn."""
        sides = (self.theirs, self.ours)
        if not all(side.solved for side in sides):
            return
        repeats = [max(1, math.ceil(SHORTEST / side.seconds)) for side in sides]
        pairs = PAIRS if max(side.seconds for side in sides) < SLOW else 3
        times: list[tuple[float, float]] = []
        end = time.monotonic() + LONGEST
        while len(times) < pairs and (not times or time.monotonic() < end):
            times.append((self.theirs.measure(repeats[0]), self.ours.measure(repeats[1])))
            if not all(side.solved for side in sides):  # an answer that is wrong when asked again has no time
                return
        times = [pair for pair in times if all(map(math.isfinite, pair))]  # a guest that was stopped has no time
        if not times:
            return
        ratios = [a / b for a, b in times]
        self.ratio, self.spread = statistics.median(ratios), f"{min(ratios):.2f} to {max(ratios):.2f}"
        self.theirs.seconds, self.ours.seconds = (statistics.median(column) for column in zip(*times, strict=True))

    @property
    def lost(self) -> bool:
        """Slower, or not solved where they solved."""
        return self.ratio < 1.0 or (self.theirs.solved and not self.ours.solved)

    def as_data(self) -> one_race.Race:
        ratio = None if math.isnan(self.ratio) else self.ratio
        who = self.theirs.name, self.ours.name
        return one_race.Race(f"contact {self.what}", self.problem, self.nc, self.tolerance, ratio, self.lost, *who)

    def __str__(self) -> str:
        cells = [
            f"{1e3 * s.seconds:10.3f} ({s.error:.0e})" if s.solved else f"{'no':>10s} ({s.error:.0e})"
            for s in (self.theirs, self.ours)
        ]
        start = f"{self.ratio:7.2f}  {self.spread:16s} {self.what:5s} {self.problem[:36]:36s} {self.nc:5d}"
        end = f"{cells[0]} {cells[1]} {1e3 * self.setup:8.3f}  {self.theirs.name} / {self.ours.told or self.ours.name}"
        return f"{start} {self.tolerance:.0e} {end}"


def read(paths: list[Path], most: float = math.inf) -> Iterator[tuple[str, Any]]:
    """Every problem in space of at most so many contacts, in local form."""
    import warnings

    from cpbench import graph, storage
    from cpbench.errors import CpbenchError

    for path in paths:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            problem = storage.load(path)
            if problem.node == "gfc" and problem.dimension == 3:
                try:
                    problem = graph.arrive(problem, "fc").problem
                except CpbenchError:
                    continue
        if problem.node == "fc" and problem.dimension == 3 and 0 < problem.nc <= most:
            yield path.name, problem


def ours_on(name: str, problem: Any, tolerance: float, iterations: int | None = None) -> tuple[Side, float]:
    """The registered solver as the runner calls it, and the seconds of its `setup`."""
    from cpbench.solvers import Budget, solvers
    from cpbench.verification import judge

    solver = solvers.get(name)
    solver.warmup()
    options = solver.spec.options()
    budget = Budget(tolerance=tolerance, iterations=iterations, seconds=2 * PATIENCE)
    solver.setup(problem, budget, options)
    before = time.process_time()
    prepared = solver.setup(problem, budget, options)
    setup = time.process_time() - before
    side = Side(name, lambda repeats: loop(lambda: solver.solve(prepared, budget, options), 1, repeats))
    output = solver.solve(prepared, budget, options)
    if output.point is not None:
        verdict = judge(problem, output.point, tolerance)
        side.error, side.solved = verdict.error, verdict.solved
    side.seconds = side.measure(1)
    side.told = f"{name}: {output.message[-70:]}" if output.message else name
    return side, setup


def theirs_on(siconos: Siconos, label: str, solver: str, problem: Any, tolerance: float, measure: str | None) -> Side:
    """The first solve, and where it is short others."""
    import numpy as np

    from cpbench.formulations import FCPoint
    from cpbench.verification import judge

    goal = tolerance

    def measured(repeats: int) -> float:
        """Seconds; every answer is judged, for some of theirs fail when they are asked again."""
        seconds = siconos.measure(label, solver, goal, repeats)
        side.solved, side.error = False, math.inf
        if math.isfinite(seconds):
            r = np.load(siconos.folder / "r.npy")
            if np.isfinite(r).all():
                verdict = judge(problem, FCPoint(r=r), tolerance, measure)
                side.error, side.solved = verdict.error, verdict.solved
        return seconds

    side = Side(solver, measured)
    for asked in FINER if measure is None else FINER[:1]:
        side.name, goal = f"{solver}{asked[0]}", asked[1] * tolerance
        side.seconds = measured(1)
        if side.solved or not math.isfinite(side.seconds) or side.seconds > PATIENCE / 10:
            break
    if side.solved and side.seconds < SLOW:
        side.seconds = min(side.seconds, measured(3))
    return side


def sweep_row(name: str, problem: Any, label: str, siconos: Siconos) -> Row | None:
    """Seconds a sweep from two runs of different length; None where a side has soon nothing left to sweep."""
    import numpy as np

    from cpbench_solvers.contact.sweeps import Sweeps, block_rows

    rows = block_rows(problem)

    def swept(count: int) -> Sweeps:
        sweeps = Sweeps(rows)
        sweeps.sweep(np.zeros(problem.q.size), count, 1e-300)
        return sweeps

    # not `solve`: to a tolerance that fine it measures its answer afresh, which takes as long as thousands of sweeps
    def our_time(count: int, repeats: int) -> float:
        return loop(lambda: swept(count), 1, repeats)

    def their_time(count: int, repeats: int) -> float:
        return siconos.measure(label, f"NSGS sweep {count}", 1e-300, repeats)

    their_time(MEASURED_SWEEPS, 1)
    many = min(swept(MEASURED_SWEEPS).done, siconos.iterations)
    few = many // 6
    if many < FEWEST:
        return None

    def side(measure: Any, name: str) -> Side:
        def measured(repeats: int) -> float:
            seconds = (measure(many, repeats) - measure(few, repeats)) / (many - few)
            return seconds if seconds > 0 else math.inf  # disturbed

        # ten times as long as other measurements, for it is a difference
        return Side(name, measured, seconds=measure(many, 3) / 10, error=0.0, solved=True)

    return Row("sweep", name, problem.nc, 0.0, side(their_time, "NSGS"), side(our_time, f"{many} sweeps"))


def rows_of(
    name: str, problem: Any, races: list[str], tolerances: list[float], siconos: Siconos, measure: str | None
) -> Iterator[Row]:
    """All races on one problem."""
    from cpbench import storage

    label = f"{abs(hash(name))}.dat"
    storage.save(problem, siconos.folder / label)
    for what in races:
        native, pool = RACES[what]
        if what == "sweep":
            row = sweep_row(name, problem, label, siconos)
            if row is not None:
                row.race()
                yield row
            continue
        for tolerance in tolerances:
            mine, setup = ours_on(native, problem, tolerance)
            results = [theirs_on(siconos, label, solver, problem, tolerance, measure) for solver in pool]
            best = min(results, key=lambda side: (not side.solved, side.seconds if side.solved else side.error))
            row = Row(what, name, problem.nc, tolerance, best, mine, setup=setup)
            row.race()
            yield row


def main(
    python: str,
    problems: Iterator[tuple[str, Any]],
    races: list[str],
    tolerances: list[float],
    measure: str | None,
    path: Path | None,
) -> None:
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as name:
        siconos = Siconos(python, Path(name))
        for label, problem in problems:
            for row in rows_of(label, problem, races, tolerances, siconos, measure):
                rows.append(row)
                print(f"# {row}", file=sys.stderr, flush=True)
        siconos.close()
    one_race.write(path, [row.as_data() for row in rows])
    rows.sort(key=lambda row: (not row.lost, not math.isnan(row.ratio), row.ratio))
    print(f"{'ratio':>7s}  {'least to most':16s} {'race':5s} {'problem':36s} {'nc':>5s} {'tol':5s}", end="")
    print(f" {'theirs [ms] (error)':>18s} {'ours [ms] (error)':>18s} {'setup':>8s}  theirs / ours")
    for row in rows:
        print(row)
    for what in dict.fromkeys(row.what for row in rows):
        for tolerance in dict.fromkeys(row.tolerance for row in rows if row.what == what):
            chosen = [row for row in rows if row.what == what and row.tolerance == tolerance]
            ratios = [row.ratio for row in chosen if not math.isnan(row.ratio)]
            solved = [sum(getattr(row, side).solved for row in chosen) for side in ("theirs", "ours")]
            if ratios:
                mean = statistics.geometric_mean(ratios)
                print(f"{what} {tolerance:.0e}: geometric mean {mean:.2f}, least {min(ratios):.2f}, ", end="")
                print(
                    f"lost {sum(row.lost for row in chosen)} of {len(chosen)}; solved {solved[0]} by the best ", end=""
                )
                print(f"of theirs, {solved[1]} by ours")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="*", type=Path, help="files, or folders of files")
    parser.add_argument("--python", default="/usr/bin/python3", help="the interpreter that has siconos")
    parser.add_argument("--races", default="auto", help="of " + ", ".join(RACES))
    parser.add_argument("--tolerances", default="1e-4,1e-8")
    parser.add_argument("--natural", action="store_true", help="judge them by the number they stop on, us by all")
    parser.add_argument("--most", type=int, default=1_000_000, help="contacts of a problem")
    parser.add_argument("--json", type=Path, help="write the races there, too")
    parser.add_argument("--serve", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    one_race.hold()
    if arguments.serve:
        serve(arguments.serve)
    else:
        files = [f for p in arguments.paths for f in (sorted(p.iterdir()) if p.is_dir() else [p])]
        chosen = [float(text) for text in arguments.tolerances.split(",")]
        judged_by = "natural" if arguments.natural else None
        problems = read(files, arguments.most)
        main(arguments.python, problems, arguments.races.split(","), chosen, judged_by, arguments.json)
