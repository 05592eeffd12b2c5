"""Certificates as data: what was proved of an answer, and the file that holds it.

A file holds the group `certificate`:

    @format_version = 5, @node, @fingerprint (of the problem), @level, @unique, @convex, @distance,
    @solutions, @tolerance, @margin, @value_low, @value_high, @seal (SHA-256 of all the rest)
    answer                the answer in doubles, its parts one after the other; none where no solution exists
    evidence/*            arrays of the proof
    data/*                the problem, as the checker reads it: vectors, dense matrices, sparse ones as groups (shape,
                          indptr, indices, data), maps as groups (inputs, constants, heads, left, right, outputs)

Beside it stands the problem with the answer as its `/solution`, as in an answer file of cpbench.

`checker/`, which shares no code with this package, proves it again from this file alone.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import h5py
import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector
from cpbench.storage.base import write_atomic
from cpbench.storage.hdf5_files import write_problem
from cpbench.storage.hdf5_points import put_solution
from cpbench.storage.hdf5_tree import new_file, put_array, put_attribute

VERSION = 5
NAMES = (
    "node", "fingerprint", "level", "unique", "convex", "distance", "solutions", "tolerance", "margin",
    "value_low", "value_high",
)  # fmt: skip
"""Attributes of a certificate's group."""
MEASURED, ENCLOSED, PROVED, DISTANT, REFUTED = "measured", "enclosed", "proved", "distant", "refuted"
STATIONARY = "stationary"
INFEASIBLE, UNBOUNDED = "infeasible", "unbounded"
TOLERANCE = 1e-6
"""Distance of an answer from a solution up to which it is that solution, where none is given."""
Evidence: TypeAlias = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Certificate:
    """Facts that are certain of an answer, or of a problem without a solution.

    Attributes
    ----------
    node, fingerprint : of the problem.
    level : of an answer `proved` (an exact solution is known, and the answer is within the tolerance of it), `enclosed`
        (a box holds one, in the same way), `stationary` (as proved, of a program that is not convex: the first-order
        conditions), `distant` (a solution is known, and the answer is not near it), `refuted`
        (no solution is near the answer, and none is known) or `measured` (none of these); of a problem `infeasible` or
        `unbounded` (proved to have no solution, with a margin of the tolerance).
    answer : the answer in doubles, its parts one after the other; empty for a problem without a solution.
    distance : a bound on ‖answer − solution‖∞/‖solution‖∞; for `mlcp` the larger one of u and v, each over its own
        size (over that of both where it is 0); NaN where no solution is known. It is absolute where the solution is 0.
    unique : the fact that makes the solution unique, '' where none was found.
    convex : the fact that makes a quadratic program convex, '' where none was found (it may be convex to rounding).
    solutions : how many there are, infinity where they fill a continuum, NaN where they were not counted.
    reason : what stops a proof, '' where there is one.
    tolerance : the distance up to which an answer is near. margin : of a problem without a solution, the largest share
        of their sizes by which its numbers may change while it has none (`cpbench.proofs.margins`); else NaN.
    value_low, value_high : doubles around ½zᵀQz + pᵀz at the exact point of a quadratic program, without the constant
        that a file may have; where the program is `convex` its least value is between them. NaN of others.
    evidence : arrays that determine the proof, by name. seconds : what it took [s].
    exact : of a polyhedral problem the exact solution that is known, as x of `mixed`; it is not in the file.
    """

    node: str
    fingerprint: str
    level: str
    answer: Vector
    distance: float = float("nan")
    unique: str = ""
    solutions: float = float("nan")
    reason: str = ""
    evidence: Evidence = field(default_factory=dict)
    seconds: float = 0.0
    tolerance: float = TOLERANCE
    margin: float = float("nan")
    convex: str = ""
    value_low: float = float("nan")
    value_high: float = float("nan")
    exact: Sequence[Any] | None = None

    def __bool__(self) -> bool:
        return self.level in (ENCLOSED, PROVED, INFEASIBLE, UNBOUNDED)


def save(path: str | Path, certificate: Certificate, problem: Problem, *, force: bool = False) -> None:
    """Write a certificate with the data of its problem; raises FormatError where the file exists (unless `force`)."""
    with new_file() as (root, made):
        own = root.create_group("certificate")
        put_attribute(own, "format_version", VERSION)
        for name in NAMES:
            put_attribute(own, name, getattr(certificate, name))
        put_array(own, "answer", certificate.answer, compress=True)
        _put_all(own.create_group("evidence"), dict(certificate.evidence))
        data = own.create_group("data")
        for name, value in problem.data().items():
            _put_data(data, name, value)
        for name, value in problem.maps().items():
            _put_all(data.create_group(name), {"inputs": np.array(value.inputs), **value.arrays()})
        put_attribute(own, "seal", _seal(own))
        write_problem(root, problem, compress=True)
        if certificate.answer.size:
            point = problem.point_from_vector(certificate.answer)
            put_solution(root, problem, point, {"name": problem.name, "verdict": certificate.level})
    write_atomic(Path(path), made[0], force=force)


def _seal(group: h5py.Group) -> str:
    """Return the hash of everything in the group, by which a change of the file is seen."""
    h = hashlib.sha256()

    def add(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            value = np.asarray(item[()])
            h.update(f"{name} {value.dtype.str} {value.shape};".encode() + np.ascontiguousarray(value).tobytes())

    group.visititems(add)
    for name in sorted(group.attrs):
        value: Any = group.attrs[name]
        h.update(f"@{name} {value.decode() if isinstance(value, bytes) else value!s};".encode())
    return h.hexdigest()


def _put_all(group: h5py.Group, arrays: Mapping[str, Any]) -> None:
    for name, value in arrays.items():
        put_array(group, name, np.asarray(value), compress=np.ndim(value) > 0)


def _put_data(group: h5py.Group, name: str, value: Any) -> None:
    if value.ndim == 1 or not matrices.is_sparse(value):
        put_array(group, name, matrices.dense(value), compress=True)
        return
    csr = matrices.sparse(value)
    parts = {"shape": np.array(csr.shape), "indptr": csr.indptr, "indices": csr.indices, "data": csr.data}
    _put_all(group.create_group(name), parts)
