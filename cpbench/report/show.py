"""A problem as text: its law, its unknowns, how it came about, and its data in numbers or as block structure."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator
from dataclasses import fields
from html import escape
from typing import Any

import numpy as np

from cpbench.conversions.base import conversions, mathematics
from cpbench.formulations.base import Kind, Problem, Step
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.infix import formulas
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.report.text import counted, cut, one_line

SMALL = 12
"""Largest dimension of a problem that is printed in numbers."""
FORMULA = 200
"""Characters of the longest formula, or part of one, that is written out."""
PICTURE = 48
"""Largest side of a spy picture in dots; a Braille character has 2×4 of them."""


def text(problem: Problem) -> str:
    """Return everything `cpbench info --data` prints of a problem."""
    lines = [f"{problem.node}: {problem.title}", f"equation: {problem.equation} (numbers of Acary's lecture)"]
    if problem.name:
        lines.append(f"name: {one_line(problem.name)}")
    lines += ["", *(f"    {relation}" for relation in relations(type(problem))), ""]
    lines += [f"unknowns: {meaning(problem)}"]
    for step in problem.provenance:
        lines += ["", *history(step)]
    numbers = {**problem.sizes(), **scalars(problem)}
    lines += ["", "sizes: " + (", ".join(f"{symbol} = {value}" for symbol, value in numbers.items()) or "none")]
    show = _numbers if is_small(problem) else _structure
    for label, value in problem.data().items():
        lines += ["", *show(label, value, shape(problem, label))]
    for label, F in problem.maps().items():
        lines += ["", *_map(problem, label, F)]
    if problem.parameters:
        lines += ["", f"parameters: {', '.join(f'{k} = {v:.17g}' for k, v in problem.parameters.items())}"]
    return "\n".join(lines)


def problem_html(problem: Problem) -> str:
    """Return what `cpbench info --data` prints, the law above the rest, which keeps its columns."""
    head = escape(f"{problem.name or problem.node}: {problem.title}")
    # dots and frame are aligned where one font has both
    style = "line-height:1.15;font-family:DejaVu Sans Mono,monospace"
    return f'<b>{head}</b><pre style="{style}">{escape(text(problem))}</pre>'


def is_small(problem: Problem) -> bool:
    """Return whether the problem is shown in numbers: no dimension above SMALL."""
    return max(problem.sizes().values(), default=0) <= SMALL


def relations(node: type[Problem]) -> tuple[str, ...]:
    """Return the law of a formulation, relation by relation; the first line of its docstring where it declares none."""
    declared = getattr(node, "relations", ())
    return tuple(declared) or ((inspect.getdoc(node) or node.title).splitlines()[0],)


def meaning(problem: Problem) -> str:
    """Describe the parts of an answer, how long each is, and what follows from them."""
    doc = one_line(inspect.getdoc(problem.point_type) or "")
    sizes = ", ".join(f"{name} {size}" for name, size in problem.point_sizes.items())
    slacks = ", ".join(problem.slacks(problem.zero_point()))
    return f"{doc.removesuffix('.')} (numbers: {sizes})" + (f"; from them {slacks}" if slacks else "")


def history(step: Step) -> list[str]:
    """Describe one conversion a problem has gone through: knobs, equation, promise, and its mathematics if it is
    installed.
    """
    knobs = ", ".join(f"{k} = {cut(v, 60)}" for k, v in step.parameters.items())
    head = f"made by {step.conversion}" + (f" ({knobs})" if knobs else "")
    if step.conversion not in conversions:
        return [f"{head}, {step.kind}, from {step.source_node} {step.source}; this conversion is not installed here"]
    edge = conversions.get(step.conversion)
    lines = [f"{head}, {edge.equation or 'no equation number'}, {step.kind}, from {step.source_node} {step.source}"]
    lines += [f"    {line}".rstrip() for line in mathematics(edge)]
    remark = slip_angle(step)
    return [*lines, f"    {remark}"] if remark else lines


def slip_angle(step: Step) -> str:
    """Return the error to expect of an approximation by facets, "" for any other step."""
    facets = step.parameters.get("facets")
    if step.kind != str(Kind.APPROXIMATE) or not facets:
        return ""
    return (
        f"Expect a slip angle wrong by up to 180°/{facets} = {180.0 / float(facets):.4g}° at contacts that slide, "
        "whatever their speed."
    )


def scalars(problem: Problem) -> dict[str, Any]:
    """Return declared numbers that are not arrays, such as the dimension of contacts."""
    return {
        f.name: getattr(problem, f.name)
        for f in fields(problem)
        if not {"shape", "map"} & f.metadata.keys() and isinstance(getattr(problem, f.name), (bool, int, float))
    }


def shape(problem: Problem, label: str) -> tuple[str, ...]:
    """Return the dimensions of a field by symbol."""
    return next(f.metadata.get("shape") or f.metadata["map"] for f in fields(problem) if f.name == label)


def sized(symbols: tuple[str, ...], value: Matrix | Vector | Map, times: str = "×") -> str:
    """Format `n×m = 20×3`, `2` where a symbol is a number itself."""
    symbolic, numeric = times.join(symbols), times.join(map(str, value.shape))
    return numeric if symbolic == numeric else f"{symbolic} = {numeric}"


def entries(value: Matrix | Vector) -> str:
    """Describe how many entries, how full, how large."""
    if value.ndim == 1:
        vector: Vector = np.asarray(value)
        finite = vector[np.isfinite(vector)]
        if not finite.size:
            return "all infinite" if value.size else "empty"
        infinite = f", {value.size - finite.size} infinite" if finite.size < value.size else ""
        return f"from {_number(finite.min(), '0')} to {_number(finite.max(), '0')}{infinite}"
    count, whole = matrices.nnz(value), math.prod(value.shape)
    kind = "sparse" if matrices.is_sparse(value) else "dense"
    share = f" ({100 * count / whole:.2g} %)" if whole else ""
    nonzeros = counted(count, "nonzero")
    return f"{kind}, {nonzeros}{share}, max |.| {_number(matrices.max_abs(value), '0')}"


def _numbers(label: str, value: Matrix | Vector, symbols: tuple[str, ...]) -> Iterator[str]:
    """Yield `M =` beside the aligned rows; 0 is a dot. A vector is one row with ᵀ."""
    rows: Any = matrices.dense(value) if value.ndim == 2 else np.asarray(value)[None, :]
    if value.size == 0:
        yield f"{label} is empty ({sized(symbols, value)})"
        return
    cells = [[_number(x) for x in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    middle = (len(cells) - 1) // 2
    for k, row in enumerate(cells):
        head = f"{label} =" if k == middle else " " * (len(label) + 2)
        inside = "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        yield f"{head} [ {inside} ]" + ("ᵀ" if value.ndim == 1 else "")


def _structure(label: str, value: Matrix | Vector, symbols: tuple[str, ...]) -> Iterator[str]:
    yield f"{label} ({sized(symbols, value)}): {entries(value)}"
    if value.ndim == 2 and matrices.nnz(value):
        picture = spy(value)
        yield f"  ┌{'─' * len(picture[0])}┐"
        yield from (f"  │{line}│" for line in picture)
        yield f"  └{'─' * len(picture[0])}┘"


def _map(problem: Problem, label: str, F: Map) -> Iterator[str]:
    """Yield the size of a map, and the formulas where it is small."""
    symbols = shape(problem, label)
    if not F.rows:
        yield f"{label} is empty ({sized(symbols, F)})"
        return
    yield f"{label} ({sized(symbols, F)}): a map of {counted(F.operations, 'operation')}"
    if is_small(problem):
        unknown, size = next(iter(problem.point_sizes.items()))
        names = [f"{letter}{k}" for letter in ("y", unknown) for k in range(1, size + 1)]
        written = formulas(F, names[len(names) - F.inputs :], FORMULA)
        yield from (f"    {label}{k} = {formula}" for k, formula in enumerate(written, 1))


def spy(M: Matrix) -> list[str]:
    """Draw where the nonzeros are, in Braille dots: a dot is an entry, or a square block of entries that holds one.

    >>> spy(np.eye(8))
    ['⠑⢄⠀⠀', '⠀⠀⠑⢄']
    """
    rows, cols = M.shape
    step = max(rows, cols, PICTURE) / PICTURE
    coo = matrices.sparse(M).tocoo()
    kept = coo.data != 0
    dots = np.zeros((4 * math.ceil(math.ceil(rows / step) / 4), 2 * math.ceil(math.ceil(cols / step) / 2)), dtype=bool)
    dots[(coo.row[kept] / step).astype(np.int64), (coo.col[kept] / step).astype(np.int64)] = True
    cells = dots.reshape(dots.shape[0] // 4, 4, dots.shape[1] // 2, 2).transpose(0, 2, 1, 3)
    bits = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])  # the order of dots in U+2800
    codes = 0x2800 + (cells * bits).sum(axis=(2, 3))
    return ["".join(map(chr, line)) for line in codes.tolist()]


def _number(value: float, zero: str = ".") -> str:
    if value == 0:
        return zero
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    return f"{value:.4g}"
