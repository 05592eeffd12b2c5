"""Option types and small pieces that several commands share."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import click


class Duration(click.ParamType):
    """`30s`, `10m`, `3h`, or a number of seconds."""

    name = "duration"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        if isinstance(value, (int, float)):
            return float(value)
        found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(ms|s|m|h)?", str(value).strip())
        if not found or float(found[1]) <= 0:
            self.fail(f"'{value}' is no duration; write 500ms, 10s, 5m or 2h", param, ctx)
        return float(found[1]) * {"ms": 1e-3, "s": 1.0, None: 1.0, "m": 60.0, "h": 3600.0}[found[2]]


class Memory(click.ParamType):
    """`512M`, `4G`, or a number of bytes; `0` for no limit."""

    name = "size"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        if isinstance(value, int):
            return value
        found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([KMGT]?)(?:i?B)?", str(value).strip(), re.IGNORECASE)
        if not found:
            self.fail(f"'{value}' is no size; write 512M or 4G", param, ctx)
        return int(float(found[1]) * 1024 ** " KMGT".index((found[2] or " ").upper()))


class Counts(click.ParamType):
    """`8` or `8,16`: numbers of facets, even and at least 4."""

    name = "numbers"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, ...]:
        if isinstance(value, tuple):
            return tuple(int(v) for v in value)
        try:
            counts = tuple(int(part) for part in str(value).split(","))
        except ValueError:
            self.fail(f"'{value}' is no list of numbers; write 8 or 8,16", param, ctx)
        for count in counts:
            if count < 4 or count % 2:
                self.fail(f"{count} facets: the number must be even and at least 4", param, ctx)
        return counts


def tolerance_option(f: Callable[..., Any]) -> Callable[..., Any]:
    """`--tolerance`, positive."""
    return click.option(
        "--tolerance",
        "-t",
        type=click.FloatRange(min=0, min_open=True),
        default=1e-6,
        show_default=True,
        help="An answer solves the problem when its measured error is at most this.",
    )(f)


def limit_options(f: Callable[..., Any]) -> Callable[..., Any]:
    """`--timeout`, `--memory`, `--threads`."""
    f = click.option("--threads", type=click.IntRange(min=1), default=1, show_default=True, help="BLAS threads.")(f)
    f = click.option(
        "--memory",
        type=Memory(),
        default="4G",
        show_default=True,
        help="What a solve may add to a warmed-up worker; conversions have twice that, 2G at least; 0: no limit.",
    )(f)
    return click.option(
        "--timeout", type=Duration(), default="10s", show_default=True, help="Wall-clock limit of a solve (30s, 5m)."
    )(f)


def format_option(f: Callable[..., Any]) -> Callable[..., Any]:
    """`--format`, for files whose format cannot be told from their content."""
    return click.option("--format", "file_format", metavar="NAME", help="Format of the input (cpbench list formats).")(
        f
    )


def force_option(f: Callable[..., Any]) -> Callable[..., Any]:
    return click.option("--force", is_flag=True, help="Replace an existing output file.")(f)


def number(value: float) -> str:
    """A measured number the way all commands print it."""
    return f"{value:.3g}"
