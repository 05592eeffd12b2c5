"""Types of the values that commands take: durations, lengths, sizes, problems, lists."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from cpbench.bench.planning import quantities
from cpbench.errors import CpbenchError
from cpbench.foundation.text import split_brackets

PATH = click.Path(path_type=Path)
FILE = click.Path(path_type=Path, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)
COUNT = click.IntRange(min=1)
POSITIVE = click.FloatRange(min=0, min_open=True)


class Parsed(click.ParamType):
    """A type whose values are parsed from text.

    Parameters
    ----------
    name : of the type in help texts. parse : raises ValueError or CpbenchError. refusal : follows a text that raised
    ValueError.
    """

    def __init__(self, name: str, parse: Callable[[str], Any], refusal: str = "") -> None:
        self.name, self._parse, self._refusal = name, parse, refusal

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not isinstance(value, str):
            return value
        try:
            return self._parse(value)
        except CpbenchError as cause:
            self.fail(str(cause), param, ctx)
        except ValueError:
            self.fail(f"'{value}' {self._refusal}", param, ctx)


def _length(text: str) -> float:
    number, unit = text.strip()[:-2], text.strip()[-2:]
    length = float(number) * {"in": 1.0, "mm": 1 / 25.4, "cm": 1 / 2.54}.get(unit, 0.0)
    if not 0 < length < 1000:
        raise ValueError
    return length


def _setting(text: str) -> tuple[str, float]:
    name, _, number = text.rpartition("=")
    return name, float(number)


def _two_labels(text: str) -> tuple[str, str]:
    first, second = split_brackets(text, ",")
    if not (first and second):
        raise ValueError
    return first, second


def _located(text: str) -> str:
    from cpbench.bench.planning.places import located
    from cpbench.generators.collection import builtin_folder

    return located(text, builtin_folder)


DURATION = Parsed("duration", quantities.seconds)
"""`30s`, `10m`, `3h`, a number of seconds, or `none`, in seconds."""
MEMORY = Parsed("size", quantities.size)
"""`512M`, `4G`, or a number of bytes; `0` or `none` for no limit."""
LENGTH = Parsed("length", _length, "is not a length: write 3.5in, 89mm or 8.9cm")
"""`3.5in`, `89mm` or `8.9cm`, in inches."""
ADDRESS = Parsed("problem", _located)
"""A file, FILE::NAME, or one of the built-in problems, `builtin/lcp/american-put.h5::american-put-100`."""
SETTINGS = Parsed("settings", lambda text: tuple(map(_setting, text.split(","))), "is not NAME=VALUE, as in nu=0.5")
"""`nu=0.5` or `nu=0.5,dt=1e-3`: names and numbers."""
NAMES = Parsed("names", lambda text: tuple(split_brackets(text, ",")))
"""`wrong` or `wrong,crash`; commas in brackets separate nothing: `nsgs[omega=1,shuffle=true],lemke`."""
LABELS = Parsed("labels", _two_labels, "is not two labels of equal code, as mine@base,mine@again")
