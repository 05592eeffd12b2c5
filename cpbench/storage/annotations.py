"""Annotations of an HDF5 problem: info, provenance with traces, sequence, contact geometry.

<problem>/info                    title, description, math_info; the rest of Info as attributes
<problem>/provenance/<k>          attributes conversion, kind, source_node, source, parameters (JSON)
<problem>/provenance/<k>/trace    arrays, matrix groups, factorizations (their matrix, attribute `factorization`);
                                  numbers and strings as JSON in the attribute `scalars`
<problem>/cpbench/sequence        attributes name, step, time [s], dt [s], previous
<problem>/cpbench/contacts        id, bodies, position [m], frame; those that are known
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, cast

import h5py
import numpy as np
import scipy.sparse as sp

from cpbench.errors import FormatError, ProblemError
from cpbench.formulations.base import Contacts, Info, Problem, Sequence, Step
from cpbench.foundation import matrices
from cpbench.foundation.factorization import Factorization
from cpbench.storage.hdf5_matrices import read_matrix, write_sparse
from cpbench.storage.hdf5_tree import Tree, put_array, put_attribute, put_text

TEXTS = ("title", "description", "math_info")
_ATTRIBUTES = ("source", "licence", "family", "citation")
_DEPTH = 8
"""Traces nest at most this deep: a group may be linked into itself."""


# ------------------------------------------------------------------------------------------------ info


def write_texts(group: h5py.Group, info: Info) -> None:
    """Write title, description and math_info as string data sets (FCLIB's info, and the native one)."""
    for name in TEXTS:
        if getattr(info, name):
            put_text(group, name, getattr(info, name))


def write_info(parent: h5py.Group, info: Info, *, texts: bool) -> None:
    """Write the group `info`, left out when there is nothing to say; `texts` are FCLIB's own in a contact problem."""
    if info == (
        Info(title=info.title, description=info.description, math_info=info.math_info) if not texts else Info()
    ):
        return
    group = parent.create_group("info")
    if texts:
        write_texts(group, info)
    for name in _ATTRIBUTES:
        if getattr(info, name):
            put_attribute(group, name, getattr(info, name))
    if info.properties:
        put_attribute(group, "properties", _to_json(info.properties))


def read_info(problem: Tree, texts: Tree | None) -> Info:
    """Read the info; `texts` is the group of title, description and math_info (FCLIB's or `info` itself)."""
    texts_by_name: dict[str, Any] = {name: texts.text(name) for name in TEXTS} if texts else {}
    if "info" in problem:
        group = problem.child("info")
        attributes = group.attributes()
        texts_by_name |= {name: str(attributes.get(name, "")) for name in _ATTRIBUTES}
        texts_by_name["properties"] = _json(group, "properties", attributes.get("properties", "{}"))
    return Info(**texts_by_name)


# ------------------------------------------------------------------------------------------ provenance


def write_provenance(parent: h5py.Group, steps: tuple[Step, ...], *, compress: bool) -> None:
    if not steps:
        return
    chain = parent.create_group("provenance")
    for k, step in enumerate(steps):
        group = chain.create_group(str(k))
        for name in ("conversion", "kind", "source_node", "source"):
            put_attribute(group, name, str(getattr(step, name)))
        put_attribute(group, "parameters", _to_json(step.parameters))
        _write_trace(group.create_group("trace"), step.trace, compress=compress)


def read_provenance(problem: Tree) -> tuple[Step, ...]:
    if "provenance" not in problem:
        return ()
    chain = problem.child("provenance")
    # by number: names are sorted as text, and 10 comes before 2
    count = len(chain.names())
    return tuple(_read_step(chain, str(k)) for k in range(count))


def _read_step(chain: Tree, name: str) -> Step:
    group = chain.child(name)
    attributes = group.attributes()
    texts = {key: attributes.get(key) for key in ("conversion", "kind", "source_node", "source")}
    for key, value in texts.items():
        if not isinstance(value, str):
            raise group.error(f"@{key}", "is missing, expected a string")
    parameters = _json(group, "parameters", attributes.get("parameters", "{}"))
    return Step(**cast("dict[str, str]", texts), parameters=parameters, trace=_read_trace(group.child("trace"), _DEPTH))


def _write_trace(group: h5py.Group, trace: Mapping[str, Any], *, compress: bool) -> None:
    scalars: dict[str, Any] = {}
    for name, value in trace.items():
        if "/" in name:
            raise FormatError(group.name or "", name, "is not a name for a trace: it has a '/'")
        if isinstance(value, Factorization):
            # its matrix, not its factors: these belong to a version of SciPy, and nothing in a file is trusted to be a
            # factor
            _write_array(group, name, value.A, compress=compress)
            group[name].attrs["factorization"] = 1
        elif isinstance(value, np.ndarray) or sp.issparse(value):
            _write_array(group, name, value, compress=compress)
        elif isinstance(value, Mapping):
            _write_trace(group.create_group(name), cast("Mapping[str, Any]", value), compress=compress)
            group[name].attrs["mapping"] = 1
        else:
            scalars[name] = value
    if scalars:
        put_attribute(group, "scalars", _to_json(scalars))


def _write_array(group: h5py.Group, name: str, value: Any, *, compress: bool) -> None:
    if sp.issparse(value):
        write_sparse(group, name, matrices.sparse(value), compress=compress)
    elif value.dtype.kind in "biuf":
        put_array(group, name, value, compress=compress)
    else:
        raise FormatError(group.name or "", name, f"holds {value.dtype}: a trace keeps numbers only")


def _read_trace(group: Tree, depth: int) -> dict[str, Any]:
    if depth == 0:
        raise group.error("", f"is nested more than {_DEPTH} deep")
    trace: dict[str, Any] = _json(group, "scalars", group.attributes().get("scalars", "{}"))
    for name in group.names():
        if not group.is_group(name):
            value: Any = matrices.freeze(group.array(name, None, None))
            marked = group.attributes(name)
        else:
            child = group.child(name)
            marked = child.attributes()
            if "mapping" in marked:
                trace[name] = _read_trace(child, depth - 1)
                continue
            value = matrices.freeze_sparse(matrices.sparse(read_matrix(group, name, (None, None))))
        trace[name] = _factorization(group, name, value) if "factorization" in marked else value
    return trace


def _factorization(group: Tree, name: str, A: Any) -> Factorization:
    if A.ndim != 2 or A.shape[0] != A.shape[1] or A.dtype != np.float64:
        raise group.error(name, f"has shape {A.shape} of {A.dtype}, a factorization needs a square matrix of float64")
    return Factorization(A)


def _to_json(values: Mapping[str, Any]) -> str:
    """Return JSON with NumPy scalars as numbers; refuse what is neither a number, a string nor a list of them."""

    def plain(value: Any) -> Any:
        if isinstance(value, np.generic):
            return value.item()
        raise FormatError("", "", f"cannot keep a {type(value).__name__}: expected numbers, strings and lists")

    return json.dumps(dict(values), default=plain)


def _json(group: Tree, name: str, text: Any) -> dict[str, Any]:
    try:
        value = json.loads(text)
    except (TypeError, ValueError) as cause:
        raise group.error(f"@{name}", f"is not JSON ({cause})") from None
    if not isinstance(value, dict):
        raise group.error(f"@{name}", "is not a JSON object")
    return cast("dict[str, Any]", value)


# -------------------------------------------------------------------------------- sequence and contacts


def write_place(parent: h5py.Group, problem: Problem, *, compress: bool) -> None:
    """Write `sequence` and `contacts` of a problem that has them."""
    sequence: Sequence | None = getattr(problem, "sequence", None)
    contacts: Contacts | None = getattr(problem, "contacts", None)
    if sequence is not None:
        group = parent.create_group("sequence")
        for f in fields(sequence):
            put_attribute(group, f.name, getattr(sequence, f.name))
    if contacts is not None:
        group = parent.create_group("contacts")
        for f in fields(contacts):
            if contacts.knows(f.name):
                put_array(group, f.name, getattr(contacts, f.name), compress=compress)


def read_place(parent: Tree) -> dict[str, Any]:
    """Return fields `sequence` and `contacts`, absent where the file has none."""
    result: dict[str, Any] = {}
    if "sequence" in parent:
        group = parent.child("sequence")
        attributes = group.attributes()
        try:
            result["sequence"] = Sequence(
                name=str(attributes["name"]),
                step=int(attributes["step"]),
                time=float(attributes["time"]),
                dt=float(attributes["dt"]),
                previous=str(attributes.get("previous", "")),
            )
        except (KeyError, TypeError, ValueError) as cause:
            raise group.error("", f"needs the attributes name, step, time and dt ({cause})") from None
    if "contacts" in parent:
        group = parent.child("contacts")
        kinds = {"id": np.int64, "bodies": np.int64, "position": np.float64, "frame": np.float64}
        parts: dict[str, Any] = {name: group.array(name, dtype, None) for name, dtype in kinds.items() if name in group}
        try:
            result["contacts"] = Contacts(**parts)
        except (ProblemError, TypeError) as cause:
            raise group.error("", str(cause)) from None
    return result
