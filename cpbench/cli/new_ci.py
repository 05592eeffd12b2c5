"""What `cpbench new ci` writes: two builds of a solver compared by somebody else's continuous integration."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

import click

from cpbench.errors import CpbenchError

HOSTS: Mapping[str, tuple[str, str]] = {
    "github": ("cpbench.yml.in", ".github/workflows/cpbench.yml"),
    "gitlab": ("cpbench.gitlab-ci.yml.in", "cpbench.gitlab-ci.yml"),
    "shell": ("compare.sh", "compare.sh"),
}
"""Host -> its template, and where that belongs in a repository."""


def texts(host: str, solver: str | None, build: str) -> dict[str, str]:
    """Path -> text; raises CpbenchError where `solver` cannot be one in a repository, UsageError without one."""
    template, place = HOSTS[host]
    text = (files("cpbench") / "templates" / "ci" / host / template).read_text(encoding="utf-8")
    if host == "shell":
        return {place: text}
    if solver is None:
        raise click.UsageError(f"say the plugin of your solver: cpbench new ci mine.toml --host {host}")
    path = Path(solver)
    if path.is_absolute() or path.suffix not in (".toml", ".py") or ".." in path.parts:
        raise CpbenchError(f"'{solver}' cannot be a plugin: say its path in the repository, of a .toml or .py file")
    if "\n" in build:
        raise CpbenchError("--build has more than one line: put them into a script, and say its name")
    words = {"@{SOLVER}@": shlex.quote(solver), "@{BUILD}@": shlex.quote(build)}
    for word, value in words.items():
        text = text.replace(word, value)
    return {place: text}


def next_steps(host: str, folder: Path) -> list[str]:
    """What is left to do."""
    if host == "github":
        return ["commit it; the next pull request has the verdict in the summary of its job"]
    if host == "gitlab":
        return ["include it in .gitlab-ci.yml: include: {local: cpbench.gitlab-ci.yml}"]
    return [f"bash {folder / 'compare.sh'} --solver mine.toml --build make --base origin/main"]
