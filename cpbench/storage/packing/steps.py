"""The files of `cpbench pack --sequence`, step by step: folders, globs, and arrays with one more dimension."""

from __future__ import annotations

import glob
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations.contact import ContactProblem
from cpbench.storage.packing import parts as pack_parts
from cpbench.storage.packing.parts import Part
from cpbench.storage.sequences import Recorder

_MORE = {"ids": 1, "positions": 2}
"""Dimensions of what is known of the contacts of one step."""


def record(
    recorder: Recorder, node: str, files: Mapping[str, Path], known: Mapping[str, Path], axes: str | None
) -> None:
    """Add a problem a step; raises FormatError where the files do not have equally many steps."""
    ranks = {part: 1 + pack_parts.is_matrix(node, part) for part in files}
    for parts in _together({**files, **known}, {**ranks, **_MORE}):
        own = {part: parts[part] for part in files}
        problem: Any = pack_parts.build(node, own, axes, "")
        recorder.add(problem, **{name: parts[name].value for name in known})


def record_problems(recorder: Recorder, source: Path, known: Mapping[str, Path]) -> None:
    """Add the problems of a folder, a glob or a pack, in the order of the numbers in their names."""
    found = sorted(storage.problem_files(_found(source)), key=_natural)
    if not found:
        raise FormatError(source, "", "has no problem file")
    steps = list(_together(known, _MORE)) if known else [{}] * len(found)
    if len(steps) != len(found):
        raise FormatError(source, "", f"has {len(found)} problems, {next(iter(known.values()))} has {len(steps)} steps")
    for address, parts in zip(found, steps, strict=True):
        problem = storage.load(address)
        if not isinstance(problem, ContactProblem):
            raise FormatError(address, "", f"is of type {problem.node}: a sequence has contact problems")
        recorder.add(problem, **{name: part.value for name, part in parts.items()})


def _together(files: Mapping[str, Path], ranks: Mapping[str, int]) -> Iterator[dict[str, Part]]:
    """Yield what the files hold, step by step; what has no steps is the same in all of them."""
    constant: dict[str, Part] = {}
    moving: dict[str, list[Part]] = {}
    for name, file in files.items():
        found = _steps(file, name, ranks[name])
        if isinstance(found, Part):
            constant[name] = found
        else:
            moving[name] = found
    if not moving:
        shown = ", ".join(map(str, files.values()))
        raise FormatError(shown, "", "has no steps: give folders, globs, or arrays with the steps as first dimension")
    first = next(iter(moving))
    for name, found in moving.items():
        if len(found) != len(moving[first]):
            counts = f"has {len(found)} steps, {files[first]} has {len(moving[first])} of {first}"
            raise FormatError(files[name], name, counts)
    for k in range(len(moving[first])):
        yield constant | {name: found[k] for name, found in moving.items()}


def _steps(file: Path, name: str, rank: int) -> Part | list[Part]:
    """Return one part a step, or the one part of all steps."""
    paths = _found(file)
    if paths != [file]:
        read = storage.read_matrix if rank == 2 else storage.read_vector
        return [Part(path, read(path)) for path in paths]
    value: Any = storage.read_array(file)
    if value.ndim == rank:
        return Part(file, value)
    if value.ndim == rank + 1:
        return [Part(file, one) for one in value]
    raise FormatError(file, name, f"has shape {value.shape}, expected {rank} dimensions, or {rank + 1} with the steps")


def _found(source: Path) -> list[Path]:
    """Return the files of a folder or a glob, in the order of the numbers in their names; any other path as it is."""
    if source.is_dir():
        inside = [path for path in source.iterdir() if path.is_file() and not path.name.startswith(".")]
    elif source.exists() or not set(str(source)) & set("*?["):
        return [source]
    else:
        inside = [Path(path) for path in glob.glob(str(source))]
    if not inside:
        raise FormatError(source, "", "has no files")
    return sorted(inside, key=lambda path: _natural(str(path)))


def _natural(text: str) -> list[tuple[int, str]]:
    """Return a sort key that puts step2 before step10."""
    return [(int(piece), "") if piece.isdecimal() else (-1, piece) for piece in re.split(r"(\d+)", text)]
