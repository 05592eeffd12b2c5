"""problem.json: what of a problem is not an array. Node, name, and the plain fields of the node (dimension)."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cpbench.errors import FormatError, UnknownName
from cpbench.formulations.base import Problem, formulations
from cpbench.storage.base import build

HEADER = "problem.json"
_LEFT_BEHIND = frozenset({"name", "info", "provenance", "sequence", "contacts"})


def encode(problem: Problem, maps: bool = False) -> bytes:
    """Return the file for `problem`; raises FormatError where it is not all arrays, unless `maps` are allowed."""
    if problem.maps() and not maps:
        raise FormatError(problem.name or problem.node, "", _no_maps(problem.node))
    others = (
        {f.name for f in dataclasses.fields(problem)} - problem.data().keys() - problem.maps().keys() - _LEFT_BEHIND
    )
    header = {"node": problem.node, "name": problem.name}
    return json.dumps(header | {name: getattr(problem, name) for name in sorted(others)}).encode()


def _no_maps(node: str) -> str:
    return f"a problem of type {node} has nonlinear maps, which are no arrays: the exchange hdf5 carries them"


def decode(path: Path, text: bytes, maps: bool = False) -> tuple[type[Problem], dict[str, Any], list[str]]:
    """Return the class, name and plain fields of the problem at `path`, and the names of its arrays; raises
    FormatError, also where the problem has maps, unless these are allowed.
    """
    try:
        header = json.loads(text)
        cls = formulations.get(header.pop("node"))
        name = str(header.pop("name", ""))
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError, UnknownName) as cause:
        raise FormatError(path, HEADER, f"names no problem ({type(cause).__name__}: {cause})") from None
    fields = {f.name: f for f in dataclasses.fields(cls)}
    mapped = {key for key, f in fields.items() if "map" in f.metadata}
    if mapped and not maps:
        raise FormatError(path, HEADER, _no_maps(cls.node))
    data = [key for key, f in fields.items() if "shape" in f.metadata]
    unknown = header.keys() - (fields.keys() - data - mapped - _LEFT_BEHIND)
    if unknown:
        raise FormatError(path, HEADER, f"has {', '.join(sorted(unknown))}, which {cls.node} has not")
    return cls, {"name": name, **header}, data


def assemble(path: Path, cls: type[Problem], fields: Mapping[str, Any], arrays: Mapping[str, Any]) -> Problem:
    """Return the problem from what `decode` found and its arrays by name; raises FormatError."""
    for f in dataclasses.fields(cls):
        if "shape" in f.metadata and f.default is dataclasses.MISSING and f.name not in arrays:
            raise FormatError(path, f.name, f"is missing, expected {' x '.join(f.metadata['shape'])} numbers")
    return build(path, cls, "", **arrays, **fields)
