"""Runs rows of a results file again, by the plan that the file keeps, into another file."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

from cpbench.bench.execution import open_run
from cpbench.bench.planned_run import RoundObserver
from cpbench.bench.planning import plan_file, run_plan
from cpbench.bench.planning.assembly import Assembly, Reading
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError, StoreError

CHOOSING = ("found", "problems", "where")
"""Keys of a set that select its problems, which are known here."""
KEPT = ("seed", "threads", "jobs")


def plan(path: Path, keys: Collection[str], output: Path) -> RunPlan:
    """Return the plan of a results file for the problems of some of its rows; it starts no declared program.

    Raises StoreError where the file keeps none, UnknownName on solvers that are not loaded.
    """
    with Store(path) as store:
        plan: Mapping[str, Any] = store.meta().get("plan") or {}
        rows = [row for row in store.rows() if row.key in keys]
    if not plan.get("sets"):
        raise StoreError(f"{path}: has no plan of its rows: none can be run again")
    sets: list[dict[str, Any]] = []
    for part in plan["sets"]:
        own = {key: _read(path, key, value) for key, value in part.items() if key not in CHOOSING and value}
        addresses = [row.address for row in rows if (row.set or "") == part.get("name", "")]
        if addresses:
            sets.append({**own, "problems": tuple(dict.fromkeys(addresses))})
    if not sets:
        raise StoreError(f"{path}: the rows to run again belong to no set of its plan")
    top = {key: plan[key] for key in KEPT if key in plan}
    return run_plan.make({"output": str(output), "report": None, "keep": "all"}, top, sets)


def carry_out(
    asked: RunPlan,
    wanted: Collection[str],
    command: str,
    name: str,
    builtin: Callable[[], Path],
    observer: RoundObserver,
    reading: Reading,
) -> Assembly:
    """Run the pairs of a plan whose keys are wanted, with all steps of their sequences; the same call resumes an
    interrupted run. Raises CpbenchError where no pair can be run here; `name` is the file they come from."""
    with open_run(asked, builtin, reading) as run:
        run.keep(wanted)
        if not run.assembly.pairs:
            why = f" ({run.assembly.refused[0][1]})" if run.assembly.refused else ""
            raise CpbenchError(f"{name}: none of its pairs can be run here{why}")
        run.execute(run.open_results(), observer, command)
    return run.assembly


def _read(path: Path, key: str, value: Any) -> Any:
    try:
        return plan_file.check(key, value)
    except CpbenchError as cause:
        raise CpbenchError(f"{path}: its plan: {key}: {cause}") from None
