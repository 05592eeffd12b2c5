"""A plan file of chosen problems, with the settings of the run that measured them and the reasons beside them."""

from __future__ import annotations

import glob
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import pandas as pd

from cpbench.advice.costs import START, MeasuredCosts
from cpbench.advice.subset import Pick, Subset
from cpbench.bench.planning import plan_text
from cpbench.bench.planning.quantities import duration
from cpbench.bench.planning.run_plan import BUILTIN, ProblemSet
from cpbench.errors import StoreError
from cpbench.report.text import counted, one_line
from cpbench.storage.base import SEPARATOR, split_address

SELECTING = ("problems", "family", "where", "keyword", "split", "max_problems", "seed")
"""Keys of a set that the chosen problems stand in for."""
_WILD = set("*?[")


@dataclass(frozen=True)
class Source:
    """A results file: the keys of its sets by name (empty where its plan is not known), with the fingerprints of the
    problems of each under `found`, and the number of threads."""

    name: str
    sets: Mapping[str, Mapping[str, Any]]
    threads: int = 1


@dataclass(frozen=True)
class Chosen:
    """Contents of a plan: the choice, what it was made from, and how it was asked for."""

    subset: Subset
    measured: MeasuredCosts
    budget: float
    safety: float
    agreement: tuple[float, int]
    command: str


def source(name: str, plan: Mapping[str, Any] | None) -> Source:
    """Return a results file by what it keeps of its plan (`RunPlan.effective`)."""
    sets = {str(part.get("name", "")): part for part in (plan or {}).get("sets", [])}
    return Source(name, sets, int((plan or {}).get("threads", 1)))


def text(chosen: Chosen, sources: Sequence[Source], folder: Path, builtin: Path | None) -> str:
    """Write the plan; `folder` is where it will be, `builtin` where the built-in problems are (None: not here).

    Raises StoreError when the results do not tell how their problems were run, or were run with different numbers of
    threads.
    """
    threads = {source.threads for source in sources}
    if len(threads) > 1:
        listed = ", ".join(f"{source.name}: {source.threads}" for source in sources)
        raise StoreError(f"the results were made with different numbers of threads ({listed}): select from each apart")
    blocks = _blocks(chosen, sources)
    named = len(blocks) > 1
    lines = [*_about(chosen), "report = false   # cpbench report writes one of the results"]
    lines += plan_text.lines({"threads": threads.pop()})
    for number, (settings, picks) in enumerate(blocks, 1):
        if named:
            lines += ["", "[[set]]", *plan_text.lines({"name": f"part-{number}"})]
        lines += plan_text.lines(settings)
        lines += ["problems = ["]
        for pick, address in picks:
            why = "family" if pick.representative else "discrimination"
            name = plan_text.value(_named(address, folder, builtin))
            lines.append(f"    {name},  # {one_line(pick.family)}: {why}, {pick.cost:.3g} s, gain {pick.gain:.1%}")
        lines += ["]"]
    return "\n".join(lines) + "\n"


def missing_files(chosen: Chosen, builtin: Path | None) -> list[str]:
    """Return the files of chosen problems that do not exist on this machine, sorted."""
    rows = _rows(chosen)
    files = {str(split_address(address)[0]) for address in rows["address"] if not _within(address, builtin)}
    return sorted(file for file in files if not os.path.exists(file))


# ------------------------------------------------------------------------------------------------ pieces


def _rows(chosen: Chosen) -> pd.DataFrame:
    rows = chosen.measured.rows
    return rows[rows["unit"].isin(chosen.subset.problems)]


def _about(chosen: Chosen) -> list[str]:
    """Return what was selected, why, and how far it can be trusted."""
    subset, measured = chosen.subset, chosen.measured
    families = measured.family.nunique()
    expected = measured.expected(subset.cost)
    factor = f"{measured.factor:.2f}{' (assumed)' if measured.assumed else ''}"
    tau, labels = chosen.agreement
    agrees = f"Kendall's tau {tau:.2f}" if math.isfinite(tau) else "no order to compare"
    lines = [
        f"# {one_line(chosen.command)}",
        f"# {len(subset.picks)} of {counted(len(measured.cost), 'problem')}, "
        f"{families - len(subset.missed)} of {counted(families, 'family', 'families')}.",
        f"# Expected: {duration(expected)}, with a safety factor of {chosen.safety:g} within "
        f"{duration(chosen.budget)}: {START:g} s for each of {counted(measured.solvers, 'solver')}, and {factor} times "
        f"the measured {subset.cost:.3g} s.",
        f"# Chosen: the cheapest problem of every family that fits; the rest greedily by {subset.order} in telling "
        f"solvers apart, {subset.value:.0%} of what all problems tell.",
        f"# Ranking of {counted(labels, 'label')} by mean score, against that on all problems: {agrees}.",
    ]
    if subset.missed:
        missed = ", ".join(f"{one_line(name)} ({cost:.3g} s)" for name, cost in sorted(subset.missed.items()))
        lines.append(f"# Families left out, with their cheapest problem: {missed}.")
    return lines


def _blocks(chosen: Chosen, sources: Sequence[Source]) -> list[tuple[dict[str, Any], list[tuple[Pick, str]]]]:
    """Return settings and problems of every set; sets with the same settings are one."""
    rows = _rows(chosen)
    addresses = rows.drop_duplicates("fingerprint").sort_values("address")
    found: dict[str, tuple[dict[str, Any], list[tuple[Pick, str]]]] = {}
    for source in sources:
        for part in source.sets.values():
            settings = _settings(part)
            inside = set(part.get("found", []))
            block = found.setdefault(str(settings), (settings, []))[1]
            there = {address for _, address in block}
            for pick in chosen.subset.picks:
                own = addresses[(addresses["unit"] == pick.problem) & addresses["fingerprint"].isin(inside)]
                block += [(pick, str(address)) for address in own["address"] if address not in there]
    known = {address for _, block in found.values() for _, address in block}
    lost = addresses[~addresses["address"].isin(known)]
    if len(lost):
        raise StoreError(
            f"{lost.iloc[0]['problem']}: the results do not tell by which plan it was run (made before this was kept, "
            "or merged of different plans); select from the files of cpbench run"
        )
    return [(settings, block) for settings, block in found.values() if block]


def _settings(part: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of a set that are not the default, as a plan file has them."""
    default = ProblemSet()
    chosen = ProblemSet(
        **{f.name: _tupled(part[f.name]) for f in fields(ProblemSet) if f.name in part and f.name != "timeout"}
    )
    # without all built-in problems another default holds
    settings: dict[str, Any] = {"routes": chosen.allowed_routes} if chosen.allowed_routes != "exact" else {}
    for f in fields(ProblemSet):
        value = part.get(f.name, getattr(default, f.name))
        if (
            f.name in ("name", "routes", "suite", *SELECTING)
            or value is None
            or _tupled(value) == getattr(default, f.name)
        ):
            continue
        settings[f.name] = list(value) if isinstance(value, list | tuple) else value
    return settings


def _tupled(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _named(address: str, folder: Path, builtin: Path | None) -> str:
    """Return a problem as a plan in `folder` names it."""
    inside = _within(address, builtin)
    file, member = split_address(address)
    name = f"{BUILTIN}/{inside}" if inside else os.path.relpath(file, folder)
    name, member = (glob.escape(t) if _WILD & set(address) else t for t in (name, member))
    return f"{name}{SEPARATOR}{member}" if member else name


def _within(address: str, builtin: Path | None) -> str:
    """Return the path below the folder of the built-in problems, wherever the results were made; "" of other files."""
    if builtin is None:
        return ""
    parts = Path(os.path.abspath(split_address(address)[0])).parts
    inside = Path(*parts[-2:])
    own = (builtin / inside).is_file() and parts[-3:-2] == (builtin.name,)
    return inside.as_posix() if own else ""
