"""Data profile: the fraction of problems solved within a budget, whichever other solvers are shown.

The budget is in seconds, or in what --metric names; with --per a dimension of the problem (`--metric
counter:contacts --per nc` counts sweeps), in that many of them.
"""

from __future__ import annotations

from cpbench.analysis.data_profiles import data_profile, size_units
from cpbench.report import figures, legend, run_canvas
from cpbench.report.chosen import Choice, choose, leading
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench.report.run import Run
from cpbench.report.text import counted, number


@figure_kind(
    "data-profile",
    problem=Need.NONE,
    metric="Budget: time, solve, cpu, memory, iterations, counter:NAME.",
    per="Dimension of the problem (n, m, nc) that a unit of the budget is.",
)
def draw(run: Run, choice: Choice, *, metric: str = "time", per: str = "") -> Drawing:
    """Draw one step curve a solver, the leading ones in colour."""
    chosen = choose(run, choice)
    found, left_out = chosen.measured(metric)
    units = size_units(chosen.rows, per) if per else None
    profile = data_profile(found.values, chosen.problems, units, found.lost)
    leaders = leading(chosen, found.values, legend.EMPHASISED)
    places = {label: chosen.looks[label] for label in leaders}
    rank = {label: k for k, label in enumerate(leaders)}
    curves = sorted(
        (c for c in profile.curves if c.solved), key=lambda c: (-c.solved, rank.get(c.label, len(rank)), c.label)
    )
    figure, axes = run_canvas.with_legend(len(curves))
    first, last = (profile.least / 1.5, profile.widest * 1.5) if profile.least else (1.0, 10.0)
    for curve in reversed(curves):
        place, dashed = places.get(curve.label), chosen.kinds.get(curve.label, "") in figures.INEXACT
        budget, height = curve.steps(last, start=first)
        marks = {} if place is None else {"markevery": (0, max(1, len(budget) // 6))}
        layer = 2 if place is None else 4
        axes.plot(budget, height, drawstyle="steps-post", **legend.look(place, dashed), **marks, zorder=layer)
    axes.set_xlim(first, last)
    axes.set_ylim(0.0, 1.0)
    cost = run_canvas.word(found.metric)
    if per:
        figures.log_axis(axes, "x", number)
    else:
        figures.log_axis(axes, "x", lambda value: run_canvas.amount(value, found.metric))
    axes.set_xlabel(f"budget: {cost}{f' over {per}' if per else ''}, log scale")
    axes.set_ylabel(f"fraction of the {counted(chosen.problems, 'problem')} solved")
    if not curves:
        figures.nothing(axes, "no problem was solved")
    lines = [figures.line_of(curve, places, chosen.kinds) for curve in curves]
    notes = figures.notes(profile.curves, chosen.kinds)
    legend.beside(axes, "solved   most first", lines, notes, run_canvas.LINES)
    guide = (
        f"The height of a curve at a budget is the fraction of the {counted(chosen.problems, 'problem')} that the "
        f"solver solved with a {cost} of at most that{f' times {per}' if per else ''}; "
        f"no curve depends on another.{left_out}"
    )
    return run_canvas.drawn(figure, f"Data profile of {chosen.scope()}", guide, chosen)
