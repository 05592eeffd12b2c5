"""Tokens of GAMS' scalar text, with the lines that are instructions to GAMS' compiler.

Nothing is executed: of such lines ($...) those are passed over that change no model, and every other one is refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from cpbench.errors import FormatError

_TOKEN = re.compile(
    r"(?P<space>\s+)"
    r"|(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
    r"|(?P<name>[A-Za-z_]\w*|%[A-Za-z_]\w*%)"
    r"|(?P<relation>=[A-Za-z]=)"
    r"|(?P<sign>\*\*|\.\.|[-+*/(),;=.])",
    re.ASCII,
)
_HARMLESS = re.compile(
    r"\$\s*(?:if\s+not\s+'%gams\.u1%'\s*==\s*''\s*\$include\s*'%gams\.u1%'"  # a file that a user may name
    r"|(?:on|off)(?:digit|empty|listing|symlist|symxref|uellist|uelxref|inline)"
    r"|title\b.*)\s*",
    re.IGNORECASE,
)
_DEFAULT = re.compile(r"\$\s*if\s+not\s+set\s+(\w+)\s+\$set\s+(\w+)\s+(\w+)\s*", re.IGNORECASE | re.ASCII)
"""`$if not set NLP $set NLP NLP`, with which later versions of CONVERT end their files."""
_SHOWN = 40


@dataclass(frozen=True, slots=True)
class Token:
    """A piece of the text. kind : number, name (in lower case), relation, sign or end."""

    kind: str
    text: str
    line: int


class Tokens:
    """The tokens of a text, or those given, one after the other."""

    def __init__(self, path: Path, text: str | Iterable[Token]) -> None:
        self._path = path
        self._set: dict[str, str] = {}
        self._source = self._all(text) if isinstance(text, str) else iter(text)
        self.next = Token("end", "", 1)
        self.advance()

    def advance(self) -> Token:
        """Return the next token and move behind it."""
        result = self.next
        self.next = next(self._source, Token("end", "", result.line))
        return result

    @property
    def ended(self) -> bool:
        """Whether there is no further token."""
        return self.next.kind == "end"

    def accept(self, text: str) -> bool:
        """Move behind the next token if it has this text."""
        if self.next.text != text or self.ended:
            return False
        self.advance()
        return True

    def require(self, text: str, where: str) -> None:
        """Raise FormatError unless the next token has this text; move behind it."""
        if not self.accept(text):
            self.refuse(f"has {self.shown()} {where}, expected '{text}'")

    def name(self, what: str) -> str:
        """Return the name that comes next; raises FormatError."""
        if self.next.kind != "name":
            self.refuse(f"has {self.shown()}, expected {what}")
        return self.advance().text

    def shown(self) -> str:
        """Return the next token for a message."""
        return f"'{self.next.text[:_SHOWN]}'" if not self.ended else "the end"

    def refuse(self, cause: str, line: int | None = None) -> NoReturn:
        """Raise FormatError with the line of the next token, or another."""
        raise FormatError(self._path, f"line {line or self.next.line}", cause)

    def _all(self, text: str) -> Iterator[Token]:
        hidden = 0
        for number, line in enumerate(text.split("\n"), 1):
            if hidden:
                hidden = 0 if re.match(r"\$\s*offtext\b", line, re.IGNORECASE) else hidden
            elif re.match(r"\$\s*ontext\b", line, re.IGNORECASE):
                hidden = number
            elif line.startswith("$"):
                self._instruction(line, number)
            elif not line.startswith("*"):
                yield from self._of_line(line, number)
        if hidden:
            self.refuse("begins a comment by $onText that does not end", hidden)

    def _of_line(self, line: str, number: int) -> Iterator[Token]:
        at = 0
        while at < len(line):
            match = _TOKEN.match(line, at)
            if match is None:
                self.refuse(f"has {line[at]!a}, which GAMS' CONVERT does not write in scalar models", number)
            at = match.end()
            kind, token = match.lastgroup, match[0]
            if kind == "space":
                continue
            if kind == "name":
                token = token.lower()
                if token.startswith("%"):
                    token = self._value(token, number)
            assert kind is not None  # every alternative of the pattern has a name
            yield Token(kind, token, number)

    def _instruction(self, line: str, number: int) -> None:
        given = _DEFAULT.fullmatch(line)
        if given is not None and given[1].lower() == given[2].lower():
            self._set.setdefault(given[1].lower(), given[3].lower())
        elif not _HARMLESS.fullmatch(line):
            shown = ascii(line[:_SHOWN])[1:-1]
            self.refuse(f"has the instruction {shown}, and cpbench executes none: write the model by CONVERT", number)

    def _value(self, name: str, number: int) -> str:
        values: Mapping[str, str] = self._set
        if name.strip("%") not in values:
            self.refuse(f"has {name}, for which no line above it sets a value", number)
        return values[name.strip("%")]
