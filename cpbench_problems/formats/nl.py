"""AMPL's .nl format, which AMPL, Pyomo and JuMP write and many solvers read: in text (g), and read in binary (b), too.

nlp    min f(z); rows g ≥ 0, rows h = 0; bounds of z
qp     min ½zᵀQz + pᵀz; rows Az ≥ b, rows Cz = d; bounds of z
ncp    row k complementary to unknown k, z ≥ 0; micp: z between its bounds

The first line of a written file names the formulation behind `# problem NAME`, as a comment. A file without that is
what its rows say (`model_problem`): with complementarity conditions a complementarity problem where it is square
(`squares`), else a qp or an nlp. Binary and integer variables, logical constraints, imported functions and special
ordered sets are refused. The parameters of maps are written as numbers, without their names.
"""

from __future__ import annotations

import dataclasses
import logging
import math
import re
from pathlib import Path

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations.base import Problem
from cpbench.storage.base import Format, formats, no_member, read_head, stem
from cpbench_problems.formats.model_problem import problem_of
from cpbench_problems.formats.mof_functions import Affine, Function, Nonlinear, Quadratic
from cpbench_problems.formats.mof_model import Model, ModelRow, slack
from cpbench_problems.formats.nl_segments import LinearTerms, Segments, read_segments
from cpbench_problems.formats.nl_write import NODES, encoded
from cpbench_problems.formats.plain_rows import PlainRows
from cpbench_problems.formats.problem_model import CONVEX
from cpbench_problems.formats.squares import squared

logger = logging.getLogger("cpbench.storage")
SUFFIX = ".nl"
COLUMNS = ".col"
"""Suffix of the file with the names of the variables, as AMPL and Pyomo write it beside the .nl."""
LARGEST_FILE = 1 << 28
"""Bytes of a file that is read, in some minutes."""
_MARK = re.compile(r"(.*?)\s*\(cpbench (nlp convex|nlp|ncp|micp|qp)\)")


class NL(Format):
    """One problem a file, which is written in text."""

    name = "nl"
    summary = "AMPL's .nl, text or binary: programs and complementarity problems, as AMPL, Pyomo and JuMP write them"
    suffixes = (SUFFIX,)
    writes = NODES

    def recognises(self, path: Path, head: bytes) -> bool:
        return path.suffix.lower() == SUFFIX

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        return read(path)

    def encode(self, problem: Problem, *, compress: bool) -> bytes:
        return encoded(problem)


def read(path: Path) -> Problem:
    """Read the problem in a file; raises FormatError."""
    read_head(path)
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise FormatError(path, "", f"has {size / 1e6:.0f} MB, at most {LARGEST_FILE / 1e6:.0f} are read")
    segments = read_segments(path, path.read_bytes())
    remark = segments.header.remark
    marked = _MARK.fullmatch(remark)
    name, formulation = (marked[1], marked[2]) if marked else (remark, "")
    node = formulation.removesuffix(CONVEX)
    # the functions of a written nlp are kept as they are, also where they are quadratic
    model, left_out = model_of(path, segments, quadratic=node != "nlp"), ""
    if model.complementary:
        model, left_out = squared(model, f"{model.sense}imized" if model.objective is not None else "")
    own = stem(path) if name in ("", "unknown") else name
    convex, names = formulation == f"nlp{CONVEX}", _names(path, len(model.names))
    problem = problem_of(model, path, own, node, convex, names)
    if not left_out:
        return problem
    logger.warning("%s: %s", path, left_out)
    return dataclasses.replace(problem, info=dataclasses.replace(problem.info, description=left_out))


def _names(path: Path, count: int) -> list[str]:
    """Return the names of the variables, a line each in the .col file beside the .nl; none where that has another
    number of lines, which a warning says."""
    beside = path.with_suffix(COLUMNS)
    if not beside.is_file() or beside.stat().st_size > LARGEST_FILE:
        return []
    names = beside.read_text(encoding="utf-8", errors="replace").splitlines()
    if len(names) == count:
        return names
    logger.warning("%s: has %d names, %s has %d variables: the names are not used", beside, len(names), path, count)
    return []


formats.add("nl", NL())


# -------------------------------------------------------------------------------------------------- the model of a file


def model_of(path: Path, segments: Segments, quadratic: bool) -> Model:
    """Return the model; `quadratic`: an objective that is quadratic becomes that. Raises FormatError."""
    model = Model(
        source=path,
        name="",
        description="",
        names=[f"v{k}" for k in range(segments.header.variables)],
        lb=np.array([low for low, _ in segments.bounds], float),
        ub=np.array([high for _, high in segments.bounds], float),
        start=segments.start,
        functions=segments.functions,
        complementary=bool(segments.beside),
    )
    beside = {row: column for column, (row, _) in segments.beside.items()}
    for row in range(segments.header.constraints):
        function = _function(segments, segments.rows[row], segments.linear.get(row, []), quadratic=False)
        if row in beside:
            _pair(path, model, segments, beside[row], function)
        else:
            model.constrain(function, *segments.sides[row])
    if segments.objective is not None:
        model.sense, value = segments.objective
        model.objective = _function(segments, value, segments.gradient, quadratic)
    return model


def _function(segments: Segments, value: int, linear: LinearTerms, quadratic: bool) -> Function:
    """Return a row: affine where its expression is a number."""
    build = segments.functions.build
    columns, values = [column for column, _ in linear], [c for _, c in linear]
    number = build.number(value)
    if number is not None and (number or math.copysign(1.0, number) > 0):
        return Affine(columns, values, number)
    plain = PlainRows(build).function(value) if quadratic else None
    if isinstance(plain, Quadratic):
        affine = plain.affine
        return Quadratic(plain.products, Affine(affine.columns + columns, affine.values + values, affine.constant))
    return Nonlinear(segments.sum(value, [term for term in linear if term[1]]))


def _pair(path: Path, model: Model, segments: Segments, column: int, function: Function) -> None:
    """Add a pair whose flags have to say which bounds the variable has."""
    row, flags = segments.beside[column]
    low, high = model.lb[column], model.ub[column]
    bounds = 1 * bool(np.isfinite(low)) + 2 * bool(np.isfinite(high))
    if bounds != flags and low != high:
        raise FormatError(
            path,
            f"r, row {row + 1}",
            f"is complementary to v{column} by {flags}, and {low:g} <= v{column} <= {high:g} is kind {bounds}",
        )
    model.pairs[column] = slack(segments.functions, ModelRow(function, 0.0))
