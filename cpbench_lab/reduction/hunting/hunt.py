"""The search: problems of all cells, tried on a solver that may fail and on one that should not.

A problem is a small built-in one, or a mutation of one that was tried. Parents are taken from the cells (`cells`) that
were visited least, or on which the solver came nearest to failing, so that the search spreads instead of walking
at random. Of each kind of failure the first is reduced and certified. Every problem has a number: a search with the
same seed draws the same problems, as long as solvers do the same in the same time.
"""

from __future__ import annotations

import json
import math
import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cpbench import storage
from cpbench.api.problems import load
from cpbench.bench.planning import plan
from cpbench.bench.results.rows import Outcome
from cpbench.errors import CpbenchError, NoRoute
from cpbench.formulations.base import Problem
from cpbench.generators.collection import builtin_folder
from cpbench.graph import candidates
from cpbench.solvers.base import solvers
from cpbench.verification import MET_TOLERANCE, Status
from cpbench_lab.reduction.cases import FailingCase, reduce_case
from cpbench_lab.reduction.hunting.cells import AXES, Cell, cell
from cpbench_lab.reduction.hunting.mutations import mutated
from cpbench_lab.reduction.numbers import digits
from cpbench_lab.reduction.predicate import FAILURES, SLOWER, Predicate
from cpbench_lab.reduction.reduce import NoFailure, unknowns
from cpbench_lab.reduction.trials import Asked, Trials, point_of

FACTOR = 100.0
"""How many times slower than the other solver is a failure."""
REDUCE_SHARE = 0.4
"""The part of the time that is left for reducing what was found."""
LARGEST = 200
"""Unknowns of a problem that is tried, at most: larger ones take the time of many."""
FRESH = 0.1
"""Share of built-in problems among those that are tried."""


@dataclass(frozen=True)
class Find:
    """A failure that was found.

    Attributes
    ----------
    kind : of a predicate. words : what the solver said, without numbers: finds with the same are counted as one.
    number : of the problem. path : its file. times : how often it was met.
    """

    kind: str
    words: str
    number: int
    path: Path
    times: int = 1


@dataclass(frozen=True)
class Shown:
    """A find after its reduction, as the last table has it; `level` is that of its certificate."""

    find: Find
    sizes: str
    digits: int
    level: str
    folder: str


@dataclass
class HuntState:
    """State of a search: what was tried, by cell."""

    seed: int
    tried: int = 0
    visits: dict[Cell, int] = field(default_factory=dict)
    best: dict[Cell, tuple[float, Problem, Any]] = field(default_factory=dict)
    finds: dict[tuple[str, str], Find] = field(default_factory=dict)


EventHandler = Callable[[HuntState], None]


def hunt(
    solver: str,
    other: str,
    folder: Path,
    *,
    seconds: float,
    seed: int = 0,
    limits: plan.Limits | None = None,
    tolerance: float = 1e-6,
    node: str = "",
    on_event: EventHandler = lambda search: None,
) -> tuple[HuntState, list[Shown]]:
    """Search for problems on which `solver` lies, crashes or is slow and which `other` solves; reduce what is found.

    Parameters
    ----------
    folder : new or empty; gets the problems found, `tried.jsonl` with a line a problem, and a folder a reduced find.
    seconds : of it all. seed : of the random numbers. node : formulation of the problems, "" for that of the solver.

    Raises NoRoute where no formulation reaches both solvers, CpbenchError where the folder has something in it.
    """
    if folder.exists() and any(folder.iterdir()):
        raise CpbenchError(f"{folder}: is not empty; name a new folder")
    limits = limits or plan.Limits(seconds=2.0, repeats=1)
    asked = Asked(solver, Predicate("disagrees", other=other), tolerance, limits)
    node = node or _node(solver, other)
    folder.mkdir(parents=True, exist_ok=True)
    begun = time.monotonic()
    search = HuntState(seed)
    with Trials(asked, begun + seconds * (1 - REDUCE_SHARE)) as trials, (folder / "tried.jsonl").open("w") as log:
        seeds = _seeds(node)
        while search.tried == 0 or not trials.over:
            made = _next(search, seeds)
            if made is not None:
                origin, problem = made
                record = {"number": search.tried, "origin": origin, **_tried(search, trials, problem, folder)}
                log.write(json.dumps(record) + "\n")
            search.tried += 1
            on_event(search)
    return search, list(_reduced(search, asked, folder, begun + seconds))


def _node(solver: str, other: str) -> str:
    """Return the formulation of one of the solvers from which an exact route leads to the other one."""
    mine, theirs = (solvers.get(plan.parse_entry(name).solver).spec.node for name in (solver, other))
    for node in (mine, theirs):
        if all(there == node or next(iter(candidates(node, there)), None) for there in (mine, theirs)):
            return node
    raise NoRoute(f"no formulation reaches both {solver} ({mine}) and {other} ({theirs}); name one by --node")


def _seeds(node: str) -> list[Problem]:
    """Return the small built-in problems of a formulation."""
    packs = sorted((builtin_folder() / node).glob("*.h5"))
    found = [load(f"{pack}::{name}") for pack in packs for name in storage.members(pack)]
    return [problem for problem in found if unknowns(problem) <= LARGEST]


def _next(search: HuntState, seeds: Sequence[Problem]) -> tuple[str, Problem] | None:
    """Return where the next problem comes from, and it; None where what was drawn is none."""
    rng = np.random.default_rng([search.seed, search.tried])
    try:
        if seeds and (not search.best or rng.random() < FRESH):
            problem = seeds[int(rng.integers(len(seeds)))]
            return problem.name, problem
        parent = _parent(search, rng)
        if parent is None:
            return None
        problem, solution = parent
        names: list[str] = []
        for _ in range(int(rng.integers(1, 4))):
            name, problem = mutated(problem, solution, rng)
            solution = None
            names.append(name)
        return "+".join(names), problem
    except (CpbenchError, ArithmeticError, np.linalg.LinAlgError):
        return None


def _parent(search: HuntState, rng: np.random.Generator) -> tuple[Problem, Any] | None:
    """Return the problem of a cell: every second time of one that was visited least, else of a promising one."""
    if not search.best:
        return None
    places = sorted(search.best)
    if rng.random() < 0.5:
        least = min(search.visits[place] for place in places)
        places = [place for place in places if search.visits[place] == least]
        chosen = places[int(rng.integers(len(places)))]
    else:
        few = rng.integers(len(places), size=3)
        chosen = max((places[int(k)] for k in few), key=lambda place: search.best[place][0])
    search.visits[chosen] += 1
    _, problem, solution = search.best[chosen]
    return problem, solution


def _tried(search: HuntState, trials: Trials, problem: Problem, folder: Path) -> dict[str, Any]:
    """Try a problem on both solvers, keep it where it belongs; returns a record of it."""
    if not 0 < unknowns(problem) <= LARGEST:
        return {"size": unknowns(problem)}
    try:
        outcome = trials.solve(problem, trials.asked.solver)
        reference = trials.solve(problem, trials.asked.predicate.other)
    except CpbenchError as refused:
        return {"refused": str(refused)}
    solved = reference.status in MET_TOLERANCE
    solution = point_of(problem, reference) if solved else None
    place = cell(problem, solution)
    search.visits[place] = search.visits.get(place, 0) + 1
    score = _score(outcome, reference) if solved else -math.inf
    if place not in search.best or score > search.best[place][0]:
        search.best[place] = (score, problem, solution)
    kind = failure(outcome, reference) if solved else ""
    if kind == SLOWER:  # a machine that was busy for a moment makes anybody slow
        again = trials.solve(problem, trials.asked.solver), trials.solve(problem, trials.asked.predicate.other)
        kind = failure(*again)
    if kind:
        _keep(search, kind, outcome, problem, folder)
    return {
        "fingerprint": problem.fingerprint,
        "cell": dict(zip(AXES, place, strict=True)),
        "status": [outcome.status, reference.status],
        "solve": [outcome.solve, reference.solve],
        "failure": kind,
    }


def failure(outcome: Outcome, reference: Outcome) -> str:
    """Return how a solver failed on a problem that the other one solved: a status, `slower`, or nothing."""
    slow = Predicate(SLOWER, FACTOR)
    if outcome.status == Status.TIMEOUT and (outcome.solve or 0.0) < FACTOR * (reference.solve or 0.0):
        return ""
    if outcome.status in FAILURES and outcome.status != Status.LOST:
        return outcome.status
    return SLOWER if slow.holds(outcome, reference) else ""


def _score(outcome: Outcome, reference: Outcome) -> float:
    """Return how near a solver came to failing: decades of its error above the other's, and of its time."""
    errors = [max(o.error if o.error is not None else math.inf, 1e-16) for o in (outcome, reference)]
    times = [max(o.solve or 0.0, 1e-5) for o in (outcome, reference)]
    lost = min(math.log10(errors[0]) - math.log10(errors[1]), 16.0) if math.isfinite(errors[0]) else 16.0
    return lost / 8.0 + math.log10(times[0] / times[1])


def _keep(search: HuntState, kind: str, outcome: Outcome, problem: Problem, folder: Path) -> None:
    """Note a find; the first of its kind is written to a file, a smaller one replaces it."""
    words = re.sub(r"[-+]?\d[\d.e+-]*", "#", outcome.message or "")[:80]
    known = search.finds.get((kind, words))
    path = folder / f"{kind}-{len(search.finds) + 1}.h5" if known is None else known.path
    number, times = search.tried, 1 if known is None else known.times + 1
    if known is None or unknowns(problem) < unknowns(load(path)):
        storage.save(problem, path, force=True)
    else:
        number = known.number
    search.finds[kind, words] = Find(kind, words, number, path, times)


def _reduced(search: HuntState, asked: Asked, folder: Path, end: float) -> Iterator[Shown]:
    """Reduce each find in the time that is left, and yield what the table shows of it."""
    finds = list(search.finds.values())
    for k, find in enumerate(finds):
        predicate = Predicate(find.kind, FACTOR if find.kind == SLOWER else 0.0, asked.predicate.other)
        share = max((end - time.monotonic()) / (len(finds) - k), 5.0)
        case = FailingCase(str(find.path), Asked(asked.solver, predicate, asked.tolerance, asked.limits))
        place = folder / find.path.stem
        try:
            reduced, written = reduce_case(case, place, share)
        except NoFailure:
            yield Shown(find, "not there again", 0, "", "")
            continue
        sizes = ", ".join(f"{symbol} = {size}" for symbol, size in reduced.problem.sizes().items() if size)
        yield Shown(find, sizes, digits(reduced.problem), written.level, str(place))
