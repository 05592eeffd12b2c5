"""MathOptFormat's JSON read with suspicion: its size before it is parsed, the type of every field, finite numbers."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

from cpbench.errors import FormatError

LARGEST = 1 << 30
"""Bytes that the parsed text may take; the maps that are made of it take up to three times as much for a while."""
_OBJECT, _LIST, _ENTRY = 200, 64, 40
"""Bytes of an object with two keys, of a list, and of an entry of either with a short string or a number in it."""
_SHOWN = 40


def memory(text: bytes) -> int:
    """Estimate how many bytes the parsed text takes, by its brackets and commas."""
    return _OBJECT * text.count(b"{") + _LIST * text.count(b"[") + _ENTRY * text.count(b",")


def parse(text: bytes, source: str | Path) -> dict[str, Any]:
    """Parse the JSON object of a text; `source` is what messages name. Raises FormatError."""
    size = memory(text)
    if size > LARGEST:
        raise FormatError(
            source, "", f"would take about {size / 1e9:.1f} GB as parsed JSON, at most {LARGEST / 1e9:.1f}"
        )
    try:
        model: Any = json.loads(text, object_pairs_hook=_without_twins)
    except RecursionError:
        raise FormatError(source, "", "is nested too deep: put inner terms into a node_list") from None
    except (ValueError, MemoryError) as cause:
        raise FormatError(source, "", f"is not readable JSON ({shown(cause)})") from None
    if not isinstance(model, dict):
        raise FormatError(source, "", f"holds a JSON {type(model).__name__}, expected an object")
    return cast("dict[str, Any]", model)


def _without_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of a JSON text; raises ValueError where a key stands twice, of which only one could count."""
    result = dict(pairs)
    if len(result) < len(pairs):
        twin = next(key for index, (key, _) in enumerate(pairs) if key in dict(pairs[:index]))
        raise ValueError(f"has the key {shown(twin)} twice")
    return result


def as_float(value: float) -> float:
    """Return a number of a JSON file, whose whole numbers have no end."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def shown(value: Any) -> str:
    """Shorten a part of a file for a message, printable whatever it is."""
    text = str(value)
    return ascii(text)[1:-1] if len(text) <= _SHOWN else f"{ascii(text[:_SHOWN])[1:-1]}..."


class Fields:
    """Fields of JSON objects, of the type that is asked for or a FormatError that names their place."""

    def __init__(self, source: str | Path) -> None:
        self.source = source

    def refused(self, where: str, cause: str) -> FormatError:
        return FormatError(self.source, where.lstrip("/"), cause)

    def get(self, parent: Any, key: str, kind: type[Any], where: str) -> Any:
        value = parent.get(key) if isinstance(parent, dict) else None
        if not isinstance(value, kind) or isinstance(value, bool):
            defect = "is missing" if value is None else f"is a {type(value).__name__}"
            raise self.refused(f"{where}/{key}", f"{defect}, expected a {kind.__name__}")
        return value

    def items(self, parent: Any, key: str, where: str = "") -> Iterator[tuple[int, Any]]:
        return enumerate(self.get(parent, key, list, where))

    def finite(self, value: Any, where: str) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(as_float(value)):
            defect = "is missing" if value is None else f"is '{shown_number(value)}'"
            raise self.refused(where, f"{defect}, expected a finite number")
        return float(value)

    def number(self, parent: Any, key: str, where: str) -> float:
        return self.finite(parent.get(key) if isinstance(parent, dict) else None, f"{where}/{key}")

    def names(self, model: Any) -> list[str]:
        """Return the names of the variables, each once."""
        names = [self.get(v, "name", str, f"variables/{k}") for k, v in self.items(model, "variables")]
        seen: set[str] = set()
        for name in names:
            if name in seen:
                raise self.refused("variables", f"has two of one name, '{shown(name)}'")
            seen.add(name)
        return names

    def variable(self, column: Mapping[str, int], name: Any, where: str) -> int:
        """Return the number of a variable."""
        result = column.get(name) if isinstance(name, str) else None
        if result is None:
            raise self.refused(where, f"names the variable '{shown_number(name)}', which is none of variables")
        return result


def shown_number(value: Any) -> str:
    """Do as `shown`; give a whole number of thousands of digits by its size, which Python would refuse to write."""
    if isinstance(value, int) and value.bit_length() > 200:
        return f"a whole number of {value.bit_length()} bits"
    return shown(value)
