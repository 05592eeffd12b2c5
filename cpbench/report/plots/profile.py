"""Performance profile: the fraction of problems solved within τ times the least cost.

`cpbench plot profile RESULTS --node lcp -o profile.svg` draws the times; -p metric=NAME takes what else
was counted.
"""

from __future__ import annotations

from cpbench.analysis import cautions
from cpbench.analysis.profiles import performance_profile
from cpbench.report import figures, run_canvas
from cpbench.report.chosen import Choice, choose
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench.report.run import Run


@figure_kind("profile", problem=Need.NONE, metric="Cost: time, solve, cpu, memory, iterations, counter:NAME.")
def draw(run: Run, choice: Choice, *, metric: str = "time") -> Drawing:
    """Draw the profile of the solvers shown, against the best of them."""
    chosen = choose(run, choice)
    found, left_out = chosen.measured(metric)
    profile = performance_profile(found.values, chosen.problems, found.metric.floor, found.lost)
    figure, axes = run_canvas.with_legend(len(profile.curves))
    cost = run_canvas.word(found.metric)
    least = "the fastest" if found.metric.unit == "s" else "the one that needed least"
    across = f"τ: {cost} / {'fastest time' if cost == 'time' else f'least {cost}'} (failures: ∞)"
    figures.profile_axes(axes, profile, chosen.kinds, chosen.looks, across, run_canvas.LINES)
    warning = cautions.caution(found.metric, [c.label for c in profile.curves], run.meta.get("solvers") or {})
    beware = f" {warning}" if warning else ""
    floor = run_canvas.amount(profile.floor, found.metric)
    below = f" Values below {floor} are set to {floor}." if profile.floor else ""
    guide = figures.profile_guide(chosen.problems, cost, least) + below + beware + left_out
    return run_canvas.drawn(figure, f"Performance profile of {chosen.scope()}", guide, chosen)
