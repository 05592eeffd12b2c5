"""The program without a command: its help into a closed pipe, shell completion; one version everywhere, TOML keys."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import cpbench
from cpbench.solvers.external.builds import as_toml

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("words", [[], ["--help"], ["list", "solvers"]])
def test_a_closed_pipe_ends_without_a_traceback(words: list[str]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "cpbench", *words]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, timeout=100)
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_get_a_completion_script(shell: str) -> None:
    """Click's protocol: the program without words, called by its name, and a variable that asks."""
    call = "import sys; sys.argv = ['cpbench']; from cpbench.__main__ import main; main()"
    asked = {**os.environ, "_CPBENCH_COMPLETE": f"{shell}_source"}
    done = subprocess.run([sys.executable, "-c", call], env=asked, capture_output=True, text=True, timeout=100)
    assert "_cpbench_completion" in done.stdout
    assert "Usage" not in done.stdout


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete_a_command(shell: str) -> None:
    """What each shell's script asks for at `cpbench list so`: fish gives the word itself, the others its place."""
    words = {"COMP_WORDS": "cpbench list so", "COMP_CWORD": "so" if shell == "fish" else "2"}
    asked = {**os.environ, **words, "_CPBENCH_COMPLETE": f"{shell}_complete"}
    done = subprocess.run([sys.executable, "-m", "cpbench"], env=asked, capture_output=True, text=True, timeout=100)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.findall(r"\w+", done.stdout)[:2] == ["plain", "solvers"]


def test_the_version_to_cite_is_that_of_the_package() -> None:
    assert f"\nversion: {cpbench.__version__}\n" in (ROOT / "CITATION.cff").read_text("utf-8")


def test_every_key_of_toml_is_read_as_it_was_written() -> None:
    options = {"omega": 1, "a b": 2.5, "a.b": "\x7f", "": float("inf"), "ä": True, 'q"': 6, "x=y": 7, "[s]": 8}
    table = {"serve": "./mine", "options": options}
    assert tomllib.loads(as_toml({"mine@base": table})) == {"solver": {"mine@base": table}}
