"""The search: problems that are tried on a solver that may fail and on one that should not.

A problem is a small built-in one, or a mutation of one that was tried: of those on which the solver came nearest to
failing, one for each size and built-in problem that it descends from, so that the search spreads. Of each kind of
failure the smallest problem is kept. Every problem has a number: a search with the same seed draws the same problems,
as long as solvers do the same in the same time.
"""

from __future__ import annotations

import json
import math
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cpbench import storage
from cpbench.api.problems import load
from cpbench.bench.planning import plan
from cpbench.bench.results.rows import Outcome
from cpbench.errors import CpbenchError
from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.foundation.matrices import dense
from cpbench.generators.collection import builtin_folder
from cpbench.solvers.base import solvers
from cpbench.verification import MET_TOLERANCE, Status
from cpbench_lab.reduction.numbers import FIXED, FRICTION, OPERATORS, rounded
from cpbench_lab.reduction.parts import RemovablePart, bare, kinds, without
from cpbench_lab.reduction.predicate import FAILURES, SLOWER, Predicate
from cpbench_lab.reduction.reduce import semidefinite, unknowns
from cpbench_lab.reduction.trials import Asked, Trials, point_of

FACTOR = 100.0
"""How many times slower than the other solver is a failure."""
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
    path : file of the smallest problem. times : how often it was met.
    """

    kind: str
    words: str
    path: Path
    times: int = 1


@dataclass
class HuntState:
    """State of a search: how much was tried, and the `best`: of each built-in problem and power of 4 of the unknowns
    the score, the problem and its solution."""

    seed: int
    tried: int = 0
    best: dict[tuple[str, int], tuple[float, Problem, Any]] = field(default_factory=dict)
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
    on_event: EventHandler = lambda search: None,
) -> HuntState:
    """Search for problems on which `solver` lies, crashes or is slow and which `other` solves.

    Parameters
    ----------
    folder : new or empty; gets the problems found, and `tried.jsonl` with a line a problem.
    seconds : of it all. seed : of the random numbers.

    Raises CpbenchError where the folder has something in it.
    """
    if folder.exists() and any(folder.iterdir()):
        raise CpbenchError(f"{folder}: is not empty; name a new folder")
    limits = limits or plan.Limits(seconds=2.0, repeats=1)
    asked = Asked(solver, Predicate("disagrees", other=other), tolerance, limits)
    folder.mkdir(parents=True, exist_ok=True)
    search = HuntState(seed)
    with Trials(asked, time.monotonic() + seconds) as trials, (folder / "tried.jsonl").open("w") as log:
        nodes = [solvers.get(plan.parse_entry(name).solver).spec.node for name in (solver, other)]
        seeds = _seeds(nodes[0]) or _seeds(nodes[1])
        if not seeds:
            raise CpbenchError(f"no built-in problem is of {' or '.join(nodes)}, the formulations of these solvers")
        while search.tried == 0 or not trials.over:
            made = _next(search, seeds)
            if made is not None:
                root, changes, problem = made
                record = {"number": search.tried, "origin": "+".join((root, *changes))}
                record |= _tried(search, trials, root, problem, folder)
                log.write(json.dumps(record) + "\n")
            search.tried += 1
            on_event(search)
    return search


def _seeds(node: str) -> list[Problem]:
    """Return the small built-in problems of a formulation."""
    packs = sorted((builtin_folder() / node).glob("*.h5"))
    found = [load(f"{pack}::{name}") for pack in packs for name in storage.members(pack)]
    return [problem for problem in found if unknowns(problem) <= LARGEST]


def _next(search: HuntState, seeds: Sequence[Problem]) -> tuple[str, list[str], Problem] | None:
    """Return the built-in problem that the next one descends from, its changes, and it; None where what was drawn is
    none."""
    rng = np.random.default_rng([search.seed, search.tried])
    try:
        if not search.best or rng.random() < FRESH:
            problem = seeds[int(rng.integers(len(seeds)))]
            return problem.name, [], problem
        few = [sorted(search.best)[int(k)] for k in rng.integers(len(search.best), size=int(rng.integers(1, 4)))]
        chosen = max(few, key=lambda place: search.best[place][0])
        _, problem, solution = search.best[chosen]
        names: list[str] = []
        for _ in range(int(rng.integers(1, 4))):
            name, problem = mutated(problem, solution, rng)
            solution = None
            names.append(name)
        return chosen[0], names, problem
    except (CpbenchError, ArithmeticError, np.linalg.LinAlgError):
        return None


def _tried(search: HuntState, trials: Trials, root: str, problem: Problem, folder: Path) -> dict[str, Any]:
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
    place = root, int(math.log(unknowns(problem), 4))
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
    times = 1 if known is None else known.times + 1
    if known is None or unknowns(problem) < unknowns(load(path)):
        storage.save(problem, path, force=True)
    search.finds[kind, words] = Find(kind, words, path, times)


# ------------------------------------------------------------------------------------------------------------ mutations
# Small changes of a problem that make it a neighbour: other units, repeated parts, ties, stiffer operators.
#
# Those of units and repetition keep a solution where there is one; others may not, and the reference solver decides.

Rng = np.random.Generator
Mutation = Callable[[Problem, Any, Rng], Problem]
BOUNDS = ("lb", "ub")
"""Vectors in the units of the unknowns, where others are in those of the rows."""


def mutated(problem: Problem, solution: Any, rng: Rng) -> tuple[str, Problem]:
    """Return the name of a mutation and what it makes of the problem; raises CpbenchError where none applies.

    Parameters
    ----------
    solution : a point that solves the problem, None where none is known.
    """
    for k in rng.permutation(len(MUTATIONS)).tolist():
        name = list(MUTATIONS)[k]
        try:
            changed = MUTATIONS[name](problem, solution, rng)
        except CpbenchError:
            continue
        if any(semidefinite(problem, op) and not semidefinite(changed, op) for op in OPERATORS):
            continue  # a monotone problem stays one
        if changed.fingerprint != problem.fingerprint and sum(changed.point_sizes.values()):
            return name, changed
    raise CpbenchError(f"no mutation of {problem.node} applies")


def _any_part(problem: Problem, rng: Rng) -> RemovablePart:
    groups = list(kinds(problem).values())
    group = groups[int(rng.integers(len(groups)))]
    return group[int(rng.integers(len(group)))]


def _affine_only(problem: Problem) -> None:
    if problem.has_maps():
        raise CpbenchError(f"{problem.node} has maps, which are not rewritten")


def _units(problem: Problem, solution: Any, rng: Rng) -> Problem:
    """Give a part other units: its rows and columns times a power of ten."""
    _affine_only(problem)
    part, factor = _any_part(problem, rng), 10.0 ** float(rng.integers(-4, 5))
    changed: dict[str, Any] = {}
    for name, shape in problem.shapes().items():
        if name in (*FIXED, *FRICTION) or not set(shape) & part.places.keys():
            continue
        value: Any = getattr(problem, name)
        array = np.array(dense(value) if len(shape) == 2 else value)
        for axis, symbol in enumerate(shape):
            if symbol in part.places and symbol != "nc":
                where = (slice(None),) * axis + (part.places[symbol],)
                array[where] *= 1.0 / factor if name in BOUNDS else factor
        changed[name] = array
    return bare(problem, changed)


def _repeated(problem: Problem, solution: Any, rng: Rng) -> Problem:
    """Repeat a part: a contact beside itself, a row that says the same again."""
    _affine_only(problem)
    if hasattr(problem, "cone_kind"):
        raise CpbenchError("cones are not repeated")
    part = _any_part(problem, rng)
    if "n" in part.places and hasattr(problem, "mu"):
        raise CpbenchError("a body that is there twice has no masses of its own")
    changed: dict[str, Any] = {}
    sizes = problem.sizes()
    for name, shape in problem.shapes().items():
        value: Any = getattr(problem, name)
        array = np.array(dense(value) if len(shape) == 2 else value)
        for axis, symbol in enumerate(shape):
            if symbol in part.places:
                array = np.take(array, np.r_[np.arange(sizes[symbol]), part.places[symbol]], axis=axis)
        changed[name] = array
    return bare(problem, changed)


def _fewer(problem: Problem, solution: Any, rng: Rng) -> Problem:
    """Leave a part out."""
    return without(problem, [_any_part(problem, rng)], solution)


def _ties(problem: Problem, solution: Any, rng: Rng) -> Problem:
    """Round the numbers to one digit or two, so that ratios tie."""
    _affine_only(problem)
    count = int(rng.integers(1, 3))
    changed = {
        name: rounded(dense(v) if v.ndim == 2 else v, count)  # type: ignore[arg-type]
        for name, v in problem.data().items()
        if name not in FIXED
    }
    return bare(problem, changed)


def _stiffer(problem: Problem, solution: Any, rng: Rng) -> Problem:
    """Add t·aaᵀ to the operator, a of one or two entries and t up to 1e6: definiteness stays, conditioning does not."""
    name = next((name for name in OPERATORS if name in problem.data()), None)
    if name is None:
        raise CpbenchError(f"{problem.node} has no operator")
    M = np.array(dense(getattr(problem, name)))
    if not M.size:
        raise CpbenchError(f"{problem.node}.{name} is empty")
    a = np.zeros(len(M))
    a[rng.integers(len(M), size=2)] = rng.choice([-1.0, 1.0], 2)
    return bare(problem, {name: M + 10.0 ** rng.uniform(-6, 6) * matrices.max_abs(M) * np.outer(a, a)})


def _load(problem: Problem, solution: Any, rng: Rng) -> Problem:
    """Make a vector of the data larger or smaller, or one of its numbers 0 or of the other sign; friction stays ≥ 0."""
    names = [n for n, v in problem.data().items() if v.ndim == 1 and v.size and n not in (*FIXED, *BOUNDS)]
    if not names:
        raise CpbenchError(f"{problem.node} has no vector")
    name = names[int(rng.integers(len(names)))]
    vector = np.array(problem.data()[name])
    if rng.random() < 0.4:
        vector *= 10.0 ** float(rng.integers(-6, 7))
    else:
        vector[int(rng.integers(vector.size))] *= float(rng.choice([0.0, 1.0 if name in FRICTION else -1.0, 1e-3, 1e3]))
    return bare(problem, {name: vector})


def _degenerate(problem: Problem, solution: Any, rng: Rng) -> Problem:
    """Take from q the slack of a row at the solution, which stays one: the pair of this row is then both 0."""
    q: Any = problem.data().get("q")
    slack = None if solution is None else next(iter(problem.slacks(solution).values()), None)
    if q is None or slack is None or slack.shape != q.shape or hasattr(problem, "mu"):
        raise CpbenchError("no solution is known whose slacks are rows of q")
    row = int(rng.integers(q.size))
    return bare(problem, {"q": q - np.where(np.arange(q.size) == row, slack, 0.0)})


MUTATIONS: Mapping[str, Mutation] = {
    change.__name__.strip("_"): change for change in (_units, _repeated, _fewer, _ties, _stiffer, _load, _degenerate)
}
