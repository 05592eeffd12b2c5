"""Sweeps over one option of a solver, or over the number of facets of its route.

A label is a solver, its options and a request for a route: `nsgs[omega=0.8]`, `lemke@inner16`. The labels that agree
in all but one of these are a *series*, and the value in which they differ is its abscissa.
"""

from __future__ import annotations

import json
import math
import re
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import means
from cpbench.analysis import table as rows_of
from cpbench.errors import CpbenchError, UnknownName

FACETS = "facets"
"""The option that is not the solver's but its route's: `inner8`, `fc-lcp-inner[facets=8]`."""
COLUMNS = ("series", "label", "value", "problems", "solved", "share", "mean", "median")
_FACETS = (re.compile(r"\b(?:inner|outer)(\d+)\b"), re.compile(r"\bfacets=(\d+)\b"))


def sweep(group: pd.DataFrame, option: str = "", problems: int | None = None) -> tuple[str, pd.DataFrame]:
    """Return the option (by default the only one that changes) and one row a label of a series: COLUMNS.

    problems (N), solved and their share of N; mean [s], the shifted geometric one over all N with failures charged the
    limit and the shift the median of all times; median [s] of what was solved (NaN of nothing). Rows are in the order
    of series and value; series with one value are left out.

    Raises UnknownName for an option that no label has, CpbenchError where none or several change, or where its values
    are not numbers.

    >>> rows = pd.DataFrame({"problem": ["p"] * 2, "solver": "s", "label": ["s[w=0.5]", "s[w=1.5]"], "seconds": 9.0,
    ...                      "options": ['{"w": 0.5}', '{"w": 1.5}'], "status": "solved", "solve": [4.0, 2.0]})
    >>> option, found = sweep(rows_of.normalised(rows))
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
    mean = means.means(times, limit=rows_of.limit(group), lost=rows_of.lost(group)).table["mean"]
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
