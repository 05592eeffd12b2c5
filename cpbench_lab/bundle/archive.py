"""The zip file of a bundle: the same bytes for the same content, and reading that believes nothing.

`BUNDLE.json` lists every other file with its size and SHA-256; a file that is not listed, or not what the list says, is
no part of a bundle. Names are plain relative paths: nothing is written outside the folder it is unpacked to.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import stat
import struct
import zipfile
import zlib
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from cpbench import __version__
from cpbench.errors import CpbenchError

MANIFEST = "BUNDLE.json"
FORMAT, VERSION = "cpbench bundle", 1
MOST_FILES = 200_000
MOST_BYTES = 2**36
"""Bytes of all files of a bundle that is unpacked: 64 GiB."""
MOST_MANIFEST = 2**28
EXPANSION = 1100
"""Deflate cannot expand by more than 1032; a zip that claims more than this is not believed."""
_PART = re.compile(r"[A-Za-z0-9_.+=@-][A-Za-z0-9_.+=@ -]*")
"""Characters of the parts of a name: none that a shell, a terminal or a file system takes for something else."""
_CHUNK = 2**20
_DAMAGE = (zipfile.BadZipFile, zlib.error, struct.error, EOFError, RuntimeError, ValueError)
"""Exceptions of zipfile on damaged archives: of unknown methods, encryption and names that are not text too."""
_DATE = (1980, 1, 1, 0, 0, 0)


class BundleError(CpbenchError):
    """A file is not a bundle, or not the one that was written."""

    def __init__(self, path: Path, cause: str) -> None:
        super().__init__(f"{path}: {cause}")


# ----------------------------------------------------------------------------------------------- writing


def pack(folder: Path, target: Path, about: Mapping[str, Any]) -> None:
    """Put all files below `folder` into the zip `target`, with their hashes and what `about` says; whole or not at all.

    The same files give the same bytes: sorted, without dates, owners and modes. Raises CpbenchError.
    """
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    files = {name: {"sha256": digest(folder / name), "bytes": (folder / name).stat().st_size} for name in names}
    manifest = {"format": FORMAT, "version": VERSION, "cpbench": __version__, **about, "files": files}
    text = json.dumps(manifest, indent=1, ensure_ascii=False, sort_keys=True) + "\n"
    (folder / MANIFEST).write_text(text, encoding="utf-8")
    partial = target.with_name(f".{target.name}.{os.getpid()}.partial")
    try:
        with zipfile.ZipFile(partial, "w") as archive:
            for name in sorted([*names, MANIFEST]):
                _put(archive, name, folder / name)
        partial.replace(target)
    except OSError as cause:
        raise BundleError(target, f"cannot be written ({cause.strerror or cause}); name another with -o") from None
    finally:
        partial.unlink(missing_ok=True)


def digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def name_of(text: str) -> str:
    """Return a text as one part of a name in a bundle.

    >>> name_of("a b/ç::d"), name_of(".."), name_of("")
    ('a_b_d', 'x', 'x')
    """
    return re.sub(r"[^A-Za-z0-9.+=@-]+", "_", text).strip("._-")[:80] or "x"


def _put(archive: zipfile.ZipFile, name: str, path: Path) -> None:
    entry = zipfile.ZipInfo(name, _DATE)
    # 3 is Unix: on Windows the same files would give other bytes
    entry.compress_type, entry.create_system = zipfile.ZIP_DEFLATED, 3
    entry.external_attr = (stat.S_IFREG | 0o644) << 16
    entry.file_size = path.stat().st_size
    with path.open("rb") as source, archive.open(entry, "w") as out:
        shutil.copyfileobj(source, out, _CHUNK)


# ----------------------------------------------------------------------------------------------- reading


def unpack(path: Path, folder: Path) -> dict[str, Any]:
    """Unpack the bundle at `path` into `folder`, every file checked against its hash; what `BUNDLE.json` says.

    The folder is made; one that has this very bundle is gone on with, any other is refused. Raises BundleError: not a
    bundle, a newer version, a changed file, a name that leads elsewhere, sizes beyond the memory.
    """
    with _opened(path) as archive:
        raw = _manifest(path, archive)
        manifest = _checked(path, raw)
        entries = _entries(path, archive, manifest)
        _require_room(path, folder, sum(entry.file_size for entry in entries.values()))
        _require_ours(path, folder, raw)
        for name, entry in entries.items():
            _extract(path, archive, entry, folder, manifest["files"][name])
        (folder / MANIFEST).write_bytes(raw)
    return manifest


@contextmanager
def _opened(path: Path) -> Generator[zipfile.ZipFile]:
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except FileNotFoundError:
        raise BundleError(path, "no such file") from None
    except _DAMAGE as cause:
        raise BundleError(path, f"is not a bundle of cpbench, or a damaged one ({cause})") from None
    except OSError as cause:
        raise BundleError(path, f"cannot be unpacked ({cause.strerror or cause})") from None


def _manifest(path: Path, archive: zipfile.ZipFile) -> bytes:
    try:
        entry = archive.getinfo(MANIFEST)
    except KeyError:
        raise BundleError(path, f"is not a bundle of cpbench: it has no {MANIFEST}") from None
    if entry.file_size > MOST_MANIFEST:
        raise BundleError(path, f"is not a bundle of cpbench: its {MANIFEST} claims {entry.file_size} bytes")
    with archive.open(entry) as file:
        return file.read(MOST_MANIFEST)


def _checked(path: Path, raw: bytes) -> dict[str, Any]:
    try:
        manifest = json.loads(raw)
    except (ValueError, RecursionError) as cause:
        raise BundleError(path, f"is not a bundle of cpbench: {MANIFEST} is not valid JSON ({cause})") from None
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise BundleError(path, f"is not a bundle of cpbench: {MANIFEST} does not say so")
    version = manifest.get("version")
    if not isinstance(version, int) or version > VERSION:
        raise BundleError(path, f"is a bundle of version {version}, this cpbench knows {VERSION}; update cpbench")
    files = manifest.get("files")
    if not isinstance(files, dict) or not all(_is_sheet(sheet) for sheet in files.values()):
        raise BundleError(path, f"is a damaged bundle: {MANIFEST} does not say what its files are")
    return manifest


def _is_sheet(sheet: Any) -> bool:
    return isinstance(sheet, dict) and isinstance(sheet.get("sha256"), str) and isinstance(sheet.get("bytes"), int)


def _entries(path: Path, archive: zipfile.ZipFile, manifest: Mapping[str, Any]) -> dict[str, zipfile.ZipInfo]:
    """Return the files by name, once each is known to be listed, plain, and as large as the list says."""
    infos = archive.infolist()
    if len(infos) > MOST_FILES:
        raise BundleError(path, f"has {len(infos)} files, at most {MOST_FILES} are unpacked")
    result: dict[str, zipfile.ZipInfo] = {}
    seen: set[str] = set()
    for entry in infos:
        name = entry.filename
        if not is_plain(name):
            raise BundleError(path, f"names a file {name!r}, which may lead out of its folder: nothing was unpacked")
        if entry.flag_bits & 1 or stat.S_ISLNK(entry.external_attr >> 16):
            raise BundleError(path, f"{name} is encrypted or a link: nothing was unpacked")
        # on a system that does not tell letters apart the second would overwrite the first, after its hash was checked
        if name.casefold() in seen:
            raise BundleError(path, f"{name} is there twice: nothing was unpacked")
        seen.add(name.casefold())
        result[name] = entry
    result.pop(MANIFEST)
    listed = manifest["files"]
    for name in sorted(result.keys() ^ listed.keys()):
        how = "is not listed in it" if name in result else "is listed and not there"
        raise BundleError(path, f"was changed: {name} {how}")
    for name, entry in result.items():
        if entry.file_size != listed[name]["bytes"]:
            raise BundleError(path, f"was changed: {name} has {entry.file_size} bytes, not {listed[name]['bytes']}")
    return result


def is_plain(name: str) -> bool:
    """Return whether a name is a relative path that stays where it begins, on every system.

    >>> [is_plain(name) for name in ("plugins/a.py", "../a", "/a", "a//b", "C:a", "a\\\\b", "a/..", "a.")]
    [True, False, False, False, False, False, False, False]
    """
    parts = name.split("/")
    return len(name) <= 400 and all(_PART.fullmatch(part) and not part.endswith((".", " ")) for part in parts)


def _require_room(path: Path, folder: Path, size: int) -> None:
    packed = path.stat().st_size
    if size > min(MOST_BYTES, EXPANSION * packed):
        raise BundleError(path, f"claims {size} bytes in a file of {packed}: nothing was unpacked")
    there = next(parent for parent in (folder.absolute(), *folder.absolute().parents) if parent.exists())
    free = shutil.disk_usage(there).free
    if size > free:
        raise BundleError(path, f"needs {size} bytes, {there} has {free}; name another folder with -o")


def _require_ours(path: Path, folder: Path, raw: bytes) -> None:
    """Raise unless the folder is new, empty, or has this bundle."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        there = sorted(item.name for item in folder.iterdir())
    except OSError as cause:
        raise BundleError(
            folder, f"is not a folder that could be made ({cause.strerror}); name another with -o"
        ) from None
    if not there:
        return
    own = folder / MANIFEST
    if not own.is_file() or own.is_symlink() or own.read_bytes() != raw:
        raise BundleError(folder, f"has something else in it ({there[0]}): name another folder with -o")


def _extract(
    path: Path, archive: zipfile.ZipFile, entry: zipfile.ZipInfo, folder: Path, sheet: Mapping[str, Any]
) -> None:
    target = folder / entry.filename
    target.parent.mkdir(parents=True, exist_ok=True)
    # a link in a folder that was there before: names alone do not show where a file goes
    if folder.resolve() not in target.parent.resolve().parents and target.parent.resolve() != folder.resolve():
        raise BundleError(folder, f"{target.parent} leads out of it: name another folder with -o")
    partial = target.with_name(f".{target.name}.partial")
    partial.unlink(missing_ok=True)
    try:
        # x: never through a link that somebody put there meanwhile
        with archive.open(entry) as source, partial.open("xb") as out:
            copied = _copy(source, out, entry.file_size)
        if copied != sheet["sha256"]:
            raise BundleError(path, f"was changed: {entry.filename} is not what was bundled (SHA-256 {copied[:16]}…)")
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)


def _copy(source: Any, out: BinaryIO, size: int) -> str:
    """Copy at most `size` bytes; return their SHA-256."""
    seen, left = hashlib.sha256(), size
    # no more than was declared, whatever the compressed data expand to
    while left and (chunk := source.read(min(_CHUNK, left))):
        seen.update(chunk)
        out.write(chunk)
        left -= len(chunk)
    return seen.hexdigest()
