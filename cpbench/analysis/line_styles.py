"""Styles of the labels in every figure of a results file, chosen from all rows, whatever a figure shows of them.

A style is a number: its colour is the number modulo the colours there are, and labels of one colour differ in the rest
(marker, dashes). Labels that lead the profile of one group get different colours as far as these go.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from cpbench.analysis import starts
from cpbench.analysis import table as rows_of
from cpbench.analysis.profiles import performance_profile

LEADING = 12
"""Labels of a group that get different styles first: those in colour, and a few that follow if others are left out."""


def line_styles(table: pd.DataFrame, colours: int) -> dict[str, int]:
    """Assign a style to every label, all different.

    >>> rows = pd.DataFrame({"label": ["a", "b", "b", "c"], "node": ["lcp", "lcp", "qp", "qp"], "problem": "p",
    ...                      "status": "solved", "solve": 1.0, "tolerance": 1e-6, "threads": 1})
    >>> line_styles(rows_of.normalised(rows), 2)
    {'b': 0, 'a': 1, 'c': 3}
    """
    labels = sorted(str(label) for label in table["label"].unique())
    ranks = {label: k for k, label in enumerate(labels)}
    groups = rows_of.groups(starts.merged(table))
    weight = np.zeros((len(labels), len(groups)))
    for g, (_, rows) in enumerate(groups):
        first = performance_profile(rows_of.times(rows), lost=rows_of.lost(rows)).leading(LEADING)
        for k, label in enumerate(first):
            weight[ranks[label], g] = LEADING - k
    taken = np.zeros((colours, len(groups)))
    used = np.zeros(colours, dtype=int)
    result: dict[str, int] = {}
    total = weight.sum(axis=1)
    for at in sorted(range(len(labels)), key=lambda k: (-total[k], labels[k])):
        crowded = taken @ weight[at]
        colour = min(range(colours), key=lambda c: (crowded[c], used[c], c))
        result[labels[at]] = colour + colours * int(used[colour])
        taken[colour] += weight[at]
        used[colour] += 1
    return result
