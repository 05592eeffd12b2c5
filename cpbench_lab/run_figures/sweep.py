"""Solved and time against the value of one option of a solver, or against the facets ν of its route.

A label is a solver, its options and a request for a route. The labels of the results that agree in all but one of
these (`nsgs[omega=0.8]`, `nsgs[omega=1.2]`; `lemke@inner8`, `lemke@inner16`) are a *series* and make a curve; --option
names it where several change.
"""

from __future__ import annotations

import json
import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from cpbench.analysis import means
from cpbench.analysis import table as rows_of
from cpbench.errors import CpbenchError, UnknownName
from cpbench.report import canvas, figures, legend, run_canvas
from cpbench.report.chosen import Choice, choose
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench.report.run import Run
from cpbench.report.text import counted, number, one_line, seconds

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FACETS = "facets"
"""The option that is not the solver's but its route's: `inner8`, `fc-lcp-inner[facets=8]`."""
COLUMNS = ("series", "label", "value", "problems", "solved", "share", "mean", "median")
_FACETS = (re.compile(r"\b(?:inner|outer)(\d+)\b"), re.compile(r"\bfacets=(\d+)\b"))


@figure_kind("sweep", problem=Need.NONE, option="The option; facets for routes with facets.")
def draw(run: Run, choice: Choice, *, option: str = "") -> Drawing:
    """Draw two panels over the option's values: share of the problems solved, and mean time."""
    chosen = choose(run, choice)
    name, found = swept(chosen.rows, option, chosen.problems)
    if not len(found):
        raise CpbenchError(f"--option {name}: no solver was run with two values of it")
    series = [str(label) for label in found.groupby("series")["solved"].max().sort_values(ascending=False).index]
    places = {label: place for place, label in enumerate(series[: legend.EMPHASISED])}
    word = "ν" if name == FACETS else one_line(name)
    height = max(2.6, legend.height(len(series), 0, run_canvas.LINES) + 0.3)
    figure = canvas.page(canvas.PAGE, height, constrained=True)
    left, right = figure.subplots(1, 2)
    for axes, column in ((left, "share"), (right, "mean")):
        for label in reversed(series):
            own = found[found["series"] == label]
            axes.plot(own["value"], own[column], **legend.look(places.get(label)), zorder=3)
        _dress(axes, found, column, word, chosen.problems)
    best = found.groupby("series")["solved"].max()
    lines = [legend.LegendLine(_between(label, 24), str(int(best[label])), places.get(label)) for label in series]
    legend.beside(right, "most solved   solver", lines, most=run_canvas.LINES)
    guide = (
        f"Left: the fraction of the {counted(chosen.problems, 'problem')} that the solver solved with this value of "
        f"{word}. Right: its mean time (shifted geometric over all problems, a failure charged the limit); an end of a "
        "curve where it still falls says that the range was too narrow."
    )
    return run_canvas.drawn(figure, f"Sweep of {word}, {chosen.scope()}", guide, chosen)


def _between(label: str, length: int) -> str:
    """Shorten a label; names of a sweep often differ at their ends.

    >>> _between("casadi-ipopt-mlcp@innerν", 18)
    'casadi-ip…p@innerν'
    """
    half = length // 2
    return label if len(label) <= length else f"{label[: length - half]}…{label[len(label) - half + 1 :]}"


def _dress(axes: Axes, found: pd.DataFrame, column: str, word: str, problems: int) -> None:
    """Set scales and labels of a panel; values over more than a decade, all positive, are on a log scale."""
    least, most = float(found["value"].min()), float(found["value"].max())
    if word == "ν" or (least > 0 and most > 10 * least):
        figures.log_axis(axes, "x", number)
        values = sorted(set(found["value"]))
        if len(values) <= 8:
            axes.set_xticks(values)
    axes.set_xlabel(word)
    axes.grid(True, color="#E4E4E4", linewidth=0.6)
    axes.set_axisbelow(True)
    if column == "share":
        axes.set_ylim(0.0, 1.03)
        axes.set_ylabel(f"fraction of {counted(problems, 'problem')} solved")
    else:
        figures.log_axis(axes, "y", seconds)
        axes.set_ylabel("mean time")


def swept(group: pd.DataFrame, option: str = "", problems: int | None = None) -> tuple[str, pd.DataFrame]:
    """Return the option (by default the only one that changes) and one row a label of a series: COLUMNS.

    problems (N), solved and their share of N; mean [s], the shifted geometric one over all N with failures charged the
    limit and the shift the median of all times; median [s] of what was solved (NaN of nothing). Rows are in the order
    of series and value; series with one value are left out.

    Raises UnknownName for an option that no label has, CpbenchError where none or several change, or where its values
    are not numbers.

    >>> rows = pd.DataFrame({"problem": ["p"] * 2, "solver": "s", "label": ["s[w=0.5]", "s[w=1.5]"], "seconds": 9.0,
    ...                      "options": ['{"w": 0.5}', '{"w": 1.5}'], "status": "solved", "solve": [4.0, 2.0]})
    >>> option, found = swept(rows_of.normalised(rows))
    >>> option, found[["series", "value", "solved", "median"]].to_numpy().tolist()
    ('w', [['s', 0.5, 1, 4.0], ['s', 1.5, 1, 2.0]])
    """
    labels = group.drop_duplicates("label").set_index("label")
    settings = {str(label): _settings(row) for label, row in labels.iterrows()}
    option = option or _changing(settings)
    having = {label: setting for label, setting in settings.items() if option in setting}
    if not having:
        raise UnknownName("option of the solvers", option, {name for setting in settings.values() for name in setting})
    times = rows_of.times(group)
    planned = len(times) if problems is None else problems
    mean = means.means(times, limit=rows_of.limit(group), lost=rows_of.lost(group)).mean
    rows: list[dict[str, Any]] = []
    for label, setting in having.items():
        own = times[label].to_numpy(dtype=float)
        done = own[np.isfinite(own)]
        rows.append(
            {
                "series": _series(str(labels.at[label, "solver"]), setting, option),
                "label": label,
                "value": _value(setting[option], option),
                "problems": planned,
                "solved": len(done),
                "share": len(done) / planned,
                "mean": float(mean[label]),
                "median": float(np.median(done)) if len(done) else math.nan,
            }
        )
    found = pd.DataFrame(rows, columns=list(COLUMNS)).sort_values(["series", "value", "label"], ignore_index=True)
    return option, found[found.groupby("series")["value"].transform("nunique") > 1].reset_index(drop=True)


def _settings(row: pd.Series[Any]) -> dict[str, Any]:
    """Return options and the facets of the route, with what is left of the route as `route`."""
    found: dict[str, Any] = json.loads(row["options"] or "{}")
    request = str(row["request"])
    for pattern in _FACETS:
        count = pattern.search(request)
        if count:
            found[FACETS] = int(count[1])
            request = request[: count.start(1)] + "ν" + request[count.end(1) :]
            break
    return found | ({"route": request} if request not in ("", "exact") else {})


def _changing(settings: dict[str, dict[str, Any]]) -> str:
    """Return the option in which labels of one series differ."""
    changing = {
        name
        for name in {name for setting in settings.values() for name in setting} - {"route"}
        if len({json.dumps(setting[name]) for setting in settings.values() if name in setting}) > 1
    }
    if len(changing) == 1:
        return changing.pop()
    if not changing:
        raise CpbenchError("no option changes: run a grid, as cpbench run -s 'nsgs[omega=0.6:1.6:0.2]'")
    raise CpbenchError(f"{len(changing)} options change: name one with --option {', '.join(sorted(changing))}")


def _series(solver: str, setting: dict[str, Any], option: str) -> str:
    rest = ",".join(f"{name}={value}" for name, value in sorted(setting.items()) if name not in (option, "route"))
    return solver + (f"[{rest}]" if rest else "") + (f"@{setting['route']}" if "route" in setting else "")


def _value(value: Any, option: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise CpbenchError(f"{option}={value}: no number, so that there is nothing to draw it against")
    return float(value)
