"""Options that several commands share, and the classes of commands and options behind them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import click

from cpbench.bench.time_limits import floors
from cpbench.cli.types import COUNT, DURATION, MEMORY, NAMES, POSITIVE

if TYPE_CHECKING:
    from cpbench.formulations import Kind

Decorator: TypeAlias = Callable[[Callable[..., Any]], Callable[..., Any]]


class ListOption(click.Option):
    """An option that takes several values, repeated or between commas: `-t 1e-4 -t 1e-8` is `-t 1e-4,1e-8`.

    Its type makes a tuple of one text, of names by default. A value that is given twice counts once; without
    the option the value is its default, or ().
    """

    def __init__(self, *args: Any, type: click.ParamType | None = None, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs, type=type or NAMES, multiple=True)

    def type_cast_value(self, ctx: click.Context, value: Any) -> tuple[Any, ...]:
        texts = value if isinstance(value, (tuple, list)) else ()
        items: Iterator[Any] = (item for text in texts for item in self.type.convert(text, self, ctx) or ())
        return tuple(dict.fromkeys(items))


class Sections(click.Command):
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


def chained(*options: Decorator) -> Decorator:
    """Return one decorator for several options, in their order."""

    def decorate(f: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            f = option(f)
        return f

    return decorate


tolerance_option = click.option(
    "--tolerance",
    "-t",
    type=POSITIVE,
    default=1e-6,
    show_default=True,
    help="Largest measured error of an answer that solves the problem.",
)
TIMEOUT_HELP = f"Wall-clock limit of a solve (30s, 5m, none), and of other phases, which have at least: {floors()}."
MEMORY_HELP = (
    "Memory that a solve may add to a warmed-up worker; conversions have twice that, 2G at least; none: no limit."
)
VIA_HELP = "Conversion to go through, by its name or the end of it; NAME[parameter=value] sets one. Repeatable."
timeout_option = click.option("--timeout", type=DURATION, default="10s", show_default=True, help=TIMEOUT_HELP)
memory_option = click.option("--memory", type=MEMORY, default="4G", show_default=True, help=MEMORY_HELP)
threads_option = click.option("--threads", type=COUNT, default=1, show_default=True, help="Number of BLAS threads.")
limit_options = chained(timeout_option, memory_option, threads_option)
via_option = click.option("--via", cls=ListOption, metavar="CONVERSION", help=VIA_HELP)
format_option = click.option(
    "--format",
    "file_format",
    metavar="NAME",
    help="Format of the input (cpbench list formats).",
)
force_option = click.option("--force", is_flag=True, help="Replace an existing output file.")
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON.")
quiet_option = click.option("-q", "--quiet", is_flag=True, help="Show no progress.")
measure_option = click.option("--measure", metavar="NAME", help="Measure that decides alone; default: all of them.")
publishable_option = click.option(
    "--publishable", is_flag=True, help="Leave out solvers whose licence restricts the publishing of figures."
)
stationary_option = click.option(
    "--count-stationary", is_flag=True, help="Count answers that are only stationary among the solved."
)


def kinds_option(default: str = "") -> Decorator:
    """Return `--routes exact|all`, as a set of kinds in the argument `kinds`; None where it is not given."""

    def _kinds(_: click.Context, __: click.Parameter, value: str | None) -> frozenset[Kind] | None:
        from cpbench import graph  # with NumPy and SciPy, which not every command needs

        return None if value is None else graph.EXACT if value == "exact" else graph.ALL

    return click.option(
        "--routes",
        "kinds",
        type=click.Choice(["exact", "all"]),
        callback=_kinds,
        help="Conversions to consider; all: approximate, relaxed and merely necessary ones too; default: "
        f"exact{default}.",
    )


def seed_option(text: str) -> Decorator:
    """Return `--seed` with a help text."""
    return click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help=text)


def number(value: float) -> str:
    """Return a measured number as all commands print it."""
    return f"{value:.3g}"
