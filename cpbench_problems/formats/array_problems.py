"""Named arrays as problems: the form is chosen by the set of their names, and every array that it does not have is
refused."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import FormatError, ProblemError
from cpbench.formulations import AVI, LCP, QP, ConeQP, FrictionContact
from cpbench.formulations.base import Info, Problem, formulations
from cpbench.formulations.conic import cone_fields
from cpbench.formulations.contact import ContactProblem
from cpbench.foundation import matrices, text
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import Vector
from cpbench.storage.arrays import SPARSE, sparse_from_parts
from cpbench.storage.base import OFFSET, build, stem
from cpbench_problems.applications import boxed_problem, game_problem, least_squares_problem
from cpbench_problems.formats import array_forms, engine_arrays, two_sided
from cpbench_problems.formats.array_forms import ArrayForm
from cpbench_problems.formats.file_rows import ConicRows, FileRows, PackageRows, remember
from cpbench_problems.formats.named_arrays import (
    NamedArrays,
    Shape,
    absent,
    counted,
    require_shapes,
    require_whole,
    shapes_of,
    symmetrized,
)
from cpbench_problems.formats.program_forms import Program, Rows
from cpbench_problems.formats.two_sided import INFINITE, infinite, require_sides, uncrossed

FORM = "form"
"""Property of a problem that says in which form its arrays were."""


def choose(path: Path, shapes: Mapping[str, Shape | None], only: ArrayForm | None = None) -> tuple[ArrayForm, str]:
    """Return the form of arrays of these names, and a text that says so.

    `only` is the form that was asked for. Raises FormatError with each array that is too many or missing.
    """
    if len(shapes.keys() - {"format"} - set(SPARSE)) <= (not shapes.keys() >= set(SPARSE)):
        raise FormatError(path, "", "holds one matrix or vector: cpbench pack makes a problem of several files")
    fits = array_forms.fitting(shapes) if only is None else [only]
    if len(fits) > 1 and {d.node for d in fits[:2]} == {"fc", "afc"}:  # mu alone tells them apart
        mu = shapes["mu"] or ()
        elliptic = len(mu) == 2 and mu[1] == 2 and mu[0] > 1
        fits = [d for d in fits if (d.node == "afc") == elliptic]
    form = fits[0] if fits else array_forms.nearest(shapes)
    if only is None and form.arrays.keys().isdisjoint(shapes):
        cause = "have names of no form; an lcp is M, q, a QP P, q, G, h (cpbench list formats has all): rename them"
        raise FormatError(path, ", ".join(sorted(shapes)), cause)
    given = [name for name in form.known() if name in shapes]
    dropped = absent(form, shapes)
    _require_one_reading(path, fits, shapes.keys() - dropped, only)
    if (wrong := array_forms.refusal(form, shapes.keys() - dropped)) is not None:
        raise FormatError(path, *wrong)
    text = f"{form.name} ({', '.join(name for name in given if name in form.arrays)})"
    if others := [d.name for d in fits[1:]]:
        text += f", which {' and '.join(others)} would fit too"
    for name in given:
        if name in form.aside:
            text += f"; {name}, {form.aside[name]}, is no part of it"
    if form.name == "linprog" and "bounds" not in shapes:
        text += "; x ≥ 0, which it has where no bounds are given"
    return form, text


def _require_one_reading(path: Path, fits: list[ArrayForm], names: set[str], only: ArrayForm | None) -> None:
    """Raise FormatError where arrays of these names mean one thing or another."""
    squares, game = array_forms.LEAST_SQUARES, array_forms.GAME
    if only is not None:
        return
    if frozenset(names) == game.needs:
        raise FormatError(path, "", "holds matrices A and B alone: --format game makes a bimatrix game of them")
    if squares.needs <= names <= set(squares.arrays) and not any(d.needs <= names for d in fits):
        raise FormatError(path, "", "holds a matrix A and b alone: --format least-squares makes min ½‖Ax − b‖² of them")
    both = [*fits, squares] if squares.needs <= names <= set(squares.arrays) else fits
    if why := array_forms.ambiguity(both, names):
        raise FormatError(path, "", why)


def build_problem(path: Path, values: Mapping[str, Any], form: ArrayForm, text: str, name: str = "") -> Problem:
    """Return the problem that arrays make in a form, with the `text` of `choose`; raises FormatError with the array
    that does not fit."""
    dropped = absent(form, shapes_of(values))
    arrays = NamedArrays(path, {name: value for name, value in values.items() if name not in dropped})
    require_shapes(path, form, shapes_of(arrays.values))
    rows = None
    if form.meaning is not None and not form.own:
        (cls, parts, properties), rows = make_program(arrays, form.name, form.meaning)
    else:
        cls, parts, properties = _MAKERS.get(form.name, _own)(arrays, form)
    known: Info = parts.pop("info", Info())
    info = dataclasses.replace(known, properties={**known.properties, **properties, FORM: text})
    problem = build(path, cls, "", name=name or stem(path), info=info, **parts)
    if rows is not None:
        remember(problem, rows)
    return problem


def _own(arrays: NamedArrays, form: ArrayForm) -> Made:
    cls, notes = formulations.get(form.node), dict[str, str]()
    if issubclass(cls, ContactProblem):
        arrays, notes = engine_arrays.in_order(arrays, form, cls)
    parts: dict[str, Any] = {}
    for name, symbols in form.arrays.items():
        if name not in arrays:
            continue
        if len(symbols) == 2:
            # Q is the one matrix that formulations require to be symmetric
            parts[name] = arrays.symmetric(name) if name == "Q" else arrays.matrix(name)
        else:
            parts[name] = arrays.vector(name) if symbols else int(arrays.number(name, 0))
    if issubclass(cls, ContactProblem) and "dimension" not in parts and len(parts["mu"]):
        parts["dimension"] = _dimension(arrays, form, cls, parts)
    return cls, uncrossed(_whole_qp(parts)) if cls is QP else parts, notes


def _dimension(arrays: NamedArrays, form: ArrayForm, cls: type[ContactProblem], parts: Mapping[str, Any]) -> int:
    """Return the rows of a contact; raises FormatError where there is no whole number of them."""
    (symbol,) = form.arrays[cls.rows_of]
    # the vector itself may be left out, where it is zero
    rows = next(
        value.shape[form.arrays[name].index(symbol)] for name, value in parts.items() if symbol in form.arrays[name]
    )
    nc = len(parts["mu"])
    if rows % nc:
        allowed = " or ".join(map(str, cls.dimensions))
        raise arrays.error(
            "mu", f"has {nc} contacts, {cls.rows_of} has {rows} rows, expected {allowed} for each contact"
        )
    return rows // nc


def _whole_qp(parts: dict[str, Any]) -> dict[str, Any]:
    """Return the data of a QP, with no rows and infinite bounds for what is absent."""
    n, Q = parts["p"].size, parts["Q"]
    none = matrices.zeros(0, n, Q if Q.ndim == 2 else np.zeros((0, 0)))
    absent = {"A": none, "b": np.zeros(0), "C": none, "d": np.zeros(0)}
    return {**absent, "lb": np.full(n, -np.inf), "ub": np.full(n, np.inf), **parts}


def _box(arrays: NamedArrays, form: ArrayForm) -> Made:
    """Bounds alone, and a Hessian by rows."""
    parts = {key: arrays.values[key] for key in ("data", "indices", "indptr", "shape")}
    Q = require_whole(arrays.path, "data", sparse_from_parts(arrays.path, "", counted(parts)))
    bounds = {"lb": infinite(arrays.vector("l")), "ub": infinite(arrays.vector("u"))}
    return QP, uncrossed(_whole_qp({"Q": Q, "p": arrays.vector("q"), **bounds})), {}


def _contactbench(arrays: NamedArrays, form: ArrayForm) -> Made:
    """Rows (T1, T2, N) of each contact become (N, T1, T2): W = PGPᵀ, q = Pg."""
    G, g, mu = arrays.matrix("G"), arrays.vector("g"), arrays.vector("mus")
    if G.shape != (3 * mu.size, 3 * mu.size):
        text = f"has shape {G.shape} and g {g.size} numbers, expected {3 * mu.size} (3 for each of {mu.size} contacts)"
        raise arrays.error("G", text)
    order = (np.arange(g.size).reshape(-1, 3)[:, [2, 0, 1]]).reshape(-1)
    return FrictionContact, {"W": G[order][:, order], "q": g[order], "mu": mu}, {}


def _boxed(arrays: NamedArrays, form: ArrayForm) -> Made:
    """Return the AVI that `boxed_problem` makes."""
    A = arrays.matrix("A")
    findex = arrays.vector("findex", arrays.vector("b").size, -1.0)
    try:
        made = boxed_problem(
            A, arrays.vector("b"), infinite(arrays.vector("lo")), infinite(arrays.vector("hi")), findex
        )
    except ProblemError as cause:
        raise arrays.error(cause.field.removeprefix("boxed."), cause.cause) from None
    return AVI, {name: getattr(made, name) for name in ("M", "q", "lb", "ub", "info")}, {}


def _game(arrays: NamedArrays, form: ArrayForm) -> Made:
    """Return the LCP that `applications.game` makes."""
    try:
        made = game_problem(arrays.matrix("A"), arrays.matrix("B"))
    except ProblemError as cause:
        raise arrays.error(cause.field.rpartition(".")[2], cause.cause) from None
    return LCP, {**made.data(), "info": made.info}, {}


_MAKERS: Mapping[str, Callable[[NamedArrays, ArrayForm], Made]] = {
    "box QP": _box,
    "ContactBench": _contactbench,
    "boxed LCP": _boxed,
    "game": _game,
    array_forms.ENGINE.name: engine_arrays.engine_step,
    array_forms.DELASSUS.name: engine_arrays.delassus,
}


# ------------------------------------------------------------------------------------------------- programs of packages
# Arrays of a form of `program_forms` as a quadratic or a conic program.
#
# Where bounds have no arrays of their own, a row with one unknown and the coefficient ±1 is a bound: OSQP, SCS and
# Clarabel have no others. Rows without a side are left out. `FileRows` keeps where each row is.

Made = tuple[type[Problem], dict[str, Any], Mapping[str, Any]]
"""A formulation, its data, and properties to remember."""
TRIANGLE = {"OSQP": "upper", "Clarabel": "upper", "SCS": "upper", "HiGHS": "lower"}
"""The triangle of the Hessian that a package takes."""
_CLARABEL = re.compile(r"(Zero|Nonnegative|SecondOrder)Cone(?:T)?\((\d+)\)")
_OTHERS = {"s": "positive semidefinite matrices", "ep": "exponentials", "ed": "exponentials", "p": "powers"}
"""Cones of SCS and CVXOPT that no formulation has."""


@dataclass(frozen=True, eq=False)
class RowBlock:
    """Rows of one matrix of a file, lower ≤ Ax ≤ upper; `disks` : the sizes of its cones of second order, whose rows
    upper − Ax are its last; `order` : the number of each row in the file, None where it is the same."""

    name: str
    A: sp.csr_array
    lower: Vector
    upper: Vector
    disks: tuple[int, ...] = ()
    order: Any = None


def make_program(arrays: NamedArrays, form: str, meaning: Program) -> tuple[Made, PackageRows | None]:
    """Return the program of a form, and where its rows are; raises FormatError."""
    blocks = [_block(arrays, form, rows) for rows in meaning.rows if rows.matrix]
    if meaning.squares:
        return _squares(arrays, meaning, blocks), None
    p = meaning.sign * arrays.vector(meaning.linear) + 0.0  # no -0
    blocks = [_wide(block, p.size) for block in blocks]
    Q = _hessian(arrays, form, meaning.hessian, p.size)
    lb, ub = _bounds(arrays, form, meaning, p.size)
    if any(block.disks for block in blocks):
        return _conic(Q, p, blocks, meaning)
    for block in blocks:
        require_sides(arrays.path, block.lower, block.upper, block.name)
    parts, rows = _quadratic(meaning, blocks, lb, ub)
    if not any(matrices.is_sparse(value) for value in arrays.values.values()):
        parts |= {name: parts[name].toarray() for name in ("A", "C")}
    count = sum(int((np.isinf(block.lower) & np.isinf(block.upper)).sum()) for block in blocks)
    left_out = f"{text.counted(count, 'row')} without a side (none, or beyond {INFINITE:g})"
    offset = arrays.number(meaning.constant, 0.0)
    properties = ({OFFSET: offset} if offset else {}) | ({"left_out": left_out} if count else {})
    return (QP, {"Q": Q, "p": p, **parts}, properties), rows


def _hessian(arrays: NamedArrays, form: str, name: str, n: int) -> Any:
    """Return the Hessian, made whole where the package stores one triangle; zeros where there is none."""
    if name not in arrays:
        return np.zeros((n, n))
    P, triangle = arrays.matrix(name), TRIANGLE.get(form)
    if triangle is not None and P.shape == (n, n):
        other = sp.tril(sp.coo_array(P), -1) if triangle == "upper" else sp.triu(sp.coo_array(P), 1)
        if not other.count_nonzero():
            return symmetrized(P, triangle)
    return arrays.symmetric(name)


def _block(arrays: NamedArrays, form: str, rows: Rows) -> RowBlock:
    A = arrays.matrix(rows.matrix, 0)
    column = rows.transposed and rows.matrix in arrays and arrays.values[rows.matrix].ndim == 2
    A = sp.csr_array(A.T if column else A)
    A.eliminate_zeros()
    if rows.cone:
        upper = infinite(arrays.vector(rows.upper))
        kinds = _clarabel(arrays) if form == "Clarabel" else _cones(arrays, form, upper.size)
        if sum(size for _, size in kinds) != upper.size:
            sizes = " + ".join(str(size) for _, size in kinds)
            raise arrays.error(rows.upper, f"has {upper.size} numbers, the cones have {sizes}")
        kind = np.repeat([kind for kind, _ in kinds], [size for _, size in kinds])
        order = np.argsort(kind == "SecondOrder", kind="stable")
        disks = tuple(size for kind, size in kinds if kind == "SecondOrder" and size)
        lower = np.where(kind == "Zero", upper, -np.inf)
        return RowBlock(rows.matrix, A[order], lower[order], upper[order], disks, order)
    m = max([A.shape[0], *(arrays.vector(side).size for side in (rows.lower, rows.upper) if side)])
    if m > A.shape[0] and form == "DAQP":  # the first sides are those of the first unknowns
        n = A.shape[1] or m
        A = sp.csr_array(sp.vstack([sp.eye_array(m - A.shape[0], n), A.reshape(A.shape[0], n)]))
    lower, upper = arrays.vector(rows.lower, m, -np.inf), arrays.vector(rows.upper, m, np.inf)
    for name, size in (("n", A.shape[1]), ("m", m)) if form == "OSQP" else ():
        if arrays.number(name, size) != size:
            raise arrays.error(name, f"is {arrays.number(name, size):g}, expected {size} as {rows.matrix} has")
    sense = arrays.vector("sense", m) if form == "DAQP" else np.zeros(m)
    if sense.size != m or ((sense != 0) & ((sense != 5) | (lower != upper))).any():
        cause = "is not 0 everywhere, or 5 for equal sides: binary and soft rows have no formulation"
        raise arrays.error("sense", cause)
    if arrays.number("factorized", 0.0):
        raise arrays.error("factorized", "is true: the matrix is the inverse of a factor, expected the Hessian itself")
    if rows.transposed:  # the first conditions of quadprog are equations
        equations = arrays.number("meq", 0.0)
        upper = np.where(np.arange(m) < equations, lower, upper)
        if not 0 <= equations <= m or equations != int(equations):
            raise arrays.error("meq", f"is {equations:g}, expected a number of the {m} columns of {rows.matrix}")
    return RowBlock(rows.matrix, A, infinite(lower), infinite(upper))


def _wide(block: RowBlock, n: int) -> RowBlock:
    """Return rows that are absent with n unknowns."""
    return block if any(block.A.shape) else dataclasses.replace(block, A=sp.csr_array((0, n)))


def _cones(arrays: NamedArrays, form: str, m: int) -> list[tuple[str, int]]:
    """Return kinds and sizes of the cones of SCS and CVXOPT, in the order of their rows."""
    start = "dims." if form.startswith("CVXOPT") else ""
    for name, what in _OTHERS.items():
        if arrays.vector(start + name).any():
            raise arrays.error(start + name, f"is a cone of {what}, which no formulation has")
    q = [int(size) for size in arrays.vector(f"{start}q")]
    zero = int(arrays.number("z", arrays.number("f", 0.0))) if not start else 0
    half = arrays.number(f"{start}l", m - zero - sum(q) if start else 0.0)
    if half < 0 or half != int(half) or zero + half + sum(q) != m:
        cause = f"is {half:g}, with {zero + sum(q)} rows in other cones, expected {m} rows in all"
        raise arrays.error(f"{start}l", cause)
    return [("Zero", zero), ("Nonnegative", int(half)), *(("SecondOrder", size) for size in q)]


def _clarabel(arrays: NamedArrays) -> list[tuple[str, int]]:
    """Return kinds and sizes of cones that are printed as Clarabel prints them."""
    result: list[tuple[str, int]] = []
    for word in map(str, np.ravel(arrays.values["cones"])):
        if (match := _CLARABEL.fullmatch(word)) is None:
            cause = f"has {text.printable(word[:40])}, expected kinds with sizes, as ZeroConeT(2), NonnegativeConeT(3)"
            raise arrays.error("cones", f"{cause} or SecondOrderConeT(3)")
        result.append((match[1], int(match[2])))
    return result


def _bounds(arrays: NamedArrays, form: str, meaning: Program, n: int) -> tuple[Vector, Vector]:
    """Return the bounds that have arrays of their own; SciPy's `linprog` has 0 below where none is given."""
    lb, ub = np.full(n, -np.inf), np.full(n, np.inf)
    if form == "linprog":
        pairs = arrays.values["bounds"] if "bounds" in arrays else np.array([0.0, np.inf])
        if pairs.shape not in ((2,), (1, 2), (n, 2)) or pairs.dtype.kind not in "biuf":
            raise arrays.error("bounds", f"has the shape {pairs.shape}, expected {n} x 2")
        lb[:], ub[:] = np.broadcast_to(pairs, (n, 2)).T
        lb[np.isnan(lb)], ub[np.isnan(ub)] = -np.inf, np.inf
    for rows in meaning.rows:
        if rows.matrix:
            continue
        at = arrays.vector(rows.at).astype(np.int64) if rows.at in arrays else np.arange(n)
        if at.size and not (at.min() >= 0 and at.max() < n):
            raise arrays.error(rows.at, f"has {at.min()} to {at.max()}, expected unknowns from 0 to {n - 1}")
        lb[at] = _spread(arrays, rows.lower, at.size, -np.inf)
        ub[at] = _spread(arrays, rows.upper, at.size, np.inf)
    return infinite(lb), infinite(ub)


def _spread(arrays: NamedArrays, name: str, size: int, absent: float) -> Vector:
    """Return a bound of each unknown; one number is that of all."""
    values = arrays.vector(name, size, absent)
    if values.size not in (1, size):
        raise arrays.error(name, f"has {values.size} numbers, expected {size}")
    return np.broadcast_to(values, size).copy()


def _quadratic(
    meaning: Program, blocks: list[RowBlock], lb: Vector, ub: Vector
) -> tuple[dict[str, Any], FileRows | None]:
    """Return the rows and bounds of a quadratic program."""
    n = lb.size
    A = sp.csr_array(sp.vstack([block.A for block in blocks], format="csr"))
    lower, upper = (np.concatenate([getattr(block, side) for block in blocks]) for side in ("lower", "upper"))
    single = np.flatnonzero((np.diff(A.indptr) == 1) & (not meaning.has_bounds))
    single = single[np.abs(A.data[A.indptr[single]]) == 1.0]
    unknown, factor = A.indices[A.indptr[single]].astype(np.int64), A.data[A.indptr[single]]
    sides = np.where(factor > 0, [lower[single], upper[single]], [-upper[single], -lower[single]])
    np.maximum.at(lb, unknown, sides[0])
    np.minimum.at(ub, unknown, sides[1])
    lower_row, upper_row = np.full(n, -1), np.full(n, -1)
    for row, side, bound in ((lower_row, sides[0], lb), (upper_row, sides[1], ub)):
        makes = np.isfinite(side) & (side == bound[unknown])
        row[unknown[makes]] = single[makes]
    rest = np.setdiff1d(np.arange(lower.size), single)
    below, above, equal = (rest[at] for at in two_sided.sides(lower[rest], upper[rest]))
    parts = two_sided.rows(A[rest], lower[rest], upper[rest])
    sizes = {block.name: block.lower.size for block in blocks} | ({"x": n} if meaning.has_bounds else {})
    rows = FileRows(meaning, sizes, below, above, equal, single, unknown, factor, lower_row, upper_row)
    return uncrossed(parts | {"lb": lb, "ub": ub}), None if (lb > ub).any() else rows


def _conic(Q: Any, p: Vector, blocks: list[RowBlock], meaning: Program) -> tuple[Made, ConicRows]:
    """Return equations, then rows below a side, then cones of second order; rows without a side are left out."""
    A, upper = sp.csr_array(sp.vstack([block.A for block in blocks])), np.concatenate([block.upper for block in blocks])
    equal = np.concatenate([block.lower for block in blocks]) == upper
    sizes = {block.name: block.upper.size for block in blocks}
    starts = np.cumsum([0, *sizes.values()])
    order = [np.arange(block.upper.size) if block.order is None else block.order for block in blocks]
    place = np.concatenate([start + at for start, at in zip(starts, order, strict=False)])
    curved = np.concatenate([np.arange(block.upper.size) >= block.upper.size - sum(block.disks) for block in blocks])
    parts = [np.flatnonzero(at) for at in (equal & ~curved, ~equal & ~curved & np.isfinite(upper), curved)]
    rows, sign = np.concatenate(parts), np.repeat([-1.0, 1.0, 1.0], [part.size for part in parts])
    factors = [(Cone.ZERO, 1, parts[0].size), (Cone.NONNEGATIVE, 1, parts[1].size)]
    factors += [(Cone.SECOND_ORDER, 1, size, 1.0) for block in blocks for size in block.disks]
    data = {"Q": matrices.sparse(matrices.matrix(Q, "P")), "p": p}
    data |= {"A": sp.csr_array(sp.diags_array(-sign) @ A[rows]), "b": sign * upper[rows]}
    cones = cone_fields(ProductCone.of(*(f for f in factors if f[2])))
    return (ConeQP, {**data, **cones}, {}), ConicRows(meaning, sizes, place[rows], sign)


def _squares(arrays: NamedArrays, meaning: Program, blocks: list[RowBlock]) -> Made:
    """Return the QP that `least_squares_problem` makes, with the conditions on x."""
    C, d = arrays.matrix(meaning.squares[0]), arrays.vector(meaning.squares[1])
    n = C.shape[1]
    lb, ub = _bounds(arrays, "", meaning, n)
    rows, _ = _quadratic(meaning, [_wide(block, n) for block in blocks], lb, ub)
    try:
        problem = least_squares_problem(C, d, rows["lb"], rows["ub"], rows=rows)
    except ProblemError as cause:
        raise arrays.error(cause.field.rpartition(".")[2], cause.cause) from None
    return QP, {**problem.data(), "info": problem.info}, {}
