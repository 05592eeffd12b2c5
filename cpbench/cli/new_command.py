"""Write a plugin that works: a solver in some language, a conversion, problems, or an engine for audits."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.cli.terminal import print_lines
from cpbench.cli.types import FOLDER
from cpbench.testing import new_ci, new_plugin

LANGUAGES = ("python", "cpp", "julia")
KINDS = ("solver", "conversion", "problem", "engine")
CI = "ci"


@click.command()
@click.argument("kind", type=click.Choice([*KINDS, CI]))
@click.argument("name", required=False)
@click.option(
    "--lang",
    type=click.Choice(LANGUAGES),
    default="python",
    show_default=True,
    help="Language of a solver. Conversions and problems are Python.",
)
@click.option(
    "--node",
    default="lcp",
    show_default=True,
    metavar="NODE",
    help="Formulation of the plugin: fc, lcp, mlcp, ncp or qp in Python or C++, lcp in Julia.",
)
@click.option("--host", type=click.Choice(list(new_ci.HOSTS)), default="github", show_default=True, help="CI system.")
@click.option("--build", default="", metavar="COMMAND", help="Command that builds the solver, for ci.")
@click.option("-o", "--output", type=FOLDER, help="Output folder; default: NAME, for ci this one.")
@click.option("--force", is_flag=True, help="Replace existing files.")
def command(
    kind: str, name: str | None, lang: str, node: str, host: str, build: str, output: Path | None, force: bool
) -> None:
    """Write a plugin that works, for you to change: a solver, a conversion, a collection of problems, or the capture of
    a physics engine.

    It passes `cpbench check` as it is, an engine `cpbench audit`. NAME is a word of letters, digits, - and _.

    `cpbench new ci mine.toml` writes a workflow for the repository of a solver, which compares each pull request with
    its base. NAME is then the plugin of the solver; --host shell writes the script that all hosts run.
    """
    if kind == CI:
        folder, texts = output or Path(), new_ci.texts(host, name, build)
        steps = new_ci.next_steps(host, folder, name, build)
    else:
        if name is None:
            raise click.UsageError(f"a name is missing: cpbench new {kind} NAME")
        folder, texts = output or Path(name), new_plugin.plugin_texts(kind, name, lang, node)
        steps = new_plugin.next_steps(kind, name, lang, folder, texts)
    new_plugin.write_files(folder, texts, force)
    print_lines(f"wrote {folder / file}" for file in sorted(texts))
    print_lines(f"next: {step}" for step in steps)
