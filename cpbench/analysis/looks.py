"""Which look each label has in every figure of a results file: found from all rows, whatever a figure shows of them.

A look is a number: its colour is the number modulo the colours there are, and labels of one colour differ in the rest
(marker, dashes). Labels that solve problems of the same formulation get different colours as far as these go, first
those that solve most.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of


def looks(table: pd.DataFrame, colours: int) -> dict[str, int]:
    """The look of every label, all different.

    >>> rows = pd.DataFrame({"label": ["a", "b", "b", "c"], "node": ["lcp", "lcp", "qp", "qp"], "status": "solved"})
    >>> looks(rows, 2)
    {'b': 0, 'a': 1, 'c': 3}
    """
    done = table.loc[rows_of.solved(table), ["label", "node"]]
    count = done.value_counts().unstack(fill_value=0)
    labels = sorted(str(label) for label in table["label"].unique())
    count = count.reindex(labels, fill_value=0)
    share = (count / count.max().clip(lower=1)).to_numpy(dtype=float)  # of what the most solving label of a node solves
    total = count.sum(axis=1)
    taken = np.zeros((colours, share.shape[1]))
    used = np.zeros(colours, dtype=int)
    found: dict[str, int] = {}
    for at in sorted(range(len(labels)), key=lambda k: (-int(total.iloc[k]), labels[k])):
        crowded = (taken @ share[at]).round(9)
        colour = min(range(colours), key=lambda c: (crowded[c], used[c], c))
        found[labels[at]] = colour + colours * int(used[colour])
        taken[colour] += share[at]
        used[colour] += 1
    return found
