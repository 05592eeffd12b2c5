"""Run the conformance checks on a plugin."""

from __future__ import annotations

import os
import sys
from collections import Counter

import click

from cpbench.cli.options import Command, ListOption
from cpbench.cli.types import DURATION
from cpbench.errors import UnknownName
from cpbench.registry import PLUGIN_FILES


@click.command(cls=Command)
@click.argument("plugin")
@click.option("--only", cls=ListOption, metavar="CHECK", help="Check to run; default: all. Repeatable.")
@click.option(
    "--timeout", type=DURATION, default="60s", show_default=True, help="Time limit of one check (30s, 5m, none)."
)
@click.option("--quiet", "-q", is_flag=True, help="Print only failures and sums.")
def command(plugin: str, only: tuple[str, ...], timeout: float, quiet: bool) -> None:
    """Run the public conformance checks on a plugin.

    PLUGIN is a Python file, a .toml file that declares solvers, or the name of a registered solver, conversion,
    formulation or format. Checks run in another process: a check that hangs or crashes has failed, and the next one
    gets a new process. The exit code is 1 when a check failed or a solver cannot run here, and 2 when the plugin does
    not load.

    If your solver is known to fail a check, enter the check with the reason in `known_failures` of its spec.
    """
    from cpbench.api.plugin_checks import PluginChecker, is_file

    if is_file(plugin):
        plugin = os.path.abspath(plugin)
        others = [path for path in os.environ.get(PLUGIN_FILES, "").split(os.pathsep) if path and path != plugin]
        os.environ[PLUGIN_FILES] = os.pathsep.join(others)  # the process that checks it loads it, and no other
    failed = False
    with PluginChecker(plugin, timeout) as checker:
        items = checker.items()
        known = {check for item in items for check in item.checks}
        for name in only:
            if name not in known:
                raise UnknownName("check", name, known)
        for item in items:
            click.echo(f"{item.kind} {item.name} ({' -> '.join(item.nodes)})")
            count = Counter[str]()
            for check, mark in checker.marks(item, only):
                count[mark.word] += 1
                bad = mark.word not in GOOD
                failed = failed or bad
                if bad or not quiet:
                    reason = f"  {mark.reason}" if mark.reason else ""
                    click.echo(f"  {mark.word:<15}{check:<{WIDE if reason else 0}}{reason}")
            click.echo(f"  {', '.join(f'{number} {word}' for word, number in sorted(count.items()))}")
    if failed:
        sys.exit(1)


GOOD = ("passed", "does not apply", "known failure")
WIDE = 52
"""Characters of the column of checks."""
