"""Detection of a file's format, and the four verbs on problems: load, members, save, find."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from cpbench.errors import CpbenchError, FormatError
from cpbench.formulations.base import Point, Problem
from cpbench.foundation import brackets
from cpbench.storage.array_containers import folder_files, is_array_folder
from cpbench.storage.base import (
    SEPARATOR,
    Format,
    formats,
    read_head,
    split_address,
    write_atomic,
)
from cpbench.storage.compressed import is_compressed, plain
from cpbench.storage.half_stored import Half

logger = logging.getLogger("cpbench.storage")

NATIVE = ".h5"
"""Suffix of the format that holds every problem."""
_MATRICES = (".npy", ".npz", ".mtx", ".csv", ".txt")
"""Suffixes of files that hold a matrix or a vector, as `cpbench pack` takes them."""


def load(path: str | Path, *, format: str | None = None) -> Problem:
    """Load the problem at `path`, which may be ``file::member``; `format` is a name in `formats`, None: by content.

    `format` may say more, in brackets: ``[symmetric=upper]``, ``cvxopt[symmetric=lower]`` (see `reading`).

    Raises FormatError when the file is not readable as a problem, UnknownName on an unknown format.
    """
    file, member = split_address(path)
    wanted, half = reading(format)
    if wanted is not None:
        if not file.is_dir():
            read_head(file)
        return wanted.load(file, member) if half is None else wanted.load_half(file, member, half)
    first, *others = _candidates(file)
    return first.load_any(others, file, member) if half is None else first.load_half(file, member, half)


def reading(text: str | None) -> tuple[Format | None, Half | None]:
    """Return what a text such as `NAME[symmetric=upper]` says of the reading of a file: the format, None for that of
    its content, and which triangle it holds of symmetric matrices, None for both.

    Raises UnknownName on another format, CpbenchError on another option.
    """
    name, options = brackets.read("format", text or "")
    half = options.pop("symmetric", None)
    if options or half not in (None, "upper", "lower"):
        raise CpbenchError(f"format '{text}': expected NAME, NAME[symmetric=upper] or NAME[symmetric=lower]")
    return formats.get(name) if name else None, half


def members(path: str | Path, format: str | None = None) -> list[str]:
    """Return the names of the problems in a file; [""] when the file is one problem. Raises FormatError."""
    file, _ = split_address(path)
    return (reading(format)[0] or _candidates(file)[0]).members(file)


def files(path: str | Path, format: str | None = None) -> list[Path]:
    """Return all files that the problem at `path` is read from, the one that is named first. Raises FormatError."""
    file, _ = split_address(path)
    chosen = reading(format)[0] or _candidates(file)[0]
    return [file, *chosen.beside(file)]


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
    found: list[str] = []
    for path in paths:
        file, member = split_address(path)
        if file.is_dir():
            found += _searched(file)
        else:
            found += [str(path)] if member else _addresses(file)
    return list(dict.fromkeys(found))


def _searched(folder: Path) -> list[str]:
    """Return the addresses of the problems in a folder; one whose files are the arrays of a problem is one itself."""
    inside = sorted(p for p in folder.rglob("*") if p.is_file() and not p.name.startswith("."))
    by_folder: dict[Path, list[str]] = {}
    for file in inside:
        by_folder.setdefault(file.parent, []).append(file.name)
    problems = [str(place) for place, names in by_folder.items() if is_array_folder(names)]
    return problems + [address for p in inside if _known(p) for address in _addresses(p)]


def _addresses(file: Path) -> list[str]:
    try:
        names = members(file)
    except FormatError:
        return [str(file)]  # loading it gives the reason
    return [f"{file}{SEPARATOR}{name}" if name else str(file) for name in names]


def _known(file: Path) -> bool:
    try:
        head = read_head(file)
    except FormatError:
        head = b""
    name = plain(file)
    return any(f.in_folder(name, head) for f in _possible(file))


def _possible(file: Path) -> list[Format]:
    """Return the formats that the file may be in by its name: those of text where it is compressed."""
    packed = is_compressed(file)
    return [f for f in formats if f.text or not packed]


def _candidates(file: Path) -> list[Format]:
    if file.is_dir() and folder_files(file):
        return [formats.get("arrays")]
    head, name = read_head(file), plain(file)
    result = [f for f in _possible(file) if f.recognises(name, head)]
    if not result:
        known = ", ".join(sorted({suffix for f in formats for suffix in f.suffixes}))
        more = "; a matrix by itself is part of a problem: cpbench pack makes one" if file.suffix in _MATRICES else ""
        raise FormatError(file, "", f"is in no known format (suffixes {known}): name it with --format{more}")
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
