"""A problem as lines for a reader, and as data for programs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.conversions import Conversion
from cpbench.formulations import Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.derivatives import derivative
from cpbench.foundation import matrices
from cpbench.foundation.plain_text import printable
from cpbench.foundation.plurals import counted
from cpbench.generators.collection import address_text
from cpbench.graph import Apply

LABELS = ("title", "description", "math_info", "family", "source", "licence", "citation")
SHOWN = 8
_KNOWN = {"id": "ids", "bodies": "bodies", "position": "positions", "frame": "frames"}
"""Parts of what is known of contacts, in words."""


def sizes_line(problem: Problem) -> str:
    """Return the sizes of a problem, as in `n = 20, m = 3, 61 nonzeros`."""
    sizes = ", ".join(f"{symbol} = {size}" for symbol, size in problem.sizes().items())
    nonzeros = sum(matrices.nnz(v) for v in problem.data().values() if v.ndim == 2)
    operations = sum(F.operations for F in problem.maps().values())
    return f"{sizes}, {nonzeros} nonzeros" + (f", {operations} operations" if problem.maps() else "")


def size_after(problem: Problem, edge: Conversion, apply: Apply) -> str:
    """Return the size that `edge` leads to: predicted where the edge can (~, at most), else measured by converting."""
    foreseen = edge.predict(problem)
    return sizes_line(apply(edge, problem)) if foreseen is None else f"~ {foreseen}"


def lines(address: str, problem: Problem, facts: Sequence[Any], starts: int = 0) -> Iterator[str]:
    """Yield formulation, sizes, data, origin and provenance of a problem, how many starting points its file has
    (`starts`), and the facts that were measured of it."""
    yield f"{address_text(address)}: {problem.title} {problem.equation}".rstrip()
    yield f"  node         {problem.node}"
    yield f"  name         {printable(problem.name)}"
    yield f"  fingerprint  {problem.fingerprint}"
    for symbol, size in problem.sizes().items():
        yield f"  {symbol:<12} {size}"
    for name, value in problem.data().items():
        yield f"  {name:<12} {_describe(value)}"
    for name, F in problem.maps().items():
        yield f"  {name:<12} map {F.rows}x{F.inputs}, {F.operations} operations, {F.constants.size} constants"
        yield f"  {'':<12} {_derivative_line(F)}"
    for name, value in problem.parameters.items():
        yield f"  parameter    {name} = {value:.17g}"
    for label in LABELS:
        text = getattr(problem.info, label)
        if text:
            yield f"  {label:<12} {printable(text)}"
    for key, value in problem.info.properties.items():
        yield printable(f"  property     {key} = {_short(value)}")
    if starts:
        yield f"  starts       {counted(starts, 'guess', 'guesses')} in the file: --start file:all runs from each"
    if isinstance(problem, ContactProblem):
        yield from _contact_lines(problem)
    for step in problem.provenance:
        parameters = ", ".join(f"{k}={v}" for k, v in step.parameters.items())
        origin = f"from {step.source_node} {step.source}"
        yield f"  made by      {step.conversion}({parameters}), {step.kind}, {origin}"
    for fact in facts:
        yield f"  fact         {fact}"


def _derivative_line(F: Map) -> str:
    """Return how many entries the Jacobian of a map may have, and what of the map is affine."""
    compiled = F.compiled
    affine = int((np.diff(compiled.C.indptr) == 0).sum())
    entries = counted(derivative(F)[1].size, "entry", "entries")
    return (
        f"Jacobian of {entries}, {affine} of {counted(F.rows, 'row')} affine, "
        f"affine part of {counted(compiled.M.nnz, 'entry', 'entries')}"
    )


def _contact_lines(problem: ContactProblem) -> Iterator[str]:
    """Yield the place of a problem in a sequence, and what is known of its contacts."""
    if (place := problem.sequence) is not None:
        yield f"  sequence     {printable(place.name)}: step {place.step}, at {place.time:g} s, dt = {place.dt:g} s"
    contacts = problem.contacts
    if contacts is not None and contacts.count:
        known = [word for part, word in _KNOWN.items() if contacts.knows(part)]
        yield f"  contacts     {', '.join(known)} known"


@dataclass(frozen=True)
class StepFacts:
    """A step of a sequence in short: `name` of the sequence, number of `contacts`, `time` and `dt` [s], and whether all
    contacts have `ids`."""

    name: str
    contacts: int
    time: float
    dt: float
    ids: bool


def step_of(problem: Problem) -> StepFacts | None:
    """Return the facts of a step of a sequence, None of any other problem."""
    if not isinstance(problem, ContactProblem) or problem.sequence is None:
        return None
    place, contacts = problem.sequence, problem.contacts
    ids = contacts is not None and contacts.id.size == problem.nc
    return StepFacts(place.name, problem.nc, place.time, place.dt, ids)


def sequence_lines(steps: Iterable[StepFacts]) -> Iterator[str]:
    """Yield a line for each sequence: its steps, dt, end, contacts from and to, and whether they have ids."""
    by_name: dict[str, list[StepFacts]] = {}
    for step in steps:
        by_name.setdefault(step.name, []).append(step)
    for name, members in by_name.items():
        dt, contacts = _range([step.dt for step in members]), _range([step.contacts for step in members])
        with_ids = sum(step.ids for step in members)
        ids = "ids in all" if with_ids == len(members) else f"ids in {with_ids}" if with_ids else "no ids"
        end = max(step.time for step in members)
        yield (
            f"sequence {printable(name)}: {counted(len(members), 'step')}, dt = {dt} s, to {end:g} s, "
            f"{contacts} contacts, {ids}"
        )


def _range(values: Sequence[float]) -> str:
    return " to ".join(f"{value:g}" for value in dict.fromkeys((min(values), max(values))))


def _short(value: Any) -> Any:
    """Return a list of more than SHOWN items, as the names of unknowns, by its first ones and its length."""
    if not isinstance(value, (list, tuple)) or len(value) <= SHOWN:
        return value
    return f"{', '.join(map(str, value[:SHOWN]))}, ... ({len(value)})"


def _describe(value: matrices.Matrix | matrices.Vector) -> str:
    if value.ndim == 1:
        return f"vector of {value.size}, max |.| {matrices.max_abs(value):.3g}"
    rows, cols = value.shape
    storage_kind = "sparse" if matrices.is_sparse(value) else "dense"
    return f"{storage_kind} {rows}x{cols}, {matrices.nnz(value)} nonzeros, max |.| {matrices.max_abs(value):.3g}"


def record(address: str, problem: Problem, facts: Sequence[Any], starts: int = 0) -> dict[str, Any]:
    """Return what `lines` yields as data that JSON takes."""
    place = problem.sequence if isinstance(problem, ContactProblem) else None
    return {
        "address": address,
        "node": problem.node,
        "title": problem.title,
        "equation": problem.equation,
        "relations": list(problem.relations),
        "name": problem.name,
        "fingerprint": problem.fingerprint,
        "sizes": problem.sizes(),
        "data": {name: _data_record(value) for name, value in problem.data().items()},
        "maps": {
            name: {
                "shape": list(F.shape),
                "operations": F.operations,
                "constants": F.constants.size,
                "jacobian_entries": int(derivative(F)[1].size),
                "affine_rows": int((np.diff(F.compiled.C.indptr) == 0).sum()),
                "affine_entries": F.compiled.M.nnz,
            }
            for name, F in problem.maps().items()
        },
        "parameters": problem.parameters,
        "unknowns": problem.point_sizes,
        "starts": starts,
        "sequence": None if place is None else vars(place),
        "info": {label: getattr(problem.info, label) for label in LABELS},
        "properties": {key: _plain(value) for key, value in problem.info.properties.items()},
        "provenance": [
            {
                "conversion": step.conversion,
                "parameters": {k: _plain(v) for k, v in step.parameters.items()},
                "kind": step.kind,
                "source_node": step.source_node,
                "source": step.source,
            }
            for step in problem.provenance
        ],
        "facts": [{k: _plain(v) for k, v in fact.record().items()} for fact in facts],
    }


def _data_record(value: matrices.Matrix | matrices.Vector) -> dict[str, Any]:
    record: dict[str, Any] = {"shape": list(value.shape), "max_abs": _plain(matrices.max_abs(value))}
    if value.ndim == 2:
        record |= {"storage": "sparse" if matrices.is_sparse(value) else "dense", "nonzeros": matrices.nnz(value)}
    return record


def _plain(value: Any) -> Any:
    """Return a value that JSON has: NumPy scalars and arrays unpacked, infinities and NaN by name."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (np.ndarray, list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value if isinstance(value, (bool, int, float, str)) or value is None else str(value)
