"""The error of a motion beside the error of the contact problems it was made of, by solver, scene and tolerance.

    python tests/bench/motion.py reports/motion                # measures: table.csv, and draws motion.svg
    python tests/bench/motion.py reports/motion --draw         # draws again from table.csv

Each scene has a closed form (`cpbench.generators.scenes.motions`), which the time stepping follows to rounding where
every step is solved exactly: what is left at the end is the solver's. No times are measured.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator
from pathlib import Path

from cpbench.api.scenes import NotSolved, Simulation
from cpbench.errors import CpbenchError
from cpbench.generators.scenes.motions import MOTIONS

SOLVERS = (
    "auto-gfc",
    "nsgs",
    "admm-fc",
    "newton-alart-curnier",
    "interior-point-fc",
    "siconos-fc3d-nsgs",
    "siconos-fc3d-nsn-ac",
    "pinocchio-admm",
    "pinocchio-pgs",
    "clarabel-de-saxce",
    "cvxpy-relaxation",
)
TOLERANCES = (1e-3, 1e-6, 1e-9)
COLUMNS = ("scene", "solver", "tolerance", "steps", "motion", "residual", "missed", "message")


def rows(solvers: tuple[str, ...]) -> Iterator[dict[str, object]]:
    """Yield a row for each scene, solver and tolerance; one that ends early has the steps that were made."""
    for make in MOTIONS:
        motion = make()
        for solver in solvers:
            for tolerance in TOLERANCES:
                simulation = Simulation(motion.scene, solver, tolerance)
                message, error = "", float("nan")
                try:
                    for _ in simulation.run(motion.steps):
                        pass
                    error = motion.error(simulation.steps[-1].state)
                except (NotSolved, CpbenchError) as cause:
                    message = " ".join(str(cause).split())
                row = (motion.scene.name, solver, tolerance, len(simulation.steps), error)
                yield dict(zip(COLUMNS, (*row, simulation.error, simulation.missed, message), strict=True))


def main() -> None:
    """Measure, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--solver", action="append", help="only these; repeatable")
    parser.add_argument("--draw", action="store_true", help="draw again, measure nothing")
    given = parser.parse_args()
    with (given.folder / "table.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        for row in rows(tuple(given.solver or SOLVERS)):
            writer.writerow(row)
            file.flush()
            print(*row.values(), flush=True)


if __name__ == "__main__":
    main()
