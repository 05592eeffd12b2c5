"""Landlock: a Linux process gives up its access to files, for itself and all that it starts.

Any other access is refused from then on with EACCES, also to root. A confined process can neither trace nor look
into the memory of one that is not. Since Linux 5.13; `man 7 landlock` has the rights and their numbers.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import stat
import struct
import sys
from collections.abc import Iterable
from functools import cache

_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_ASK_VERSION, _PATH_BENEATH = 1, 1
_PR_SET_NO_NEW_PRIVS = 38
_EXECUTE, _WRITE_FILE, _READ_FILE, _READ_DIR = 1 << 0, 1 << 1, 1 << 2, 1 << 3
_REFER, _TRUNCATE = 1 << 13, 1 << 14
_FIRST = (1 << 13) - 1
"""All rights of the first version: those above, to remove and to make entries of every kind."""
_OF_FILES = _EXECUTE | _WRITE_FILE | _READ_FILE | _TRUNCATE
"""Rights that may be given for a file that is not a folder."""


@cache
def version() -> int:
    """Return the version of Landlock in the kernel, 0 for none."""
    return max(0, _call(_CREATE_RULESET, None, 0, _ASK_VERSION)) if sys.platform == "linux" else 0


def confine(writable: Iterable[str]) -> None:
    """Allow this thread, and all that it starts, to write below `writable` only.

    Paths are absolute and without links; those that do not exist are ignored. Raises OSError.
    """
    known = _FIRST | (_REFER if version() >= 2 else 0) | (_TRUNCATE if version() >= 3 else 0)
    ruleset = _checked(_call(_CREATE_RULESET, struct.pack("=Q", known), 8, 0))
    try:
        _allow(ruleset, "/", _READ_DIR | _READ_FILE | _EXECUTE)
        for path in writable:
            _allow(ruleset, path, known)
        _libc().prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0)
        _checked(_call(_RESTRICT_SELF, ruleset, 0))
    finally:
        os.close(ruleset)


def _allow(ruleset: int, path: str, rights: int) -> None:
    """Allow rights below a path, if it exists and can be opened."""
    with contextlib.suppress(OSError):
        beneath = os.open(path, os.O_PATH | os.O_NOFOLLOW | os.O_CLOEXEC)
        try:
            if not stat.S_ISDIR(os.fstat(beneath).st_mode):
                rights &= _OF_FILES
            _checked(_call(_ADD_RULE, ruleset, _PATH_BENEATH, struct.pack("=Qi", rights, beneath), 0))
        finally:
            os.close(beneath)


def _call(number: int, *arguments: int | bytes | None) -> int:
    """Make a system call and return its result, minus the error number where it failed."""
    libc = _libc()
    given = (ctypes.c_long(a) if isinstance(a, int) else a for a in arguments)
    done = libc.syscall(ctypes.c_long(number), *given)
    return done if done >= 0 else -ctypes.get_errno()


@cache
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def _checked(done: int) -> int:
    if done < 0:
        raise OSError(-done, os.strerror(-done))
    return done
