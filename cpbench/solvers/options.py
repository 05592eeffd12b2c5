"""Values that an option of a solver may have: the members of an Enum, the values of a Literal, else any of its type."""

from __future__ import annotations

import dataclasses
import typing
from enum import Enum
from typing import Any


def choices(options: type, name: str) -> tuple[Any, ...]:
    """Return all values that an option may have, () where any value of its type is allowed."""
    option = next(f for f in dataclasses.fields(options) if f.name == name)
    if isinstance(option.default, Enum):
        return tuple(type(option.default))
    if "Literal" not in str(option.type):  # other annotations may name what is not imported at run time
        return ()
    hint = typing.get_type_hints(options)[name]
    return typing.get_args(hint) if typing.get_origin(hint) is typing.Literal else ()


def written(value: Any) -> str:
    """Return a value of an option as it is typed on the command line."""
    if isinstance(value, Enum):
        return str(value.value)
    return str(value).lower() if isinstance(value, bool) else str(value)
