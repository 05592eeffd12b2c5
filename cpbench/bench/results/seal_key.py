"""The key with which this user's runs seal their rows.

It lies in a folder of the user's own, which workers may not read where the system can forbid it (`confinement`): never
in a results file, in the environment or in what a worker inherits. Whoever has it can seal any row.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
import tempfile
from dataclasses import dataclass
from pathlib import Path

import platformdirs

BYTES = 32


@dataclass(frozen=True)
class Key:
    """A secret, and whether later commands of this user find it again."""

    secret: bytes
    kept: bool = True

    @property
    def name(self) -> str:
        """Eight digits that identify the key in seals and reveal nothing of the secret."""
        return hashlib.blake2b(self.secret, digest_size=4, person=b"cpbench key").hexdigest()


def folder() -> Path:
    """Return where the key is."""
    return Path(platformdirs.user_state_dir("cpbench", appauthor=False)) / "seals"


def find() -> Key | None:
    """Return this user's key, None where there is none yet or none can be read."""
    try:
        secret = bytes.fromhex((folder() / "key").read_text("ascii"))
    except (OSError, ValueError):
        return None
    return Key(secret) if len(secret) == BYTES else None


def find_or_make() -> Key:
    """Return this user's key, made where there is none; one for this process alone where it cannot be kept."""
    known = find()
    if known is not None:
        return known
    key = Key(secrets.token_bytes(BYTES), kept=False)
    with contextlib.suppress(OSError):
        folder().mkdir(parents=True, exist_ok=True, mode=0o700)
        descriptor, name = tempfile.mkstemp(dir=folder())  # readable by its owner alone
        try:
            with os.fdopen(descriptor, "w") as file:
                file.write(key.secret.hex())
            with contextlib.suppress(FileExistsError):  # of two runs that start together, the first one's stays
                os.link(name, folder() / "key")
        finally:
            os.unlink(name)
    return find() or key
