"""Types of the values that commands take: durations, lengths, sizes, facet counts, problems, lists."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from cpbench.bench.planning import quantities
from cpbench.errors import CpbenchError

PATH = click.Path(path_type=Path)
FILE = click.Path(path_type=Path, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)
COUNT = click.IntRange(min=1)
POSITIVE = click.FloatRange(min=0, min_open=True)


class Duration(click.ParamType):
    """`30s`, `10m`, `3h`, a number of seconds, or `none`."""

    name = "duration"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        if isinstance(value, (int, float)):
            return float(value)
        try:
            return quantities.seconds(str(value))
        except CpbenchError as cause:
            self.fail(str(cause), param, ctx)


class Length(click.ParamType):
    """`3.5in`, `89mm` or `8.9cm`, in inches."""

    name = "length"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        if isinstance(value, float):
            return value
        units = {"in": 1.0, "mm": 1 / 25.4, "cm": 1 / 2.54}
        number, unit = str(value).strip()[:-2], str(value).strip()[-2:]
        try:
            length = float(number) * units[unit]
        except (ValueError, KeyError):
            length = 0.0
        if not 0 < length < 1000:
            self.fail(f"'{value}' is no length: write 3.5in, 89mm or 8.9cm", param, ctx)
        return length


class Memory(click.ParamType):
    """`512M`, `4G`, or a number of bytes; `0` or `none` for no limit."""

    name = "size"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        if isinstance(value, int):
            return value
        try:
            return quantities.size(str(value))
        except CpbenchError as cause:
            self.fail(str(cause), param, ctx)


class Counts(click.ParamType):
    """`8` or `8,16`: numbers of facets, even and at least 4."""

    name = "numbers"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, ...]:
        if isinstance(value, tuple):
            return tuple(int(v) for v in value)
        try:
            return tuple(quantities.facet_count(int(part)) for part in str(value).split(","))
        except ValueError:
            self.fail(f"'{value}' is no list of numbers; write 8 or 8,16", param, ctx)
        except CpbenchError as cause:
            self.fail(str(cause), param, ctx)


class Count(click.ParamType):
    """`8`: one number of facets, even and at least 4."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        try:
            return quantities.facet_count(int(value))
        except ValueError:
            self.fail(f"'{value}' is no number of facets; write one, as 8", param, ctx)
        except CpbenchError as cause:
            self.fail(str(cause), param, ctx)


class Address(click.ParamType):
    """A file, FILE::NAME, or one of the built-in problems, `builtin/lcp/american-put.h5::american-put-100`."""

    name = "problem"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        from cpbench.bench.planning.selection import located
        from cpbench.generators.collection import builtin_folder

        return located(str(value), builtin_folder)


class Numbers(click.ParamType):
    """`1e-6` or `1e-4,1e-6`."""

    name = "numbers"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        if isinstance(value, tuple):
            return tuple(float(v) for v in value)
        try:
            return tuple(float(part) for part in str(value).split(","))
        except ValueError:
            self.fail(f"'{value}' is no list of numbers; write 1e-6 or 1e-4,1e-6", param, ctx)


class Names(click.ParamType):
    """`wrong` or `wrong,crash`; commas in brackets separate nothing: `nsgs[omega=1,shuffle=true],lemke`."""

    name = "names"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, ...]:
        return value if isinstance(value, tuple) else tuple(separated(str(value)))


def separated(text: str) -> list[str]:
    """The parts between commas that stand in no bracket.

    >>> separated("nsgs[omega=1,shuffle=true], lemke")
    ['nsgs[omega=1,shuffle=true]', 'lemke']
    """
    parts, depth = [""], 0
    for sign in text:
        depth += (sign in "[({") - (sign in "])}")
        if sign == "," and depth <= 0:
            parts.append("")
        else:
            parts[-1] += sign
    return [part.strip() for part in parts]
