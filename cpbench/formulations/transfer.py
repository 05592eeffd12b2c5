"""The answer to one step of a scene as a start of the next: contacts matched by id, reactions in the new frames.

Where the ids are not known, as many contacts are matched in their order. Where frames are not known, components are
kept as they are.

r_N, ‖r_T‖ and ‖m‖ of a contact that goes on are kept, so that what was in its cone is. Let R be the least rotation
that takes the old normal to the new one and T, T' the old and new tangents as rows. Then

    r_N' = r_N,   r_T' = T'RTᵀ r_T,   m' = T'RTᵀ m   (plane rolling: m is about the third axis, m' = ±m)

Where the normal stays R = I, and the force in the world stays. Where it turns, as on a body that rolls, the force turns
with it; the world force in a new frame would leave the cone. A normal that has turned by more than a right angle
tells nothing of the tangents: r_T' = m' = 0. Where the two bodies of a contact are listed the other way round and its
normal points the other way, the old frame is turned over first: the force on the other body is −Fᵀr.
New contacts get 0, vanished ones are dropped. Velocities v and joint reactions λ are kept where their number is.

The world vector of local components x is Fᵀx, F the frame (rows: normal, tangent, tangent).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from cpbench.errors import NotApplicable, PointError
from cpbench.formulations.base import Contacts, Point, Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.foundation.matrices import Dense, Vector

Index: TypeAlias = np.ndarray[Any, np.dtype[np.intp]]
BY_ID, BY_ORDER = "contacts matched by id", "contacts matched by order"
ORTHONORMAL = 1e-6
"""Frames are orthonormal up to this: what a file in single precision keeps."""


@dataclass(frozen=True)
class Transferred:
    """A start, and how it came about.

    Attributes
    ----------
    point : for the new problem. how : `BY_ID`, `BY_ORDER` (no ids, but as many contacts), "" without contacts.
    matched, new, gone : numbers of contacts.
    """

    point: Any
    how: str
    matched: int
    new: int
    gone: int


def transfer(contacts: Contacts | None, point: Point, problem: Problem) -> Transferred:
    """Carry `point`, an answer to the step before with geometry `contacts`, over as a start for `problem`.

    Raises NotApplicable where nothing says which contact is which: no ids, and another number; or, for a problem
    without contacts, another number of unknowns. PointError on an answer of another node.
    """
    if not isinstance(point, problem.point_type):
        raise PointError(
            f"{problem.node}: the step before has a {type(point).__name__}, expected {problem.point_type.__name__}"
        )
    sizes = problem.point_sizes
    kept = {name: x if x.size == sizes[name] else np.zeros(sizes[name]) for name, x in point.arrays().items()}
    if not isinstance(problem, ContactProblem):
        if any(x.size != sizes[name] for name, x in point.arrays().items()):
            sizes_before = ", ".join(f"{name}: {x.size}" for name, x in point.arrays().items())
            raise NotApplicable("transfer", f"the step before has other unknowns ({sizes_before}; now {sizes})")
        return Transferred(problem.point_type(**kept), "", 0, 0, 0)
    d, nc = problem.dimension, problem.nc
    before: Dense = point.arrays()["r"].reshape(-1, d)
    now = problem.contacts
    if contacts is not None and contacts.count != len(before):
        raise PointError(f"{problem.node}: {len(before)} reactions for {contacts.count} contacts of the step before")
    if contacts is not None and now is not None and contacts.knows("id") and now.knows("id"):
        for geometry in (contacts, now):
            _require_unique(geometry.id)
        how, (_, old, new) = BY_ID, np.intersect1d(contacts.id, now.id, return_indices=True)
    elif len(before) == nc:
        how, old, new = BY_ORDER, np.arange(nc), np.arange(nc)
    else:
        raise NotApplicable("transfer", f"{len(before)} contacts before, {nc} now, and no ids to match them by")
    r = np.zeros((nc, d))
    if contacts is not None and now is not None and contacts.knows("frame") and now.knows("frame"):
        r[new] = _in_new_frames(before[old], contacts, old, now, new, rolling=hasattr(problem, "mu_r"))
    else:
        r[new] = before[old]
    start = problem.point_type(**{**kept, "r": r.ravel()})
    return Transferred(start, how, len(old), nc - len(old), len(before) - len(old))


def _in_new_frames(r: Dense, before: Contacts, old: Index, after: Contacts, new: Index, *, rolling: bool) -> Dense:
    """Return reactions of the matched contacts, row for row, shape (k, d)."""
    d = r.shape[1]
    k = (d - 1) // 2 if rolling else d - 1
    axes = 1 + k if d == 2 else 3
    F, G = before.frame[old], after.frame[new]
    for frames, geometry, places in ((F, before, old), (G, after, new)):
        _require_orthonormal(frames[:, :axes], geometry.id[places] if geometry.knows("id") else places)
    turned = np.einsum("ci,ci->c", F[:, 0], G[:, 0])
    swapped = np.zeros(len(r), dtype=bool)
    if before.knows("bodies") and after.knows("bodies"):
        swapped = (before.bodies[old][:, ::-1] == after.bodies[new]).all(axis=1) & (turned < 0)
    F = np.where(swapped, -1.0, 1.0)[:, None, None] * F
    turned = np.where(swapped, -turned, turned)
    turn = _tangent_map(F, G, turned, k)
    result = r.copy()
    result[:, 1 : 1 + k] = np.einsum("cij,cj->ci", turn, r[:, 1 : 1 + k])
    if rolling and k == 2:
        result[:, 3:] = np.einsum("cij,cj->ci", turn, r[:, 3:])
    elif rolling:
        result[:, 2] *= np.where(turned > 0, np.sign(np.einsum("ci,ci->c", F[:, 2], G[:, 2])), 0.0)
    return result


def _tangent_map(F: Dense, G: Dense, turned: Vector, k: int) -> Dense:
    """Return T'RTᵀ of every contact, shape (c, k, k); 0 where the normals are more than a right angle apart.

    R = I + [a]ₓ + [a]ₓ²/(1 + n·n') with a = n × n' (Rodrigues), so that t'·Rt = t'·t − (t'·n)(n'·t)/(1 + n·n'): t is
    normal to n, and t' to n'.
    """
    T, S = F[:, 1 : 1 + k], G[:, 1 : 1 + k]
    n, m = F[:, 0], G[:, 0]
    onto = np.einsum("cik,cjk->cij", S, T)
    leaning = np.einsum("cik,ck->ci", S, n)[:, :, None] * np.einsum("cjk,ck->cj", T, m)[:, None, :]
    near = turned > 0
    return np.where(near[:, None, None], onto - leaning / np.where(near, 1.0 + turned, 1.0)[:, None, None], 0.0)


def _require_unique(ids: np.ndarray[Any, np.dtype[np.int64]]) -> None:
    distinct, count = np.unique(ids, return_counts=True)
    if count.max(initial=1) > 1:
        c = int(np.argmax(count))
        raise NotApplicable("transfer", f"the id {distinct[c]} stands for {count[c]} contacts of one step")


def _require_orthonormal(frames: Dense, ids: np.ndarray[Any, np.dtype[Any]]) -> None:
    off = np.abs(np.einsum("cik,cjk->cij", frames, frames) - np.eye(frames.shape[1])).max(axis=(1, 2), initial=0.0)
    if not (off <= ORTHONORMAL).all():
        c = int(np.argmax(np.where(off <= ORTHONORMAL, 0.0, np.inf)))
        raise NotApplicable("transfer", f"the frame of contact {ids[c]} is not orthonormal (off by {off[c]:.1e})")
