"""The ten lines of text that an .nl file begins with."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from cpbench.errors import FormatError
from cpbench_problems.formats.nl_source import HEADER_LINES, BinarySource, NLSource, TextSource

_LEAST = (1, 3, 2, 2, 3, 2, 5, 2, 2, 5)
"""How many numbers each line has at least."""
_OPTIONAL = 4
"""How many further ones a line may have."""
_NAMED = re.compile(r"#\s*problem[ \t]+(.*)")


@dataclass(frozen=True)
class Header:
    """Sizes of a model, and the text behind `# problem` in its first line, "" without one."""

    variables: int
    constraints: int
    objectives: int
    pairs: int
    jacobian: int
    gradients: int
    remark: str


def read_header(path: Path, data: bytes) -> tuple[Header, NLSource]:
    """Return the header and what follows it; raises FormatError."""
    lines, at = _lines(path, data)
    numbers = [_numbers(path, k, line) for k, line in enumerate(lines)]
    sizes, kinds, functions = numbers[1], numbers[2], numbers[5]
    header = Header(
        variables=sizes[0],
        constraints=sizes[1],
        objectives=sizes[2],
        pairs=sum(kinds[2:4]),
        jacobian=numbers[7][0],
        gradients=numbers[7][1],
        remark=name[1].strip() if (name := _NAMED.search(lines[0])) else "",
    )
    _check(path, header, len(data), numbers)
    if data[:1] == b"g":
        if not data.endswith(b"\n"):  # what is left of its last number may be another number
            raise FormatError(path, "", "ends in the middle of a line: the file is not complete")
        return header, TextSource(path, data, at)
    arithmetic = functions[2] if len(functions) > 2 else 0
    if arithmetic > 2:
        raise FormatError(path, "line 6", f"has the arithmetic {arithmetic}, cpbench reads 1 and 2, those of IEEE 754")
    return header, BinarySource(path, data, at, ">" if arithmetic == 2 else "<")


def _lines(path: Path, data: bytes) -> tuple[list[str], int]:
    if data[:1] not in (b"g", b"b"):
        raise FormatError(path, "line 1", "begins with neither g (text) nor b (binary), as an .nl file does")
    lines, at = list[str](), 0
    for number in range(1, HEADER_LINES + 1):
        end = data.find(b"\n", at)
        if end < 0 or end - at > 1000:
            raise FormatError(path, f"line {number}", f"does not end: an .nl file has {HEADER_LINES} lines of sizes")
        lines.append(data[at:end].decode("latin-1"))
        at = end + 1
    return lines, at


def _numbers(path: Path, line: int, text: str) -> list[int]:
    words = text[line == 0 :].partition("#")[0].split()  # behind the letter of the first line
    if line == 0:
        words = words[:1]  # the others say how a program of AMPL answers
    if len(words) < _LEAST[line] or not all(re.fullmatch(r"\d{1,10}", word, re.ASCII) for word in words):
        raise FormatError(path, f"line {line + 1}", f"has '{text[:40]}', expected {_LEAST[line]} whole numbers")
    if len(words) > _LEAST[line] + _OPTIONAL:
        raise FormatError(path, f"line {line + 1}", f"has {len(words)} numbers, expected {_LEAST[line]}")
    return [int(word) for word in words]


def _check(path: Path, header: Header, size: int, numbers: list[list[int]]) -> None:
    """Raise FormatError on what cpbench does not read, and on sizes that the file has no room for."""
    functions, logical = numbers[5][1], numbers[1][5] if len(numbers[1]) > 5 else 0
    discrete = sum(numbers[6])
    for line, count, what in (
        (2, logical, "logical constraints"),
        (6, functions, "imported functions, and cpbench runs none"),
        (7, discrete, "binary and integer variables, and cpbench has continuous ones only"),
        (2, max(header.objectives - 1, 0), "objectives more than one"),
    ):
        if count:
            raise FormatError(path, f"line {line}", f"has {count} {what}")
    for line, count, what in (
        (2, header.variables, "variables"),
        (2, header.constraints, "constraints"),
        (8, header.jacobian, "entries of the Jacobian"),
        (8, header.gradients, "entries of gradients"),
    ):
        if count > size:  # each has a byte at least
            raise FormatError(path, f"line {line}", f"declares {count} {what} in a file of {size} bytes")
