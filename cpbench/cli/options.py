"""Option types and small pieces that several commands share."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import click
from click.core import ParameterSource

from cpbench.bench.planning import quantities
from cpbench.bench.time_limits import floors
from cpbench.errors import CpbenchError


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
        from cpbench.bench.planning.places import located
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


class ListOption(click.Option):
    """An option that takes several values, repeated or between commas: `-t 1e-4 -t 1e-8` is `-t 1e-4,1e-8`.

    Its type makes a tuple of one text, of names where none is said. A value that is given twice counts once; without
    the option the value is its default, or ().
    """

    def __init__(self, *args: Any, type: click.ParamType | None = None, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs, type=type or Names(), multiple=True)

    def type_cast_value(self, ctx: click.Context, value: Any) -> tuple[Any, ...]:
        texts = value if isinstance(value, (tuple, list)) else ()
        items: Iterator[Any] = (item for text in texts for item in self.type.convert(text, self, ctx) or ())
        return tuple(dict.fromkeys(items))


class Command(click.Command):
    """A command that refuses an option of one value when it is given twice, where click would take the last."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if args and not ctx.resilient_parsing:
            _, _, order = self.make_parser(ctx).parse_args(args=list(args))
            for option in (p for p in order if isinstance(p, click.Option) and not p.is_eager):
                if order.count(option) > 1 and not option.multiple:
                    flag = "/".join((*option.opts[-1:], *option.secondary_opts[-1:]))
                    raise click.UsageError(f"{flag} is given twice: give it once, it has one value", ctx)
        return super().parse_args(ctx, args)


class Sections(Command):
    """A command with many options: its help shows them in `sections`, title -> names of their parameters."""

    def __init__(self, *args: Any, sections: Mapping[str, Sequence[str]], examples: Sequence[str] = (), **kwargs: Any):
        super().__init__(*args, **kwargs)
        self._sections, self._examples = sections, examples

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the sections; an option that none of them names stands in the last."""
        options = [p for p in self.get_params(ctx) if isinstance(p, click.Option)]
        records = {p.name: r for p in options if (r := p.get_help_record(ctx)) is not None}
        named = {name for names in self._sections.values() for name in names}
        rest = [name for name in records if name not in named]
        last = list(self._sections)[-1]
        for title, names in self._sections.items():
            rows = [records[name] for name in (*names, *(rest if title == last else ())) if name in records]
            with formatter.section(title):
                formatter.write_dl(rows)
        if self._examples:
            with formatter.section("Examples"):
                for example in self._examples:
                    formatter.write_text(example)


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
        help="What a solve may add to a warmed-up worker; conversions have twice that, 2G at least; none: no limit.",
    )(f)
    return click.option(
        "--timeout",
        type=Duration(),
        default="10s",
        show_default=True,
        help=f"Wall-clock limit of a solve (30s, 5m, none), and of every other phase, which has at least: {floors()}.",
    )(f)


def facets_option(f: Callable[..., Any]) -> Callable[..., Any]:
    """`--facets`, of commands that convert once."""
    return click.option("--facets", type=Count(), default=8, show_default=True, help="Facets of a facet conversion.")(f)


def require_with_via(via: Sequence[str]) -> None:
    """Raises UsageError when a knob of conversions is given that no conversion is named to take."""
    context = click.get_current_context()
    for name in ("facets", "angle"):
        source = context.get_parameter_source(name)
        if not via and source is not None and source is not ParameterSource.DEFAULT:
            raise click.UsageError(f"--{name} goes with --via CONVERSION, as in --via inner: nothing else takes it")


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
