"""Text for a reader: the answer to a problem, its status in words, its unknowns by name, and what its contacts do."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from cpbench.analysis.contact_table import ContactTable, contact_table
from cpbench.errors import PointError
from cpbench.formulations.applications.own_unknowns import own_unknowns
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.foundation.matrices import Vector
from cpbench.foundation.plain_text import printable
from cpbench.foundation.plurals import counted
from cpbench.storage.program_properties import SENSE, offset, unknowns
from cpbench.verification import Status, error_text

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


def objective_of(problem: Problem, point: Point) -> float | None:
    """Return the value of the objective at an answer, as its file has it: with its constant, and the value of the
    maximum where it was to be maximized; None of a problem without one."""
    value = getattr(problem, "objective", None)
    if value is None or not point.finite:
        return None
    with np.errstate(all="ignore"):
        least = float(value(next(iter(point.arrays().values())))) + offset(problem.info)
    return -least if problem.info.properties.get(SENSE) == "max" else least


def answer_lines(problem: Problem, point: Point, tolerance: float, *, every: bool = False) -> Iterator[str]:
    """Yield the numbers of an answer: of contacts what they do and the load of each body, else the unknowns by name.

    `every` : whether all of them are written, however many there are.
    """
    most = None if every else MOST
    if isinstance(problem, ContactProblem):
        try:
            yield from contact_lines(contact_table(problem, point, tolerance), most)
        except PointError as cause:
            yield f"  {cause}"
    else:
        yield from unknown_lines(problem, point, most)


def unknown_lines(problem: Problem, point: Point, most: int | None) -> Iterator[str]:
    """Yield the unknowns (of a game x and y, of least squares x and r) and the slacks that belong to them; of more than
    `most` the first, and how many follow."""
    own = own_unknowns(problem, point)
    parts = own or point.arrays()
    slacks = problem.slacks(point) if point.finite and own is None else {}
    total = sum(part.size for part in parts.values())
    left = total if most is None else most
    columns = unknowns(problem.info)
    if named := _covered(parts, len(columns)):
        values = np.concatenate([parts[name] for name in named])
        slack = next(((name, w) for name, w in slacks.items() if w.size == values.size), None)
        yield from _named_lines([printable(column) for column in columns], values, slack, left)
        left -= min(left, len(columns))
        parts = {name: part for name, part in parts.items() if name not in named}
    for name, values in parts.items():
        beside = next((f"{other}[{{}}] = {{:.6g}}" for other, w in slacks.items() if w.size == values.size), "")
        against = next((w for w in slacks.values() if w.size == values.size), np.zeros(0))
        texts = [f"{value:.9g}" for value in values[:left].tolist()]
        room, label = max(map(len, texts), default=0), len(f"{name}[{max(values[:left].size - 1, 0)}]")
        for i, text in enumerate(texts):
            more = f"    {beside.format(i, against[i])}" if beside else ""
            yield f"  {f'{name}[{i}]':<{label}} = {text:<{room}}{more}".rstrip()
        left -= min(left, values.size)
    shown = min(total, total if most is None else most)
    if shown < total:
        yield f"  and {counted(total - shown, 'more number')}: --verbose shows them, -o FILE writes them"


def _covered(parts: Mapping[str, Vector], count: int) -> list[str]:
    """Return the first parts that have so many numbers together; none where there are no such parts."""
    covered: list[str] = []
    for name, part in parts.items():
        if count <= 0:
            break
        covered.append(name)
        count -= part.size
    return covered if count == 0 else []


def _named_lines(names: Sequence[str], values: Vector, slack: tuple[str, Vector] | None, most: int) -> Iterator[str]:
    """Yield the first unknowns by the names that they have in their file, with the slacks that belong to them."""
    texts = [f"{value:.9g}" for value in values[:most].tolist()]
    label, room = (max(map(len, column[:most]), default=0) for column in (names, texts))
    for k, (name, text) in enumerate(zip(names[:most], texts, strict=True)):
        more = "" if slack is None else f"    {slack[0]} = {slack[1][k]:.6g}"
        yield f"  {name:<{label}} = {text:<{room}}{more}".rstrip()


def contact_lines(table: ContactTable, most: int | None) -> Iterator[str]:
    """Yield how many contacts are in each state, a table of the contacts, and the load of each body where these are
    known."""
    total = len(table)
    if not total:
        yield "  no contacts"
        return
    yield f"  {counted(total, 'contact')}: {', '.join(f'{count} {state}' for state, count in table.counts().items())}"
    rolling = table.rolling.size > 0
    head = ["contact", "normal force", "‖T‖/(μN)", "opening velocity", "sliding speed"]
    rows = [[*head, *(["‖M‖/(μ_rN)", "rolling speed"] if rolling else []), "state"]]
    columns = [table.normal, table.friction, table.opening, table.sliding]
    columns += [table.moment, table.rolling] if rolling else []
    shown = total if most is None else min(total, most)
    for c in range(shown):
        numbers = (_short(column[c], 5 if column is table.normal else 3) for column in columns)
        rows.append([str(table.id[c]), *numbers, str(table.state[c])])
    yield from _aligned(rows)
    if shown < total:
        yield f"  and {counted(total - shown, 'more contact')}: --verbose shows them"
    yield from _load_lines(table, most)


def _load_lines(table: ContactTable, most: int | None) -> Iterator[str]:
    if not table.bodies.size:
        return
    framed = len(table.load) > 0
    rows = [["body", "contacts", *(["load x", "load y", "load z"] if framed else [])]]
    shown = table.bodies.size if most is None else min(table.bodies.size, most)
    for b in range(shown):
        load = [_short(value, 5) for value in table.load[b]] if framed else []
        rows.append([str(table.bodies[b]), str(table.touched[b]), *load])
    yield from _aligned(rows)
    if shown < table.bodies.size:
        yield f"  and {counted(table.bodies.size - shown, 'more body')}: --verbose shows them"


def _short(value: float, digits: int) -> str:
    return f"{float(value):.{digits}g}"


def _aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield rows as lines, columns to the right but the last where it is text."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    words = rows[0][-1] == "state"
    for row in rows:
        cells = [f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True)]
        if words:
            cells[-1] = row[-1]
        yield f"  {'  '.join(cells)}"
