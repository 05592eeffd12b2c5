"""Arrays of contacts as engines have them: M and J of a step, one coefficient for all contacts, rows in other orders.

engine     M, J, v, mu[, tau, dt, phi, restitution, dimension, order]: the step Mv⁺ = Jᵀr + Mv + dt tau, u = Jv⁺ + w.
           w_N = phi/dt is the gap of Stewart and Trinkle's and of Anitescu's steps, of both signs; e u_N⁻, by Newton's
           law of impact, where a contact closes within the step and has a restitution e > 0
Delassus   W, q, mu, joints[, dimension, order]: (0, u) = W(λ, r) + q, where `joints` are the number of rows of joints,
           which come first, or the rows themselves

An `order` of rows is that of one contact, NTT or TTN (NT or TN in a plane), or N..NT..T, where all normals come first.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cpbench.formulations import GlobalFrictionContact, MixedFrictionContact
from cpbench.formulations.contact import ContactProblem, diagonal_blocks
from cpbench.formulations.global_contact import GlobalContact
from cpbench.formulations.local_contact import LocalContact
from cpbench.foundation import matrices
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Vector
from cpbench.storage.base import NOTE
from cpbench_problems.formats.array_forms import ArrayForm
from cpbench_problems.formats.named_arrays import NamedArrays

GROUPED = "N..NT..T"
Parts = dict[str, Any]
CHECKED, APART = 1500, 3.0
"""The most rows of which the order is doubted; the factor by which blocks of another order are better conditioned."""


def in_order(arrays: NamedArrays, form: ArrayForm, cls: type[ContactProblem]) -> tuple[NamedArrays, dict[str, str]]:
    """Return the arrays of a contact problem with the normal first in every contact and a coefficient for each, and
    what to note; raises FormatError where the numbers speak against the order, or do not decide it."""
    (symbol,) = form.arrays[cls.rows_of]
    named = ((name, symbols.index(symbol)) for name, symbols in form.arrays.items() if symbol in symbols)
    rows = next(arrays.values[name].shape[axis] for name, axis in named if name in arrays)
    values: dict[str, Any] = {**arrays.values}
    if arrays.values["mu"].size == 1:
        d, nc = _contacts(arrays, rows, cls.dimensions)
        values |= {"dimension": np.array(d), "mu": np.full(nc, arrays.number("mu", 0.0))}
    order = values.pop("order", None)
    made, notes = replace(arrays, values=values), dict[str, str]()
    d = rows // max(values["mu"].shape[0], 1)
    if order is not None:
        return permuted(made, form, symbol, _permutation(arrays, str(order), rows, d)), {NOTE: f"rows {order}"}
    if issubclass(cls, LocalContact) and d == 3 and d * len(values["mu"]) == rows <= CHECKED and "q" in made:
        _require_normals_first(made, form, symbol, d)
        notes[NOTE] = "rows were read as N, T, T of each contact: an array order says another order"
    H = values.get("H")
    if issubclass(cls, GlobalContact) and H is not None and H.shape[0] == H.shape[1]:
        H = matrices.dense(H)
        if _frames(H, d) and not _frames(H.T, d):
            raise arrays.error("H", "is square, and its rows, not its columns, are frames of contacts: H is Jᵀ")
        notes[NOTE] = "H is square: taken as that of u = Hᵀv + w, not as J = Hᵀ"
    return made, notes


def permuted(arrays: NamedArrays, form: ArrayForm, symbol: str, order: Vector) -> NamedArrays:
    """Return the arrays with the rows and columns of contacts in another order."""
    values = dict(arrays.values)
    for name, symbols in form.arrays.items():
        for axis, size in enumerate(symbols if name in values else ()):
            if size == symbol:
                value = values[name].tocsr() if matrices.is_sparse(values[name]) else values[name]
                values[name] = value[order] if axis == 0 else value[:, order]
    return replace(arrays, values=values)


def engine_step(arrays: NamedArrays, form: ArrayForm) -> tuple[type[GlobalFrictionContact], Parts, Mapping[str, str]]:
    """Return the gfc of a step of an engine; raises FormatError where an array that it needs is missing."""
    M, J, v = arrays.symmetric("M"), arrays.matrix("J"), arrays.vector("v")
    dt = arrays.number("dt", 0.0)
    if dt <= 0.0 and ("dt" in arrays or "tau" in arrays or "phi" in arrays):
        raise arrays.error("dt", f"is {dt:g}, expected a time step > 0 beside tau and phi")
    dense = matrices.dense(J)
    framed = [
        d
        for d in (2, 3)
        if not len(dense) % d and any(_frames(dense[at], d) for at in _orders(arrays, dense, d).values())
    ]
    d, nc = _contacts(arrays, J.shape[0], tuple(framed) or (2, 3))
    f = M @ v + dt * arrays.vector("tau", v.size)
    mu, phi, e = (_each(arrays, name, nc) for name in ("mu", "phi", "restitution"))
    gap = phi / dt if dt else phi
    if "order" in arrays:
        order = str(arrays.values["order"])
    else:
        order = _decided(arrays, dense, d, Factorization(M).solve(f), gap)
    J = permuted(arrays, form, "m", _permutation(arrays, order, J.shape[0], d)).values["J"].astype(np.float64)
    before, w = (J @ v)[::d], np.zeros(J.shape[0])
    w[::d] = np.where((e > 0.0) & (before < 0.0) & (before + gap <= 0.0), e * before, gap)
    data: Parts = {"M": M, "H": J.T, "f": f, "w": w, "mu": mu, "dimension": d}
    return GlobalFrictionContact, data, {NOTE: f"rows {order}"}


def delassus(arrays: NamedArrays, form: ArrayForm) -> tuple[type[MixedFrictionContact], Parts, Mapping[str, str]]:
    """Return the fcm of a Delassus matrix of joints and contacts."""
    W, q, joints = matrices.dense(arrays.matrix("W")), arrays.vector("q"), arrays.vector("joints").astype(np.int64)
    if joints.size == 1:
        joints = np.arange(int(joints[0]))
    if joints.size and not (joints.min() >= 0 and joints.max() < q.size and np.unique(joints).size == joints.size):
        raise arrays.error("joints", f"names rows that are not among the {q.size} of q")
    own = np.setdiff1d(np.arange(q.size), joints)
    d, nc = _contacts(arrays, own.size, (2, 3))
    order = str(arrays.values.get("order", "NTT"[:d]))
    own = own[_permutation(arrays, order, own.size, d)]
    parts: Parts = {"W": W[np.ix_(own, own)], "V": W[np.ix_(own, joints)], "R": W[np.ix_(joints, joints)]}
    parts |= {"q": q[own], "s": q[joints], "mu": _each(arrays, "mu", nc), "dimension": d}
    return MixedFrictionContact, parts, {NOTE: f"rows {order}"}


def _contacts(arrays: NamedArrays, rows: int, dimensions: tuple[int, ...]) -> tuple[int, int]:
    """Return the rows of a contact and the number of contacts; raises FormatError where the arrays do not say it."""
    sizes = {arrays.values[name].size for name in ("mu", "phi", "restitution") if name in arrays} - {1}
    fits = [d for d in dimensions if rows % d == 0 and (not sizes or sizes == {rows // d})]
    order = str(arrays.values.get("order", GROUPED))
    given = arrays.number("dimension", 0.0) or (0 if order == GROUPED else len(order))
    if given:
        fits = [d for d in fits if d == given]
    if len(fits) != 1 and not (1 in dimensions and rows == 0):
        choices = " or ".join(f"{rows // d} contacts of {d} rows" for d in fits)
        cause = (
            f"is one number for all contacts, {choices}: {_say('NTT, TTN, NT or TN')}, or dimension"
            if fits
            else (
                f"has {', '.join(map(str, sorted(sizes))) or 'one'} numbers and the contacts {rows} rows, expected "
                f"{' or '.join(map(str, dimensions))} rows for each contact"
            )
        )
        raise arrays.error("mu", cause)
    return fits[0], rows // fits[0]


def _each(arrays: NamedArrays, name: str, nc: int) -> Vector:
    """Return a number for each contact, of one for all or of as many; 0 where there is none."""
    given = arrays.vector(name, nc)
    if given.size not in (1, nc):
        raise arrays.error(name, f"has {given.size} numbers, expected one or {nc}")
    return np.broadcast_to(given, nc).copy()


def _permutation(arrays: NamedArrays, order: str, rows: int, d: int) -> Any:
    """Return where the rows of contacts are, normals first in each; raises FormatError for an unknown order."""
    each = np.arange(rows).reshape(-1, d)
    if order == GROUPED:
        nc = rows // d
        return np.column_stack([np.arange(nc), np.arange(nc, rows).reshape(nc, d - 1)]).ravel()
    if order not in ("N" + (d - 1) * "T", (d - 1) * "T" + "N"):
        text = f"is {order}, expected {'N' + (d - 1) * 'T'}, {(d - 1) * 'T'}N or {GROUPED}"
        raise arrays.error("order", f"{text} for {d} rows of a contact")
    return (each if order[0] == "N" else np.roll(each, 1, axis=1)).ravel()


def _decided(arrays: NamedArrays, J: Any, d: int, free: Vector, gap: Vector) -> str:
    """Return the one order of rows in which some contact closes by the free velocities and, where the velocities are
    those of free bodies, the rows of each contact are a frame. Raises FormatError where there is not exactly one."""
    at = _orders(arrays, J, d)
    framed = [order for order in at if _frames(J[at[order]], d)] or [*at]
    fits = [order for order in framed if (J[at[order][::d]] @ free + np.maximum(gap, 0.0) < 0.0).any()] or framed
    if len(fits) > 1:
        raise arrays.error("order", f"is missing: the rows of J may be {' or '.join(fits)}; {_say(' or '.join(fits))}")
    return fits[0]


def _orders(arrays: NamedArrays, J: Any, d: int) -> dict[str, Any]:
    """Return where the rows of contacts are, normals first, in each order that J may have."""
    orders = ["N" + (d - 1) * "T", (d - 1) * "T" + "N", *([GROUPED] if J.shape[0] > d else [])]
    return {order: _permutation(arrays, order, J.shape[0], d) for order in orders}


def _frames(J: Any, d: int) -> bool:
    """Return whether J has the velocities of free bodies and the rows of each contact are a frame."""
    size = 6 if d == 3 else 3
    if J.shape[1] % size or J.shape[0] % d:
        return False
    linear = J.reshape(-1, d, J.shape[1] // size, size)[..., :d]
    gram = np.einsum("cibk,cjbk->cij", linear, linear)
    each = np.einsum("cii->c", gram) / d
    return bool((each > 0.0).all() and np.allclose(gram, each[:, None, None] * np.eye(d), atol=1e-6 * each.max()))


def _require_normals_first(arrays: NamedArrays, form: ArrayForm, symbol: str, d: int) -> None:
    """Raise FormatError where the numbers of W and q speak for another order of rows than NTT, which W alone has: fewer
    contacts are coupled, each contact is far better conditioned, or all of them close and at most half in NTT."""

    def facts(order: str) -> tuple[int, float, int]:
        there = permuted(arrays, form, symbol, _permutation(arrays, order, rows, d))
        W, q = matrices.dense(there.matrix("W")), there.vector("q")
        size = np.abs(W).reshape(q.size // d, d, -1, d).max(axis=(1, 3))
        values = np.linalg.eigvalsh(np.asarray(diagonal_blocks(W, d)))
        condition = float(np.max(values[:, -1] / np.maximum(values[:, 0], 1e-16 * np.abs(values[:, -1]))))
        return int((size > 1e-12 * size.max()).sum()), condition, int((q[::d] <= 1e-9 * np.abs(q).max()).sum())

    rows = arrays.vector("q").size
    pairs, condition, closing = facts("NTT")
    for order in (GROUPED, "TTN"):
        other = facts(order)
        if other[0] < pairs:
            why = f"couples {other[0]} pairs of contacts, NTT {pairs}"
        elif APART * other[1] < condition:
            why = f"has contacts of condition {other[1]:.2g}, NTT {condition:.2g}"
        elif rows >= 4 * d and other[2] == rows // d >= 2 * closing:
            why = f"closes all {other[2]} contacts by q, NTT {closing}"
        else:
            continue
        raise arrays.error("W", f"may have other rows: the order {order} {why}: {_say(f'NTT or {order}')}")


def _say(choices: str) -> str:
    return f"add an array order, {choices} (cpbench pack FILE --axes ORDER -o NEW.h5)"
