"""Named arrays as problems: the form is chosen by the set of their names, and every array that it does not have is
refused."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cpbench.errors import FormatError, ProblemError
from cpbench.formulations import AVI, LCP, QP, FrictionContact
from cpbench.formulations.base import Info, Problem, formulations
from cpbench.formulations.contact import ContactProblem
from cpbench.foundation import matrices
from cpbench.storage.arrays import SPARSE, sparse_from_parts
from cpbench.storage.base import build, stem
from cpbench_problems.applications import boxed_problem, game_problem
from cpbench_problems.formats import array_forms, engine_arrays
from cpbench_problems.formats.array_forms import ArrayForm
from cpbench_problems.formats.file_rows import remember
from cpbench_problems.formats.named_arrays import (
    NamedArrays,
    Shape,
    absent,
    counted,
    require_shapes,
    require_whole,
    shapes_of,
)
from cpbench_problems.formats.program_arrays import Made, make_program
from cpbench_problems.formats.two_sided import infinite, uncrossed

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
