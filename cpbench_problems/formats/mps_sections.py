"""Text of an MPS or QPS file, line by line, as named rows, columns and numbers.

Words are separated by blanks, as in free MPS; fixed MPS without blanks in its names is the same. Every line is read
or refused with its number: an unknown section, an unknown name, a number too many, a value given twice, a second set of
right sides. Where programs read one file differently, the file is refused too: an upper bound below 0 without a lower
one, both triangles in QUADOBJ.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from cpbench.errors import FormatError
from cpbench.foundation.text import printable
from cpbench_problems.formats import text_lines
from cpbench_problems.formats.program_text import REFUSED, ProgramText

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?\Z")
_INFINITY = re.compile(r"[+-]?inf(inity)?\Z", re.IGNORECASE)
_ROW_TYPES = ("N", "G", "L", "E")
_WHOLE = {"BV": "a binary", "LI": "an integer", "UI": "an integer", "SC": "a semi-continuous", "SI": "a semi-integer"}
_BOUNDS = ("UP", "LO", "FX", "FR", "MI", "PL")


class Reader:
    """Reads the lines of one file; `sections` is what it has read."""

    def __init__(self, path: Path) -> None:
        self.path, self.line, self.section = path, 0, ""
        self.sections = ProgramText()
        self._sets: dict[str, str] = {}
        self._last = ""
        self._seen: set[str] = set()
        self._lines: dict[str, Callable[[list[str]], None]] = {
            "OBJSENSE": self._sense,
            "ROWS": self._row,
            "COLUMNS": self._column,
            "RHS": self._side,
            "RANGES": self._range,
            "BOUNDS": self._bound,
            "QUADOBJ": self._product,
            "QMATRIX": self._product,
            "QSECTION": self._product,
        }

    def read(self, text: str) -> ProgramText:
        """Read all lines; raises FormatError with the number of the line."""
        ended = False
        for self.line, line in enumerate(text_lines.lines(text), 1):
            if not (words := text_lines.words(line)) or line.startswith("*"):
                continue
            if ended:
                raise self.error(f"'{_shown(words[0])}' stands after ENDATA")
            if line[0] not in " \t":
                ended = self._header(words)
            elif self.section not in self._lines:
                raise self.error(f"'{_shown(words[0])}' stands in no section, expected ROWS before it")
            else:
                self._lines[self.section](words)
        if not ended:
            raise self.error("is the last line, expected ENDATA")
        if not self.sections.objective:
            raise FormatError(self.path, "ROWS", "has no row of type N, expected the objective")
        self._require_bounds()
        self._require_triangles()
        return self.sections

    def error(self, cause: str) -> FormatError:
        place = f"line {self.line}" + (f" ({self.section})" if self.section else "")
        return FormatError(self.path, place, cause)

    # ------------------------------------------------------------------------------------------ lines

    def _header(self, words: list[str]) -> bool:
        """Begin a section; returns whether it is the last one."""
        self.section = words[0].upper()
        if self.section == "ENDATA":
            return True
        if self.section == "NAME":
            self.sections.name = " ".join(words[1:2])
        elif self.section in REFUSED:
            raise self.error(f"holds {REFUSED[self.section]}: no formulation has them")
        elif self.section not in self._lines:
            self.section = ""
            raise self.error(f"'{_shown(words[0])}' is no section, expected one of {', '.join(self._lines)}")
        elif self.section in self._seen:
            raise self.error("is there twice")
        elif self.section == "QSECTION" and words[1:] not in ([], [self.sections.objective]):
            raise self.error(f"is of the row {_shown(words[1])}: no formulation has quadratic constraints")
        elif self.section == "OBJSENSE" and words[1:]:
            self._sense(words[1:])
        elif words[1:] and self.section != "QSECTION":
            raise self.error(f"has '{_shown(words[1])}' behind its name")
        self._seen.add(self.section)
        return False

    def _sense(self, words: list[str]) -> None:
        sense = words[0].upper()
        if len(words) != 1 or sense not in ("MIN", "MAX", "MINIMIZE", "MAXIMIZE"):
            raise self.error(f"is '{_shown(' '.join(words))}', expected MIN or MAX")
        self.sections.maximize = sense.startswith("MAX")

    def _row(self, words: list[str]) -> None:
        if len(words) != 2 or words[0].upper() not in _ROW_TYPES:
            raise self.error(f"has '{_shown(' '.join(words))}', expected N, G, L or E and a name without blanks")
        kind, name = words[0].upper(), words[1]
        found = self.sections
        if name in found.rows or name in found.free or name == found.objective:
            raise self.error(f"has the row {_shown(name)} twice")
        if kind != "N":
            found.rows[name] = kind
        elif found.objective:
            found.free.append(name)
        else:
            found.objective = name

    def _column(self, words: list[str]) -> None:
        if len(words) > 1 and words[1].strip("'\"").upper() == "MARKER":
            raise self.error("has a MARKER of integer unknowns: no formulation has them")
        if len(words) not in (3, 5):
            raise self.error(f"has {len(words)} words, expected a column and one or two pairs of a row and a number")
        found, name = self.sections, words[0]
        if name != self._last:
            if name in found.columns:
                raise self.error(f"returns to the column {_shown(name)}: its lines must follow each other")
            found.columns[name] = len(found.columns)
            self._last = name
        for row, value in self._pairs(words[1:]):
            if row == found.objective:
                self._once(found.cost, name, value, f"the objective of {name}")
            elif row in found.rows:
                self._once(found.entries, (row, name), value, f"the entry of {name} in {row}")
            elif row not in found.free:
                raise self.error(f"has the row {_shown(row)}, which is not in ROWS")

    def _side(self, words: list[str]) -> None:
        found = self.sections
        for row, value in self._pairs(self._without_set(words)):
            if row == found.objective:
                if "RHS of the objective" in self._seen:
                    raise self.error(f"has a right side of {_shown(row)} twice")
                self._seen.add("RHS of the objective")
                found.constant = 0.0 - value  # by convention: objective - right side
            elif row in found.rows:
                self._once(found.sides, row, value, f"a right side of {row}")
            elif row not in found.free:
                raise self.error(f"has the row {_shown(row)}, which is not in ROWS")

    def _range(self, words: list[str]) -> None:
        for row, value in self._pairs(self._without_set(words)):
            if row not in self.sections.rows:
                raise self.error(f"has the row {_shown(row)}, which is no constraint in ROWS")
            self._once(self.sections.ranges, row, value, f"a range of {row}")

    def _bound(self, words: list[str]) -> None:
        kind = words[0].upper()
        if kind in _WHOLE:
            raise self.error(f"makes {_shown(words[-1])} {_WHOLE[kind]} unknown ({kind}): no formulation has them")
        if kind not in _BOUNDS:
            raise self.error(f"has the type '{_shown(kind)}', expected one of {', '.join(_BOUNDS)}")
        without = kind in ("FR", "MI", "PL")
        # the name of the set may be left out, and a value that means nothing may be there
        rest = words[1:]
        column_first = len(rest) >= 1 and rest[0] in self.sections.columns and len(rest) == 2 - without
        if not column_first:
            self._set(rest[0] if rest else "")
            rest = rest[1:]
        if len(rest) not in ((1, 2) if without else (2,)):
            expected = "a type, a set, a column" + ("" if without else ", a number")
            raise self.error(f"has {len(words)} words, expected {expected}")
        name = rest[0]
        if name not in self.sections.columns:
            raise self.error(f"has the column {_shown(name)}, which is not in COLUMNS")
        value = 0.0 if without else self._number(rest[1], infinite=True)
        if kind in ("LO", "FX", "FR", "MI"):
            lower = value if kind in ("LO", "FX") else -math.inf
            self._once(self.sections.lower, name, lower, f"a lower bound of {name}")
        if kind in ("UP", "FX", "FR", "PL"):
            upper = value if kind in ("UP", "FX") else math.inf
            self._once(self.sections.upper, name, upper, f"an upper bound of {name}")

    def _product(self, words: list[str]) -> None:
        if len(words) != 3:
            raise self.error(f"has {len(words)} words, expected two columns and a number")
        first, second, value = *words[:2], self._number(words[2])
        for name in (first, second):
            if name not in self.sections.columns:
                raise self.error(f"has the column {_shown(name)}, which is not in COLUMNS")
        self.sections.full = self.section == "QMATRIX"
        if len({"QUADOBJ", "QMATRIX", "QSECTION"} & self._seen) > 1:
            raise self.error("is a second section of quadratic terms")
        self._once(self.sections.quadratic, (first, second), value, f"the product of {first} and {second}")

    # ------------------------------------------------------------------------------------------ words

    def _pairs(self, words: list[str]) -> Iterator[tuple[str, float]]:
        if not words or len(words) % 2:
            raise self.error(f"has {len(words)} words, expected pairs of a row and a number")
        for row, text in zip(words[::2], words[1::2], strict=True):
            yield row, self._number(text)

    def _without_set(self, words: list[str]) -> list[str]:
        """Return the pairs of a line that may begin with the name of its set."""
        if len(words) > 5:
            raise self.error(f"has {len(words)} words, expected a set and one or two pairs of a row and a number")
        if len(words) % 2:
            self._set(words[0])
            return words[1:]
        return words

    def _set(self, name: str) -> None:
        """Raise FormatError on a second set of right sides, ranges or bounds: a program would take the first."""
        first = self._sets.setdefault(self.section, name)
        if name != first:
            raise self.error(f"has the set {_shown(name)} beside {_shown(first)}, expected one set")

    def _number(self, text: str, *, infinite: bool = False) -> float:
        if infinite and _INFINITY.match(text):
            return float(text)
        value = float(text.lower().replace("d", "e")) if _NUMBER.match(text) else math.nan
        if not math.isfinite(value):
            raise self.error(f"has '{_shown(text)}', expected a number")
        return value

    def _once(self, values: dict[Any, float], key: str | tuple[str, str], value: float, what: str) -> None:
        if key in values:
            raise self.error(f"has {_shown(what)} twice")
        values[key] = value

    # ------------------------------------------------------------------------------------------ whole file

    def _require_bounds(self) -> None:
        found = self.sections
        for name, upper in found.upper.items():
            if name not in found.lower and upper < 0:
                text = f"has the upper bound {upper:g} and no lower one, which some take for 0, some for -inf: add it"
                raise FormatError(self.path, f"BOUNDS of {_shown(name)}", text)

    def _require_triangles(self) -> None:
        terms, full = self.sections.quadratic, self.sections.full
        for (first, second), value in terms.items():
            other = terms.get((second, first), 0.0)
            pair = f"{_shown(first)} and {_shown(second)}"
            if full and other != value:
                text = f"is not symmetric at {pair}: {value:g} and {other:g}; QUADOBJ is of one triangle"
                raise FormatError(self.path, "QMATRIX", text)
            if not full and first != second and (second, first) in terms:
                raise FormatError(self.path, "QUADOBJ", f"has {pair} in both triangles, expected one; QMATRIX has both")


def _shown(text: str) -> str:
    return printable(text[:60])
