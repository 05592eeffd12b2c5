"""Published results, measured again: the problems and the plan of each, and the table that its page shows.

    python benchmarks/reproductions.py [NAME ...]     # fathi, bg2012, exponential, mass-ratio, incline, orderings

writes the problems of reports/reproductions/NAME.toml beside it, runs it in a folder of its own, and writes NAME.csv.
`python docs/generate/reproductions_page.py` then writes the pages.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd

from cpbench import storage
from cpbench.api.results import Results
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation.matrices import Dense, dense
from cpbench_problems.generators.lcp_classics import fathi, murty
from cpbench_problems.scenes import simulation as scenes
from cpbench_problems.scenes.motions import incline
from cpbench_problems.scenes.stepper import contact_problem, own_axes

FOLDER = Path(__file__).resolve().parents[1] / "reports" / "reproductions"
COLUMNS = ("problem", "solver", "tolerance", "status", "time", "count", "what", "message")
RATIOS = (1.0, 1e2, 1e4, 1e6)
FIRST = 10
"""Steps of the block on the incline whose contact problems are taken."""
Packed = dict[str, tuple[Problem, tuple[Point, ...]]]
"""Problems by name, each with its starting points."""


def fathi_problems() -> Packed:
    """Return Fathi's problems of growing size; they are started from zero."""
    return {f"fathi-{n}": (fathi(n).problem, ()) for n in (2, 4, 8, 16, 32, 64, 128)}


def ben_gharbia_gilbert_matrix(n: int) -> Dense:
    """Return the P-matrix of order n on which plain Newton-min cycles: a circulant with 1 on the diagonal.

    For odd n the entry before it is 2; for even n the two entries before it are 4/3 and 1/2 (Ben Gharbia and Gilbert
    2012, as in the file bg2012.m of the authors' hnm4lcp).
    """
    before = (2.0,) if n % 2 else (4.0 / 3.0, 0.5)
    M = np.eye(n)
    for k, value in enumerate(before, 1):
        M += value * np.roll(np.eye(n), -k, axis=1)
    return M


def ben_gharbia_gilbert_problems() -> Packed:
    """Return the problems with q = e, whose solution is 0, each with the start −e₁."""
    made: Packed = {}
    for n in (3, 4, 5, 6, 8, 9, 16, 33, 64):
        problem = LCP(M=ben_gharbia_gilbert_matrix(n), q=np.ones(n), name=f"bg2012-{n}")
        made[problem.name] = problem, (LCPPoint(z=-np.eye(n)[0]),)
    return made


def murty_problems() -> Packed:
    """Return Murty's problems of growing size, as they are hard for Lemke's method and for the least-index rule.

    For Lemke's method with the covering vector e, −q = (2ⁿ, 2ⁿ + 2ⁿ⁻¹, …); for the rule, which takes the first negative
    component, the unknowns are in reverse order.
    """
    made: Packed = {}
    for n in (4, 6, 8, 10, 12):
        M = dense(cast(LCP, murty(n).problem).M)
        hard = LCP(M=M, q=-np.cumsum(2.0 ** np.arange(n, 0, -1)), name=f"lemke-{n}")
        reverse = LCP(M=M[::-1, ::-1], q=-np.ones(n), name=f"least-index-{n}")
        made |= {hard.name: (hard, ()), reverse.name: (reverse, ())}
    return made


def mass_ratio_problems() -> Packed:
    """Return the contact problem of a heavy cube at rest on a light one, of a step of 1 ms, by mass ratio.

    All steps of the scene have this problem, since nothing moves.
    """
    made: Packed = {}
    for ratio in RATIOS:
        scene = scenes.scene_of("tower", size=2, mass_ratio=ratio, mu=0.9, dt=1e-3)
        free = scene.dt * own_axes(scene.start, scene.force)
        problem = contact_problem(scene, scene.start, scene.touch(scene.start), free.ravel())
        name = f"cubes-{ratio:.0e}"
        made[name] = replace(problem, name=name, sequence=None), ()
    return made


def incline_problems() -> Packed:
    """Return the contact problems of the first steps of the block on the incline, which move by answers to 1e-9."""
    simulation = scenes.Simulation(incline().scene, None, 1e-9)
    made: Packed = {}
    for k, step in enumerate(simulation.run(FIRST)):
        if step.problem is not None:
            name = f"incline-{k}"
            made[name] = replace(step.problem, name=name, sequence=None), ()
    return made


def lemke_howson_path(d: int, dropped: int) -> int:
    """Count the steps of Lemke and Howson's algorithm on the d × d game of two dual cyclic polytopes.

    Vertices are bit strings by Gale's evenness condition; to leave a facet moves its bit past the ones beside it, to
    the side on which their number was odd. The labels of the second polytope are permuted (Savani and von Stengel
    2006, Econometrica 74:397; Morris 1994). d is even, `dropped` the missing label from 0 to 2d − 1.
    """
    label = [
        0,
        *(k for i in range(2, d, 2) for k in (i, i - 1)),
        d - 1,
        *(k for i in range(d, 2 * d, 2) for k in (i + 1, i)),
    ]
    place = [label.index(k) for k in range(2 * d)]
    first, second = [True] * d + [False] * d, [False] * d + [True] * d
    length, here = 0, dropped
    on_second = dropped >= d
    while True:
        here = label[_left(second, place[here])] if on_second else _left(first, here)
        length += 1
        if here == dropped:
            return length
        on_second = not on_second


def _left(vertex: list[bool], facet: int) -> int:
    """Leave a facet of a vertex of a cyclic polytope; return the facet that is met."""
    n, before = len(vertex), 0
    while vertex[(facet - before - 1) % n]:
        before += 1
    step = -1 if before % 2 else 1
    vertex[facet], met = False, (facet + step) % n
    while vertex[met]:
        met = (met + step) % n
    vertex[met] = True
    return met


def lemke_howson_rows() -> Iterator[dict[str, object]]:
    """Yield a row for each game: the longest and the shortest path over all labels."""
    for d in (2, 4, 6, 8, 10, 12, 14, 16):
        lengths = [lemke_howson_path(d, label) for label in range(2 * d)]
        for what, count in (("longest path", max(lengths)), ("shortest path", min(lengths))):
            yield {"problem": f"game-{d}", "solver": "Lemke-Howson", "status": "counted", "count": count, "what": what}


PROBLEMS: Mapping[str, Callable[[], Packed]] = {
    "fathi": fathi_problems,
    "bg2012": ben_gharbia_gilbert_problems,
    "exponential": murty_problems,
    "mass-ratio": mass_ratio_problems,
    "incline": incline_problems,
}
EXTRA: Mapping[str, Callable[[], Iterator[dict[str, object]]]] = {"exponential": lemke_howson_rows}
NAMES = (*PROBLEMS, "orderings")


def run(name: str, folder: Path) -> pd.DataFrame:
    """Run the plan of a reproduction; its results lie in `folder`."""
    if name in PROBLEMS:
        packed = PROBLEMS[name]()
        storage.save_pack(
            {key: problem for key, (problem, _) in packed.items()},
            FOLDER / f"{name}.h5",
            guesses={key: guesses for key, (_, guesses) in packed.items() if guesses},
            force=True,
        )
    results = folder / f"{name}.sqlite"
    plugin, plan = FOLDER / "newton_min.py", FOLDER / f"{name}.toml"
    call = ["run", "--plugin", str(plugin), "--plan", str(plan), "-o", str(results)]
    subprocess.run([sys.executable, "-m", "cpbench", *call], cwd=folder, env=os.environ, check=False)
    return Results(results).frame


def table(rows: pd.DataFrame) -> Iterator[dict[str, object]]:
    """Yield what a page shows of each row: the status, the time of the solve [s] and the count of its work."""
    for row in rows.to_dict("records"):
        counters: dict[str, Any] = json.loads(row["counters"] or "{}")
        what = next((key for key in ("period", "iterations", "pivots") if key in counters), "")
        count = counters.get(what, "")
        values = (row["problem"], row["solver"], row["tolerance"], row["status"], row["solve"], count, what)
        yield dict(zip(COLUMNS, (*values, row.get("message") or ""), strict=True))


def main(names: Sequence[str]) -> None:
    """Run the plans and write their tables."""
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            rows = [*table(run(name, Path(folder))), *EXTRA.get(name, lambda: iter(()))()]
        with (FOLDER / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS, restval="", lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
        print(f"{FOLDER / name}.csv: {len(rows)} rows")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", choices=[*NAMES, []], metavar="NAME")
    main(parser.parse_args().names or NAMES)
