"""The FCLIB schema (Acary et al., Friction Contact LIBrary): frictional contact, with bilateral constraints or rolling.

    fclib_local           spacedim, W, vectors/{q, mu}, info          u = Wr + q                            (fc)
                          V, R, vectors/s beside them                 u = Wr + Vλ + q, Vᵀr + Rλ + s = 0     (fcm)
    fclib_global          spacedim, M, H, vectors/{f, w, mu}, info    Mv = Hr + f, u = Hᵀv + w              (gfc)
                          G, vectors/b beside them                    Mv = Hr + Gλ + f, Gᵀv + b = 0
    fclib_global_rolling  as fclib_global, with vectors/mu_r; spacedim 3 or 5                               (grfc)
    solution, guesses/{number_of_guesses, 1, 2, ...}                  beside the problem: v, u, r, l = λ

Written so that every reader takes it: local matrices by rows, global ones as triplets, counts as int32 data sets
of shape (1,). Without bilateral constraints their parts are left out.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import h5py
import scipy.sparse as sp

from cpbench.formulations.base import Info, Problem
from cpbench.formulations.global_contact import GlobalFrictionContact, GlobalRollingFrictionContact
from cpbench.formulations.local_contact import FrictionContact, MixedFrictionContact
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector
from cpbench.storage.annotations import read_info, read_place, read_provenance, write_texts
from cpbench.storage.base import build
from cpbench.storage.hdf5_matrices import read_matrix, write_sparse
from cpbench.storage.hdf5_tree import Tree, put_array, put_integer

LOCAL, GLOBAL, ROLLING = "fclib_local", "fclib_global", "fclib_global_rolling"
GROUPS = {
    FrictionContact.node: LOCAL,
    MixedFrictionContact.node: LOCAL,
    GlobalFrictionContact.node: GLOBAL,
    GlobalRollingFrictionContact.node: ROLLING,
}
"""The group of every node that FCLIB has."""
_BILATERAL = frozenset({"V", "R", "s", "G", "b"})
_DIMENSIONS = {LOCAL: (2, 3), GLOBAL: (2, 3), ROLLING: (3, 5)}


def read(parent: Tree, group: str, name: str, node: str = "") -> Problem:
    """Read the problem in `parent`/`group`; `name` when the file gives none, `node` where the file says which it is.

    Raises FormatError.
    """
    tree = parent.child(group)
    annotations = _annotations(parent, tree, name)
    return _read_local(tree, group, node, annotations) if group == LOCAL else _read_global(tree, group, annotations)


def write(parent: h5py.Group, problem: Problem, *, compress: bool) -> None:
    """Write the FCLIB group of a problem of a node in `GROUPS`; raises OverflowError beyond FCLIB's 32-bit counts."""
    name = GROUPS[problem.node]
    group = parent.create_group(name)
    put_integer(group, "spacedim", problem.dimension)  # type: ignore[attr-defined]
    free = not problem.sizes().get("p", 0)
    data = {part: value for part, value in problem.data().items() if not (free and part in _BILATERAL)}
    for part, value in data.items():
        if value.ndim == 2:
            write_sparse(group, part, value, compress=compress, triplet=name != LOCAL, int32=True)
    vectors = group.create_group("vectors")
    for part, value in data.items():
        if value.ndim == 1:
            put_array(vectors, part, matrices.dense(value), compress=compress)
    info = problem.info
    if info.title or info.description or info.math_info:
        write_texts(group.create_group("info"), info)


def _read_local(tree: Tree, group: str, node: str, annotations: dict[str, Any]) -> Problem:
    vectors = tree.child("vectors")
    _require_known(tree, vectors, ("W", "V", "R"), ("q", "s", "mu"))
    q, mu = vectors.array("q"), vectors.array("mu")
    parts: dict[str, Any] = {"q": q, "mu": mu, "dimension": _dimension(tree, group, q, mu, "q")}
    parts["W"] = _matrix(tree, "W", (q.size, q.size), annotations)
    constrained = _constrained(tree, vectors, ("V", "R"), "s")
    if not constrained and node != "fcm":
        return build(tree.path, FrictionContact, group, **parts, **annotations["fields"])
    if node == "fc":
        raise tree.error("V", "couples bilateral constraints, but cpbench/@node says fc: expected fcm")
    s = vectors.array("s") if constrained else q[:0]
    for name, shape in (("V", (q.size, s.size)), ("R", (s.size, s.size))):
        parts[name] = _matrix(tree, name, shape, annotations) if constrained else _empty(name, shape, annotations)
    return build(tree.path, MixedFrictionContact, group, **parts, s=s, **annotations["fields"])


def _read_global(tree: Tree, group: str, annotations: dict[str, Any]) -> Problem:
    vectors = tree.child("vectors")
    _require_known(tree, vectors, ("M", "H", "G"), ("f", "w", "b", "mu", *(("mu_r",) if group == ROLLING else ())))
    f, w, mu = (vectors.array(name) for name in ("f", "w", "mu"))
    parts: dict[str, Any] = {"f": f, "w": w, "mu": mu, "dimension": _dimension(tree, group, w, mu, "w")}
    if group == ROLLING:
        parts["mu_r"] = vectors.array("mu_r")
    parts["M"] = _matrix(tree, "M", (f.size, f.size), annotations)
    parts["H"] = _matrix(tree, "H", (f.size, w.size), annotations)
    if _constrained(tree, vectors, ("G",), "b"):
        parts["b"] = vectors.array("b")
        parts["G"] = _matrix(tree, "G", (f.size, parts["b"].size), annotations)
    else:
        parts["G"] = _empty("G", (f.size, 0), annotations)
    cls = GlobalRollingFrictionContact if group == ROLLING else GlobalFrictionContact
    return build(tree.path, cls, group, **parts, **annotations["fields"])


def _require_known(tree: Tree, vectors: Tree, known: Collection[str], names: Collection[str]) -> None:
    tree.require_known({*known, "vectors", "spacedim", "info"})
    vectors.require_known(names)


def _constrained(tree: Tree, vectors: Tree, names: tuple[str, ...], vector: str) -> bool:
    """Return whether bilateral constraints are there: all of their parts or none."""
    fields = {name: name in tree for name in names} | {f"vectors/{vector}": vector in vectors}
    if any(fields.values()) and not all(fields.values()):
        missing = next(name for name, held in fields.items() if not held)
        present = ", ".join(name for name, held in fields.items() if held)
        raise tree.error(missing, f"is missing beside {present}: bilateral constraints need {', '.join(fields)}")
    return all(fields.values())


def _annotations(parent: Tree, tree: Tree, name: str) -> dict[str, Any]:
    """Return the name, info, provenance and geometry; which matrices were dense; whether W is packed."""
    own = parent.child("cpbench") if "cpbench" in parent else None
    attributes = own.attributes() if own else {}
    fields: dict[str, Any] = {"name": str(attributes.get("name", "")) or name}
    fields["info"] = _info(parent, tree)
    fields["provenance"] = read_provenance(parent) if own else ()
    if own:
        fields |= read_place(own)
    packed = any(t.flagged("symmetric_packed") for t in (tree, parent))
    return {"fields": fields, "dense": str(attributes.get("dense", "")).split(), "packed": packed}


def _info(parent: Tree, tree: Tree) -> Info:
    return read_info(parent, tree.child("info") if "info" in tree else None)


def _matrix(tree: Tree, name: str, shape: tuple[int, int], annotations: dict[str, Any]) -> Any:
    M = read_matrix(tree, name, shape, packed=annotations["packed"] and name == "W")
    return matrices.dense(M) if name in annotations["dense"] else M


def _empty(name: str, shape: tuple[int, int], annotations: dict[str, Any]) -> Any:
    """Return a matrix without columns, in the storage it had."""
    M = sp.csr_array(shape)
    return M.toarray() if name in annotations["dense"] else M


def _dimension(tree: Tree, group: str, rows: Vector, mu: Vector, vector: str) -> int:
    d, allowed = tree.integer("spacedim"), _DIMENSIONS[group]
    if d not in allowed:
        raise tree.error("spacedim", f"is {d}, expected {' or '.join(map(str, allowed))}")
    if rows.size != d * mu.size:
        raise tree.error(
            f"vectors/{vector}",
            f"has {rows.size} numbers, expected {d} for each of the {mu.size} contacts in vectors/mu",
        )
    return d
