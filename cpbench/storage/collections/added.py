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
from cpbench.foundation.plurals import counted, some_of
from cpbench.foundation.temporary import TemporaryHome
from cpbench.storage.collections.manifests import Manifest, manifest

SUMS = "SHA256SUMS"
POINTER = b"version https://git-lfs"
_BLOCK, _SHOWN = 1 << 20, 5
_TEMPORARY = "cpbench-collection-"


@dataclass(frozen=True)
class Found:
    """Files of a set that are there, and the paths of those that are missing, changed, or Git-LFS pointers.

    `size` is of all files that are there [bytes].
    """

    folder: Path
    files: tuple[str, ...]
    missing: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()
    pointers: tuple[str, ...] = ()
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

    Raises FormatError where the set is there already (unless `force`), where files are wrong or Git-LFS pointers, or
    where `source` has none of them.
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
        sums, wrong, pointers = _copied(known, chosen, temporary.folder)
        if pointers or wrong:
            raise FormatError(source, "", _refusal(known, wrong, pointers))
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


def check(known: Manifest, *, content: bool = True) -> Found | None:
    """Compare the copy of a set with its manifest, and what has no hash there with `SHA256SUMS`; None without a copy.

    Without `content` only the presence of the files is checked.
    """
    folder = home() / known.name
    if not folder.is_dir():
        return None
    wanted = _recorded(folder) | {name: listed.sha256 for name, listed in known.files.items()}
    there = [name for name in sorted(wanted) if (folder / name).is_file()]
    changed, pointers = [], []
    for name in there if content else ():
        digest, head = _hashed(folder / name)
        if digest != wanted[name]:
            (pointers if head.startswith(POINTER) else changed).append(name)
    missing = tuple(name for name in wanted if name not in there)
    size = sum((folder / name).stat().st_size for name in there)
    return Found(folder, tuple(there), missing, tuple(changed), tuple(pointers), size)


def _chosen(known: Manifest, source: Path) -> dict[str, list[Path]]:
    """Return the files below `source` that may be those of the set, by their path in the set, the likeliest first."""
    by_name: dict[str, list[PurePosixPath]] = {}
    every = sorted(_files(source))
    for path in every:
        by_name.setdefault(path.name, []).append(path)
    chosen: dict[str, list[Path]] = {}
    for name, listed in known.files.items():
        wanted = PurePosixPath(known.folder, listed.origin)
        found = {*by_name.get(wanted.name, ()), *by_name.get(PurePosixPath(name).name, ())}
        if found:
            ranked = sorted(found, key=lambda path: (-_shared_end(path, wanted), path))
            chosen[name] = [source / path for path in ranked]
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


def _shared_end(path: PurePosixPath, wanted: PurePosixPath) -> int:
    """Return how many parts at their ends two paths have in common."""
    pairs = list(zip(reversed(path.parts), reversed(wanted.parts), strict=False))
    return next((i for i, (one, other) in enumerate(pairs) if one != other), len(pairs))


def _copied(
    known: Manifest, chosen: Mapping[str, Sequence[Path]], folder: Path
) -> tuple[dict[str, str], list[Path], list[Path]]:
    """Copy the files into a folder; return their hashes, those with another content, and those that are pointers."""
    sums: dict[str, str] = {}
    wrong: list[Path] = []
    pointers: list[Path] = []
    for name, candidates in chosen.items():
        listed, to = known.files.get(name), folder / name
        to.parent.mkdir(parents=True, exist_ok=True)
        for path in candidates:
            digest, head = _hashed(path, to)
            if not head.startswith(POINTER) and (listed is None or digest == listed.sha256):
                sums[name] = digest
                break
        else:
            is_pointer = _hashed(candidates[0])[1].startswith(POINTER)
            (pointers if is_pointer else wrong).append(candidates[0])
    return sums, wrong, pointers


def _refusal(known: Manifest, wrong: Sequence[Path], pointers: Sequence[Path]) -> str:
    """Say which files are pointers or have another content, and what to do; one line."""
    said: list[str] = []
    if pointers:
        some = some_of([path.name for path in pointers], _SHOWN)
        said.append(f"{counted(len(pointers), 'Git-LFS pointer')} in place of files ({some}): run 'git lfs pull' there")
    if wrong:
        at = f" of commit {known.commit}" if known.commit else f" of {known.source}"
        some = some_of([path.name for path in wrong], _SHOWN)
        said.append(f"{counted(len(wrong), 'file')} whose SHA-256 is not that of the manifest ({some}): take those{at}")
    return f"has {'; '.join(said)}; nothing was added"


def _hashed(path: Path, copy: Path | None = None) -> tuple[str, bytes]:
    """Return the SHA-256 of a file and its first bytes, and copy it on the way. Raises OSError."""
    digest, head = hashlib.sha256(), b""
    with path.open("rb") as file, open(copy or os.devnull, "wb") as out:
        while block := file.read(_BLOCK):
            head = head or block[: len(POINTER)]
            digest.update(block)
            out.write(block)
    return digest.hexdigest(), head


def _recorded(folder: Path) -> dict[str, str]:
    """Return the hashes that a copy's `SHA256SUMS` has, by path."""
    try:
        lines = (folder / SUMS).read_text("utf-8").splitlines()
    except OSError:
        return {}
    return {name: digest for digest, _, name in (line.partition("  ") for line in lines) if name}
