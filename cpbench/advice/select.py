"""Problems for short runs, chosen from results of all of them, as a plan file."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from cpbench.advice import costs, subset, subset_plan
from cpbench.advice.costs import MeasuredCosts
from cpbench.advice.subset_plan import Chosen, Source
from cpbench.bench.planning.quantities import duration
from cpbench.bench.results.sealed import sealed
from cpbench.errors import CpbenchError
from cpbench.generators.collection import builtin_folder
from cpbench.plurals import counted
from cpbench.solvers.base import solvers


@dataclass(frozen=True)
class Selection:
    """A plan of chosen problems (`text`), what its reader should mind (`remarks`), and solvers declared elsewhere."""

    text: str
    remarks: tuple[str, ...]
    declared: tuple[str, ...]


def select(
    files: Sequence[Path], folder: Path, *, budget: float = 600.0, safety: float = 1.25, seed: int = 0
) -> Selection:
    """Choose problems whose run takes at most a given time and still ranks the solvers as all problems do.

    Parameters
    ----------
    files : results files of all problems. folder : where the plan will be written. budget : wall time of its run [s].
    safety : factor on the expected time. seed : decides between equal problems.

    Raises CpbenchError where not even the cheapest problem fits, StoreError where the plan of the results is not known.
    """
    if not math.isfinite(budget):
        raise CpbenchError("--budget none: without a limit there is nothing to select; run all problems")
    table, sources = _read(files)
    measured = costs.measured_costs(table)
    room = measured.affordable(budget / safety)
    _require_room(measured, room, budget, safety)
    chosen = subset.choose(measured.outcomes, measured.cost, measured.family, room, seed)
    agreement = subset.agreement(measured.outcomes, chosen.problems)
    plan = Chosen(chosen, measured, budget, safety, agreement, _command(sources, budget, safety, seed))
    builtin = _builtin()
    declared = sorted(set(measured.rows["solver"]) - set(solvers.names()))
    return Selection(
        subset_plan.text(plan, sources, folder.absolute(), builtin),
        tuple(_remarks(plan, builtin, room)),
        tuple(declared),
    )


def _read(files: Sequence[Path]) -> tuple[pd.DataFrame, list[Source]]:
    tables: list[pd.DataFrame] = []
    sources: list[Source] = []
    for path in dict.fromkeys(path.resolve() for path in files):
        with sealed(path) as store:
            tables.append(store.table())
            sources.append(subset_plan.source(path.name, store.meta().get("plan")))
    return pd.concat(tables, ignore_index=True), sources


def _command(sources: Sequence[Source], budget: float, safety: float, seed: int) -> str:
    """Return the command without the places of this machine."""
    names = shlex.join(source.name for source in sources)
    return f"cpbench select {names} --budget {budget:g}s --safety {safety:g} --seed {seed}"


def _require_room(measured: MeasuredCosts, room: float, budget: float, safety: float) -> None:
    """Raise CpbenchError when not even the cheapest problem fits."""
    least = measured.cost.min()
    if room < least:
        need = math.ceil(safety * measured.expected(least))
        cheapest = str(measured.cost.idxmin())
        whole = cheapest.startswith("sequence ")  # as `costs` names it
        what = f"the {cheapest}, whose steps cannot be taken apart," if whole else "the cheapest problem"
        raise CpbenchError(
            f"--budget {duration(budget)}: starting {counted(measured.solvers, 'solver')} and {what} take "
            f"{need} s with --safety {safety:g}: use --budget {need}s or more, or results of fewer solvers"
        )


def _remarks(plan: Chosen, builtin: Path | None, room: float) -> list[str]:
    """Return what the reader of the plan should do something about."""
    cost = plan.measured.cost
    left = cost[~cost.index.isin(plan.subset.problems)]
    remarks = [
        f"not here: {file}; the plan names it as the results do" for file in subset_plan.missing_files(plan, builtin)
    ]
    if len(left) and left.min() <= room - plan.subset.cost:
        remarks.insert(0, "no further problem tells the solvers apart: the rest of the budget is left")
    return remarks


def _builtin() -> Path | None:
    try:
        return builtin_folder()
    except CpbenchError:
        return None
