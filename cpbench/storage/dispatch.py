"""Detection of a file's format, and the four verbs on problems: load, members, save, find."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from cpbench.errors import FormatError
from cpbench.formulations.base import Point, Problem
from cpbench.storage.base import (
    SEPARATOR,
    Format,
    formats,
    read_head,
    split_address,
    write_atomic,
)

logger = logging.getLogger("cpbench.storage")

NATIVE = ".h5"
"""Suffix of the format that holds every problem."""
_PACK = "; a matrix by itself is part of a problem: cpbench pack makes one"
_HINTS = {
    **dict.fromkeys((".npy", ".npz", ".mtx", ".csv", ".txt"), _PACK),
    ".gz": "; unpack it first (gunzip)",
    ".json": " (MathOptFormat: mof)",
    ".xml": "; a scene of MuJoCo is for cpbench audit mujoco FILE, and in Python for cpbench.from_mujoco",
}
"""Advice on files that are no problem, by suffix."""


def load(path: str | Path, *, format: str | None = None) -> Problem:
    """Load the problem at `path`, which may be ``file::member``; `format` is a name in `formats`, None: by content.

    Raises FormatError when the file is not readable as a problem, UnknownName on an unknown format.
    """
    file, member = split_address(path)
    if format is not None:
        read_head(file)
        return formats.get(format).load(file, member)
    first, *others = _candidates(file)
    return first.load_any(others, file, member)


def members(path: str | Path, format: str | None = None) -> list[str]:
    """Return the names of the problems in a file; [""] when the file is one problem. Raises FormatError."""
    file, _ = split_address(path)
    return _format(file, format).members(file)


def save(
    problem: Problem,
    path: str | Path,
    *,
    format: str | None = None,
    force: bool = False,
    compress: bool = True,
    guesses: Sequence[Point] = (),
) -> None:
    """Write `problem` to `path`, completely or not at all; `format` None: by suffix (.h5, .dat, .npz, .mof.json, .nl).

    `guesses` are starting points; where the format keeps none, a warning says so.

    Raises FormatError when the file exists (unless `force`), or when the format cannot hold the problem.
    """
    file = Path(path)
    chosen = formats.get(format) if format is not None else _by_suffix(problem, file)
    if problem.node not in chosen.writes:
        if not chosen.writes:
            raise FormatError(file, "", f"the format {chosen.name} is only read; cpbench list formats has the others")
        able = ", ".join(sorted(chosen.writes))
        reason = f": {why}" if (why := chosen.why_not(problem.node)) else ""
        raise FormatError(
            file, "", f"the format {chosen.name} writes {able}, not a problem of type {problem.node}{reason}"
        )
    write_atomic(file, lambda out: chosen.write(problem, out, compress=compress, guesses=guesses), force=force)
    if problem.provenance and not chosen.keeps_provenance:
        logger.warning("%s: %s keeps no provenance: answers to it cannot be lifted (.h5 can)", file, chosen.name)
    if guesses and not chosen.keeps_guesses:
        logger.warning(
            "%s: %s keeps no starting points: %d are left out (.h5 keeps them)", file, chosen.name, len(guesses)
        )


def save_pack(
    problems: Mapping[str, Problem],
    path: str | Path,
    *,
    solutions: Mapping[str, Point] | None = None,
    guesses: Mapping[str, Sequence[Point]] | None = None,
    force: bool = False,
    compress: bool = True,
) -> None:
    """Write several problems into one HDF5 file, each under its name, with known solutions under `/solution` and
    starting points under `/guesses`.

    Raises FormatError as `save` does.
    """
    from cpbench.storage.hdf5_files import SUFFIXES, encode_pack

    file = Path(path)
    if file.suffix.lower() not in SUFFIXES:
        raise FormatError(file, "", f"a pack is HDF5: expected a name that ends in {' or '.join(SUFFIXES)}")
    write_atomic(file, encode_pack(problems, solutions, guesses, compress=compress), force=force)


def problem_files(paths: Iterable[str | Path]) -> list[str]:
    """Return the addresses of the problems in files, packs and folders (searched recursively, in sorted order).

    A file that is named is always listed, so that loading it says what is wrong with it. In a folder, files
    that no format recognises are passed over, and so are answer files.
    """
    addresses: list[str] = []
    for path in paths:
        file, member = split_address(path)
        if file.is_dir():
            addresses += _searched(file)
        else:
            addresses += [str(path)] if member else _addresses(file)
    return list(dict.fromkeys(addresses))


def _searched(folder: Path) -> list[str]:
    """Return the addresses of the problems in the files of a folder that some format recognises."""
    inside = sorted(p for p in folder.rglob("*") if p.is_file() and not p.name.startswith("."))
    return [address for p in inside if _is_listed(p) for address in _addresses(p)]


def _addresses(file: Path) -> list[str]:
    try:
        names = members(file)
    except FormatError:
        return [str(file)]  # loading it gives the reason
    return [f"{file}{SEPARATOR}{name}" if name else str(file) for name in names]


def _is_listed(file: Path) -> bool:
    try:
        head = read_head(file)
    except FormatError:
        head = b""
    return any(f.in_folder(file, head) for f in formats)


def _format(file: Path, name: str | None) -> Format:
    return formats.get(name) if name is not None else _candidates(file)[0]


def _candidates(file: Path) -> list[Format]:
    head = read_head(file)
    result = [f for f in formats if f.recognises(file, head)]
    if not result:
        suffixes = ", ".join(sorted({suffix for f in formats for suffix in f.suffixes}))
        raise FormatError(
            file, "", f"is in no known format (suffixes {suffixes}): name it with --format{_HINTS.get(file.suffix, '')}"
        )
    return result


def _by_suffix(problem: Problem, file: Path) -> Format:
    if file.suffix.lower() in (NATIVE, ".hdf5"):  # the usual one: no other format has to be imported
        return formats.get("native")
    name = file.name.lower()
    fitting = [f for f in formats if f.by_suffix and f.holds(problem)]
    reasoned = [f for f in formats if f.writes and f.why_not(problem.node)]  # it says what to do
    for chosen in (*fitting, *reasoned):
        if any(name.endswith(suffix) for suffix in chosen.suffixes):
            return chosen
    suffixes = sorted({suffix for f in fitting for suffix in f.suffixes if NATIVE not in f.suffixes})
    raise FormatError(
        file,
        "",
        f"no format writes a problem of type {problem.node} to a name that ends in '{file.suffix.lower()}': use "
        f"{' or '.join([NATIVE, *suffixes])}",
    )
