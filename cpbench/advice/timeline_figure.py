"""Small multiples over dates: of every label the part that it solved, and its time against its first run."""

from __future__ import annotations

import math
import textwrap
import warnings
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from cpbench.advice.timeline import moved
from cpbench.errors import FormatError
from cpbench.report.figures import STYLE, shorten
from cpbench.report.legend import PALETTE
from cpbench.report.panels import ACROSS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST = 24
"""Labels that are drawn: those that moved most."""
_BOLD: dict[str, Any] = {"fontsize": 10.5, "fontweight": "bold", "va": "center"}
SOLVED, TIME, OWN, LIE = PALETTE[2], PALETTE[0], "#8C8C8C", PALETTE[1]


def guide() -> str:
    """Explain how to read the panels."""
    return (
        "Upper strips: the fraction of the pairs that were run and solved (0 to 1); a cross where some answers were "
        "wrong or the solver crashed, a gap where the number of pairs changes. Lower strips: geometric mean of time "
        "over that of the label's first run on the same machine, log scale, over the pairs solved in both; below 1 is "
        "faster. Grey: the same for the reference solve, which is the machine's own drift. Lines break where the "
        "machine changes; a dotted line is a new version of the solver."
    )


def timeline_figure(points: pd.DataFrame, title: str) -> Figure:
    """Draw panels of the labels that moved most, of a timeline with a row at least."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    points = points.assign(at=[_moment(str(date)) for date in points["date"]])
    order = moved(points)
    labels = sorted(order[:MOST])
    columns = min(ACROSS, len(labels))
    rows = -(-len(labels) // columns)
    reach = _reach(points[points["label"].isin(labels)])
    with matplotlib.rc_context({**STYLE, "font.size": 7.5}):
        height = 0.5 + 1.85 * rows + 0.95
        figure = Figure(figsize=(9.2, height), dpi=150)
        FigureCanvasAgg(figure)
        figure.text(0.05, 1 - 0.2 / height, _title(title, points, len(labels)), **_BOLD)
        outer = figure.add_gridspec(
            rows, columns, left=0.05, right=0.985, bottom=1.05 / height, top=1 - 0.6 / height, wspace=0.17, hspace=0.3
        )
        lower: list[Axes] = []
        for k, label in enumerate(labels):
            inner = outer[k // columns, k % columns].subgridspec(2, 1, height_ratios=(0.6, 1.0), hspace=0.14)
            below = figure.add_subplot(inner[1], sharex=lower[0] if lower else None)
            above = figure.add_subplot(inner[0], sharex=below)
            _panel(above, below, points[points["label"] == label], reach)
            above.tick_params(labelbottom=False)
            below.tick_params(labelbottom=k + columns >= len(labels))
            lower.append(below)
        _dates(lower[0], points["at"])
        guide_text = textwrap.fill(guide(), 168)
        figure.text(0.05, 0.08 / height, guide_text, fontsize=6.8, color="#444444", va="bottom", linespacing=1.35)
    return figure


def _title(title: str, points: pd.DataFrame, shown: int) -> str:
    """Return the title with the first and last day, and what is not shown."""
    days = sorted({str(date)[:10] for date in points["date"]})
    labels = points["label"].nunique()
    more = f" ({shown} of {labels} labels: those that moved most)" if labels > shown else ""
    return f"{title}, {days[0]}{f' to {days[-1]}' if len(days) > 1 else ''}{more}"


def write(figure: Figure, path: Path) -> None:
    """Write .png or .svg, without dates or versions in them; raises FormatError."""
    import matplotlib

    metadata: dict[str, Any] = {"Software": None} if path.suffix == ".png" else {"Date": None, "Creator": None}
    try:
        with matplotlib.rc_context(STYLE), warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Glyph .* missing")  # a label may use any script
            figure.savefig(path, metadata=metadata)
    except OSError as cause:
        raise FormatError(path, "", f"cannot be written ({cause.strerror or cause})") from None


def _panel(upper: Axes, lower: Axes, rows: pd.DataFrame, reach: float) -> None:
    """Draw one label: what it solved above, how fast below."""
    last = rows.iloc[-1]
    text = f"{shorten(str(rows['label'].iloc[0]), 26)}  {last['solved']}/{last['pairs']}"
    upper.set_title(text, fontsize=7.5, loc="left", pad=3)
    upper.set_ylim(-0.06, 1.06)
    upper.set_yticks([0.0, 1.0])
    lower.set_yscale("log", base=2)
    lower.set_ylim(1 / reach, reach)
    _ratio_ticks(lower, reach)
    for axes in (upper, lower):
        axes.grid(True, color="#E8E8E8", linewidth=0.5)
        axes.set_axisbelow(True)
        versions = rows["version"] != rows["version"].shift()
        for at in rows.loc[versions, "at"].iloc[1:]:
            axes.axvline(at, color="#777777", linewidth=0.7, linestyle=(0, (1, 2)), zorder=1)
    for _, part in rows.groupby((rows["pairs"] != rows["pairs"].shift()).cumsum()):
        upper.plot(part["at"], part["solved"] / part["pairs"], color=SOLVED, **_line(len(rows)))
    bad = rows[(rows["wrong"] > 0) | (rows["crash"] > 0)]
    upper.plot(
        bad["at"], bad["solved"] / bad["pairs"], color=LIE, marker="x", markersize=4.6, linestyle="none", zorder=5
    )
    for _, part in rows.groupby("base", sort=False):
        timed = part[np.isfinite(part["ratio"])]
        lower.plot(part["at"], part["reference"], color=OWN, linewidth=0.9, zorder=2)
        lower.plot(timed["at"], timed["ratio"], color=TIME, **_line(len(timed)))
    if not np.isfinite(rows["ratio"]).any():
        lower.text(0.5, 0.5, "no time to compare", transform=lower.transAxes, ha="center", va="center", color="#777777")


def _line(count: int) -> dict[str, Any]:
    return {"linewidth": 1.3, "marker": "o", "markersize": 2.6 if count < 40 else 0.0, "zorder": 4, "clip_on": False}


def _reach(points: pd.DataFrame) -> float:
    """Return a power of two that no ratio leaves either way, so that all panels share their scale."""
    ratios = points[["ratio", "reference"]].to_numpy(dtype=float)
    far = float(np.max(np.abs(np.log2(ratios[np.isfinite(ratios) & (ratios > 0)])), initial=0.0))
    return 2.0 ** max(1, math.ceil(1.05 * far))


def _ratio_ticks(axes: Axes, reach: float) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    most = round(math.log2(reach))
    step = -(-most // 3)
    axes.yaxis.set_major_locator(FixedLocator([2.0**k for k in range(-step * (most // step), most + 1, step)]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}" if value >= 1 else f"1/{1 / value:g}"))
    axes.axhline(1.0, color="#9A9A9A", linewidth=0.7, zorder=1)


def _dates(axes: Axes, moments: pd.Series[Any]) -> None:
    """Write few dates, short: the title has the days."""
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

    locator = AutoDateLocator(minticks=2, maxticks=4)
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator, show_offset=False))
    if moments.nunique() == 1:
        axes.set_xlim(moments.iloc[0] - pd.Timedelta(days=1), moments.iloc[0] + pd.Timedelta(days=1))


def _moment(date: str) -> datetime:
    """Return the date of a run; raises ValueError on text that is no date."""
    return datetime.fromisoformat(date)
