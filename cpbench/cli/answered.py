"""One solve of a problem of a file, as `cpbench solve` shows and writes it."""

from __future__ import annotations

import json
import math
import os
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

from cpbench import storage
from cpbench.analysis.contact_freedom import freedom_lines
from cpbench.analysis.contact_table import ContactTable, contact_table
from cpbench.api.solution import objective_of
from cpbench.bench.results.rows import MEASURED, Outcome
from cpbench.cli.terminal import columns_of
from cpbench.errors import CpbenchError, PointError
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.foundation import extensions
from cpbench.foundation.matrices import Vector
from cpbench.foundation.text import counted, on_one_line, printable
from cpbench.registry import PLUGIN_FILES
from cpbench.storage.answers import save_vector
from cpbench.storage.base import NOTE, unknowns
from cpbench.verification import MET_TOLERANCE, PROVEN, REFUSED, Status, error_text

MOST = 20
"""The most unknowns and contacts that have a line each, where not all are asked for."""
WORDS: Mapping[str, str] = {
    Status.SOLVED: "solved",
    Status.STATIONARY: "only stationary: the optimality conditions hold, and that it is a minimum is not shown",
    Status.INFEASIBLE: "there is no solution: infeasible, proved",
    Status.UNBOUNDED: "there is no least value: unbounded, proved",
    Status.APPROXIMATE: "not solved, approximate: the answer solves the approximation that the conversions make",
    Status.LOST: "not solved, lost: the conversion lost the accuracy of the answer",
    Status.INACCURATE: "not solved, inaccurate: the solver claims an answer that misses the tolerance",
    Status.WRONG: "not solved, wrong: the solver claims an answer that is none",
    Status.UNRESOLVABLE: "not solved, unresolvable: rounding decides whether the answer meets the tolerance",
    Status.FAILED: "not solved, failed: the solver gave up",
    Status.MAX_ITER: "not solved, max_iter: the solver's iterations were not enough",
    Status.TIMEOUT: "not solved, timeout: the time limit was reached",
    Status.MEMOUT: "not solved, memout: the memory limit was reached",
    Status.CRASH: "not solved, crash: the solver's process died",
    Status.ERROR: "not solved, error",
    Status.UNSUPPORTED: "not solved, unsupported: the solver does not take this problem",
    Status.UNAVAILABLE: "not solved, unavailable: the solver cannot run here",
}
"""Words for the status of an answer."""


def status_text(status: str, error: float | None, tolerance: float, objective: float | None) -> str:
    """Return status, objective and error in words.

    >>> status_text("solved", 2.5e-14, 1e-6, -3.25)
    'solved; objective -3.25, error 2.5e-14 (1e-06 asked for)'
    >>> status_text("infeasible", 0.5, 1e-6, None)
    'there is no solution: infeasible, proved'
    """
    words = WORDS.get(status, status)
    if status in (Status.INFEASIBLE, Status.UNBOUNDED):
        return words
    finite = objective is not None and math.isfinite(objective)
    numbers = [f"objective {objective:.9g}"] if finite else []
    if error is not None and math.isfinite(error):
        numbers.append(f"error {error_text(error)} ({tolerance:.3g} asked for)")
    return "; ".join(filter(None, (words, ", ".join(numbers))))


def answer_lines(
    problem: Problem, point: Point, tolerance: float, *, every: bool = False, solved: bool = False
) -> Iterator[str]:
    """Yield the numbers of an answer: of contacts what they do and the load of each body, and of one that is `solved`
    what it leaves open; else the unknowns by name.

    `every` : whether all of them are written, however many there are.
    """
    most = None if every else MOST
    if not isinstance(problem, ContactProblem):
        yield from unknown_lines(problem, point, most)
        return
    try:
        yield from _contact_lines(contact_table(problem, point, tolerance), most)
    except PointError as cause:
        yield f"  {cause}"
        return
    velocities = point.arrays().get("v", np.zeros(0))
    for first in range(0, velocities[: 6 * (most or velocities.size)].size, 6):
        some = velocities[first : first + 6]
        yield f"  v[{first}:{first + some.size}] = {', '.join(f'{value:.6g}' for value in some.tolist())}"
    if most is not None and velocities.size > 6 * most:
        yield f"  and {counted(velocities.size - 6 * most, 'more velocity', 'more velocities')}: --verbose shows them"
    if solved:
        yield from freedom_lines(problem, point, tolerance)


def own_parts(problem: Problem, point: Point) -> Mapping[str, Vector]:
    """Return the numbers of an answer by the names of what the problem was made of, a game or the arrays of a package,
    else by those of its formulation."""
    return extensions.hook("own_unknowns")(problem, point) or point.arrays()


def unknown_lines(problem: Problem, point: Point, most: int | None) -> Iterator[str]:
    """Yield the unknowns (of a game x and y, of least squares x and r) and the slacks that belong to them; of more than
    `most` the first, and how many follow."""
    parts = dict(own_parts(problem, point))
    slacks = problem.slacks(point) if point.finite and parts.keys() == point.arrays().keys() else {}
    columns = [printable(column) for column in unknowns(problem.info)]
    named = [name for name, end in zip(parts, accumulate(map(len, parts.values())), strict=True) if end <= len(columns)]
    blocks: list[tuple[Sequence[str] | None, str, Vector]] = []
    if columns and sum(parts[name].size for name in named) == len(columns):
        blocks.append((columns, "", np.concatenate([parts.pop(name) for name in named])))
    blocks += [(None, name, values) for name, values in parts.items()]
    total = sum(values.size for _, _, values in blocks)
    left = total if most is None else most
    for names, part, values in blocks:
        shown = values[:left].tolist()
        labels = names[:left] if names is not None else [f"{part}[{i}]" for i in range(len(shown))]
        beside = next(((name, slack) for name, slack in slacks.items() if slack.size == values.size), None)
        rows = [[f"  {label}", "=", f"{value:.9g}"] for label, value in zip(labels, shown, strict=True)]
        for i, row in enumerate(rows):
            if beside is None:
                break
            name, slack = beside
            row.append(f"   {name}{f'[{i}]' if names is None else ''} = {slack[i]:.6g}")
        yield from columns_of(rows, gap=1) if rows else ()
        left -= len(shown)
    if most is not None and most < total:
        yield f"  and {counted(total - most, 'more number')}: --verbose shows them, -o FILE writes them"


def _contact_lines(table: ContactTable, most: int | None) -> Iterator[str]:
    """Yield how many contacts are in each state, a table of the contacts, and the load of each body where these are
    known."""
    if not len(table):
        yield "  no contacts"
        return
    counts = ", ".join(f"{count} {state}" for state, count in table.counts().items())
    yield f"  {counted(len(table), 'contact')}: {counts}"
    contacts = {
        "contact": table.id,
        "normal force": table.normal,
        "‖T‖/(μN)": table.friction,
        "opening velocity": table.opening,
        "sliding speed": table.sliding,
    }
    if table.rolling.size:
        contacts |= {"‖M‖/(μ_rN)": table.moment, "rolling speed": table.rolling}
    yield from _number_lines({**contacts, "state": table.state}, most, "more contact")
    if table.bodies.size:
        loads = dict(zip(("load x", "load y", "load z"), table.load.T, strict=True)) if len(table.load) else {}
        yield from _number_lines({"body": table.bodies, "contacts": table.touched, **loads}, most, "more body")


def _number_lines(columns: Mapping[str, Any], most: int | None, noun: str) -> Iterator[str]:
    """Yield arrays as the columns of a table, numbers to the right; of more than `most` rows the first."""
    texts: list[list[str]] = []
    for name, array in columns.items():
        digits = 5 if name.startswith(("normal", "load")) else 3
        values = array[:most].tolist()
        texts.append([name, *(f"{v:.{digits}g}" if isinstance(v, float) else str(v) for v in values)])
    total = len(next(iter(columns.values())))
    for line in columns_of(list(zip(*texts, strict=True)), right=[name != "state" for name in columns]):
        yield f"  {line}"
    if most is not None and most < total:
        yield f"  and {counted(total - most, noun)}: --verbose shows them"


@dataclass(frozen=True, eq=False)
class Answered:
    """Outcome of one solve; true in a condition where the answer is verified, or proved that there is none.

    Attributes
    ----------
    address, name, node : of the problem. label : of the solver. tolerance : what was asked for.
    outcome : what was measured.
    problem, point : the problem and the answer to it, None where there is no answer.
    """

    address: str
    name: str
    node: str
    label: str
    tolerance: float
    outcome: Outcome
    problem: Problem | None = None
    point: Point | None = None

    def __bool__(self) -> bool:
        return self.outcome.status in (*MET_TOLERANCE, *PROVEN)

    def record(self) -> dict[str, Any]:
        """Return what was measured with its problem and label, as JSON takes it."""
        measured = {name: getattr(self.outcome, name) for name in MEASURED}
        measured_values = {name: value for name, value in measured.items() if value is not None}
        objective = self._objective()
        more: dict[str, Any] = {} if objective is None else {"objective": objective}
        if self.problem is not None and self.point is not None and self.outcome.status not in PROVEN:
            parts: Mapping[str, Vector] = own_parts(self.problem, self.point)
            measured_values["answer"] = {name: values.tolist() for name, values in parts.items()}
        return {"problem": self.name, "solver": self.label, **more, **measured_values}

    def _objective(self) -> float | None:
        return None if self.problem is None or self.point is None else objective_of(self.problem, self.point)

    def lines(self, *, verbose: bool = False) -> Iterator[str]:
        """Yield what the answer is worth in a line, its numbers, and with `verbose` all of them and what was
        measured."""
        row = self.outcome
        words = status_text(row.status, row.error, self.tolerance, self._objective())
        spent = [seconds for seconds in (row.setup, row.solve) if seconds is not None]
        took = f" in {_duration(sum(spent))}" if spent else ""
        name = on_one_line(self.name or Path(self.address).stem)
        yield f"{name} ({self.node}): {words}; by {self.label}{took}"
        # of what did not solve it, what the solver says; of a proof, what was proved
        if row.message and row.status not in MET_TOLERANCE and not verbose:
            yield f"  {printable(row.message)}"
        if not self and row.status not in REFUSED:
            yield on_one_line(
                f"  why, and what else to try: {_command('explain', _near(self.address), '-s', self.label)}"
            )
        if row.flags and row.error is not None and math.isfinite(row.error) and not verbose:
            yield f"  flags: {row.flags}"
        if self.problem is not None and self.point is not None and row.status not in PROVEN:
            yield from answer_lines(self.problem, self.point, self.tolerance, every=verbose, solved=bool(self))
        said = {} if self.problem is None else self.problem.info.properties
        yield from (f"  {printable(str(said[key]))}" for key in (NOTE, "joints", "left_out") if key in said)
        if verbose:
            yield from self._details()

    def _details(self) -> Iterator[str]:
        """Yield by what route the answer came, all that was measured of it, and what it took."""
        row = self.outcome
        if row.started not in (None, "cold"):
            yield f"  started    {row.started}"
        if row.route:
            yield f"  route      {row.route} ({row.kind})"
        if row.error is not None:
            yield f"  error      {error_text(row.error)}, asked for {self.tolerance:.3g}; claimed {row.claim}"
        if row.route != "direct" and row.target_error is not None:
            error, wanted = row.target_error, row.target_tolerance
            yield f"  there      {error_text(error)}, asked for {wanted:.3g}: the error on the solver's own problem"
        if row.flags:
            yield f"  flags      {row.flags}"
        for name, value in json.loads(row.parts or "{}").items():
            yield f"    {name:<28} {value:.3g}"
        parts = ("load", "convert", "setup", "solve", "lift", "verify")
        times = {part: getattr(row, part) for part in parts if getattr(row, part) is not None}
        if times:
            yield "  seconds    " + ", ".join(f"{k} {v:.3g}" for k, v in times.items())
        counters = json.loads(row.counters or "{}")
        if counters:
            yield "  counters   " + ", ".join(f"{k} {v}" for k, v in counters.items())
        if row.message:
            yield f"  message    {printable(row.message)}"

    def save(self, path: Path, *, force: bool = False) -> None:
        """Write the answer, as a plain vector (.npy, .csv, .txt) or with its problem and verdict (.h5).

        Raises CpbenchError where there is no answer, FormatError where the file exists (unless `force`).
        """
        if self.problem is None or self.point is None:
            raise CpbenchError(f"{self.label}: no answer to write")
        if not save_vector(self.point, path, force=force):
            row = self.outcome
            facts = {"solver": self.label, "claim": row.claim, "verdict": row.status}
            facts |= {"residual": row.error, "tolerance": self.tolerance}
            storage.save_answer(path, self.problem, self.point, facts, force=force, with_problem=True)


def _duration(seconds: float) -> str:
    """Return a time in words: 0.27 ms, 1.5 s.

    >>> _duration(2.69e-4), _duration(1.5)
    ('0.269 ms', '1.5 s')
    """
    return f"{seconds:.3g} s" if seconds >= 1.0 else f"{1e3 * seconds:.3g} ms"


def _command(*words: str) -> str:
    """Return `cpbench WORDS`, quoted for a shell, with the plugins that this command was given: names come from
    them."""
    given = [path for path in os.environ.get(PLUGIN_FILES, "").split(os.pathsep) if path]
    plugins = [word for path in dict.fromkeys(given) for word in ("--plugin", _near(path))]
    return shlex.join(["cpbench", *words, *plugins])


def _near(path: str) -> str:
    """Return a path from this folder on where it lies below it, else as it is."""
    file, here = Path(path), Path.cwd()
    return str(file.relative_to(here)) if file.is_absolute() and file.is_relative_to(here) else path
