"""A problem as a LaTeX fragment that compiles with amsmath alone."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from cpbench.conversions.base import conversions
from cpbench.formulations.base import Problem
from cpbench.formulations.expressions import Map
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.report import show
from cpbench.report.tex import law, name, number, prose
from cpbench.report.text import one_line


def fragment(problem: Problem) -> str:
    """Write the law, and the data as matrices when small, else as spaces with their dimensions and nonzeros."""
    label = f" \\texttt{{{prose(one_line(problem.name))}}}" if problem.name else ""
    lines = ["% needs amsmath", f"\\noindent {prose(problem.title.capitalize())}{label}, {prose(problem.equation)}:"]
    names = [*problem.data(), *problem.maps()]
    lines += _aligned([f"& {law(relation, names)}" for relation in show.relations(type(problem))])
    lines += [_origin(problem)] if problem.provenance else []
    data = [
        _entry(label, value) if show.is_small(problem) else _space(problem, label, value)
        for label, value in problem.data().items()
    ]
    data += [_map(problem, label, F) for label, F in problem.maps().items()]
    return "\n".join([*lines, *_aligned(data)])


def _aligned(rows: list[str]) -> Iterator[str]:
    if rows:
        yield r"\begin{align*}"
        yield " \\\\\n".join(f"  {row}" for row in rows)
        yield r"\end{align*}"


def _origin(problem: Problem) -> str:
    steps: list[str] = []
    for step in problem.provenance:
        equation = conversions.get(step.conversion).equation if step.conversion in conversions else ""
        remarks = ", ".join(prose(part) for part in (equation, step.kind) if part)
        steps.append(f"\\texttt{{{prose(step.conversion)}}} ({remarks})")
    sentence = f"\\noindent From {prose(problem.provenance[0].source_node)} by {', then '.join(steps)}."
    return " ".join([sentence, *(prose(remark) for s in problem.provenance if (remark := show.slip_angle(s)))])


def _entry(label: str, value: Matrix | Vector) -> str:
    if value.size == 0:
        return f"{name(label)} &= \\text{{empty}}, {_size(value)}"
    rows = np.asarray(value)[:, None] if value.ndim == 1 else matrices.dense(value)
    body = r" \\ ".join(" & ".join(number(float(x)) for x in row) for row in rows)
    # array, not pmatrix: columns are aligned to the right, and there is no limit of ten of them
    return f"{name(label)} &= \\left[\\begin{{array}}{{{'r' * rows.shape[1]}}} {body} \\end{{array}}\\right]"


def _space(problem: Problem, label: str, value: Matrix | Vector) -> str:
    symbols = r" \times ".join(s if s[0].isdigit() else name(s) for s in show.shape(problem, label))
    row = f"{name(label)} &\\in \\mathbf{{R}}^{{{symbols}}} = \\mathbf{{R}}^{{{_size(value)}}}"
    if value.ndim == 1:
        return row
    count, whole = matrices.nnz(value), math.prod(value.shape)
    share = f", {100 * count / whole:.2g} \\%" if whole else ""
    return f"{row} && \\text{{{count} nonzeros{share}}}"


def _map(problem: Problem, label: str, F: Map) -> str:
    rows, columns = (s if s[0].isdigit() else name(s) for s in show.shape(problem, label))
    between = f"\\mathbf{{R}}^{{{columns}}} \\to \\mathbf{{R}}^{{{rows}}}"
    return f"{name(label)} &\\colon {between} && \\text{{{F.operations} operations, {F.rows} values}}"


def _size(value: Matrix | Vector) -> str:
    return r" \times ".join(map(str, value.shape))
