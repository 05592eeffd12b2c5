"""Benchmarks from Python: problems and solvers to results, each solver in a separate process, as `cpbench run`."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cpbench import storage
from cpbench.api.concluding import conclude
from cpbench.api.results import Results
from cpbench.bench import skipped
from cpbench.bench.events import Observer
from cpbench.bench.planning import run_plan
from cpbench.bench.planning.assembly import Assembly
from cpbench.bench.planning.run_plan import SETTINGS
from cpbench.bench.run import open_run, require_answers
from cpbench.errors import CpbenchError, UnknownName
from cpbench.formulations.base import Problem
from cpbench.generators.collection import builtin_folder


def run(
    problems: str | Path | Problem | Sequence[str | Path | Problem],
    solvers: str | Sequence[str] = (),
    *,
    tolerance: float | Sequence[float] = 1e-6,
    seconds: float = 10.0,
    repeats: int = 3,
    jobs: int = 1,
    out: str | Path | None = None,
    **plan: Any,
) -> Results:
    """Solve every problem by every solver, judge every answer on the problem that was asked, and keep the rows.

    Each solver runs in a separate process, which is stopped at the limit; no crash reaches this process.

    Parameters
    ----------
    problems : files, packs (``FILE::NAME``), folders, globs, ``"builtin/..."``, or problems from memory, which are
        written beside the results.
    solvers : names, globs and grids (``"nsgs[omega=0.8:1.4:0.2]"``); none for those that `cpbench run` takes.
    tolerance : the largest error of an answer that counts as solved; a row each for several.
    seconds : limit of a solve [s]. repeats : solves of a pair that takes less than 1 s. jobs : pairs at a time.
    out : results file (SQLite), where an earlier run is gone on with; None: a temporary one, gone with the `Results`.
    plan : any other key of a plan file: routes, via, where, start, memory, threads, seed, ...

    Raises
    ------
    CpbenchError : nothing can be run; the message says why. UnknownName : no such solver or key.

    >>> import cpbench
    >>> lcp = cpbench.LCP(M=[[2.0, 1.0], [1.0, 2.0]], q=[-5.0, -6.0], name="two")
    >>> results = cpbench.run(lcp, ["lemke", "psor"], repeats=1)
    >>> results.frame[["problem", "solver", "status"]].values.tolist()
    [['two', 'lemke', 'solved'], ['two', 'psor', 'solved']]
    """
    for key in plan:
        if key not in SETTINGS or key in ("report", "output", "timeout", "fail_on"):
            raise UnknownName("key of a plan", key, [key for key in SETTINGS if key not in _NAMED])
    if out is None:
        folder = tempfile.mkdtemp(prefix="cpbench-")
        try:
            into = Path(folder) / "run.sqlite"
            results = run(
                problems, solvers, tolerance=tolerance, seconds=seconds, repeats=repeats, jobs=jobs, out=into, **plan
            )
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        weakref.finalize(results, shutil.rmtree, folder, ignore_errors=True)
        return results
    path = Path(out)
    settings: dict[str, Any] = {
        **plan,
        "problems": _addresses(problems, path),
        **({"solvers": [solvers] if isinstance(solvers, str) else list(solvers)} if solvers else {}),
        "tolerance": list(tolerance) if isinstance(tolerance, Sequence) else [tolerance],
        "timeout": seconds,
        "repeats": repeats,
        "jobs": jobs,
        "output": str(path),
    }
    given = {key: SETTINGS[key].read(value) for key, value in settings.items()}
    checked = run_plan.make({**given, "report": None}, {}, [])
    remarks: list[str] = []
    observer = Observer()
    with _environment_kept(), open_run(checked, builtin_folder, observer.reading) as opened:
        assembly = opened.assembly
        assembly.require_pairs()
        require_answers(checked, assembly.pairs)
        remarks += _remarks(assembly)
        store = opened.open_results()
        opened.execute(store, observer, "cpbench.run from Python")
        conclude(store, say=remarks.append)
        remarks += [f"rows are missing: {gap}; the same call goes on" for gap in skipped.gaps(store, assembly)]
    return Results(path, remarks=remarks)


_NAMED = ("problems", "solvers", "tolerance", "timeout", "repeats", "jobs", "output", "report", "fail_on")
"""Keys of a plan that have a parameter of their own, or mean nothing here."""


@contextmanager
def _environment_kept() -> Generator[None]:
    """Undo what a run sets for its processes: the numbers of threads are this process's own affair."""
    before = dict(os.environ)
    try:
        yield
    finally:
        for name in os.environ.keys() - before.keys():
            del os.environ[name]
        os.environ.update(before)


def _remarks(assembly: Assembly) -> list[str]:
    """Return what would otherwise be left out in silence."""
    remarks = [f"same problem, run once: {address} is {twin}" for address, twin in assembly.twins]
    remarks += [f"refused: {reason}" for _, reason in assembly.refused]
    remarks += [f"no route leads to {', '.join(assembly.idle)}: no row"] if assembly.idle else []
    return remarks + [f"not available: {name}: {why}" for name, why in assembly.absent.items()]


def _addresses(problems: str | Path | Problem | Sequence[str | Path | Problem], results: Path) -> list[str]:
    """Return where the problems are; those from memory are written into a pack beside the results."""
    given = [problems] if isinstance(problems, (str, Path, Problem)) else list(problems)
    problems_of_user: Mapping[str, Problem] = {}
    addresses: list[str] = []
    pack = results.with_suffix(".problems.h5")
    for number, one in enumerate(given, 1):
        if not isinstance(one, Problem):
            addresses.append(str(one))
            continue
        name = one.name or f"problem-{number}"
        if name in problems_of_user and problems_of_user[name].fingerprint != one.fingerprint:
            raise CpbenchError(f"problems: two are called '{name}'; give each its own name")
        problems_of_user = {**problems_of_user, name: one}
    if problems_of_user:
        storage.save_pack(problems_of_user, pack, force=True)
        addresses += [f"{pack}::{name}" for name in problems_of_user]
    return addresses
