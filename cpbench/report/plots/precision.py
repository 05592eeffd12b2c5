"""Work-precision: the median time to each error over a group of problems, from recorded iterates.

Needs a run with --history, which keeps the iterates of solvers that can tell them.
"""

from __future__ import annotations

from cpbench.analysis import histories
from cpbench.errors import CpbenchError
from cpbench.report import convergence, run_canvas
from cpbench.report.chosen import Choice, SelectedRows, choose
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench.report.run import Run
from cpbench.report.text import listed_plainly


@figure_kind("precision", problem=Need.NONE)
def draw(run: Run, choice: Choice) -> Drawing:
    """Draw one curve a solver with histories, the one that gets furthest in the first colour."""
    chosen = choose(run, choice)
    require_histories(chosen)
    work_precision = histories.work_precision(chosen.rows, chosen.histories)
    figure, axes = run_canvas.with_legend(work_precision["label"].nunique(), notes=1)
    convergence.curves_axes(axes, work_precision, chosen.problems, chosen.looks)
    axes.set_xlabel("time, conversion and set-up included, log scale")
    without = sorted(set(chosen.rows["label"]) - set(work_precision["label"]))
    left_out = f" No history of {listed_plainly(without)}." if without else ""
    guide = f"{convergence.guide(chosen.problems)}{left_out}"
    return run_canvas.drawn(figure, f"Error against time, {chosen.scope()}", guide, chosen)


def require_histories(chosen: SelectedRows) -> None:
    """Raise CpbenchError when no iterate of these rows was kept."""
    if not chosen.rows["key"].isin(chosen.histories["key"]).any():
        raise CpbenchError("no iterates were kept of these rows: run with --history, for solvers that tell theirs")
