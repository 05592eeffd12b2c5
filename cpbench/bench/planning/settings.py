"""The settings of a run: how each value is read, whether a plan file, the command line or Python gives it.

A setting belongs to a field of `run_plan`. Its reader takes what TOML has, and returns the value of the field or raises
CpbenchError.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from cpbench.bench.planning import features, grids, quantities, where
from cpbench.bench.planning.plan import pinned
from cpbench.bench.starts import parse_start
from cpbench.errors import CpbenchError, UnknownName
from cpbench.storage.base import formats
from cpbench.verification import CONTRADICTION, Status

TEXT, DURATION, SIZE, COUNT, NUMBERS = "TEXT", "DURATION", "SIZE", "NUMBER", "NUMBERS"
NUMERIC = (COUNT, NUMBERS)
"""Words for the value of an option, and those that are numbers."""
_TYPES = {str: "text", bool: "truth value", int: "number", float: "number", list: "list", tuple: "list", dict: "table"}


@dataclass(frozen=True)
class PlanValue:
    """Reader of a value of a plan, with its default.

    Attributes
    ----------
    read : from a value of TOML; raises CpbenchError. default : of the field. metavar : what stands for a text of it.
    """

    read: Callable[[Any], Any]
    default: Any
    metavar: str

    @property
    def many(self) -> bool:
        """Whether the value is a list, on the command line one with commas."""
        return isinstance(self.default, tuple) and self.read is not shard

    def from_texts(self, texts: Sequence[str]) -> Any:
        """Return the value of the texts of an option; raises CpbenchError."""
        values = [_number(text, self.many) if self.metavar in NUMERIC else text for text in texts]
        return self.read(values if self.many else values[0])

    def default_text(self) -> str:
        """Return the default as the command line takes it, '' where it says nothing."""
        if self.metavar == DURATION:
            return f"{self.default:g}s"
        if self.metavar == SIZE:
            return f"{self.default // 2**30}G"
        if self.many:
            return ",".join(f"{value:g}" if isinstance(value, float) else str(value) for value in self.default)
        return str(self.default) if isinstance(self.default, int | str) and not isinstance(self.default, bool) else ""


def setting(default: Any, read: Callable[[Any], Any], metavar: str = TEXT) -> Any:
    """Return the field of a plan with such a setting."""
    return dataclasses.field(default=default, metadata={"setting": PlanValue(read, default, metavar)})


def choice(default: str, *choices: str) -> Any:
    """Return the field of a plan that is one of several words."""

    def read(value: Any) -> str:
        if text(value) not in choices:
            raise UnknownName("choice", value, choices)
        return value

    return setting(default, read, f"[{'|'.join(choices)}]")


def settings_of(plan: type[Any]) -> dict[str, PlanValue]:
    """Return the settings of a class of plans by the names of their fields."""
    return {f.name: f.metadata["setting"] for f in dataclasses.fields(plan) if f.metadata}


def _number(text: str, many: bool) -> Any:
    """Return the number that a text is; raises CpbenchError, which says how `many` are written."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    raise CpbenchError(f"'{text}' is no number" + ("; write 1e-6 or 1e-4,1e-6" if many else ""))


def _wrong(value: Any, expected: str) -> CpbenchError:
    return CpbenchError(f"expected {expected}, found a {_TYPES.get(type(value), type(value).__name__)}")


def text(value: Any) -> str:
    if not isinstance(value, str):
        raise _wrong(value, "a text")
    return value


def texts(value: Any) -> tuple[str, ...]:
    items = [value] if isinstance(value, str) else value
    if not isinstance(items, list | tuple) or not all(isinstance(item, str) and item for item in items):
        raise _wrong(value, "a text or a list of texts")
    return tuple(items)


def some_texts(value: Any) -> tuple[str, ...]:
    if not (items := texts(value)):
        raise CpbenchError("is empty; leave it out for the default")
    return items


def flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise _wrong(value, "true or false")
    return value


def whole(least: int) -> Callable[[Any], int]:
    """Return the reader of whole numbers from `least` on."""

    def read(value: Any) -> int:
        if not isinstance(value, int) or isinstance(value, bool):
            raise _wrong(value, "a whole number")
        if value < least:
            raise CpbenchError(f"is {value}, must be at least {least}")
        if value > quantities.LARGEST:
            raise CpbenchError(f"is too large, at most {quantities.LARGEST} is kept")
        return value

    return read


def tolerances(value: Any) -> tuple[float, ...]:
    items = value if isinstance(value, list | tuple) else [value]
    if not items or not all(isinstance(item, int | float) and not isinstance(item, bool) for item in items):
        raise _wrong(items[0] if len(items) == 1 else value, "a number or a list of numbers")
    for item in items:
        if not 0 < item < float("inf"):
            raise CpbenchError(f"the tolerance {item:g} is not positive")
    return tuple(dict.fromkeys(float(item) for item in items))


def facets(value: Any) -> tuple[int, ...]:
    items = value if isinstance(value, list | tuple) else [value]
    return tuple(quantities.facet_count(whole(0)(item)) for item in items) or (8, 16)


def seconds(value: Any) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool):
        value = f"{value:f}" if value < float("inf") else "none"
    return quantities.seconds(text(value))


def size(value: Any) -> int:
    return whole(0)(value) if isinstance(value, int) else quantities.size(text(value))


def solvers(value: Any) -> tuple[str, ...]:
    names = texts(value)
    grids.entries(names)
    return names


def via(value: Any) -> tuple[str, ...]:
    names = texts(value)
    pinned(names)
    return names


def starts(value: Any) -> tuple[str, ...]:
    return tuple(dict.fromkeys(str(parse_start(name)) for name in texts(value))) or ("cold",)


def file_format(value: Any) -> str:
    formats.get(text(value))
    return value


def condition(value: Any) -> str:
    where.require_condition(text(value), features.known())
    return value


def report(value: Any) -> str | None:
    return None if value is False else text(value)


def failures(value: Any) -> tuple[str, ...]:
    statuses = (*map(str, Status), CONTRADICTION)
    for name in texts(value):
        if name not in statuses:
            raise UnknownName("status", name, statuses)
    return texts(value)


def shard(value: Any) -> tuple[int, int]:
    part, _, parts = text(value).partition("/")
    if not (part.isdecimal() and parts.isdecimal() and len(value) < 20 and 1 <= int(part) <= int(parts)):
        raise CpbenchError(f"'{value}' is no shard; write 1/4 to 4/4")
    return int(part), int(parts)
