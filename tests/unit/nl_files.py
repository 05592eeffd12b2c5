"""Files of AMPL's .nl, written by hand: in text, and in binary by an encoder that shares nothing with cpbench."""

from __future__ import annotations

import struct


def text(
    *segments: str, n: int = 2, m: int = 1, objectives: int = 0, pairs: int = 0, jacobian: int = 0, gradient: int = 0
) -> str:
    """A file with these segments."""
    header = [
        "g3 1 1 0\t# problem by-hand", f" {n} {m} {objectives} 0 0\t# vars", f" {m} {objectives} 0 {pairs} 0 0", " 0 0",
        f" {n} {n} {n}", " 0 0 0 1", " 0 0 0 0 0", f" {jacobian} {gradient}", " 0 0", " 0 0 0 0 0",
    ]  # fmt: skip
    return "\n".join([*header, *segments, ""])


def binary(segments: list[str], order: str = "<", **sizes: int) -> bytes:
    """The same file in binary, by an encoder that shares nothing with cpbench's."""
    header = text(**sizes).replace("g3", "b3").replace(" 0 0 0 1\n", f" 0 0 {1 if order == '<' else 2} 1\n", 1)
    found = header.encode()
    for before, line in zip(["", *segments], segments, strict=False):
        words = line.split()
        first = words[0]
        if before in ("o11", "o12", "o54"):
            found += struct.pack(f"{order}i", int(first))
        elif first in ("0", "1", "2", "3", "4", "5") and len(words) != 2:
            found += first.encode() + b"".join(struct.pack(f"{order}d", float(w)) for w in words[1:])
        elif first[0] in "nsl":
            kind = {"n": "d", "s": "h", "l": "i"}[first[0]]
            found += first[:1].encode() + struct.pack(order + kind, (float if kind == "d" else int)(first[1:]))
        elif first[0].isalpha():
            numbers = [first[1:], *words[1:]] if first[1:] else words[1:]
            found += first[:1].encode() + b"".join(struct.pack(f"{order}i", int(w)) for w in numbers)
        elif line == "4 0":
            found += b"4" + struct.pack(f"{order}d", 0.0)
        else:
            found += struct.pack(f"{order}i", int(first)) + b"".join(
                struct.pack(f"{order}d", float(w)) for w in words[1:]
            )
    return found
