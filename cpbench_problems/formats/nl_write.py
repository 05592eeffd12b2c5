"""Writing problems as .nl files.

Rows that are affine are linear terms, all others expressions; the constant of an affine row is in its sides, that of a
pair in its expression. AMPL numbers nonlinear unknowns and rows first; here the order is the problem's, and the header
counts as nonlinear all up to the last one that is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations.expressions.operators import Operator
from cpbench.foundation.matrices import Vector
from cpbench.registry import NodeTable
from cpbench.storage.base import offset
from cpbench_problems.formats.mof_functions import Affine
from cpbench_problems.formats.mof_linear import kept, quadratic
from cpbench_problems.formats.nl_operators import SUM, UNWRITTEN, WRITTEN
from cpbench_problems.formats.nl_terms import Encoder, NLTerms

CONVEX = " convex"


@dataclass
class _Row:
    """A row, or the objective: its expression, the unknowns in it, its linear terms, its sides."""

    expression: bytes
    nonlinear: Sequence[int] = ()
    columns: Sequence[int] = ()
    values: Sequence[float] = ()
    sides: bytes = b""

    def terms(self) -> dict[int, float]:
        """Return the linear terms, 0 for unknowns that stand in the expression alone."""
        return dict.fromkeys(self.nonlinear, 0.0) | dict(zip(self.columns, self.values, strict=True))


@dataclass
class _Written:
    """The parts of a file. pairs : how many rows are complementary to an unknown."""

    lb: Vector
    ub: Vector
    start: Vector
    rows: list[_Row] = field(default_factory=list[_Row])
    objective: _Row | None = None
    defined: list[bytes] = field(default_factory=list[bytes])
    pairs: int = 0


WRITERS: NodeTable[Callable[[Any, Encoder], _Written]] = NodeTable("model of .nl")
"""Function that makes the parts of a file of a problem."""


def obstacle(problem: Any) -> str | None:
    """Return why a problem of a formulation that can be written cannot be, None where it can."""
    for name, F in problem.maps().items():
        unknown = sorted(
            operator.name.lower() for operator in UNWRITTEN & {Operator(int(h)) for h in np.unique(F.heads)}
        )
        if unknown:
            return f"{name} has the operator {unknown[0]}, for which .nl has no number"
    return None


def encoded(problem: Any, to: Encoder) -> bytes:
    """Return the file for a problem; raises FormatError."""
    why = obstacle(problem)
    if why is not None:
        raise FormatError(problem.name or problem.node, "", f"cannot be written as nl: {why}")
    model = WRITERS[problem.node](problem, to)
    return b"".join((_header(problem, model, to).encode(), *_segments(model, to)))


@WRITERS.of("nlp")
def _nlp(problem: Any, to: Encoder) -> _Written:
    model = _Written(problem.lb, problem.ub, problem.start)
    terms = NLTerms(problem.start.size, (problem.f, problem.g, problem.h))
    kinds = ["", *["2"] * problem.g.rows, *["4"] * problem.h.rows]
    model.objective, *model.rows = _rows(model, terms, kinds, to)
    return model


@WRITERS.of("ncp", "micp")
def _pairs(problem: Any, to: Encoder) -> _Written:
    n = problem.start.size
    lb, ub = (problem.lb, problem.ub) if problem.node == "micp" else (np.zeros(n), np.full(n, np.inf))
    model = _Written(lb, ub, problem.start, pairs=n)
    model.rows = _rows(model, NLTerms(n, (problem.F,)), [""] * n, to)
    for k, row in enumerate(model.rows):
        flags = 1 * bool(np.isfinite(lb[k])) + 2 * bool(np.isfinite(ub[k]))
        row.sides = to.key("5 " if to.letter == "g" else "5", flags, k + 1)
    return model


def _rows(model: _Written, terms: NLTerms, kinds: Sequence[str], to: Encoder) -> list[_Row]:
    """Return the rows of maps; `kinds` are those of their sides, "" where the constant stays with the row."""
    plain = [terms.affine(end) for end in terms.ends]
    model.defined, texts = terms.written([end for end, row in zip(terms.ends, plain, strict=True) if row is None], to)
    expressions = iter(texts)
    result: list[_Row] = []
    for end, row, kind in zip(terms.ends, plain, kinds, strict=True):
        if row is None:
            side = to.numbers(kind, 0.0) if kind else b""
            result.append(_Row(next(expressions), terms.columns(end), sides=side))
            continue
        constant = to.numbers("n", 0.0 if kind else row.constant)
        side = to.numbers(kind, -row.constant if row.constant else 0.0) if kind else b""
        result.append(_Row(constant, (), row.columns, row.values, side))
    return result


@WRITERS.of("qp")
def _qp(problem: Any, to: Encoder) -> _Written:
    n = problem.p.size
    model = _Written(problem.lb, problem.ub, np.zeros(n))
    pieces: list[bytes] = []
    unknowns: set[int] = set()
    for i, j, value in quadratic(problem.Q):
        c = 0.5 * value if i == j else value
        if i == j and 2.0 * c != value:
            raise FormatError(problem.name or "qp", f"Q[{i},{i}]", f"is {value}, half of which is no number of a file")
        product = to.key("o", WRITTEN[Operator.MUL])
        pieces.append(product + to.numbers("n", c) + product + to.key("v", i) + to.key("v", j))
        unknowns |= {i, j}
    constant = offset(problem.info)
    if constant or not pieces:
        pieces.append(to.numbers("n", constant))
    expression = pieces[0]
    if len(pieces) == 2:
        expression = to.key("o", WRITTEN[Operator.ADD]) + b"".join(pieces)
    elif len(pieces) > 2:
        expression = to.key("o", SUM) + to.entry(len(pieces)) + b"".join(pieces)
    p = problem.p.tolist()
    linear = [j for j in range(n) if p[j] or math.copysign(1.0, p[j]) < 0]
    model.objective = _Row(expression, sorted(unknowns), linear, [p[j] for j in linear])
    zero = to.numbers("n", 0.0)
    for M, sides, kind in ((problem.A, problem.b, "2"), (problem.C, problem.d, "4")):
        S = kept(M)
        for i, side in enumerate(sides.tolist()):
            inside = slice(S.indptr[i], S.indptr[i + 1])
            row = Affine(S.indices[inside].tolist(), S.data[inside].tolist(), 0.0)
            model.rows.append(_Row(zero, (), row.columns, row.values, to.numbers(kind, side)))
    return model


def _header(problem: Any, model: _Written, to: Encoder) -> str:
    n, m = model.start.size, len(model.rows)
    inside = [k for k, row in enumerate(model.rows) if row.nonlinear]
    equations = sum(row.sides[:1] == b"4" for row in model.rows)
    by_rows = 1 + max((max(model.rows[k].nonlinear) for k in inside), default=-1)
    objectives = 0 if model.objective is None else 1
    by_objective = 1 + max(model.objective.nonlinear, default=-1) if model.objective is not None else 0
    if by_rows and by_objective:  # those of both come first, so that there are no others
        by_rows = by_objective = max(by_rows, by_objective)
    curved = sum(bool(row.nonlinear) for row in model.rows) if model.pairs else 0
    low, both = np.isfinite(model.lb), np.isfinite(model.lb) & np.isfinite(model.ub)
    shifted = int((low & (model.lb != 0.0)).sum())
    ccons = (model.pairs - curved, curved, int(both.sum()), shifted) if model.pairs else (0, 0, 0, 0)
    remark = f"cpbench {problem.node}{CONVEX if problem.node == 'nlp' and problem.convex else ''}"
    name = " ".join(problem.name.split()).replace("#", "")
    jacobian = sum(len(row.terms()) for row in model.rows)
    gradient = len(model.objective.terms()) if model.objective is not None else 0
    lines = [
        f"{to.letter}3 1 1 0\t# problem {name} ({remark})",
        f" {n} {m} {objectives} 0 {equations}\t# vars, constraints, objectives, ranges, eqns",
        f" {1 + inside[-1] if inside else 0} {int(by_objective > 0)} {' '.join(map(str, ccons))}\t"
        "# nonlinear constrs, objs; ccons: lin, nonlin, nd, nzlb",
        " 0 0\t# network constraints: nonlinear, linear",
        f" {by_rows} {by_objective} {min(by_rows, by_objective)}\t# nonlinear vars in constraints, objectives, both",
        f" 0 0 {to.arithmetic} 1\t# linear network variables; functions; arith, flags",
        " 0 0 0 0 0\t# discrete variables: binary, integer, nonlinear (b,c,o)",
        f" {jacobian} {gradient}\t# nonzeros in Jacobian, obj. gradient",
        " 0 0\t# max name lengths: constraints, variables",
        f" {len(model.defined)} 0 0 0 0\t# common exprs: b,c,o,c1,o1",
    ]
    return "\n".join(lines).encode("ascii", "replace").decode() + "\n"


def _segments(model: _Written, to: Encoder) -> Iterator[bytes]:
    yield from model.defined
    for k, row in enumerate(model.rows):
        yield to.key("C", k) + row.expression
    if model.objective is not None:
        yield to.key("O", 0, 0) + model.objective.expression
    started = [k for k, value in enumerate(model.start.tolist()) if value or math.copysign(1.0, value) < 0]
    if started:
        yield to.key("x", len(started))
        yield from (to.entry(k, float(model.start[k])) for k in started)
    if model.rows:
        yield to.key("r")
        yield from (row.sides for row in model.rows)
    yield to.key("b")
    yield from (_bounds(low, high, to) for low, high in zip(model.lb.tolist(), model.ub.tolist(), strict=True))
    counts = np.zeros(model.start.size, dtype=int)
    for row in model.rows:
        counts[list(row.terms())] += 1
    if model.rows and counts.size:
        yield to.key("k", counts.size - 1)
        yield from (to.entry(count) for count in np.cumsum(counts)[:-1].tolist())
    for k, row in enumerate(model.rows):
        yield from _linear("J", k, row, to)
    if model.objective is not None:
        yield from _linear("G", 0, model.objective, to)


def _linear(key: str, number: int, row: _Row, to: Encoder) -> Iterator[bytes]:
    terms = row.terms()
    if terms:
        yield to.key(key, number, len(terms))
        yield from (to.entry(column, terms[column]) for column in sorted(terms))


def _bounds(low: float, high: float, to: Encoder) -> bytes:
    below, above = low > -math.inf, high < math.inf
    if below and above and repr(low) != repr(high):
        return to.numbers("0", low, high)
    if below and above:
        return to.numbers("4", low)
    return to.numbers("2", low) if below else to.numbers("1", high) if above else to.numbers("3")
