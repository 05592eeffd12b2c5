"""Values of an option: its range or its choices, written beside its default in a solver's dataclass of options.

    @dataclass(frozen=True)
    class MyOptions:
        omega: float = searched(1.0, low=0.5, high=1.9)              # uniform
        rho: float = searched(1.0, low=1e-4, high=1e4, log=True)     # uniform in log ρ
        local: str = searched("newton", choices=("newton", "exact"))  # and nothing else is accepted
        max_sweeps: int = fixed(100_000)                             # a limit: nothing to search

They are metadata of the field (`range`, `log`, `choices`, `fixed`); `cpbench tune` draws from them. A range says where
a search is worth while, not what is allowed; choices are all that is allowed. Without metadata: a truth value is
both, an Enum its members, a Literal its values, a positive number a decade around its default on either side, uniform
in the logarithm. Texts, zeros, negative numbers and limits (`max_...`) are not searched unless they say where.
"""

from __future__ import annotations

import dataclasses
import math
import random
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, TypeVar

T = TypeVar("T")

DECADE = 10.0
"""How far a number without a range is searched, as a factor on either side of its default."""


def searched(
    default: T, *, low: float | None = None, high: float | None = None, log: bool = False, choices: Sequence[T] = ()
) -> T:
    """Return a field of a dataclass of options that `cpbench tune` searches: between two numbers, or among choices.

    `log` : the search is uniform in the logarithm.
    """
    metadata = {"choices": tuple(choices)} if choices else {"range": (low, high), "log": log}
    return field(default=default, metadata=metadata)


def fixed(default: T) -> T:
    """Return a field of a dataclass of options that is not worth a search: a limit, a seed, what is printed."""
    return field(default=default, metadata={"fixed": True})


@dataclass(frozen=True)
class Domain:
    """Values that are worth a search: `choices`, or the numbers from `low` to `high`, `whole` ones if so."""

    choices: tuple[Any, ...] = ()
    low: float = 0.0
    high: float = 0.0
    log: bool = False
    whole: bool = False

    @property
    def size(self) -> float:
        """Number of values; infinite where they need not be whole."""
        if self.choices:
            return len(self.choices)
        return math.floor(self.high) - math.ceil(self.low) + 1 if self.whole else math.inf

    def draw(self, source: random.Random) -> Any:
        """Return a value; a number has four digits, so that it can be read and typed.

        >>> Domain(low=0.5, high=1.9).draw(random.Random(0))
        1.682
        """
        if self.choices:
            return source.choice(self.choices)
        if self.whole and not self.log:
            return source.randint(math.ceil(self.low), math.floor(self.high))
        if self.log:
            value = math.exp(source.uniform(math.log(self.low), math.log(self.high)))
        else:
            value = source.uniform(self.low, self.high)
        value = min(max(float(f"{value:.4g}"), self.low), self.high)
        return round(value) if self.whole else value

    def __str__(self) -> str:
        if self.choices:
            return " | ".join(written(choice) for choice in self.choices)
        return f"{self.low:g} to {self.high:g}{' (log)' if self.log else ''}"


def domains(options: type) -> dict[str, Domain]:
    """Return where to search, by name of the option; options that are not worth it have no entry."""
    found = {f.name: _domain(options, f) for f in dataclasses.fields(options)}
    return {name: domain for name, domain in found.items() if domain is not None}


def choices(options: type, name: str) -> tuple[Any, ...]:
    """Return all values that an option may have, () where it is not that kind."""
    option = next(f for f in dataclasses.fields(options) if f.name == name)
    if "choices" in option.metadata:
        return tuple(option.metadata["choices"])
    if isinstance(option.default, Enum):
        return tuple(type(option.default))
    if "Literal" not in str(option.type):  # what else is annotated need not be there at run time
        return ()
    hint = typing.get_type_hints(options)[name]
    return typing.get_args(hint) if typing.get_origin(hint) is typing.Literal else ()


def written(value: Any) -> str:
    """Return a value of an option as it is typed on the command line."""
    if isinstance(value, Enum):
        return str(value.value)
    return str(value).lower() if isinstance(value, bool) else str(value)


def _domain(options: type, option: dataclasses.Field[Any]) -> Domain | None:
    about: Mapping[str, Any] = option.metadata
    default = option.default
    if about.get("fixed"):
        return None
    among = choices(options, option.name)
    if among:
        return Domain(choices=among)
    if isinstance(default, bool):
        return Domain(choices=(False, True))
    low, high = about.get("range", (None, None))
    if low is not None and high is not None:
        return Domain(low=low, high=high, log=bool(about.get("log")), whole=isinstance(default, int))
    if not isinstance(default, int | float) or not 0 < default < math.inf or option.name.startswith("max_"):
        return None
    least = default / DECADE
    return Domain(
        low=max(1.0, least) if isinstance(default, int) else least,
        high=default * DECADE,
        log=True,
        whole=isinstance(default, int),
    )
