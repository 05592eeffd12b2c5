"""Dimensions of problems, which a table keeps as JSON: each different text is read once."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping

import numpy as np
import pandas as pd

from cpbench.analysis.codes import Integers, by_appearance
from cpbench.analysis.table import Floats


def sizes_read(group: pd.DataFrame) -> tuple[Integers, list[Mapping[str, float]]]:
    """Give each row's sizes a number, and return these, of every dimension by its symbol.

    >>> place, sizes = sizes_read(pd.DataFrame({"sizes": ['{"n": 3}', "", '{"n": 3}']}))
    >>> place.tolist(), sizes
    ([0, 1, 0], [{'n': 3.0}, {}])
    """
    place, texts = by_appearance(group["sizes"])
    return place, [{symbol: float(size) for symbol, size in (json.loads(t) if t else {}).items()} for t in texts]


def sizes_of(group: pd.DataFrame, symbol: str, features: pd.DataFrame | None = None) -> Floats:
    """Return a size of each row's problem, NaN where it has none of that name.

    `features` : facts of the problems by fingerprint, as nnz; a symbol is looked up there first.

    >>> sizes_of(pd.DataFrame({"sizes": ['{"n": 3}', "", '{"m": 1}']}), "n").tolist()
    [3.0, nan, nan]
    """
    if features is not None and symbol in features.columns:
        return group["fingerprint"].map(features[symbol]).to_numpy(dtype=float)
    place, sizes = sizes_read(group)
    return np.array([known.get(symbol, math.nan) for known in sizes], dtype=float)[place]
