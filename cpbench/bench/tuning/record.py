"""What a search leaves behind: a plan file that runs the tuned solver beside its default one, and tells how it came."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cpbench.bench.planning.plan import Entry
from cpbench.bench.planning.run_plan import BUILTIN, ProblemSet
from cpbench.bench.planning.tunings import Tuning
from cpbench.bench.tuning.score import NAME
from cpbench.bench.tuning.search import Found
from cpbench.errors import CpbenchError
from cpbench.solvers.options import written

METHOD = "random search, successive halving"
OTHER = {"dev": "test", "test": "dev", "": ""}


def tuning(found: Found, part: ProblemSet, budget: float, seed: int) -> Tuning:
    """What a plan and its results tell of a search."""
    return Tuning(
        solver=as_text(found.entry),
        method=METHOD,
        score=NAME,
        found=str(found.score),
        default=str(found.default),
        seed=seed,
        budget=budget,
        spent=round(found.seconds, 3),
        configurations=found.configurations,
        solves=found.solves,
        split=part.split,
        problems=found.problems,
    )


def as_text(entry: Entry) -> str:
    """A solver as it is named on the command line."""
    given = ",".join(f"{name}={written(value)}" for name, value in sorted(entry.options.items()))
    return f"{entry.solver}[{given}]" if given else entry.solver


def plan_text(made: Tuning, default: Entry, part: ProblemSet, threads: int, folder: Path) -> str:
    """The plan: both configurations on the problems of the other half."""
    keys: dict[str, Any] = {
        "problems": [_beside(folder, text) for text in part.problems],
        "split": OTHER[part.split] or "all",
        "solvers": list(dict.fromkeys([as_text(default), made.solver])),
        "tolerance": list(part.tolerance),
        "timeout": part.timeout,
        "memory": part.memory,
        "threads": threads,
    }
    chosen = {"family": list(part.family), "where": part.where, "keyword": part.keyword, "format": part.format}
    keys |= {name: value for name, value in chosen.items() if value}
    about = [f"# {made.solver}, tuned for {made.spent:.3g} s: {made.found}", f"# by default: {made.default}"]
    lines = [*about, *_lines(keys), "", "[[tuning]]", *_lines(made.as_data())]
    return "\n".join(lines) + "\n"


def write(path: Path, text: str) -> None:
    """Write the plan, whole or not at all; raises CpbenchError."""
    beside = path.with_name(f".{path.name}.part")
    try:
        beside.write_text(text, encoding="utf-8")
        beside.replace(path)
    except OSError as cause:
        raise CpbenchError(f"{path}: cannot be written ({cause.strerror}); name another file with -o") from None


def _beside(folder: Path, text: str) -> str:
    return text if text.split("/")[0] == BUILTIN else os.path.relpath(text, folder)


def _lines(table: Mapping[str, Any]) -> list[str]:
    """Keys of a TOML table."""
    return [f"{key} = {_value(value)}" for key, value in table.items()]


def _value(value: Any) -> str:
    """A value in TOML, whose texts are those of JSON save one character."""
    if isinstance(value, list):
        return f"[{', '.join(_value(item) for item in value)}]"
    if isinstance(value, float) and math.isinf(value):
        return '"none"'
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
