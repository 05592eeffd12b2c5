"""Failures to be reduced, and their reduction into a folder."""

from __future__ import annotations

import contextlib
import shlex
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cpbench import storage
from cpbench.api.problems import load
from cpbench.bench.planning import plan
from cpbench.bench.planning.places import located
from cpbench.bench.results.rows import Outcome, unpack_answer
from cpbench.errors import CpbenchError, PointError
from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.foundation.text import counted
from cpbench.generators.collection import address_text, builtin_folder
from cpbench.report import canvas
from cpbench.report.text import code, plain
from cpbench.verification import MET_TOLERANCE
from cpbench_lab.pictures import contact
from cpbench_lab.reduction.numbers import digits
from cpbench_lab.reduction.predicate import Predicate
from cpbench_lab.reduction.reduce import Progress, ReducedFailure, data_size, reduce
from cpbench_lab.reduction.trials import Asked, Trials


@dataclass(frozen=True)
class FailingCase:
    """A problem and how a solver fails on it."""

    address: str
    asked: Asked


def case_of(
    address: str,
    solver: str,
    predicate: Predicate,
    limits: plan.Limits,
    *,
    tolerance: float = 1e-6,
    via: Sequence[str] = (),
) -> FailingCase:
    """Return the case of a problem; raises UnknownName on a solver."""
    for name in filter(None, (solver, predicate.other)):
        plan.parse_entry(name)
    return FailingCase(located(address, builtin_folder), Asked(solver, predicate, tolerance, limits, tuple(via)))


def reduce_case(
    case: FailingCase, folder: Path, seconds: float, progress: Progress = lambda problem, tried: None
) -> tuple[ReducedFailure, tuple[Path, ...]]:
    """Reduce a case for so many seconds into a new or empty folder.

    Raises NoFailure, NoRoute; CpbenchError where the folder has something in it.
    """
    if folder.exists() and any(folder.iterdir()):
        raise CpbenchError(f"{folder}: is not empty; name a new folder")
    problem = load(case.address)
    with Trials(case.asked, time.monotonic() + seconds) as trials:
        reduced = reduce(problem, trials, progress)
    return reduced, write_folder(reduced, case.asked, address_text(case.address), folder)


# ----------------------------------------------------------------------------------------------------------- the folder

PRINTED = 60
"""Numbers of a problem that the report shows; more stand in the file only."""


def write_folder(reduced: ReducedFailure, asked: Asked, source: str, folder: Path) -> tuple[Path, ...]:
    """Write `problem.h5`, `report.md` and, of contacts, `problem.svg`, replacing what is there.

    Parameters
    ----------
    source : what the problem was reduced from, for the report.
    """
    problem, last = reduced.problem, reduced.last
    folder.mkdir(parents=True, exist_ok=True)
    known = {
        "claimed": _point(problem, last.outcome),
        "true": _point(problem, last.other if last.other and last.other.status in MET_TOLERANCE else None),
    }
    points = {name: point for name, point in known.items() if point is not None}
    storage.save(problem, folder / "problem.h5", force=True)
    written = [folder / "problem.h5", *_picture(problem, points.get("true", points.get("claimed")), folder)]
    title = f"{asked.solver}: {asked.predicate} on a problem of {_sizes(problem)} ({problem.node})"
    report = folder / "report.md"
    report.write_text("\n".join(_report(reduced, asked, source, title, points)) + "\n", encoding="utf-8")
    return (*written, report)


def _point(problem: Problem, outcome: Outcome | None) -> Any:
    """Return the answer of an outcome as a point; None where there is none."""
    if outcome is None or outcome.answer is None:
        return None
    try:
        return problem.point_from_vector(unpack_answer(outcome.answer))
    except PointError:
        return None


def _picture(problem: Problem, point: Any, folder: Path) -> Iterator[Path]:
    if point is None:
        return
    with contextlib.suppress(CpbenchError), canvas.drawing():  # problems without contacts have none
        canvas.write(contact.draw(problem, point), folder / "problem.svg")
        yield folder / "problem.svg"


# ------------------------------------------------------------------------------------------- the report


def _report(reduced: ReducedFailure, asked: Asked, source: str, title: str, points: dict[str, Any]) -> Iterator[str]:
    problem, outcome, other = reduced.problem, reduced.last.outcome, reduced.last.other
    ended = "" if reduced.complete else ", not to the end: the time was over"
    yield f"# {plain(title)}"
    yield ""
    yield f"- Problem: {', '.join(problem.relations)}; {', '.join(_data(problem))}."
    yield (
        f"- Its numbers have {counted(digits(problem), 'digit')} at most; reduced from {plain(source)} "
        f"({_sizes(reduced.source)}) by {counted(reduced.tried, 'solve')}{ended}."
    )
    yield f"- Command: {code(_command(asked))}"
    version = f" {plain(outcome.version)}" if outcome.version else ""
    says = code(outcome.claim) if outcome.claim else outcome.status
    message = f" ({plain(outcome.message)})" if outcome.message else ""
    yield f"- {plain(asked.solver)}{version} says {says}{message}{_answer(points.get('claimed'))}."
    error = "" if outcome.error is None else f", error {outcome.error:.3g} where {asked.tolerance:g} was asked for"
    yield f"- Measured: {outcome.status}{error}{_seconds(outcome, 'solved in')}."
    if other is not None:
        error = "" if other.error is None else f" with error {other.error:.3g}"
        taken, answer = _seconds(other, "in"), _answer(points.get("true"))
        yield f"- {plain(reduced.last.name)}: {other.status}{error}{taken}{answer}."
    yield f"- The true answer, with a proof where there is one: {code('cpbench certify problem.h5')}"


def _sizes(problem: Problem) -> str:
    return ", ".join(f"{symbol} = {size}" for symbol, size in problem.sizes().items() if size)


def _seconds(outcome: Outcome, words: str) -> str:
    return "" if outcome.solve is None else f", {words} {outcome.solve:.3g} s"


def _command(asked: Asked) -> str:
    words = ["cpbench", "solve", "problem.h5", "-s", shlex.quote(asked.solver), "-t", f"{asked.tolerance:g}"]
    words += ["--timeout", f"{asked.limits.seconds:g}s"]
    words += [word for via in asked.via for word in ("--via", shlex.quote(via))]
    return " ".join(words)


def _data(problem: Problem) -> Iterator[str]:
    """Yield the data in numbers, as far as a reader takes them in."""
    if data_size(problem) > PRINTED:
        yield _sizes(problem)
        return
    for name, value in problem.data().items():
        if value.size or value.shape == (0,):
            array = matrices.dense(value) if value.ndim == 2 else np.asarray(value)
            if array.size:
                yield f"{name} = {_numbers(array)}"
    yield from (f"{name} has {F.operations} operations" for name, F in problem.maps().items())


def _numbers(array: Any) -> str:
    if array.ndim == 2:
        return "[" + ", ".join(map(_numbers, array)) + "]"
    return "[" + ", ".join(f"{x:.17g}" if float(f"{x:.6g}") != x else f"{x:.6g}" for x in array.tolist()) + "]"


def _answer(point: Any) -> str:
    if point is None:
        return ""
    parts = {name: x for name, x in point.arrays().items() if x.size}
    if sum(x.size for x in parts.values()) > PRINTED:
        return ""
    return ": " + ", ".join(f"{name} = [{', '.join(f'{v:.6g}' for v in x.tolist())}]" for name, x in parts.items())
