"""What the plan fixes of a row, before anything is solved; limits are of it, and those of one file have to agree."""

from __future__ import annotations

import json
from typing import Any

from cpbench.bench.planning.plan import Pair

LIMITS = {"seconds": "timeout", "memory": "memory", "threads": "threads", "repeats_asked": "repeats"}
"""The columns of limits, by the name that an option gives them."""


def planned(pair: Pair) -> dict[str, Any]:
    """The planned columns of a pair's row."""
    return {
        "key": pair.key,
        "problem": pair.problem,
        "address": pair.address,
        "fingerprint": pair.fingerprint,
        "node": pair.node,
        "family": pair.family,
        "sizes": json.dumps(dict(pair.sizes)),
        "set": pair.set,
        "solver": pair.entry.solver,
        "label": pair.label,
        "request": pair.request.name,
        "options": json.dumps(dict(pair.entry.options), sort_keys=True),
        "tolerance": pair.tolerance,
        "measure": pair.measure,
        "start": pair.start,
        "sequence": pair.sequence,
        "step": pair.step,
        **dict(zip(LIMITS, limits_of(pair), strict=True)),
    }


def limits_of(pair: Pair) -> tuple[float, int, int, int]:
    """The limits of a pair, in the order of `LIMITS`."""
    return pair.limits.seconds, pair.limits.memory, pair.limits.threads, pair.limits.repeats


def agree(old: tuple[Any, ...], asked: tuple[Any, ...]) -> bool:
    """Whether results of these limits may stand in one file; an old limit that is not known (None) is no obstacle."""
    return all(a is None or a == b for a, b in zip(old, asked, strict=True))


def difference(name: str, old: tuple[Any, ...], asked: tuple[Any, ...]) -> str:
    """Why a file does not take limits that do not `agree` with the old ones of set `name`."""
    for limit, before, now in zip(LIMITS.values(), old, asked, strict=True):
        if before is not None and before != now:
            made = f"set '{name}' was made" if name else "was made"
            return (
                f"{made} with {limit} {before:.12g}, now {now:.12g}; results of other limits do not mix: use another "
                "file with -o"
            )
    return "was made with other limits"
