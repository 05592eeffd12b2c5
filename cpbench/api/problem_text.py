"""A problem as lines for a reader, and as data for programs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cpbench.conversions import Conversion
from cpbench.formulations import Problem
from cpbench.foundation import matrices
from cpbench.foundation.plain_text import printable
from cpbench.generators.collection import address_text
from cpbench.graph import Apply

if TYPE_CHECKING:
    from cpbench.formulations.facts import Fact

LABELS = ("title", "description", "math_info", "family", "source", "licence", "citation")
SHOWN = 8


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


def lines(address: str, problem: Problem, facts: Sequence[Fact]) -> Iterator[str]:
    """Yield formulation, sizes, data, origin and provenance of a problem, and the facts that were measured of it."""
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
    for name, value in problem.parameters.items():
        yield f"  parameter    {name} = {value:.17g}"
    for label in LABELS:
        text = getattr(problem.info, label)
        if text:
            yield f"  {label:<12} {printable(text)}"
    for key, value in problem.info.properties.items():
        yield printable(f"  property     {key} = {_short(value)}")
    for step in problem.provenance:
        parameters = ", ".join(f"{k}={v}" for k, v in step.parameters.items())
        origin = f"from {step.source_node} {step.source}"
        yield f"  made by      {step.conversion}({parameters}), {step.kind}, {origin}"
    for fact in facts:
        yield f"  fact         {fact}"


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


def record(address: str, problem: Problem, facts: Sequence[Fact]) -> dict[str, Any]:
    """Return what `lines` yields as data that JSON takes."""
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
            name: {"shape": list(F.shape), "operations": F.operations, "constants": F.constants.size}
            for name, F in problem.maps().items()
        },
        "parameters": problem.parameters,
        "unknowns": problem.point_sizes,
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
