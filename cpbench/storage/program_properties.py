"""Properties of a problem that its file has beside the data, and that change no solution."""

from __future__ import annotations

import math

from cpbench.formulations.base import Info

OFFSET, SENSE, UNKNOWNS = "objective_offset", "objective_sense", "unknowns"
"""Names of the properties: the constant of ½zᵀQz + pᵀz, `max` where that with its constant is the opposite of the
objective of the file, and the names of the unknowns in the order of the parts of a point, first parts alone where the
others are multipliers."""


def offset(info: Info) -> float:
    """Return the constant of the objective; 0 where there is none, or no finite number."""
    value = info.properties.get(OFFSET, 0.0)
    try:
        constant = float(value) if isinstance(value, int | float) else 0.0
    except OverflowError:  # whole numbers of a JSON file have no end
        return 0.0
    return constant if math.isfinite(constant) else 0.0


def unknowns(info: Info) -> list[str]:
    """Return the names of the unknowns; empty where the file has none."""
    names = info.properties.get(UNKNOWNS)
    return [str(name) for name in names] if isinstance(names, list | tuple) else []
