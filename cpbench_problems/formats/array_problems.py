"""Named arrays as problems: the form is chosen by the set of their names, and every array that it does not have is
refused."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
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
from cpbench.storage.arrays import SPARSE, sparse_from_parts
from cpbench.storage.base import OFFSET, build, stem
from cpbench_problems.applications import boxed_problem, game_problem, least_squares_problem
from cpbench_problems.formats import array_forms, engine_arrays
from cpbench_problems.formats.array_forms import ArrayForm
from cpbench_problems.formats.named_arrays import (
    NamedArrays,
    Shape,
    absent,
    counted,
    require_shapes,
    require_whole,
    shapes_of,
)
from cpbench_problems.formats.two_sided import INFINITE, infinite, rows_and_bounds

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
    there = [name for name in form.known() if name in shapes]
    dropped = absent(form, shapes)
    squares = array_forms.LEAST_SQUARES
    if only is None and squares.needs <= shapes.keys() <= {*squares.arrays, "format"}:
        raise FormatError(path, "", "holds a matrix A and b alone: --format least-squares makes min ½‖Ax − b‖² of them")
    if (wrong := array_forms.refusal(form, shapes.keys() - dropped)) is not None:
        raise FormatError(path, *wrong)
    text = f"{form.name} ({', '.join(name for name in there if name in form.arrays)})"
    if others := [d.name for d in fits[1:]]:
        text += f", which {' and '.join(others)} would fit too"
    for name in there:
        if name in form.aside:
            text += f"; {name}, {form.aside[name]}, is no part of it"
    return form, text


def build_problem(path: Path, values: Mapping[str, Any], form: ArrayForm, text: str, name: str = "") -> Problem:
    """Return the problem that arrays make in a form, with the `text` of `choose`; raises FormatError with the array
    that does not fit."""
    dropped = absent(form, shapes_of(values))
    arrays = NamedArrays(path, {name: value for name, value in values.items() if name not in dropped})
    require_shapes(path, form, shapes_of(arrays.values))
    make = _MAKERS.get(form.name, _own)
    cls, parts, properties = make(arrays, form)
    known: Info = parts.pop("info", Info())
    info = dataclasses.replace(known, properties={**known.properties, **properties, FORM: text})
    return build(path, cls, "", name=name or stem(path), info=info, **parts)


Made = tuple[type[Problem], dict[str, Any], Mapping[str, Any]]
"""A formulation, its data, and properties to remember."""


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
    return cls, _whole_qp(parts) if cls is QP else parts, notes


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


def _below(arrays: NamedArrays, form: ArrayForm) -> Made:
    """Rows below a side and rows of an equation: qpsolvers, quadprog, cvxopt."""
    Q, p, G, h, C, d = list(form.arrays)[:6]
    vector = arrays.vector(p)
    n = vector.size
    side = infinite(arrays.vector(h))
    kept = side != np.inf
    parts = {
        "Q": arrays.symmetric(Q),
        "p": vector,
        "A": -arrays.matrix(G, n)[kept],
        "b": -side[kept],
        "C": arrays.matrix(C, n),
        "d": arrays.vector(d),
        "lb": infinite(arrays.vector("lb", n, -np.inf)),
        "ub": infinite(arrays.vector("ub", n, np.inf)),
    }
    return QP, parts, _left_out(side.size - int(kept.sum()))


def _left_out(count: int) -> dict[str, Any]:
    """Return the property that says how many rows are left out, where there are some."""
    return {"left_out": f"{text.counted(count, 'row')} without a side (none, or beyond {INFINITE:g})"} if count else {}


def _cvxopt(arrays: NamedArrays, form: ArrayForm) -> Made:
    """Cones of orthants and of second order make a conic program, whose equations are rows of {0}."""
    if "dims.s" in arrays and arrays.vector("dims.s").any():
        raise arrays.error("dims.s", "is a cone of positive semidefinite matrices, which no formulation has")
    sizes = arrays.vector("dims.q")
    rows = arrays.vector("h").size
    half = arrays.number("dims.l", rows - float(sizes.sum()))
    if half < 0 or half != int(half) or half + sizes.sum() != rows:
        raise arrays.error("dims.l", f"is {half:g}, with {sizes.sum():g} rows in dims.q, expected {rows} as h has")
    if not sizes.size:
        return _below(arrays, form)
    n = arrays.vector("q").size
    A, b = matrices.sparse(arrays.matrix("A", n)), arrays.vector("b")
    G = matrices.sparse(arrays.matrix("G", n))
    factors = ((Cone.ZERO, 1, b.size), (Cone.NONNEGATIVE, 1, half), *((Cone.SECOND_ORDER, 1, k, 1.0) for k in sizes))
    parts = {
        "Q": matrices.sparse(matrices.matrix(arrays.symmetric("P"), "P")),
        "p": arrays.vector("q"),
        "A": sp.csr_array(sp.vstack([A, -G])),
        "b": np.concatenate([-b, arrays.vector("h")]),
    }
    return ConeQP, {**parts, **cone_fields(ProductCone.of(*(f for f in factors if f[2])))}, {}


def _osqp(arrays: NamedArrays, form: ArrayForm) -> Made:
    """Rows between two sides; the constant r changes no solution and is remembered."""
    A = sp.csr_array(arrays.matrix("A"))
    for name, size in (("n", A.shape[1]), ("m", A.shape[0])):
        if arrays.number(name, size) != size:
            raise arrays.error(name, f"is {arrays.number(name, size):g}, expected {size} as A has")
    lower, upper = arrays.vector("l"), arrays.vector("u")
    rows = rows_and_bounds(arrays.path, matrices.sparse(A), lower, upper)
    offset = arrays.number("r", 0.0)
    sideless = np.isinf(infinite(lower)) & np.isinf(infinite(upper))
    properties = ({OFFSET: offset} if offset else {}) | _left_out(int(sideless.sum()))
    return QP, {"Q": sp.csr_array(arrays.symmetric("P")), "p": arrays.vector("q"), **rows}, properties


def _box(arrays: NamedArrays, form: ArrayForm) -> Made:
    """Bounds alone, and a Hessian by rows."""
    parts = {key: arrays.values[key] for key in ("data", "indices", "indptr", "shape")}
    Q = require_whole(arrays.path, "data", sparse_from_parts(arrays.path, "", counted(parts)))
    bounds = {"lb": infinite(arrays.vector("l")), "ub": infinite(arrays.vector("u"))}
    return QP, _whole_qp({"Q": Q, "p": arrays.vector("q"), **bounds}), {}


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


def _least_squares(arrays: NamedArrays, form: ArrayForm) -> Made:
    """Return the QP that `least_squares_problem` makes."""
    lb, ub = (infinite(arrays.vector(name)) if name in arrays else None for name in ("lb", "ub"))
    try:
        made = least_squares_problem(arrays.matrix("A"), arrays.vector("b"), lb, ub)
    except ProblemError as cause:
        raise arrays.error(cause.field.rpartition(".")[2], cause.cause) from None
    return QP, {**made.data(), "info": made.info}, {}


def _game(arrays: NamedArrays, form: ArrayForm) -> Made:
    """Return the LCP that `applications.game` makes."""
    try:
        made = game_problem(arrays.matrix("A"), arrays.matrix("B"))
    except ProblemError as cause:
        raise arrays.error(cause.field.rpartition(".")[2], cause.cause) from None
    return LCP, {**made.data(), "info": made.info}, {}


_MAKERS: Mapping[str, Callable[[NamedArrays, ArrayForm], Made]] = {
    array_forms.QPSOLVERS.name: _below,
    array_forms.QUADPROG.name: _below,
    array_forms.CVXOPT.name: _cvxopt,
    array_forms.OSQP.name: _osqp,
    array_forms.BOX.name: _box,
    array_forms.CONTACTBENCH.name: _contactbench,
    array_forms.BOXED.name: _boxed,
    array_forms.LEAST_SQUARES.name: _least_squares,
    array_forms.GAME.name: _game,
    array_forms.ENGINE.name: engine_arrays.engine_step,
    array_forms.DELASSUS.name: engine_arrays.delassus,
}
