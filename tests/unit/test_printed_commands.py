"""Commands that cpbench prints can be run as they are printed: each is taken from a real output, and run.

What a message or a docstring names with words in place of files is looked up: the command and its options exist.
"""

from __future__ import annotations

import ast
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import click
import numpy as np
import pytest
from tiers import some_by_day

import cpbench as package
from cpbench import storage
from cpbench.cli import cli, main
from cpbench.formulations import LCP, FrictionContact

ROOT = Path(package.__file__).parent
Run = Callable[..., str]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    """The command line in this process, in an empty folder; what it said. No call has the plugins of the one before."""
    monkeypatch.chdir(tmp_path)

    def called(*words: object, rc: int = 0) -> str:
        with monkeypatch.context() as patch:
            patch.setenv("CPBENCH_PLUGINS", "")
            patch.setattr(sys, "argv", ["cpbench", *map(str, words)])
            code = 0
            try:
                main()
            except SystemExit as leave:
                code = int(leave.code or 0)
        said = capfd.readouterr()
        assert code == rc, said.out + said.err
        return said.out + said.err

    return called


def apart(*words: object, folder: Path) -> str:
    """A command in a process of its own: what it loads is forgotten."""
    command = [sys.executable, "-m", "cpbench", *map(str, words)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def write_lcp(folder: Path, name: str, n: int = 3) -> Path:
    problem = LCP(M=np.eye(n), q=-np.arange(1.0, n + 1), name=name)
    storage.save(problem, folder / f"{name}.h5")
    return folder / f"{name}.h5"


# --------------------------------------------------------------------------------------- taken from an output


@pytest.mark.nightly
@pytest.mark.parametrize("lang", ["python", "cpp"])
def test_new(run: Run, tmp_path: Path, lang: str) -> None:
    if lang == "cpp" and not (shutil.which("make") and shutil.which("c++")):
        pytest.skip("needs a program: a C++ compiler, apt-get install g++")
    said = run("new", "solver", "mine", "--node", "qp", "--lang", lang, "-o", "a folder")
    for line in re.findall(r"^next: (.*)$", said, re.MULTILINE):
        words = shlex.split(line)
        if words[0] == "cpbench":
            assert " passed" in apart(*words[1:], "--quiet", folder=tmp_path)
        else:
            subprocess.run(words, cwd=tmp_path, check=True, capture_output=True, timeout=300)


@pytest.mark.nightly
def test_new_ci_names_what_it_was_given(run: Run, tmp_path: Path) -> None:
    """The script begins with its options: it gets as far as the commit to compare with, which this folder has not."""
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    (tmp_path / "mine.toml").write_text("")
    said = run("new", "ci", "mine.toml", "--host", "shell", "--build", "make all")
    (line,) = re.findall(r"^next: (.*)$", said, re.MULTILINE)
    assert line == "bash compare.sh --solver mine.toml --build 'make all' --base 'HEAD~1'"
    done = subprocess.run(shlex.split(line), cwd=tmp_path, capture_output=True, text=True, timeout=100)
    assert "no commit 'HEAD~1' here" in done.stderr


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
