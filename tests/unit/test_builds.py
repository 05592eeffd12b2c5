"""Two checkouts of one plugin as variants of its solvers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from tiers import some_by_day

from cpbench.registry import DECLARED, PLUGIN_FILES


def builds(*words: str, rc: int = 0, **env: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", "-m", "cpbench.solvers.external.builds", *words]
    done = subprocess.run(command, env={**os.environ, **env}, capture_output=True, text=True, timeout=600)
    assert done.returncode == rc, done.stdout + done.stderr
    return done


def known(tables: dict[str, Any], *plugins: Path) -> dict[str, Any]:
    """Name -> options with their defaults, in a process that is told of these plugins."""
    code = (
        "import dataclasses, json; from cpbench.solvers.base import solvers; "
        f"print(json.dumps({{n: dataclasses.asdict(solvers.get(n).spec.options()) for n in {list(tables)!r}}}))"
    )
    env = {**os.environ, PLUGIN_FILES: os.pathsep.join(map(str, plugins)), DECLARED: ""}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.nightly
def test_a_program_is_that_of_its_checkout(tmp_path: Path) -> None:
    for side, omega in (("base", ""), ("head", 'options = {omega = 1.5, "rule" = \'a "b"\'}')):
        (tmp_path / side / "src").mkdir(parents=True)
        (tmp_path / side / "src/mine.toml").write_text(
            f"[solver.mine]\nnode = 'lcp'\nserve = './build/mine --serve'\nenv = {{A = 'b'}}\n{omega}\n"
            "[solver.'mine@old']\nserve = './old'\n[solver.also]\nnode = 'lcp'\ncommand = 'python x.py {problem}'\n"
        )
    told = "".join(builds(side, str(tmp_path / side), "src/mine.toml").stdout for side in ("base", "head"))
    tables = tomllib.loads(told)["solver"]
    assert set(tables) == {"mine@base", "also@base", "mine@head", "also@head"}
    assert tables["mine@base"] == {
        "serve": f"{tmp_path}/base/src/build/mine --serve",
        "cwd": f"{tmp_path}/base/src",
        "env": {"A": "b"},
        "options": {},
    }
    assert tables["also@head"]["command"] == "python x.py {problem}"
    variants = tmp_path / "variants.toml"
    variants.write_text(told)
    found = known(tables, tmp_path / "head/src/mine.toml", variants)
    assert (found["mine@base"], found["mine@head"]) == ({}, {"omega": 1.5, "rule": 'a "b"'})


@pytest.mark.parametrize(
    ("plugin", "words", "told"),
    some_by_day(
        [
            ("none.toml", (), "none.toml: is not a file"),
            ("empty.py", (), "empty.py: has no solver"),
            ("lost.py", (), "lost.py: line 1: ModuleNotFoundError"),
            ("empty.toml", (), "empty.toml: has no table [solver.NAME]"),
            ("good.toml", ("--python", "python3"), "declares programs; --python is for solvers in Python"),
        ],
        1,
    ),
)
def test_a_plugin_that_has_no_solver_is_one_line(
    tmp_path: Path, plugin: str, words: tuple[str, ...], told: str
) -> None:
    (tmp_path / "lost.py").write_text("import nowhere_to_be_found\n")
    for name in ("empty.py", "empty.toml"):
        (tmp_path / name).write_text("")
    (tmp_path / "good.toml").write_text("[solver.mine]\nnode = 'lcp'\nserve = './mine'\n")
    said = builds("head", str(tmp_path), plugin, *words, rc=1)
    assert told in said.stderr
    assert (said.stdout, said.stderr.count("\n")) == ("", 1)
