"""Sets of problem files that the user has: `collection/NAME` stands for the folder of this name in `home()`, which the
user makes: a copy of the files, or a link to it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from cpbench.errors import CpbenchError
from cpbench.storage.collections.manifests import Manifest, manifest


@dataclass(frozen=True)
class LocalFiles:
    """Files of a set that are there, and the paths of those that are missing or changed.

    `size` is of all files that are there [bytes].
    """

    folder: Path
    files: tuple[str, ...]
    missing: tuple[str, ...]
    changed: tuple[str, ...]
    size: int


def home() -> Path:
    """Return the folder of all sets, in the data directory of the user."""
    import platformdirs

    return Path(platformdirs.user_data_dir("cpbench", appauthor=False)) / "collections"


def local_path(address: str) -> str:
    """Return `NAME/REST`, the part of an address after `collection/`, as a path in the folder of that set.

    Raises UnknownName, and CpbenchError where there is no such folder, with what goes into it.
    """
    name, slash, rest = address.partition("/")
    name, separator, member = (name, "", "") if slash else name.partition("::")
    if name and not set("*?[") & set(name) and not (home() / name).is_dir():
        raise CpbenchError(f"collection '{name}' is not there: {how_to_add(manifest(name))}")
    return f"{home() / name}{slash}{rest}{separator}{member}"


def how_to_add(manifest: Manifest) -> str:
    """Return what the user has to do for a set to be there."""
    at = f" at commit {manifest.commit}" if manifest.commit else ""
    return f"put the files of {manifest.source}{at} into {home() / manifest.name}, or make that a link to their folder"


def check(manifest: Manifest) -> LocalFiles | None:
    """Compare the files of a set with its manifest; None where there is no folder of it. A file may have the name that
    it has in its source. Raises OSError."""
    folder = home() / manifest.name
    if not folder.is_dir():
        return None
    paths = {path.relative_to(folder).as_posix(): path for names in manifest.names for path in folder.rglob(names)}
    changed: list[str] = []
    for name, listed in manifest.files.items():
        path = next((path for path in (folder / name, folder / listed.origin) if path.is_file()), None)
        if path is not None:
            paths[name] = path
            with path.open("rb") as file:
                if hashlib.file_digest(file, "sha256").hexdigest() != listed.sha256:
                    changed.append(name)
    missing = tuple(name for name in manifest.files if name not in paths)
    size = sum(path.stat().st_size for path in paths.values())
    return LocalFiles(folder, tuple(sorted(paths)), missing, tuple(changed), size)
