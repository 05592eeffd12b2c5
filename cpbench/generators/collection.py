"""The built-in problems: `problems/<node>/<collection>.h5` with known solutions, and a TOML table beside each."""

from __future__ import annotations

import hashlib
import json
import os
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpbench import storage
from cpbench.errors import CpbenchError
from cpbench.formulations.base import Problem
from cpbench.generators.base import SMALL, TIERS, Collection, Instance, generators
from cpbench.storage.collections import PREFIX, added

NAME, VERSION = "cpbench-collection", "2026.12.1"
"""Name of the collection; its version changes when problems are added, changed or removed."""
PROOFS = "proofs.toml"
"""File, among the built-in problems, of what is proved of them; `benchmarks/certified.py --save` writes it."""
TIER_FOLDER = "tiers"
"""Folder, among the built-in problems, of the tables of problems that are not shipped."""


def builtin_folder() -> Path:
    """Return the folder of the shipped problems, inside an installed package or beside it in a checkout; raises
    CpbenchError.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "problems", package.parent / "problems"):
        if any(folder.glob("*/*.h5")):
            return folder
    raise CpbenchError("the built-in problems are not installed; write them with: cpbench collection generate FOLDER")


def address_text(address: str) -> str:
    """Return an address as a reader may type it: that of a built-in problem as `builtin/...`, that of one in a
    collection as `collection/...`, any other as it is.

    >>> address_text(f"{builtin_folder()}/lcp/american-put.h5"), address_text("mine.h5")
    ('builtin/lcp/american-put.h5', 'mine.h5')
    """
    if (shorter := address.removeprefix(f"{added.home()}{os.sep}")) != address:
        return f"{PREFIX}/{shorter}"
    try:
        inside = address.removeprefix(f"{builtin_folder()}{os.sep}")
    except CpbenchError:  # none are installed
        return address
    return address if inside == address else f"builtin/{inside}"


@dataclass(frozen=True)
class ListedProblem:
    """A problem of the collection, without its data.

    Attributes
    ----------
    address : `builtin/...` of a problem of the small tier, else the place in the folder of its tier. unknowns : numbers
        that a solver has to find, multipliers of rows not counted. known : how a solution is known.
    proof : what is proved in exact arithmetic: `proved` or `enclosed` (levels of `certify`), `infeasible, proved`,
        `unbounded, proved`, '' for nothing.
    weight : what it counts where each family of a formulation and tier counts 1. solutions : their number, '' where it
        is not known.
    """

    address: str
    name: str
    node: str
    family: str
    tier: str
    unknowns: int
    known: str
    proof: str
    weight: float
    licence: str
    citation: str
    description: str
    solutions: str
    fingerprint: str
    properties: Mapping[str, Any]


@dataclass(frozen=True)
class Identity:
    """Name by which results quote the collection: version, number of problems, hash over their mathematics."""

    name: str
    problems: int
    digest: str

    def __str__(self) -> str:
        return f"{self.name} ({self.problems} problems, sha256 {self.digest[:16]})"


def identity(entries: Sequence[ListedProblem]) -> Identity:
    """Return the identity of the collection that has these entries, in any order.

    The hash is that of the sorted fingerprints, which are hashes of the mathematics of each problem.
    """
    marks = "\n".join(sorted(entry.fingerprint for entry in entries))
    return Identity(f"{NAME} {VERSION}", len(entries), hashlib.sha256(marks.encode("ascii")).hexdigest())


def catalogue(folder: Path | None = None) -> list[ListedProblem]:
    """Return the entries of all tiers, from the tables in the folder of the built-in problems.

    Those of the standard and the large tier are in its `tiers`, without their files. Raises CpbenchError where no
    problems are installed.
    """
    root = folder or builtin_folder()
    proved = root / PROOFS
    proofs = tomllib.loads(proved.read_text("utf-8")) if proved.exists() else {}
    problems: list[ListedProblem] = []
    for tier, parent in ((SMALL, root), *((tier, root / TIER_FOLDER / tier) for tier in TIERS if tier != SMALL)):
        for table in sorted(parent.glob("*/*.toml")):
            start = "builtin" if tier == SMALL else tier
            problems += _entries(table, tier, f"{start}/{table.parent.name}/{table.stem}.h5", proofs)
    return problems


def _entries(table: Path, tier: str, address: str, proofs: Mapping[str, str]) -> Iterator[ListedProblem]:
    described = tomllib.loads(table.read_text("utf-8"))
    problems = described["problem"]
    for problem in problems:
        yield ListedProblem(
            address=f"{address}::{problem['name']}",
            family=described["name"],
            tier=tier,
            proof=proofs.get(problem["fingerprint"], ""),
            weight=1.0 / len(problems),
            licence=described["licence"],
            citation=described["citation"],
            node=described["node"],
            properties=json.loads(problem["properties"]),
            **{key: problem[key] for key in ("name", "unknowns", "known", "description", "solutions", "fingerprint")},
        )


def write_collections(folder: str | Path, names: Sequence[str] = (), tier: str = SMALL) -> Iterator[Path]:
    """Write the collections `names` below `folder` (none: all of the tier), replacing what is there.

    Yields the files; one collection at a time is in memory. Raises UnknownName. The files are not compressed: zlib and
    zlib-ng, which h5py's wheels carry in turn, deflate the same numbers to other bytes.
    """
    for collection in [generators.get(name) for name in names] or [c for c in generators if c.tier == tier]:
        node_folder = Path(folder) / collection.node
        node_folder.mkdir(parents=True, exist_ok=True)
        instances = collection.instances()
        pack = node_folder / f"{collection.name}.h5"
        storage.save_pack(
            {i.name: i.problem for i in instances},
            pack,
            solutions={i.name: i.solution for i in instances if i.solution is not None},
            guesses={i.name: i.starts for i in instances},
            force=True,
            compress=False,
        )
        yield pack
        table = pack.with_suffix(".toml")
        table.write_text(_as_toml(collection, instances), encoding="utf-8")
        yield table


def _as_toml(collection: Collection, instances: list[Instance]) -> str:
    """Describe a collection, with a table for each instance: sizes, fingerprint, known solution, properties."""
    first = instances[0].problem.info
    lines = [
        f"name = {_quoted(collection.name)}",
        f"node = {_quoted(collection.node)}",
        f"summary = {_quoted(collection.summary)}",
        f"citation = {_quoted(collection.citation)}",
        f"source = {_quoted(first.source)}",
        f"licence = {_quoted(first.licence)}",
    ]
    for instance in instances:
        problem = instance.problem
        lines += ["", "[[problem]]", f"name = {_quoted(problem.name)}", f"fingerprint = {_quoted(problem.fingerprint)}"]
        lines += [f"{symbol} = {size}" for symbol, size in problem.sizes().items()]
        lines.append(f"unknowns = {unknowns(problem)}")
        lines.append(f"known = {_quoted(instance.known)}")
        lines.append(f"solutions = {_quoted(str(problem.info.properties.get('solutions', '')))}")
        lines.append(f"description = {_quoted(problem.info.description)}")
        lines.append(f"properties = {_quoted(json.dumps(dict(instance.properties), sort_keys=True))}")
    return "\n".join(lines) + "\n"


def unknowns(problem: Problem) -> int:
    """Return how many numbers a solver has to find; multipliers beside an unknown z are not counted."""
    sizes = problem.point_sizes
    return sizes["z"] if "z" in sizes else sum(sizes.values())


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
