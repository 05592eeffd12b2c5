"""The FCLIB schema (Acary et al., Friction Contact LIBrary): groups `fclib_local` and `fclib_global`.

    fclib_local    spacedim, W, vectors/{q, mu}, info        u = Wr + q
    fclib_global   spacedim, M, H, vectors/{f, w, mu}, info  Mv = Hr + f, u = Hᵀv + w
    solution, guesses/{number_of_guesses, 1, 2, ...}         beside the problem: v, u, r

Written so that every reader takes it: local W by rows, global M and H as triplets, counts as int32 data sets
of shape (1,). Bilateral constraints (V, R, s or G, b) and rolling friction are refused: no formulation of this
version has them, and leaving them out would be another problem.
"""

from __future__ import annotations

from typing import Any

import h5py

from cpbench import matrices
from cpbench.formulations.base import Info, Problem
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.storage.annotations import read_info, read_place, read_provenance, write_texts
from cpbench.storage.base import build
from cpbench.storage.hdf5_matrices import read_matrix, write_sparse
from cpbench.storage.hdf5_tree import Tree
from cpbench.storage.hdf5_writer import put_array, put_integer

LOCAL, GLOBAL, ROLLING = "fclib_local", "fclib_global", "fclib_global_rolling"
NODES = {LOCAL: "fc", GLOBAL: "gfc"}


def read(parent: Tree, group: str, name: str) -> Problem:
    """The problem in `parent`/`group`; `name` when the file gives none. Raises FormatError."""
    if group == ROLLING:
        raise parent.error(
            ROLLING, "is a rolling friction problem: no formulation of this version has rolling friction"
        )
    tree = parent.child(group)
    vectors = tree.child("vectors")
    annotations = _annotations(parent, tree, name)
    if group == LOCAL:
        for part in ("V", "R"):
            if part in tree:
                raise tree.error(
                    part, "couples bilateral constraints (V, R, s): no formulation of this version has them"
                )
        q, mu = vectors.array("q"), vectors.array("mu")
        W = _matrix(parent, tree, "W", (q.size, q.size), annotations)
        dimension = _dimension(tree, q.size, mu.size, "q")
        return build(tree.path, FrictionContact, LOCAL, W=W, q=q, mu=mu, dimension=dimension, **annotations["fields"])
    if "G" in tree:
        raise tree.error("G", "couples bilateral constraints (G, b): no formulation of this version has them")
    f, w, mu = vectors.array("f"), vectors.array("w"), vectors.array("mu")
    M = _matrix(parent, tree, "M", (f.size, f.size), annotations)
    H = _matrix(parent, tree, "H", (f.size, w.size), annotations)
    dimension = _dimension(tree, w.size, mu.size, "w")
    parts = {"M": M, "H": H, "f": f, "w": w, "mu": mu, "dimension": dimension}
    return build(tree.path, GlobalFrictionContact, GLOBAL, **parts, **annotations["fields"])


def write(parent: h5py.Group, problem: FrictionContact | GlobalFrictionContact, *, compress: bool) -> None:
    """The FCLIB group of a contact problem; raises OverflowError beyond FCLIB's 32-bit counts."""
    local = isinstance(problem, FrictionContact)
    group = parent.create_group(LOCAL if local else GLOBAL)
    put_integer(group, "spacedim", problem.dimension)
    data = {name: value for name, value in problem.data().items() if name != "G" or value.shape[1]}
    data = {name: value for name, value in data.items() if name != "b" or value.size}
    for name, value in data.items():
        if value.ndim == 2:
            write_sparse(group, name, value, compress=compress, triplet=not local, int32=True)
    vectors = group.create_group("vectors")
    for name, value in data.items():
        if value.ndim == 1:
            put_array(vectors, name, matrices.dense(value), compress=compress)
    info = problem.info
    if info.title or info.description or info.math_info:
        write_texts(group.create_group("info"), info)


def _annotations(parent: Tree, tree: Tree, name: str) -> dict[str, Any]:
    """Name, info, provenance and geometry; which matrices were dense; whether W is packed."""
    own = parent.child("cpbench") if "cpbench" in parent else None
    said = own.attributes() if own else {}
    fields: dict[str, Any] = {"name": str(said.get("name", "")) or name}
    fields["info"] = _info(parent, tree)
    fields["provenance"] = read_provenance(parent) if own else ()
    if own:
        fields |= read_place(own)
    packed = any(t.flagged("symmetric_packed") for t in (tree, parent))
    return {"fields": fields, "dense": str(said.get("dense", "")).split(), "packed": packed}


def _info(parent: Tree, tree: Tree) -> Info:
    return read_info(parent, tree.child("info") if "info" in tree else None)


def _matrix(parent: Tree, tree: Tree, name: str, shape: tuple[int, int], annotations: dict[str, Any]) -> Any:
    M = read_matrix(tree, name, shape, packed=annotations["packed"] and name == "W")
    return matrices.dense(M) if name in annotations["dense"] else M


def _dimension(tree: Tree, rows: int, contacts: int, vector: str) -> int:
    d = tree.integer("spacedim")
    if d not in (2, 3):
        raise tree.error("spacedim", f"is {d}, expected 2 or 3")
    if rows != d * contacts:
        raise tree.error(
            f"vectors/{vector}", f"has {rows} numbers, expected {d} for each of the {contacts} contacts in vectors/mu"
        )
    return d
