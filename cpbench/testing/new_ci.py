"""Files with which another project's continuous integration compares two builds of a solver."""

from __future__ import annotations

import json
import shlex
import subprocess
from collections.abc import Mapping
from importlib.metadata import distribution
from importlib.resources import files
from pathlib import Path

from cpbench.errors import CpbenchError

HOSTS: Mapping[str, tuple[str, str]] = {
    "github": ("cpbench.yml.in", ".github/workflows/cpbench.yml"),
    "gitlab": ("cpbench.gitlab-ci.yml.in", "cpbench.gitlab-ci.yml"),
    "shell": ("compare.sh", "compare.sh"),
}
"""Host -> its template, and where that belongs in a repository."""


def texts(host: str, solver: str | None, build: str) -> dict[str, str]:
    """Return texts by path; raises CpbenchError without a solver, or where it cannot be one in a repository."""
    template, place = HOSTS[host]
    text = (files("cpbench.testing") / "templates" / "ci" / host / template).read_text(encoding="utf-8")
    if host == "shell":
        return {place: text}
    if solver is None:
        raise CpbenchError(f"the plugin of your solver is missing: cpbench new ci mine.toml --host {host}")
    path = Path(solver)
    if path.is_absolute() or path.suffix not in (".toml", ".py") or ".." in path.parts:
        raise CpbenchError(f"'{solver}' cannot be a plugin: say its path in the repository, of a .toml or .py file")
    if "\n" in build:
        raise CpbenchError("--build has more than one line: put them into a script, and say its name")
    words = {"@{PACKAGE}@": shlex.quote(package()), "@{SOLVER}@": shlex.quote(solver), "@{BUILD}@": shlex.quote(build)}
    for word, value in words.items():
        text = text.replace(word, value)
    return {place: text}


def next_steps(host: str, folder: Path, solver: str | None, build: str) -> list[str]:
    """Return what is left to do."""
    if host != "shell":
        source = f"it runs pip install {package()}: where no index has that, put git+URL of a repository there"
        if host == "github":
            return [source, "commit it; the next pull request has the verdict in the summary of its job"]
        return [source, "include it in .gitlab-ci.yml: include: {local: cpbench.gitlab-ci.yml}"]
    building = ["--build", build] if build else []
    words = ["bash", str(folder / "compare.sh"), "--solver", solver or "FILE", *building, "--base", _base()]
    missing = [] if solver else ["FILE stands for the plugin of your solver, with its path in the repository"]
    return [shlex.join(words), *missing]


def package() -> str:
    """Return what pip installs: the commit of a repository where this cpbench came from one, else its name."""
    text = distribution("cpbench").read_text("direct_url.json")
    origin = json.loads(text) if text else {}
    commit = origin.get("vcs_info", {}).get("commit_id")
    return f"cpbench @ git+{origin['url']}@{commit}" if commit else "cpbench"


def _base() -> str:
    """Return the branch to compare with: the default one of the remote repository, else the commit before."""
    command = ["git", "symbolic-ref", "--short", "refs/remotes/origin/HEAD"]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return "HEAD~1"
    return answer or "HEAD~1"
