"""The plan that makes the rows of a results file again, as a file that `cpbench run` takes.

It is read off the rows, not off the command that made them: a results file may have grown by several commands, and
what a glob, a condition or `all` meant is what was run. A set of the plan is a set of the results under one group of
limits; routes that are pinned make a set of their own.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from operator import attrgetter
from typing import Any

from cpbench.bench.planning.plan import BEYOND, Entry
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.results.rows import Row
from cpbench.formulations.base import Kind
from cpbench.foundation import brackets
from cpbench_lab.bundle import plan_text

SETTINGS = ("seed", "threads", "jobs", "keep", "retry")
"""Keys of a plan as a whole that a bundle says; places (output, report, cluster) are those of its user."""
PARTS = (
    "name", "problems", "solvers", "routes", "facets", "via", "tolerance", "timeout", "memory", "repeats", "history",
    "measure", "start",
)  # fmt: skip
"""Keys of a set that a bundle says: selections are made, formats are one."""
_FACETS = re.compile(r"(inner|facets|outer)(\d+)(?:-.*)?")
_LEVELS = ("exact", "facets", "all")
_limits = attrgetter("set", "seconds", "memory", "repeats_asked", "measure", "start")


def settings(meta: Mapping[str, Any], rows: Sequence[Row]) -> dict[str, Any]:
    """Return what the plan says for all of its sets."""
    plan: Mapping[str, Any] = meta.get("plan") or {}
    known = {key: plan[key] for key in SETTINGS if plan.get(key) is not None}
    threads = [row.threads for row in rows if row.threads]
    most = max(sorted(set(threads)), key=threads.count, default=RunPlan.threads)
    return {"seed": meta.get("seed") or 0, **known, "keep": "all", "threads": int(most)}


def sets(rows: Iterable[Row], recorded: bool, written: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return the sets that hold the rows, whose addresses are those of the bundle.

    `recorded` : whether histories were kept. `written` : how a solver is written in a plan, where not by its name.
    """
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        request = row.request
        via = "" if _level(request) is not None else request
        groups.setdefault((*_limits(row), via), []).append(row)
    parts = [_set(own, via, recorded, written) for (*_, via), own in groups.items()]
    for k, part in enumerate(parts, 1):
        before = [other["name"] for other in parts[: k - 1]]
        if len(parts) > 1 and (not part["name"] or part["name"] in before):
            part["name"] = f"{part['name'] or 'set'}-{k}"
    return parts


def text(settings: Mapping[str, Any], parts: Iterable[Mapping[str, Any]], heading: str) -> str:
    """Write the plan file."""
    lines = [*(f"# {line}" for line in heading.splitlines()), *plan_text.lines(settings), "report = false"]
    for part in parts:
        lines += ["", "[[set]]"]
        for key, value in part.items():
            if key == "name" and not value:
                continue
            if key in ("problems", "solvers"):
                lines += [f"{key} = [", *(f"    {plan_text.value(item)}," for item in value), "]"]
            else:
                lines.append(f"{key} = {plan_text.value(value)}")
    return "\n".join(lines) + "\n"


def _set(rows: Sequence[Row], via: str, recorded: bool, written: Mapping[str, str]) -> dict[str, Any]:
    first = rows[0]
    part: dict[str, Any] = {
        "name": first.set or "",
        "problems": _unique(row.address for row in rows),
        "solvers": sorted({_entry(row, written) for row in rows}),
    }
    part |= {"via": brackets.split(via, "+")} if via else _routes(rows)
    part["tolerance"] = sorted({float(row.tolerance) for row in rows}, reverse=True)
    limits = {"timeout": first.seconds, "memory": first.memory, "repeats": first.repeats_asked}
    part |= {key: value for key, value in limits.items() if value is not None}
    if recorded:
        part["history"] = True
    if first.measure:
        part["measure"] = first.measure
    if first.start:
        part["start"] = first.start
    return part


def _entry(row: Row, written: Mapping[str, str]) -> str:
    """Return the solver with its options as it is typed; a truth value is `true` there."""
    given: dict[str, Any] = json.loads(row.options or "{}")
    typed = {key: str(value).lower() if isinstance(value, bool) else value for key, value in given.items()}
    solver = row.solver
    return Entry(written.get(solver, solver), typed).label


def _routes(rows: Sequence[Row]) -> dict[str, Any]:
    """Return the least routes that hold what was requested, with the facet counts."""
    requests = {row.request for row in rows}
    level = max(_level(request) or 0 for request in requests)
    if any(row.request == "exact" and row.kind == Kind.RELAXATION for row in rows):
        level = _LEVELS.index("all")  # solvers that drop a term take part there only
    counts = sorted({int(found[2]) for request in requests if (found := _FACETS.fullmatch(request))})
    return {"routes": _LEVELS[level], **({"facets": counts} if counts else {})}


def _level(request: str) -> int | None:
    """Return the routes that make a request, None for one that is pinned."""
    facets = _FACETS.fullmatch(request)
    if facets:
        return _LEVELS.index("all" if facets[1] == "outer" else "facets")
    return _LEVELS.index("all") if request in BEYOND else 0 if request == "exact" else None


def _unique(items: Iterable[Any]) -> list[Any]:
    return sorted(dict.fromkeys(items))


def total_seconds(rows: Iterable[Row]) -> float:
    """Return the sum of the wall-clock times of the rows [s]; rows without one count 0."""
    return math.fsum(float(row.wall) for row in rows if row.wall and math.isfinite(row.wall))
