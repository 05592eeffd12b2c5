"""Sets of problem files that the user has added: `collection/NAME` stands for the folder of a copy.

A copy is complete or absent: files are copied into a temporary folder beside, hashed on the way, and the folder then
gets its name. `SHA256SUMS` in it has the hash of every file, as `sha256sum -c` reads it.
"""

from __future__ import annotations

import fnmatch
import hashlib
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from cpbench.errors import CpbenchError, FormatError
from cpbench.foundation.locks import TemporaryHome
from cpbench.foundation.text import counted, some_of
from cpbench.storage.collections.manifests import Manifest, manifest

SUMS = "SHA256SUMS"
_BLOCK, _SHOWN = 1 << 20, 5
_TEMPORARY = "cpbench-collection-"


@dataclass(frozen=True)
class Found:
    """Files of a set that are there, and the paths of those that are missing or changed.

    `size` is of all files that are there [bytes].
    """

    folder: Path
    files: tuple[str, ...]
    missing: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()
    size: int = 0


def home() -> Path:
    """Return the folder of all added sets, in the data directory of the user."""
    import platformdirs

    return Path(platformdirs.user_data_dir("cpbench", appauthor=False)) / "collections"


def place(address: str) -> str:
    """Return `NAME/REST`, the part of an address after `collection/`, as a path in the copy of that set.

    Raises UnknownName, and CpbenchError with the command that adds the set where it has not been added.
    """
    name, slash, rest = address.partition("/")
    name, separator, member = (name, "", "") if slash else name.partition("::")
    if name and not set("*?[") & set(name):
        known = manifest(name)
        if not (home() / name).is_dir():
            raise CpbenchError(f"collection '{name}' has not been added: {how_to_add(known)}")
    return f"{home() / name}{slash}{rest}{separator}{member}"


def how_to_add(known: Manifest) -> str:
    """Return the command that adds a set, and where its files come from."""
    at = f" at commit {known.commit}" if known.commit else ""
    return f"cpbench collection add {known.name} --from DIR, where DIR has the files of {known.source}{at}"


def add(known: Manifest, source: Path, *, force: bool = False) -> Found:
    """Copy the files of a set that are below the folder `source`, each checked against its hash.

    A file is recognized by its name; files with that name and another content are refused together, with nothing
    written. Listed files that are not there are in `missing` of what is returned.

    Raises FormatError where the set is there already (unless `force`), where files are wrong, or where `source` has
    none of them.
    """
    target = home() / known.name
    if not source.is_dir():
        raise FormatError(source, "", f"is no folder: --from takes the one with the files of {known.source}")
    if target.exists() and not force:
        raise FormatError(
            target, "", f"is there already: cpbench collection verify {known.name} checks it, --force replaces it"
        )
    chosen = _chosen(known, source)
    if not chosen:
        wanted = some_of(known.names or list(known.files), 2)
        raise FormatError(source, "", f"has no file of the collection '{known.name}', such as {wanted}")
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = TemporaryHome(_TEMPORARY, target.parent)
    try:
        sums, wrong = _copied(known, chosen, temporary.folder)
        if wrong:
            at = f" of commit {known.commit}" if known.commit else f" of {known.source}"
            raise FormatError(
                source,
                "",
                f"has {counted(len(wrong), 'file')} whose SHA-256 is not that of the manifest "
                f"({some_of(wrong, _SHOWN)}): take those{at} (pointers: git lfs pull); nothing was added",
            )
        lines = [f"{sums[name]}  {name}\n" for name in sorted(sums)]
        (temporary.folder / SUMS).write_text("".join(lines), encoding="utf-8")
        shutil.rmtree(target, ignore_errors=True)
        temporary.folder.rename(target)
    except OSError as cause:
        raise FormatError(target, "", f"cannot be written ({cause.strerror or cause}): nothing was added") from None
    finally:
        temporary.remove()
    missing = tuple(name for name in known.files if name not in sums)
    return Found(target, tuple(sorted(sums)), missing, size=sum((target / name).stat().st_size for name in sums))


def check(known: Manifest) -> Found | None:
    """Compare the copy of a set with its manifest, and what has no hash there with `SHA256SUMS`; None without one."""
    folder = home() / known.name
    if not folder.is_dir():
        return None
    wanted = _recorded(folder) | {name: listed.sha256 for name, listed in known.files.items()}
    there = [name for name in sorted(wanted) if (folder / name).is_file()]
    changed = [name for name in there if _hashed(folder / name) != wanted[name]]
    missing = tuple(name for name in wanted if name not in there)
    size = sum((folder / name).stat().st_size for name in there)
    return Found(folder, tuple(there), missing, tuple(changed), size)


def _chosen(known: Manifest, source: Path) -> dict[str, list[Path]]:
    """Return the files below `source` that may be those of the set by their names, by their path in the set."""
    by_name: dict[str, list[Path]] = {}
    every = sorted(_files(source))
    for path in every:
        by_name.setdefault(path.name, []).append(source / path)
    chosen: dict[str, list[Path]] = {}
    for name, listed in known.files.items():
        either = dict.fromkeys((PurePosixPath(listed.origin).name, PurePosixPath(name).name))
        if found := [path for one in either for path in by_name.get(one, ())]:
            chosen[name] = found
    for path in every:
        if any(fnmatch.fnmatchcase(path.name, pattern) for pattern in known.names):
            chosen.setdefault(str(path), [source / path])
    return chosen


def _files(source: Path) -> Iterator[PurePosixPath]:
    """Yield the regular files below a folder, relative to it."""
    for folder, folders, names in os.walk(source):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for name in names:
            if os.path.isfile(os.path.join(folder, name)):
                yield PurePosixPath(Path(folder, name).relative_to(source).as_posix())


def _copied(known: Manifest, chosen: Mapping[str, Sequence[Path]], folder: Path) -> tuple[dict[str, str], list[str]]:
    """Copy the files into a folder; return their hashes, and the names of those of which none has the right content."""
    sums: dict[str, str] = {}
    for name, candidates in chosen.items():
        listed, to = known.files.get(name), folder / name
        to.parent.mkdir(parents=True, exist_ok=True)
        for path in candidates:
            digest = _hashed(path, to)
            if listed is None or digest == listed.sha256:
                sums[name] = digest
                break
    return sums, [candidates[0].name for name, candidates in chosen.items() if name not in sums]


def _hashed(path: Path, copy: Path | None = None) -> str:
    """Return the SHA-256 of a file, and copy it on the way. Raises OSError."""
    digest = hashlib.sha256()
    with path.open("rb") as file, open(copy or os.devnull, "wb") as out:
        while block := file.read(_BLOCK):
            digest.update(block)
            out.write(block)
    return digest.hexdigest()


def _recorded(folder: Path) -> dict[str, str]:
    """Return the hashes that a copy's `SHA256SUMS` has, by path."""
    try:
        lines = (folder / SUMS).read_text("utf-8").splitlines()
    except OSError:
        return {}
    return {name: digest for digest, _, name in (line.partition("  ") for line in lines) if name}
