"""The command line. Commands are imported when they are called: help and completion load click and little else."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Sequence
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import click

from cpbench import __version__
from cpbench.errors import CpbenchError, FormatError
from cpbench.foundation import extensions
from cpbench.foundation.imports import uncollected
from cpbench.foundation.plain_text import on_one_line


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
    "run", "solve", "convert", "lift", "verify", "info", "show", "plot", "graph", "route", "list",
    "report", "compare", "results", "collection", "generate", "new", "check", "doctor",
)  # fmt: skip
RESULT_COMMANDS = ("import", "merge", "export")
"""Commands of `cpbench results`, which packages may add to; each is also found by its name alone, as it was before."""
RESULTS = "results"
SAYING_MORE = ("-h", "--help", "--plugin", "--plan", "--cluster")
"""Options with which a run has no processes here, or others than most."""
_PLUGIN: dict[str, Any] = {
    "multiple": True,
    "metavar": "FILE",
    "expose_value": False,
    "is_eager": True,
    "callback": _name_plugins,
    "help": "Plugin to load: a Python file, or a TOML file that declares solvers. Repeatable.",
}
"""The option of the group, and of every command: it may stand before or after its name."""


class LazyGroup(click.Group):
    """A group whose commands live in `cpbench.cli.<name>_command`, or behind the entry points ``cpbench.commands`` of
    other packages, and are imported on use. A name that is taken here is not taken by another package.
    """

    listed: tuple[str, ...] = COMMANDS
    of_packages = ""
    """Group of commands to which other packages add."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(dict.fromkeys([*self.listed, *extensions.commands(self.of_packages)]))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        entry = _entry(cmd_name)
        if entry is None:
            return None
        with uncollected():
            command: click.Command = entry.load()
        if all(parameter.name != "plugin_files" for parameter in command.params):
            command.params.append(click.Option(["--plugin", "plugin_files"], **_PLUGIN))
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the first paragraph of the docstring of each command's module, none of which is imported."""
        entries = ((name, _entry(name)) for name in self.list_commands(ctx))
        with formatter.section("Commands"):
            formatter.write_dl([(name, extensions.summary(entry.module)) for name, entry in entries if entry])

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        _begin_run(args)
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError:
            import difflib

            known = self.list_commands(ctx)
            near = difflib.get_close_matches(args[0], known, n=3)
            hint = f"did you mean {', '.join(near)}?" if near else f"commands: {', '.join(known)}"
            ctx.fail(f"no command '{args[0]}': {hint}")


def _begin_run(arguments: Sequence[str]) -> None:
    """Start what starts the processes of a run before its command is imported, which takes as long; where a file or an
    option may say otherwise, as of its threads, the run starts it later."""
    if arguments[:1] != ["run"] or any(word.startswith(SAYING_MORE) for word in arguments):
        return
    for file in map(Path, ("cpbench.toml", "pyproject.toml")):
        if file.is_file() and (file.name == "cpbench.toml" or b"tool.cpbench" in file.read_bytes()):
            return
    from cpbench.bench.processes import launch

    launch.begin(1)


def _entry(name: str) -> EntryPoint | None:
    """Return where the command of a name is; None without such a command."""
    if name in COMMANDS or name in RESULT_COMMANDS:
        return EntryPoint(name, f"cpbench.cli.{name}_command:command", extensions.COMMANDS)
    return {**extensions.commands(RESULTS), **extensions.commands()}.get(name)


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="cpbench")
@click.option("--plugin", "plugin_files", **_PLUGIN)
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
