"""What a file of AMPL's .nl format consists of: keys, whole numbers and numbers, in text (g) or binary (b).

In text an entry is a line, its key the first character, and `#` begins a comment; in binary there are 4-byte whole
numbers (2-byte ones where the format says short) and 8-byte numbers of IEEE 754. The header is text in both.
"""

from __future__ import annotations

import math
import re
import struct
from abc import ABC, abstractmethod
from pathlib import Path
from typing import NoReturn

from cpbench.errors import FormatError

_WHOLE = re.compile(r"[+-]?\d{1,18}", re.ASCII)
_NUMBER = re.compile(r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|inf(?:inity)?)", re.ASCII | re.IGNORECASE)
HEADER_LINES = 10
_SHOWN = 30


class NLSource(ABC):
    """The rest of a file, read from its beginning on."""

    def __init__(self, path: Path) -> None:
        self._path = path

    @abstractmethod
    def key(self) -> str:
        """Return the character that begins the next entry, "" at the end of the file."""

    @abstractmethod
    def line(self) -> None:
        """Begin an entry without a key."""

    @abstractmethod
    def signed(self) -> int:
        """Return the next whole number of an entry, which may be negative; raises FormatError."""

    @abstractmethod
    def number(self) -> float:
        """Return the next number of an entry; raises FormatError where there is none, or it is NaN."""

    @abstractmethod
    def word(self) -> str:
        """Return the next name of an entry."""

    @abstractmethod
    def end(self) -> None:
        """End an entry; raises FormatError where more stands in it."""

    @abstractmethod
    def where(self) -> str:
        """Return the place for a message."""

    def whole(self) -> int:
        """Return the next whole number of an entry; raises FormatError, also where it is negative."""
        result = self.signed()
        if result < 0:
            self.refuse(f"has {result}, expected a whole number of at least 0")
        return result

    def short(self) -> float:
        """Return a number of the kind `s`."""
        return self.number()

    def long(self) -> float:
        """Return a number of the kind `l`."""
        return self.number()

    def finite(self) -> float:
        """Return the next number; raises FormatError unless it is finite."""
        result = self.number()
        if not math.isfinite(result):
            self.refuse(f"has {result}, expected a finite number")
        return result

    def below(self, limit: int, what: str) -> int:
        """Return the next whole number, which has to be less than `limit`; raises FormatError."""
        result = self.whole()
        if result >= limit:
            self.refuse(f"has {what} {result}, expected one of 0 to {limit - 1}" if limit else f"has {what} {result}")
        return result

    def refuse(self, cause: str) -> NoReturn:
        """Raise FormatError with the place."""
        raise FormatError(self._path, self.where(), cause)


class TextSource(NLSource):
    """Lines."""

    def __init__(self, path: Path, data: bytes, at: int) -> None:
        super().__init__(path)
        self._lines = data[at:].decode("latin-1").split("\n")
        self._next, self._number = 0, HEADER_LINES
        self._words: list[str] = []
        self._at = 0

    def key(self) -> str:
        if not self._advance():
            return ""
        first = self._words[0]
        self._words[0] = first[1:]
        self._at = 0 if first[1:] else 1
        return first[0]

    def line(self) -> None:
        if not self._advance():
            self.refuse("ends here, expected more entries")

    def signed(self) -> int:
        word = self.word()
        if not _WHOLE.fullmatch(word):
            self.refuse(f"has '{word[:_SHOWN]}', expected a whole number")
        return int(word)

    def number(self) -> float:
        word = self.word()
        if not _NUMBER.fullmatch(word):
            self.refuse(f"has '{word[:_SHOWN]}', expected a number")
        return float(word)

    def word(self) -> str:
        if self._at >= len(self._words):
            self.refuse("ends too soon: a number is missing")
        self._at += 1
        return self._words[self._at - 1]

    def end(self) -> None:
        if self._at < len(self._words):
            self.refuse(f"has '{self._words[self._at][:_SHOWN]}' behind what belongs there")

    def where(self) -> str:
        return f"line {self._number}"

    def _advance(self) -> bool:
        """Go to the next line that is not empty."""
        while self._next < len(self._lines):
            self._words = self._lines[self._next].partition("#")[0].split()
            self._next += 1
            self._number = HEADER_LINES + self._next
            self._at = 0
            if self._words:
                return True
        return False


class BinarySource(NLSource):
    """Bytes. order : `<` or `>`."""

    def __init__(self, path: Path, data: bytes, at: int, order: str) -> None:
        super().__init__(path)
        self._data, self._at = data, at
        self._whole, self._double = struct.Struct(f"{order}i"), struct.Struct(f"{order}d")
        self._short = struct.Struct(f"{order}h")

    def key(self) -> str:
        if self._at >= len(self._data):
            return ""
        self._at += 1
        return chr(self._data[self._at - 1])

    def line(self) -> None:
        pass

    def signed(self) -> int:
        return int(self._unpacked(self._whole))

    def number(self) -> float:
        result = self._unpacked(self._double)
        if math.isnan(result):
            self.refuse("has NaN, expected a number")
        return result

    def short(self) -> float:
        return float(self._unpacked(self._short))

    def long(self) -> float:
        return float(self._unpacked(self._whole))

    def word(self) -> str:
        size = self.whole()
        if size > len(self._data) - self._at:
            self.refuse(f"has a name of {size} bytes, and {len(self._data) - self._at} follow")
        self._at += size
        return self._data[self._at - size : self._at].decode("latin-1")

    def end(self) -> None:
        pass

    def where(self) -> str:
        return f"byte {self._at}"

    def _unpacked(self, form: struct.Struct) -> int | float:
        if self._at + form.size > len(self._data):
            self.refuse("ends here, in the middle of a number")
        (result,) = form.unpack_from(self._data, self._at)
        self._at += form.size
        return result
