"""`refs.bib`: what a paper with these figures has to cite.

A solver's or a collection's citation is free text in its own words; it becomes the note of an entry that carries the
name of what it belongs to. Methods of this report that have an author have an entry of their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from cpbench_lab.document.escape import text
from cpbench_lab.document.macros import letters

METHODS = Path(__file__).parent / "methods.bib"
"""Entries of the methods of this report."""


@dataclass
class Bibliography:
    """Entries by citation: things with the same citation share one. `versions` of solvers stand in their entry."""

    _of: dict[tuple[str, str], list[str]] = field(default_factory=dict)
    _keys: dict[tuple[str, str], str] = field(default_factory=dict)

    def cite(self, what: str, name: str, citation: str) -> str:
        r"""Return the call that cites a solver or collection; '' for one without a citation.

        >>> found = Bibliography()
        >>> found.cite("solver", "lemke", "Lemke 1965"), found.cite("solver", "lemke2", "Lemke 1965")
        ('\\cite{cpbench-solver-Lemke}', '\\cite{cpbench-solver-Lemke}')
        """
        if not citation.strip():
            return ""
        place = (what, citation)
        names = self._of.setdefault(place, [])
        if name not in names:
            names.append(name)
        if place not in self._keys:
            key = f"cpbench-{what}-{letters(name)}"
            taken = sum(known.startswith(key) for known in self._keys.values())
            self._keys[place] = key + "x" * taken
        return f"\\cite{{{self._keys[place]}}}"

    def text(self) -> str:
        """Write the whole file."""
        return "\n".join([METHODS.read_text(encoding="utf-8"), *(self._entry(place) for place in self._of)])

    def _entry(self, place: tuple[str, str]) -> str:
        what, citation = place
        names = ", ".join(rf"\texttt{{{text(name)}}}" for name in self._of[place])
        kind = "Solver" if what == "solver" else "Collection"
        several = "s" if len(self._of[place]) > 1 else ""
        title = f"{{{kind}{several} {names}}}"
        key = f"{letters(self._of[place][0])}"
        fields: Mapping[str, str] = {"key": key, "title": title, "note": text(citation)}
        body = ",\n".join(f"  {name} = {{{value}}}" for name, value in fields.items())
        return f"@misc{{{self._keys[place]},\n{body}\n}}\n"
