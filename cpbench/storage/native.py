"""The native schema: any node whose data are matrices and vectors, under the group `cpbench` of a problem.

    <problem>/cpbench            attributes format_version = 1, node, name (and `fields`: further scalars, JSON), and
                                 fingerprint: that of the problem, with which a reader compares what it has read
    <problem>/cpbench/<M>        sparse: a group as in FCLIB; dense: a 2-D float64 data set
    <problem>/cpbench/vectors/*  float64 data sets
    <problem>/cpbench/maps/<F>   a nonlinear map with rows: a list of operations on numbered values. Values are the
                                 unknowns (attribute inputs: how many), the data set constants, then one for each row
                                 of operations: operator, left and right argument (−1 where there is no right one).
                                 outputs: the values of the rows. parameters: a JSON object, name -> place in constants

Contact problems that FCLIB has (fc, fcm, gfc, grfc) keep its own group beside `cpbench`, which then holds the name,
the geometry and which matrices were dense. A new node needs no code here: its fields are read from its class.
"""

from __future__ import annotations

import dataclasses
import json
from typing import Any, cast

import h5py
import numpy as np

from cpbench.errors import ProblemError, UnknownName
from cpbench.formulations.base import ANNOTATIONS, Info, Problem, counted, formulations
from cpbench.formulations.expressions import Map
from cpbench.foundation import matrices
from cpbench.storage import fclib
from cpbench.storage.annotations import (
    read_info,
    read_place,
    read_provenance,
    write_info,
    write_place,
    write_provenance,
)
from cpbench.storage.base import build
from cpbench.storage.hdf5_matrices import read_matrix, write_matrix
from cpbench.storage.hdf5_tree import Tree, put_array, put_attribute, put_text

VERSION = 1
_PLACE = frozenset({"sequence", "contacts"})


def write(parent: h5py.Group, problem: Problem, *, compress: bool) -> None:
    """Write `problem` into the group `parent`; raises OverflowError where FCLIB cannot count that far."""
    node_group = parent.create_group("cpbench")
    put_attribute(node_group, "format_version", VERSION)
    put_attribute(node_group, "node", problem.node)
    put_attribute(node_group, "fingerprint", problem.fingerprint)
    if problem.name:
        put_attribute(node_group, "name", problem.name)
    contact = problem.node in fclib.GROUPS
    if contact:
        fclib.write(parent, problem, compress=compress)
        dense = [name for name, value in problem.data().items() if value.ndim == 2 and not matrices.is_sparse(value)]
        if dense:
            put_attribute(node_group, "dense", " ".join(dense))
    else:
        _write_data(node_group, problem, compress=compress)
        _write_maps(node_group, problem, compress=compress)
    write_place(node_group, problem, compress=compress)
    write_info(parent, problem.info, texts=not contact)
    write_provenance(parent, problem.provenance, compress=compress)


def read(parent: Tree, name: str) -> Problem:
    """Read the problem whose `cpbench` group stands in `parent`; `name` when none is stored. Raises FormatError."""
    node_group = parent.child("cpbench")
    attributes = node_group.attributes()
    problem = _read(parent, node_group, attributes, name)
    written = attributes.get("fingerprint")
    if written is not None and written != problem.fingerprint:
        raise node_group.error(
            "@fingerprint",
            f"is {str(written)[:16]}…, its numbers have {problem.fingerprint[:16]}…: the file is damaged, or was "
            "changed by another program, which has to remove this attribute",
        )
    return problem


def _read(parent: Tree, node_group: Tree, attributes: dict[str, Any], name: str) -> Problem:
    node = _node(node_group, attributes)
    if node in fclib.GROUPS:
        node_group.require_known(_PLACE)
        return fclib.read(parent, fclib.GROUPS[node], name, node)
    cls = formulations.get(node)
    vectors = node_group.child("vectors")
    parts: dict[str, Any] = {}
    sizes: dict[str, int] = {}
    declared = [(f.name, f.metadata["shape"]) for f in cls._data_fields()]
    node_group.require_known({"vectors", "maps", *_PLACE, *(name for name, shape in declared if len(shape) == 2)})
    vectors.require_known({name for name, shape in declared if len(shape) == 1})
    for field, shape in declared:
        if len(shape) == 1:
            parts[field] = vectors.array(field)
            sizes.setdefault(shape[0], parts[field].size)
    for field, shape in declared:
        if len(shape) == 2:
            parts[field] = read_matrix(node_group, field, (sizes.get(shape[0]), sizes.get(shape[1])))
    parts |= _read_maps(node_group, cls, sizes)
    parts |= _read_fields(node_group, attributes, cls)
    parts |= read_place(node_group)
    info = read_info(parent, parent.child("info")) if "info" in parent else Info()
    stored = str(attributes.get("name", "")) or name
    where = node_group.path, cls, node_group.where
    return build(*where, name=stored, info=info, provenance=read_provenance(parent), **parts)


def _node(node_group: Tree, attributes: dict[str, Any]) -> str:
    version = attributes.get("format_version")
    if version != VERSION:
        raise node_group.error("@format_version", f"is {version}, this version of cpbench reads {VERSION}")
    node = attributes.get("node")
    if not isinstance(node, str):
        raise node_group.error("@node", "is missing, expected the name of a formulation")
    try:
        formulations.get(node)
    except UnknownName as cause:
        raise node_group.error("@node", str(cause)) from None
    return node


def _scalar_fields(cls: type[Problem]) -> list[str]:
    return [
        f.name
        for f in dataclasses.fields(cls)
        if f.name not in ANNOTATIONS and not {"shape", "map"} & f.metadata.keys()
    ]


def _write_data(node_group: h5py.Group, problem: Problem, *, compress: bool) -> None:
    vectors = node_group.create_group("vectors")
    for name, value in problem.data().items():
        if value.ndim == 1:
            put_array(vectors, name, matrices.dense(value), compress=compress)
        else:
            write_matrix(node_group, name, value, compress=compress)
    scalars = {name: getattr(problem, name) for name in _scalar_fields(type(problem))}
    if scalars:
        put_attribute(node_group, "fields", json.dumps(scalars))


def _write_maps(node_group: h5py.Group, problem: Problem, *, compress: bool) -> None:
    for name, F in problem.maps().items():
        if not F.rows:
            continue
        group = node_group.create_group(f"maps/{name}")
        put_attribute(group, "inputs", F.inputs)
        operations = np.column_stack([F.heads, F.left, F.right])
        parts = {"constants": F.constants, "operations": operations.astype(np.int32), "outputs": F.outputs}
        for part, array in parts.items():
            put_array(group, part, array, compress=compress)
        if F.named:
            put_text(group, "parameters", json.dumps(dict(F.named)))


def _read_maps(node_group: Tree, cls: type[Problem], sizes: dict[str, int]) -> dict[str, Map]:
    declared = {f.name: f.metadata["map"][1] for f in dataclasses.fields(cls) if "map" in f.metadata}
    if not declared:
        return {}
    maps: dict[str, Map] = {}
    if "maps" in node_group:
        stored = node_group.child("maps")
        stored.require_known(declared)
        maps = {name: _map(stored.child(name)) for name in stored.names()}
    return {
        name: maps[name] if name in maps else Map.empty(counted(symbol, sizes)) for name, symbol in declared.items()
    }


def _map(stored: Tree) -> Map:
    stored.require_known({"constants", "operations", "outputs", "parameters"})
    inputs = stored.attributes().get("inputs")
    if not isinstance(inputs, np.integer):
        raise stored.error("@inputs", "is missing, expected the number of unknowns")
    operations = stored.array("operations", np.int64, ndim=2)
    if operations.shape[1] != 3:
        raise stored.error("operations", f"has {operations.shape[1]} columns, expected operator, left, right")
    heads, left, right = operations.T
    constants, outputs = stored.array("constants"), stored.array("outputs", np.int64)
    try:
        return Map(int(inputs), constants, heads, left, right, outputs, _parameters(stored))
    except ProblemError as cause:
        raise stored.error("", str(cause)) from None


def _parameters(stored: Tree) -> dict[str, int]:
    try:
        parameters = json.loads(stored.text("parameters") or "{}")
    except ValueError as cause:
        raise stored.error("parameters", f"is not a JSON object ({cause})") from None
    if not isinstance(parameters, dict) or not all(type(index) is int for index in parameters.values()):
        raise stored.error("parameters", "is not a JSON object of places")
    return parameters


def _read_fields(node_group: Tree, attributes: dict[str, Any], cls: type[Problem]) -> dict[str, Any]:
    names = _scalar_fields(cls)
    if not names:
        return {}
    try:
        stored = cast("dict[str, Any]", json.loads(attributes.get("fields", "{}")))
        result = {name: stored[name] for name in names if name in stored}
    except (TypeError, ValueError) as cause:
        raise node_group.error("@fields", f"is not a JSON object ({cause})") from None
    for name, value in result.items():
        default = cls.__dataclass_fields__[name].default
        if default is not dataclasses.MISSING and type(value) is not type(default):
            raise node_group.error("@fields", f"has {name} = {value!r}, expected {type(default).__name__}")
    return result
