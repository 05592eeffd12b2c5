"""README, guides and the other documents: their blocks run, their commands exist, their links lead somewhere.

A page's blocks run from top to bottom in one empty folder: `python` in this process, lines of `sh` that begin with
`cpbench` or `make` in a shell. Blocks headed `console` need a cluster or files that nobody has: only their options are
looked at.
"""

from __future__ import annotations

import os
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import click
import pytest

import cpbench
from cpbench.bench.planning import plan_file
from cpbench.cli import cli

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted(
    [*ROOT.glob("*.md"), *(path for path in ROOT.glob("docs/**/*.md") if path.parent.name != "decisions")],
    key=lambda path: path.relative_to(ROOT).as_posix(),
)
NAMES = [path.relative_to(ROOT).as_posix() for path in PAGES]
FENCES = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
WALKED = [name for name in NAMES if re.search(r"^```(sh|python)$", (ROOT / name).read_text("utf-8"), re.MULTILINE)]
METHODS = {f"methods/{page}.md" for page in ("statistics", "tolerances", "engine-laws", "difficulty")}
GENERATED = {"reference", "lecture", "assets", "results", "decisions/index.md"} | METHODS
"""What only the build of the documentation makes."""


def blocks(page: Path) -> list[tuple[str, str]]:
    """Language and text of every fenced block of a page."""
    return FENCES.findall(page.read_text(encoding="utf-8"))


def command_lines(page: Path, *languages: str) -> list[str]:
    """The lines of a page's shell blocks that call cpbench, without their comments."""
    text = "".join(block for language, block in blocks(page) if language in languages)
    return [line.partition("  #")[0].strip() for line in text.splitlines() if line.startswith("cpbench ")]


def test_each_script_that_measures_is_named_with_its_question() -> None:
    page = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`(\w+\.py)`", page))
    assert named == {path.name for path in (ROOT / "benchmarks").glob("*.py")}


@pytest.mark.parametrize("path", sorted((ROOT / "benchmarks").glob("*.py")), ids=lambda path: path.stem)
def test_each_script_that_measures_begins(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What they import is there: no other test runs them."""
    monkeypatch.setattr(sys, "path", [str(path.parent), *sys.path])
    runpy.run_path(str(path), run_name="benchmark")


def test_modules_that_pages_name_exist() -> None:
    named = {
        module for page in PAGES for module in re.findall(r"`(\w+/[a-z_/]+\.py)`", page.read_text(encoding="utf-8"))
    }
    assert named
    assert not [module for module in sorted(named) if not (ROOT / module).exists()]


def test_the_readme_is_a_page_and_no_book() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 150


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_every_picture_and_file_named_exists(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
        place = (page.parent / target).resolve()
        within = place.relative_to(ROOT / "docs").as_posix() if place.is_relative_to(ROOT / "docs") else ""
        made = within in GENERATED or within.partition("/")[0] in GENERATED
        assert "://" in target or place.exists() or made, target


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_commands_and_their_options_exist(page: Path) -> None:
    for line in command_lines(page, "sh", "console"):
        for part in line.split("&&"):
            assert_known(part.strip().removeprefix("cpbench "), line)


def test_each_command_has_an_example() -> None:
    """The pages of the commands run them while they are made."""
    examples = tomllib.loads((ROOT / "docs/generate/command_examples.toml").read_text("utf-8"))
    assert list(examples) == cli.list_commands(click.Context(cli))
    for name, example in examples.items():
        assert example["run"].split()[:2] == ["cpbench", name]
        assert_known(example["run"].removeprefix("cpbench "), name)


def assert_known(part: str, line: str) -> None:
    name, *words = shlex.split(part)
    if name.startswith("-"):
        return
    command = cli.get_command(click.Context(cli), name)
    if isinstance(command, click.Group) and words and not words[0].startswith("-"):
        name, *words = words
        command = command.get_command(click.Context(command), name)
    assert command is not None, line
    known = {flag for option in command.params for flag in (*option.opts, *option.secondary_opts)} | {
        "--help",
        "--plugin",
    }
    used = {word.partition("=")[0] for word in words if re.match(r"--?[a-zA-Z]", word)}
    assert used <= known, (line, used - known)


def test_python_of_the_readme_names_what_there_is() -> None:
    text = "".join(block for language, block in blocks(ROOT / "README.md") if language == "python")
    names = set(re.findall(r"\bcp\.(\w+)", text))
    assert {"solve", "run"} <= names <= set(cpbench.__all__)


def test_python_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What solves in this process; the blocks that start others are of the nightly walk."""
    monkeypatch.chdir(tmp_path)
    (quick,) = (b for language, b in blocks(ROOT / "README.md") if language == "python" and "cp.run(" not in b)
    exec(compile(quick, "README.md", "exec"), {})


@pytest.mark.nightly
@pytest.mark.parametrize("name", WALKED)
def test_a_page_works_from_top_to_bottom(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = ROOT / name
    if "import casadi" in page.read_text(encoding="utf-8"):
        pytest.importorskip("casadi", reason="does not apply: CasADi is not installed")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    for language, block in blocks(page):
        if language == "python":
            exec(compile(block, name, "exec"), {})
        if language == "sh":
            lines = [line for line in block.splitlines() if line.startswith(("cpbench ", "make "))]
            done = subprocess.run(["bash", "-ec", "\n".join(lines)], capture_output=True, text=True)
            assert done.returncode == 0, f"{block}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"


def test_the_plan_file_is_one(tmp_path: Path) -> None:
    """Read the plan of the guide, its blocks one after the other: the reader refuses unknown keys and values."""
    texts = [block for language, block in blocks(ROOT / "docs/guides/runs.md") if language == "toml"]
    (tmp_path / "cpbench.toml").write_text("\n".join(texts))
    plan = plan_file.read(tmp_path / "cpbench.toml")
    assert [part["name"] for part in plan.sets] == ["boxes", "rolling"]


def test_the_declared_solvers_are_some(tmp_path: Path) -> None:
    (text,) = (block for language, block in blocks(ROOT / "docs/guides/solver-author.md") if language == "toml")
    (tmp_path / "mine.toml").write_text(text)
    listed = [sys.executable, "-m", "cpbench", "list", "solvers", "--plugin", str(tmp_path / "mine.toml"), "mine*"]
    shown = subprocess.run(listed, capture_output=True, text=True, check=True).stdout
    assert re.findall(r"^\s*(mine\S*)", shown, re.MULTILINE) == ["mine", "mine@head"]


@pytest.mark.parametrize(("looser", "failed"), [("", 0), ("1e6 * ", 3)])
def test_the_least_solver_passes_its_check_and_fails_it_where_it_lies(looser: str, failed: int, tmp_path: Path) -> None:
    (text,) = (block for language, block in blocks(ROOT / "docs/guides/solver-author.md") if language == "py")
    (tmp_path / "least.py").write_text(text.replace("<= budget.tolerance", f"<= {looser}budget.tolerance"))
    checked = [sys.executable, "-m", "cpbench", "check", str(tmp_path / "least.py")]
    done = subprocess.run(checked, capture_output=True, text=True)
    assert (done.returncode, done.stdout.count("\n  failed ")) == (bool(failed), failed), done.stdout


def test_decisions_have_a_title_a_date_and_a_part() -> None:
    folder = ROOT / "docs" / "decisions"
    numbers = []
    for path in sorted(folder.glob("*.md")):
        text = path.read_text(encoding="utf-8")
        assert re.match(r"# \S.*\n\nDate: \d{4}-\d\d-\d\d · Part: [a-z]+\n\n\S", text), path.name
        numbers.append(int(path.name[:4]))
    assert len(numbers) == len(set(numbers)), "two decisions have one number"


def test_reports_in_the_repository_are_small() -> None:
    """Plans, pictures, and the report of the standard run; what CI makes goes to artefacts."""
    listed = subprocess.run(["git", "ls-files", "-z", "reports"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("does not apply: no clone")
    assert sum((ROOT / name).stat().st_size for name in listed.stdout.split("\0") if name) < 2_000_000


FOLDER = Path(__file__).resolve().parents[2] / "docs" / "decisions"
FILES = {path.name[:4]: path for path in sorted(FOLDER.glob("[0-9]*.md"))}
NUMBER = re.compile(r"\b(\d{4})\b")


def status(number: str) -> str:
    found = re.findall(r"^Status: (.+)$", FILES[number].read_text("utf-8"), re.MULTILINE)
    assert len(found) == 1, FILES[number].name
    return found[0]


def test_a_decision_has_one_status_that_names_later_decisions() -> None:
    for number in FILES:
        named = NUMBER.findall(status(number))
        assert bool(named) == (status(number) != "accepted"), number
        assert all(number < later and later in FILES for later in named), number


def test_what_a_decision_revises_names_it() -> None:
    for number, path in FILES.items():
        for old, other in re.findall(r"[Rr]evises (\d{4})(?: and (\d{4}))?", path.read_text("utf-8")):
            for one in filter(FILES.get, (old, other)):  # of others, which were merged, git has the text
                assert number in status(one), number


def test_the_man_page_has_every_command() -> None:
    commands = (ROOT / "docs" / "cpbench.1").read_text("utf-8").partition(".SH COMMANDS")[2].partition(".SH")[0]
    assert sorted(re.findall(r"^\.B (\w+)$", commands, re.MULTILINE)) == sorted(cli.list_commands(click.Context(cli)))
