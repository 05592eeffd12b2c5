"""The README's tables are those of the registries; `cpbench list readme-tables` prints them."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest

import cpbench
from cpbench.bench.planning import plan_file
from cpbench.cli import cli
from cpbench.formulations import formulations
from cpbench.graph import edges
from cpbench.report.registry_tables import promise, registry_tables, replace_between_marks

README = Path(__file__).resolve().parents[2] / "README.md"


def test_tables_are_those_of_the_registries() -> None:
    text = README.read_text()
    assert text == replace_between_marks(text, registry_tables()), (
        "python -m cpbench list readme --write README.md brings the tables up to date"
    )


def test_the_table_of_conversions_is_the_graph() -> None:
    """Read from the README itself: names, ends and promises of every registered conversion, and of no other."""
    rows = re.findall(r"^\| `(\S+)` \| (\w+) \| (\w+) \| ([\w, -]+) \| .*\|$", README.read_text(), re.MULTILINE)
    known = {(e.name, e.source, e.target, promise(e)) for e in edges()}
    nodes = set(formulations.names())
    assert {row for row in rows if {row[1], row[2]} <= nodes} == known


def test_every_picture_and_file_named_exists() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README.read_text()):
        if "://" not in target:
            assert (README.parent / target).exists(), target


def test_the_plan_file_is_one(tmp_path: Path) -> None:
    """Two sets, read by the reader of plan files, which refuses unknown keys and values; and a solver and a variant."""
    plan_text, solver_text = re.findall(r"^```toml\n(.*?)^```", README.read_text(), re.MULTILINE | re.DOTALL)
    (tmp_path / "cpbench.toml").write_text(plan_text)
    plan = plan_file.read(tmp_path / "cpbench.toml")
    assert [part["name"] for part in plan.sets] == ["boxes", "rolling"]
    (tmp_path / "mine.toml").write_text(solver_text)
    listed = [sys.executable, "-m", "cpbench", "list", "solvers", "--plugin", str(tmp_path / "mine.toml"), "mine*"]
    told = subprocess.run(listed, capture_output=True, text=True, check=True).stdout
    assert re.findall(r"^\s*(mine\S*)", told, re.MULTILINE) == ["mine", "mine@head"]


PYTHON = re.findall(r"^```python\n(.*?)^```", README.read_text(), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize(
    "block",
    [pytest.param(block, marks=[pytest.mark.nightly] if "cp.run(" in block else []) for block in PYTHON],
)
def test_its_python_runs(block: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if "casadi" in block:
        pytest.importorskip("casadi", reason="does not apply: CasADi is not installed")
    monkeypatch.chdir(tmp_path)
    exec(compile(block, str(README), "exec"), {})


def test_its_python_names_what_there_is() -> None:
    names = {name for block in PYTHON for name in re.findall(r"\bcp\.(\w+)", block)}
    assert {"solve", "run"} <= names <= set(cpbench.__all__)


def test_the_options_named_are_those_of_the_commands() -> None:
    """Every command line of the README is one that the command line understands, down to the options."""
    for line in re.findall(r"^cpbench (.*?)(?:  #.*)?$", README.read_text(), re.MULTILINE):
        for part in line.split("&&"):
            name, *words = shlex.split(part.removeprefix(" cpbench"))
            command = cli.get_command(click.Context(cli), name)
            if isinstance(command, click.Group):
                name, *words = words
                command = command.get_command(click.Context(command), name)
            assert command is not None, name
            known = {flag for option in command.params for flag in (*option.opts, *option.secondary_opts)}
            used = {word.partition("=")[0] for word in words if re.match(r"--?[a-zA-Z]", word)}
            assert used <= known, (line, used - known)
