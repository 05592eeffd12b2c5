"""Damage to files, drawn by a seed, and what a reader makes of it: a content, or a refusal in one line."""

from __future__ import annotations

import random
import re
import signal
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from typing import TypeVar

from cpbench.errors import CpbenchError

T = TypeVar("T")

HANGS = 20
"""Seconds after which a reader of a file of some kilobytes hangs."""
INSERTED = (b"\0" * 31, b"8" * 350, b"-3", b"nan", b"1e888", b"\xfe" * 12, b"{{" * 40, b"\x1b[32m")


def spoiled(whole: bytes, draw: random.Random) -> bytes:
    """Flip a bit, overwrite, cut short, copy, insert, or leave out."""
    found, place = bytearray(whole), draw.randrange(len(whole))
    kind = draw.randrange(6)
    if kind == 0:
        found[place] ^= 1 << draw.randrange(8)
    elif kind == 1:
        for _ in range(10):
            found[draw.randrange(len(whole))] = draw.randrange(256)
    elif kind == 2:
        del found[place:]
    elif kind == 3:
        source, size = draw.randrange(len(whole)), draw.randrange(1, 160)
        found[place : place + size] = found[source : source + size]
    elif kind == 4:
        found[place:place] = draw.choice(INSERTED)
    else:
        del found[place : place + draw.randrange(1, 1500)]
    return bytes(found)


def rearranged(text: str, draw: random.Random, cuts: Sequence[str], letters: str) -> str:
    """Leave out, double, exchange or replace up to three pieces.

    cuts : patterns at which a text is cut into pieces, one of them each time. letters : what a piece is replaced by.
    """
    for _ in range(draw.randint(1, 3)):
        pieces = re.split(draw.choice(cuts), text)
        i, j = draw.randrange(len(pieces)), draw.randrange(len(pieces))
        match draw.randrange(4):
            case 0:
                pieces[i] = ""
            case 1:
                pieces[i] += pieces[j]
            case 2:
                pieces[i], pieces[j] = pieces[j], pieces[i]
            case _:
                pieces[i] = draw.choice(letters)
        text = "".join(pieces)
    return text


def read_or_refused(read: Callable[[], T]) -> T | None:
    """Return what `read` returns, None where it refuses in one line.

    Any other exception, a refusal of more than a line, and a hang are failures of the test.
    """
    refusal = ""
    with _limited():
        try:
            return read()
        except CpbenchError as cause:
            refusal = str(cause)
    assert "\n" not in refusal
    return None


@contextmanager
def _limited() -> Generator[None]:
    """End what hangs within this context by TimeoutError, where the system has an alarm."""

    def late(*_: object) -> None:
        raise TimeoutError(f"not over after {HANGS} s")

    if not hasattr(signal, "alarm"):
        yield
        return
    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(HANGS)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
