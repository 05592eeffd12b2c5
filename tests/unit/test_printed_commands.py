"""Commands that cpbench prints can be run as they are printed: each is taken from a real output, and run.

What a message or a docstring names with words in place of files is looked up: the command and its options exist.
"""

from __future__ import annotations

import ast
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import click
import numpy as np
import pytest
from command_line import with_plugins
from tiers import some_by_day

import cpbench as package
from cpbench import storage
from cpbench.cli import cli
from cpbench.formulations import LCP, FrictionContact

ROOT = Path(package.__file__).parent
Run = Callable[..., str]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """The command line in an empty folder; what it said. No call has the plugins of the one before."""

    def called(*words: object, rc: int = 0) -> str:
        done = with_plugins(tmp_path, *words)
        assert done.returncode == rc, done.stdout + done.stderr
        return done.stdout + done.stderr

    return called


def write_lcp(folder: Path, name: str, n: int = 3) -> Path:
    problem = LCP(M=np.eye(n), q=-np.arange(1.0, n + 1), name=name)
    storage.save(problem, folder / f"{name}.h5")
    return folder / f"{name}.h5"


# --------------------------------------------------------------------------------------- taken from an output


@pytest.mark.parametrize(
    ("words", "told"),
    some_by_day(
        [
            (("solve", "two.h5", "-s", "bananas"), "cpbench list solvers --all"),
            (("solve", "a contact.h5", "-s", "casadi-sqpmethod"), "cpbench graph 'a contact.h5' --explain"),
            (("run", "a contact.h5", "-s", "casadi-sqpmethod"), "cpbench graph 'a contact.h5' --explain"),
            (("run", "empty"), "cpbench list formats"),
        ],
        2,
    ),
)
def test_the_hint_of_a_refusal(run: Run, tmp_path: Path, words: tuple[str, ...], told: str) -> None:
    write_lcp(tmp_path, "two", 2)
    (tmp_path / "empty").mkdir()
    contact = FrictionContact(W=np.eye(3), q=np.array([-1.0, 0.5, 0.0]), mu=np.array([0.5]), dimension=3)
    storage.save(contact, tmp_path / "a contact.h5")
    said = run(*words, rc=2)
    assert told in said
    assert run(*shlex.split(told)[1:])


# ------------------------------------------------------------------------------------------ named in a text

NAMED = re.compile(r"(?<![\w/.-])cpbench (?P<name>[a-z]+)\b(?P<rest>[^\n`;]*)")


def texts() -> list[tuple[str, str]]:
    """Place and text of every string of the package, and of every template."""
    found = [
        (f"{path.relative_to(ROOT)}:{node.lineno}", node.value)
        for path in sorted(ROOT.rglob("*.py"))
        if re.search(r"cpbench (?!import\b)", text := path.read_text("utf-8"))  # of most files none
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and "cpbench " in node.value
    ]
    templates = [path for path in sorted((ROOT / "testing" / "templates").rglob("*")) if path.is_file()]
    return found + [(str(path.relative_to(ROOT)), path.read_text("utf-8")) for path in templates]


@pytest.mark.needs("cpbench_lab")
def test_commands_that_are_named_have_the_options_that_are_named() -> None:
    context = click.Context(cli)
    seen = 0
    for place, text in texts():
        for match in NAMED.finditer(text):
            name = match["name"]
            if cli.get_command(context, name) is None:
                quoted = match.start() > 0 and text[match.start() - 1] == "`"
                tag = match["rest"].startswith(":")  # of a description in a file
                assert tag or not quoted, f"{place}: there is no command 'cpbench {name}'"
                continue
            seen += 1
            command = cli.get_command(context, name)
            assert command is not None
            plain = {"--help", "--plugin"} | {word for option in command.params for word in option.opts}
            if isinstance(command, click.Group):
                inner = (command.get_command(context, each) for each in command.list_commands(context))
                plain |= {word for each in inner if each is not None for option in each.params for word in option.opts}
            own = re.split(r"cpbench ", match["rest"])[0]
            asked = set(re.findall(r"(?<![\w-])(--[a-z][\w-]*)", re.split(r"[,:(] ", own)[0]))
            assert asked <= plain, f"{place}: cpbench {name} has no {', '.join(sorted(asked - plain))}"
    assert seen > 80
