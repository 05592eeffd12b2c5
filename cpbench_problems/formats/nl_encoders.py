"""Pieces of .nl files as bytes, in text (g) and binary (b)."""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod


class Encoder(ABC):
    """One of the two ways of writing. letter : with which a file begins; arithmetic : in its header, 0 for text."""

    letter: str
    arithmetic: int

    @abstractmethod
    def key(self, key: str, *wholes: int) -> bytes:
        """Return the beginning of a segment, an operator or a variable, with whole numbers."""

    @abstractmethod
    def entry(self, whole: int, number: float | None = None) -> bytes:
        """Return an entry without a key."""

    @abstractmethod
    def numbers(self, key: str, *numbers: float) -> bytes:
        """Return an entry with a key: a constant, or the interval of a row or a variable."""


class Text(Encoder):
    """Lines. Numbers are written so that they come back bit for bit."""

    letter, arithmetic = "g", 0

    def key(self, key: str, *wholes: int) -> bytes:
        return f"{key}{' '.join(map(str, wholes))}\n".encode()

    def entry(self, whole: int, number: float | None = None) -> bytes:
        return f"{whole}\n".encode() if number is None else f"{whole} {number!r}\n".encode()

    def numbers(self, key: str, *numbers: float) -> bytes:
        between = "" if key == "n" else " "
        return f"{key}{between}{' '.join(map(repr, numbers))}".rstrip().encode() + b"\n"


class Binary(Encoder):
    """Little-endian numbers."""

    letter, arithmetic = "b", 1

    def key(self, key: str, *wholes: int) -> bytes:
        return key.encode() + struct.pack(f"<{len(wholes)}i", *wholes)

    def entry(self, whole: int, number: float | None = None) -> bytes:
        return struct.pack("<i", whole) if number is None else struct.pack("<id", whole, number)

    def numbers(self, key: str, *numbers: float) -> bytes:
        return key.encode() + struct.pack(f"<{len(numbers)}d", *numbers)
