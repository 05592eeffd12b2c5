"""The built-in problems: `problems/<node>/<collection>.h5` with known solutions, and a TOML sheet beside each."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from pathlib import Path

from cpbench import storage
from cpbench.errors import CpbenchError
from cpbench.generators.base import Collection, Instance, generators

SMALL, FEW = 40, 2
"""The largest dimension of a problem of the quick suite, and how many of them a formulation has there."""
UNKNOWN = ("nothing", "infeasible")
"""Facts of a problem that has no known solution."""


def builtin_folder() -> Path:
    """Return the folder of the shipped problems, inside an installed package or beside it in a checkout; raises
    CpbenchError.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "problems", package.parent / "problems"):
        if any(folder.glob("*/*.h5")):
            return folder
    raise CpbenchError("the built-in problems are not installed; write them with: cpbench generate FOLDER")


def address_text(address: str) -> str:
    """Return an address as a reader may type it: that of a built-in problem as `builtin/...`, any other as it is.

    >>> address_text(f"{builtin_folder()}/lcp/american-put.h5"), address_text("mine.h5")
    ('builtin/lcp/american-put.h5', 'mine.h5')
    """
    try:
        inside = address.removeprefix(f"{builtin_folder()}{os.sep}")
    except CpbenchError:  # none are installed
        return address
    return address if inside == address else f"builtin/{inside}"


def quick_problems(folder: Path) -> list[str]:
    """Return the addresses of the small problems of every formulation whose solution is known:
    `builtin/NODE/COLLECTION.h5::NAME`.

    FEW of a formulation, from its collections in turn: of each the largest first that has no dimension above SMALL.
    """
    found: dict[str, list[list[str]]] = {}
    for sheet in sorted(folder.glob("*/*.toml")):
        described = tomllib.loads(sheet.read_text("utf-8"))
        sizes = {
            str(problem["name"]): max(size for size in problem.values() if isinstance(size, int))
            for problem in described["problem"]
            if problem["known"] not in UNKNOWN
        }
        small = sorted((name for name in sizes if sizes[name] <= SMALL), key=lambda name: (-sizes[name], name))
        pack = f"builtin/{described['node']}/{sheet.stem}.h5"
        found.setdefault(str(described["node"]), []).append([f"{pack}::{name}" for name in small])
    return [
        address
        for collections in found.values()
        for address in [one for turn in zip_longest(*collections) for one in turn if one is not None][:FEW]
    ]


def write_collections(folder: str | Path, names: Sequence[str] = ()) -> Iterator[Path]:
    """Write the collections `names` below `folder` (none: all that are shipped), replacing what is there.

    Yields the files; raises UnknownName. Not compressed: zlib and zlib-ng, which h5py's wheels carry in turn, deflate
    the same numbers to other bytes.
    """
    for collection in [generators.get(name) for name in names] or [c for c in generators if c.builtin]:
        place = Path(folder) / collection.node
        place.mkdir(parents=True, exist_ok=True)
        instances = collection.instances()
        pack = place / f"{collection.name}.h5"
        storage.save_pack(
            {i.name: i.problem for i in instances},
            pack,
            solutions={i.name: i.solution for i in instances if i.solution is not None},
            guesses={i.name: i.starts for i in instances},
            force=True,
            compress=False,
        )
        yield pack
        sheet = pack.with_suffix(".toml")
        sheet.write_text(_sheet(collection, instances), encoding="utf-8")
        yield sheet


def _sheet(collection: Collection, instances: list[Instance]) -> str:
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
        lines.append(f"known = {_quoted(instance.known)}")
        lines.append(f"properties = {_quoted(json.dumps(dict(instance.properties), sort_keys=True))}")
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
