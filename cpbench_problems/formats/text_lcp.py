"""An LCP as two text files, `<name>-M<case>.txt` (row by row) and `<name>-q<case>.txt`, addressed by the first."""

from __future__ import annotations

from pathlib import Path

from cpbench.errors import FormatError
from cpbench.formulations.base import Problem
from cpbench.formulations.linear import LCP
from cpbench.storage.arrays import read_matrix, read_vector
from cpbench.storage.base import Format, build, formats, no_member, stem


class TextLCP(Format):
    """M and q in two files, as the hnm4lcp collection of Ben Gharbia and Gilbert has them."""

    name = "text-lcp"
    summary = "LCP in two text files, *-M*.txt and *-q*.txt"
    suffixes = (".txt",)

    def recognises(self, path: Path, head: bytes) -> bool:
        partner = vector_file(path)
        return path.suffix.lower() in self.suffixes and partner is not None and partner.is_file()

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        partner = vector_file(path)
        if partner is None:
            raise FormatError(
                path, "", "has no '-M' in its name, expected <name>-M<case>.txt beside <name>-q<case>.txt"
            )
        M, q = read_matrix(path), read_vector(partner)
        if M.shape != (q.size, q.size):
            raise FormatError(
                path, "M", f"is {M.shape[0]}x{M.shape[1]}, expected {q.size}x{q.size} as {partner.name} has"
            )
        return build(path, LCP, "", name=stem(path), M=M, q=q)


def vector_file(path: Path) -> Path | None:
    """Return the file of q that belongs to the file of M; None when the name has no '-M'.

    >>> vector_file(Path("diphasic-Ma.txt")).name
    'diphasic-qa.txt'
    """
    before, mark, after = path.name.rpartition("-M")
    return path.with_name(f"{before}-q{after}") if mark else None


formats.add("text-lcp", TextLCP())
