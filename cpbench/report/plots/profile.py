"""Performance profile: the fraction of problems solved within τ times the least cost.

`cpbench plot profile RESULTS --node lcp -o profile.svg` draws the times; --metric takes what else was counted, --bands
adds 95 % bootstrap bands that draw families again.
"""

from __future__ import annotations

from cpbench.analysis import bootstrap, cautions, pairwise
from cpbench.analysis.profiles import performance_profile
from cpbench.report import figures, legend, run_canvas
from cpbench.report.chosen import Choice, choose
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench.report.run import Run
from cpbench.report.text import counted, listed_plainly

BANDS = 3
"""The most curves that get a band: more of them cover each other."""


@figure_kind(
    "profile",
    problem=Need.NONE,
    metric="Cost: time, solve, cpu, memory, iterations, counter:NAME.",
    bands=f"Bootstrap bands around the {BANDS} leading curves.",
)
def draw(run: Run, choice: Choice, *, metric: str = "time", bands: bool = False) -> Drawing:
    """Draw the profile of the solvers shown, against the best of them."""
    chosen = choose(run, choice)
    found, left_out = chosen.measured(metric)
    profile = performance_profile(found.values, chosen.problems, found.metric.floor, found.lost)
    figure, axes = run_canvas.with_legend(len(profile.curves))
    cost = run_canvas.word(found.metric)
    least = "the fastest" if found.metric.unit == "s" else "the one that needed least"
    across = f"τ: {cost} / {'fastest time' if cost == 'time' else f'least {cost}'} (failures: ∞)"
    places = figures.profile_axes(axes, profile, chosen.kinds, chosen.looks, across, run_canvas.LINES)
    banded = ""
    if bands and places:
        families = bootstrap.families_of(chosen.rows)
        leading = list(places)[:BANDS]
        heights = bootstrap.profile_heights(found.values, leading, found.metric.floor or 0.0, found.lost)
        for label, (tau, statistic) in heights.items():
            around = bootstrap.intervals(statistic, families)
            low, high = (around.table[end].to_numpy()[[*range(len(tau)), -1]] for end in ("low", "high"))
            ends = [*tau, figures.right_end(profile)]
            axes.fill_between(ends, low, high, step="post", color=legend.colour(places[label]), alpha=0.16, linewidth=0)
            few = "; with so few a rough guess" if around.families < bootstrap.FEW else ""
            banded = (
                f" Bands: 95 % at each τ by itself, {counted(around.families, 'family', 'families')} drawn again "
                f"{around.replicates} times{few}."
            )
    swapped = pairwise.reversals(found.values, profile.leading(legend.EMPHASISED), floor=found.metric.floor)
    caution = ""
    if swapped:
        shown = listed_plainly([f"{one} is above {other}" for one, other in swapped], 3)
        caution = f" At τ = 2 {shown} only because of the other solvers shown; pairwise, the order reverses."
    warning = cautions.caution(found.metric, [c.label for c in profile.curves], run.meta.get("solvers") or {})
    beware = f" {warning}" if warning else ""
    floor = run_canvas.amount(profile.floor, found.metric)
    below = f" Values below {floor} are set to {floor}." if profile.floor else ""
    guide = figures.profile_guide(chosen.problems, cost, least) + below + banded + caution + beware + left_out
    return run_canvas.drawn(figure, f"Performance profile of {chosen.scope()}", guide, chosen)
