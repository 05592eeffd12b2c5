"""`cpbench new`."""

from __future__ import annotations

import os
import shlex
import tempfile
from collections.abc import Mapping
from pathlib import Path

import click

from cpbench.cli import new_ci, new_templates
from cpbench.cli.options import Command
from cpbench.errors import DuplicateName, FormatError

LANGUAGES = ("python", "cpp", "julia", "command")
KINDS = ("solver", "conversion", "problem")
CI = "ci"


@click.command(cls=Command)
@click.argument("kind", type=click.Choice([*KINDS, CI]))
@click.argument("name", required=False)
@click.option(
    "--lang",
    type=click.Choice(LANGUAGES),
    default="python",
    show_default=True,
    help="Language of a solver; command: a shell script. Conversions and problems are Python.",
)
@click.option(
    "--node",
    default="lcp",
    show_default=True,
    metavar="NODE",
    help="The formulation it is for: fc, lcp, mlcp, ncp or qp, in Python or C++; else lcp.",
)
@click.option("--with", "guest", type=click.Choice(["path"]), help="Julia: call the PATH solver (PATHSolver.jl).")
@click.option("--host", type=click.Choice(list(new_ci.HOSTS)), default="github", show_default=True, help="Of ci.")
@click.option("--build", default="", metavar="COMMAND", help="ci: makes the solver, at the top of the repository.")
@click.option(
    "-o", "--output", type=click.Path(path_type=Path, file_okay=False), help="Folder; default: NAME, for ci this one."
)
@click.option("--force", is_flag=True, help="Replace files that are there.")
def command(
    kind: str,
    name: str | None,
    lang: str,
    node: str,
    guest: str | None,
    host: str,
    build: str,
    output: Path | None,
    force: bool,
) -> None:
    """Write a plugin that works: a solver, a conversion or a collection of problems, to be changed into yours.

    It passes `cpbench check` as it is. NAME is a word of letters, digits, - and _.

    `cpbench new ci mine.toml` writes the workflow of a repository with a solver: each pull request is compared with
    what it changes. NAME is the plugin of the solver; --host shell writes the script that all hosts run.
    """
    if kind == CI:
        folder, texts = output or Path(), new_ci.texts(host, name, build)
        steps = new_ci.next_steps(host, folder, name, build)
    else:
        if name is None:
            raise click.UsageError(f"say a name: cpbench new {kind} NAME")
        _checked(kind, lang, node, guest)
        words = new_templates.words(kind, name)
        _is_free(kind, words["EDGE"] if kind == "conversion" else name)
        folder = output or Path(name)
        texts = new_templates.texts(kind, words, lang, node, guest)
        steps = _next(lang, folder, texts)
    _write(folder, texts, force)
    for file in sorted(texts):
        click.echo(f"wrote {folder / file}")
    for step in steps:
        click.echo(f"next: {step}")


def _checked(kind: str, lang: str, node: str, guest: str | None) -> None:
    """Raises UsageError, UnknownName on options that do not go together."""
    from cpbench.formulations import formulations

    if guest is not None and lang != "julia":
        raise click.UsageError(f"--with {guest} is for --lang julia")
    if kind != "solver" and lang != "python":
        raise click.UsageError(f"a {kind} is written in Python; --lang is for solvers")
    formulations.get(node)


def _is_free(kind: str, name: str) -> None:
    """Raises DuplicateName when the name belongs to something that is registered."""
    from cpbench.testing.conduct import REGISTRIES

    if name in REGISTRIES[kind]:
        raise DuplicateName(f"the {kind} '{name}' exists already: take another name")


def _write(folder: Path, texts: Mapping[str, str], force: bool) -> None:
    """All files or none; raises FormatError."""
    for file in texts:
        if (folder / file).exists() and not force:
            raise FormatError(folder / file, "", "exists already; --force replaces it, -o FOLDER writes elsewhere")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".new-") as place:
            for file, text in texts.items():
                fresh = Path(place, file)
                fresh.parent.mkdir(parents=True, exist_ok=True)
                fresh.write_text(text, encoding="utf-8")
                if text.startswith("#!"):
                    fresh.chmod(0o755)
            for file in texts:
                (folder / file).parent.mkdir(parents=True, exist_ok=True)
                os.replace(Path(place, file), folder / file)
    except OSError as cause:
        raise FormatError(folder, "", f"cannot be written ({cause.strerror or cause})") from None


def _next(lang: str, folder: Path, texts: Mapping[str, str]) -> list[str]:
    """Command lines to go on with."""
    plugin = next(file for file in sorted(texts) if file.endswith(".py" if lang == "python" else ".toml"))
    check = shlex.join(["cpbench", "check", str(folder / plugin)])
    if lang == "cpp":
        return [shlex.join(["make", "-C", str(folder)]), check]
    if lang == "julia":
        return [f"install Julia and the packages, as the first line of {folder / plugin} says", check]
    return [check]
