"""The error of a motion beside the error of the contact problems it was made of, by solver, scene and tolerance.

    python benchmarks/motion.py reports/motion                # measures: table.csv, and draws motion.svg
    python benchmarks/motion.py reports/motion --draw         # draws again from table.csv

Each scene has a closed form (`cpbench_problems.scenes.motions`), which the time stepping follows to rounding where
every step is solved exactly: what is left at the end is the solver's. No times are measured.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cpbench.errors import CpbenchError
from cpbench.report import canvas
from cpbench.report.figure_kinds import Drawing
from cpbench_problems.scenes.motions import MOTIONS
from cpbench_problems.scenes.simulation import NotSolved, Simulation

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
    "clarabel-relaxation",
)
TOLERANCES = (1e-3, 1e-6, 1e-9)
FLOOR = 1e-16
"""What is smaller is drawn here."""
GUIDE = (
    "A point is a scene that a solver moved at one of three tolerances (1e-9, 1e-6, 1e-3, from left to right). Error "
    "of the motion: how far a body ends from its closed form at most, over the longest way that a body goes. Error "
    "of a step: as cpbench judges the answer to the contact problem. On the grey line both are equal."
)
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


def drawn(table: list[dict[str, str]]) -> Drawing:
    """Draw a panel a scene: the error of the motion over the largest error of a step, a line a solver."""
    scenes, solvers = (list(dict.fromkeys(row[name] for row in table)) for name in ("scene", "solver"))
    figure = canvas.page(canvas.PAGE, 4.2)
    values = [
        max(float(row[name]), FLOOR) for row in table for name in ("motion", "residual") if row["motion"] != "nan"
    ]
    limits = 0.5 * FLOOR, 3.0 * max(values)
    for k, scene in enumerate(scenes):
        row, column = divmod(k, 3)
        axes: Any = figure.add_axes((0.09 + 0.31 * column, 0.575 - 0.485 * row, 0.265, 0.375))
        axes.set(xscale="log", yscale="log", xlim=limits, ylim=limits, title=scene)
        axes.plot(limits, limits, color=canvas.FAINT, linewidth=1.0, zorder=0)
        for j, solver in enumerate(solvers):
            points = [
                (max(float(row["residual"]), FLOOR), max(float(row["motion"]), FLOOR))
                for row in table
                if (row["scene"], row["solver"]) == (scene, solver) and row["motion"] != "nan"
            ]
            axes.plot(*zip(*points, strict=True) if points else ((), ()), **_look(solver, j))
        if column == 0:
            axes.set_ylabel("error of the motion")
        if row == 1 or k + 3 >= len(scenes):
            axes.set_xlabel("largest error of a step")
    axes = figure.add_axes((0.705, 0.09, 0.275, 0.375))
    axes.axis("off")
    handles = [axes.plot((), (), label=solver, **_look(solver, j))[0] for j, solver in enumerate(solvers)]
    axes.legend(handles=handles, loc="center left", fontsize=6.5, frameon=False)
    return Drawing(figure, _title(table), GUIDE)


def _look(solver: str, j: int) -> dict[str, Any]:
    groups = (("siconos", canvas.RED), ("pinocchio", canvas.GREEN), ("clarabel", canvas.INK))
    colour = next((colour for start, colour in groups if solver.startswith(start)), canvas.BLUE)
    return {"color": colour, "marker": "osD^vPX*<>ph"[j % 12], "markersize": 3.5, "linewidth": 0.7, "alpha": 0.85}


def _title(table: list[dict[str, str]]) -> str:
    """Say what the table has: how far the error of a motion is from that of the steps."""
    ended = [row for row in table if row["motion"] != "nan"]
    solved = [row for row in ended if row["missed"] == "0"]
    worst = max(float(row["motion"]) / float(row["tolerance"]) for row in solved)
    line = f"Where each step meets the tolerance, the motion is right to {worst:.2g} times the tolerance"
    others = [row for row in ended if row["missed"] != "0"]
    if not others:
        return line
    far = max(others, key=lambda row: float(row["motion"]))
    wrong = f"{float(far['motion']):.2g} wrong ({far['scene']}) with an error of {float(far['residual']):.1g} in a step"
    return f"{line}; the worst of those that miss it, {far['solver']}, is {wrong}"


def main() -> None:
    """Measure, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--solver", action="append", help="only these; repeatable")
    parser.add_argument("--draw", action="store_true", help="draw again, measure nothing")
    given = parser.parse_args()
    path = given.folder / "table.csv"
    if not given.draw:
        with path.open("w", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            for row in rows(tuple(given.solver or SOLVERS)):
                writer.writerow(row)
                file.flush()
                print(*row.values(), flush=True)
    with path.open(newline="") as file, canvas.drawing():
        canvas.write(drawn(list(csv.DictReader(file))), given.folder / "motion.svg")


if __name__ == "__main__":
    main()
