"""Performance profile: the fraction of problems solved within τ times the least cost.

`cpbench plot profile RESULTS --node lcp -o profile.svg` draws the times; -p metric=NAME takes what else
was counted.
"""

from __future__ import annotations

from cpbench.analysis import cautions
from cpbench.analysis.profiles import performance_profile
from cpbench.report import figures
from cpbench.report.chosen import Choice, choose
from cpbench.report.figure_kinds import Drawing, figure_kind
from cpbench.report.run import Run
from cpbench.report.text import counted, number, seconds

WORDS = {
    "time": "time",
    "solve": "time of the solve alone",
    "cpu": "processor time",
    "reported": "time by its own account",
    "memory": "memory",
}
"""Names of metrics in a sentence; all others are numbers of something."""


@figure_kind("profile", metric="Cost: time, solve, cpu, memory, iterations, counter:NAME.")
def draw(run: Run, choice: Choice, *, metric: str = "time") -> Drawing:
    """Draw the profile of the solvers shown, against the best of them."""
    chosen = choose(run, choice)
    measured, left_out = chosen.measured(metric)
    profile = performance_profile(measured.values, chosen.problems, measured.metric.floor, measured.lost)
    figure, axes = figures.with_room(len(profile.curves))
    cost = WORDS.get(measured.metric.name, f"number of {measured.metric.name.removeprefix('counter:')}")
    least = "the fastest" if measured.metric.unit == "s" else "the one that needed least"
    across = f"τ: {cost} / {'fastest time' if cost == 'time' else f'least {cost}'} (failures: ∞)"
    figures.profile_axes(axes, profile, chosen.kinds, chosen.line_styles, across)
    warning = cautions.caution(measured.metric, [c.label for c in profile.curves], run.meta.get("solvers") or {})
    beware = f" {warning}" if warning else ""
    floor = _amount(profile.floor, measured.metric.unit)
    below = f" Values below {floor} are set to {floor}." if profile.floor else ""
    guide = _guide(chosen.problems, cost, least) + below + beware + left_out
    return chosen.drawing(figure, f"Performance profile of {chosen.scope()}", guide)


def _guide(problems: int, cost: str, least: str) -> str:
    """Explain how to read a performance profile, in one sentence."""
    best, ahead = ("the fastest solver", "it was the fastest") if least == "the fastest" else (least, "it needed least")
    return (
        f"The height of a curve at τ is the fraction of the {counted(problems, 'problem')} that the solver solved "
        f"within τ times the {cost} of {best} of that problem: at the left end the fraction where {ahead}, "
        "at the right end the fraction it solved at all."
    )


def _amount(value: float, unit: str) -> str:
    """Format a cost with its unit.

    >>> _amount(0.02, "s"), _amount(3e6, "byte"), _amount(1.0, "")
    ('20 ms', '3 MB', '1')
    """
    return seconds(value) if unit == "s" else f"{value / 1e6:.3g} MB" if unit == "byte" else number(value)
