"""The command line. Commands are imported when they are called: help and completion load click and little else."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Sequence
from importlib.metadata import EntryPoint
from itertools import islice
from typing import Any

import click

from cpbench import __version__
from cpbench.errors import CpbenchError, FormatError
from cpbench.foundation import extensions
from cpbench.foundation.imports import uncollected
from cpbench.foundation.text import on_one_line


def _name_plugins(ctx: click.Context, parameter: click.Parameter, files: tuple[str, ...]) -> None:
    """Put the files into the environment while options are parsed: before anything looks for solvers, and where
    worker processes inherit them. Raises FormatError."""
    for path in files:
        if not (path.endswith((".py", ".toml")) and os.path.isfile(path)):
            raise FormatError(path, "", "--plugin takes a Python file or a .toml file with tables [solver.NAME]")
    if files:
        from cpbench.registry import PLUGIN_FILES

        before = os.environ.get(PLUGIN_FILES)
        given = [os.path.abspath(path) for path in files]
        os.environ[PLUGIN_FILES] = os.pathsep.join([*([before] if before else []), *given])


COMMANDS = (
    "run", "solve", "convert", "verify", "info", "plot", "graph", "list", "report", "compare", "results",
    "collection", "new", "check", "doctor",
)  # fmt: skip
PLUGIN = "--plugin"
SAYING_MORE = ("-h", "--help", "--plan", "--cluster")
"""Options with which a run has no processes here, or others than most."""


class Group(click.Group):
    """A group of commands, to which the entry points ``cpbench.commands`` of other packages add."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(dict.fromkeys([*self.commands, *self._entries()]))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        entry = None if cmd_name in self.commands else self._entries().get(cmd_name)
        if entry is None:
            return self.commands.get(cmd_name)
        with uncollected():
            command: click.Command = entry.load()
        return command

    def _entries(self) -> dict[str, EntryPoint]:
        """Return where each command is that is imported on use."""
        return extensions.commands(self.name or "")

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the first paragraph of the help of each command."""
        helps = ((name, self.get_command(ctx, name)) for name in self.list_commands(ctx))
        with formatter.section("Commands"):
            formatter.write_dl([(name, (command.help or "").split("\n\n")[0]) for name, command in helps if command])

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError:
            import difflib

            commands = self.list_commands(ctx)
            near = difflib.get_close_matches(args[0], commands, n=3)
            hint = f"did you mean {', '.join(near)}?" if near else f"commands: {', '.join(commands)}"
            ctx.fail(f"no command '{args[0]}': {hint}")


class Commands(Group):
    """All commands, of which each lives in `cpbench.cli.<name>_command` or in another package, and is imported on use.

    A name that is taken here is not taken by another package. `--plugin FILE` may stand anywhere.
    """

    def _entries(self) -> dict[str, EntryPoint]:
        of = extensions.COMMANDS
        ours = {name: EntryPoint(name, f"cpbench.cli.{name}_command:command", of) for name in COMMANDS}
        return {**ours, **{name: entry for name, entry in extensions.commands().items() if name not in ours}}

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the first paragraph of the docstring of each command's module, none of which is imported."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, extensions.summary(entry.module)) for name, entry in self._entries().items()])

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        first: list[str] = []
        rest: list[str] = []
        words = iter(args)
        for word in words:
            if word == PLUGIN:
                first += [word, *islice(words, 1)]
            else:
                (first if word.startswith(f"{PLUGIN}=") else rest).append(word)
        return super().parse_args(ctx, [*first, *rest])

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        _begin_run(args)
        return super().resolve_command(ctx, args)


def _begin_run(arguments: Sequence[str]) -> None:
    """Start what starts the processes of a run before its command is imported, which takes as long; where a file or an
    option may say otherwise, as of its threads, the run starts it later."""
    if arguments[:1] != ["run"] or any(word.startswith(SAYING_MORE) for word in arguments):
        return
    if os.path.isfile("cpbench.toml"):
        return
    from cpbench.bench.processes import launch

    launch.begin(1)


@click.group(name="", cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="cpbench")
@click.option(
    PLUGIN,
    multiple=True,
    metavar="FILE",
    expose_value=False,
    is_eager=True,
    callback=_name_plugins,
    help="Plugin to load, anywhere on the line: a Python file, or a TOML file of solvers. Repeatable.",
)
def cli() -> None:
    """Benchmark solvers of complementarity and frictional-contact problems, and convert the problems.

    `cpbench run` without arguments compares solvers on small built-in problems, within a minute.
    """


def main() -> None:
    """Run the command line: errors in one line; exit codes 0 done, 1 check failed, 2 bad input, 3 internal, 130
    interrupted."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # names of files may have bytes that are not text
            stream.reconfigure(errors="backslashreplace")
    output = sys.stdout  # which click replaces, and exits with 1, when the reader of a pipe has gone
    try:
        cli.main(sys.argv[1:] or ["--help"], prog_name="cpbench", standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as bare:
        click.echo(bare.format_message())
    except click.ClickException as usage:
        click.echo(on_one_line(f"cpbench: {usage.format_message()}"), err=True)
        sys.exit(2)
    except click.exceptions.Exit as leave:
        sys.exit(leave.exit_code)
    except CpbenchError as refusal:
        click.echo(on_one_line(f"cpbench: {refusal}"), err=True)
        sys.exit(2)
    except (click.Abort, KeyboardInterrupt):
        click.echo("cpbench: interrupted", err=True)
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(0)
    except SystemExit as ended:
        sys.exit(ended.code if sys.stdout is output else 0)
    except Exception:
        import traceback

        traceback.print_exc()
        click.echo("cpbench: this is a bug; please report it with the lines above", err=True)
        sys.exit(3)
