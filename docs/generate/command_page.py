"""The pages of the commands: their help, as the command line prints it, and an example that runs meanwhile."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path

import click
from page_parts import contents, table, verbatim

from cpbench.cli import cli

EXAMPLES = Path(__file__).with_name("command_examples.toml")
LINES = 12
"""Lines of output that an example shows, where it says nothing else."""
INFORMATIVE = 1
"""Largest exit code of an example: 1 says that a command found something."""


def files() -> dict[str, str]:
    """Return the page of each command by its path, and the page that lists them."""
    context = click.Context(cli, info_name="cpbench")
    outputs = dict(_examples())
    pages: dict[str, str] = {}
    rows: list[list[str]] = []
    for name in cli.list_commands(context):
        command = cli.get_command(context, name)
        if command is None:
            continue
        described = list(_described(command, click.Context(command, context, name), f"cpbench {name}"))
        example = [f"## Example\n\n{verbatim(outputs[name], 'console')}"] if name in outputs else []
        pages[f"reference/commands/{name}.md"] = "\n\n".join([f"# {name}", *example, "## Help", *described])
        rows.append([f"[{name}](commands/{name}.md)", " ".join((command.help or "").split("\n\n")[0].split())])
    head = ["# Commands", "Each page has the help of a command, and an example that ran when the pages were made."]
    whole = verbatim(cli.get_help(context))
    rest = [table(["command", "what it does"], rows), "## cpbench", whole, contents("commands/*")]
    pages["reference/commands.md"] = "\n\n".join([*head, *rest])
    return pages


def _described(command: click.Command, context: click.Context, name: str) -> Iterator[str]:
    heading = f"## {name}\n\n" if name.count(" ") > 1 else ""
    yield f"{heading}{verbatim(command.get_help(context))}"
    if isinstance(command, click.Group):
        for child in command.list_commands(context):
            inner = command.get_command(context, child)
            if inner is not None:
                yield from _described(inner, click.Context(inner, context, child), f"{name} {child}")


def _examples() -> Iterator[tuple[str, str]]:
    """Run the examples one after the other; yield commands with what was typed and printed.

    Raises RuntimeError where one fails."""
    with tempfile.TemporaryDirectory() as folder:
        programs = Path(folder, "programs")
        programs.mkdir()
        for name, words in (("cpbench", f"{sys.executable} -m cpbench"), ("python", sys.executable)):
            (programs / name).write_text(f'#!/bin/sh\nexec {words} "$@"\n')
            (programs / name).chmod(0o755)
        found = os.pathsep.join([str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")])
        path = os.pathsep.join([str(programs), os.environ["PATH"]])
        variables = {**os.environ, "PATH": path, "PYTHONPATH": found, "COLUMNS": "110"}
        for name, example in tomllib.loads(EXAMPLES.read_text("utf-8")).items():
            lines: list[str] = []
            for line in filter(None, (example.get("first"), example["run"])):
                done = subprocess.run(line, shell=True, cwd=folder, env=variables, capture_output=True, text=True)
                if done.returncode > INFORMATIVE:
                    raise RuntimeError(f"{EXAMPLES.name}, {name}: {line} ended with {done.returncode}: {done.stderr}")
                lines = done.stdout.rstrip().splitlines()
            shown = example.get("lines", LINES)
            cut = ["..."] if len(lines) > shown else []
            yield name, "\n".join([f"$ {example['run']}", *lines[:shown], *cut])
