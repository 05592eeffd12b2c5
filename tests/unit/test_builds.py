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

PLUGIN = """
from dataclasses import dataclass
from typing import ClassVar

from cpbench.solvers import Solver, SolverSpec, register
from helpers import OMEGA


@dataclass(frozen=True)
class Options:
    omega: float = OMEGA
    rule: str = "bland"
    seed: int = 3
    start: object = None


@register
class Mine(Solver):
    spec: ClassVar[SolverSpec] = SolverSpec(
        name="mine", node="lcp", summary="s", method="m", licence="MIT", options=Options
    )

    def solve(self, prepared, budget, options, start=None, record=None):
        raise NotImplementedError
"""


def builds(*words: str, rc: int = 0, **env: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", "-m", "cpbench.solvers.external.builds", *words]
    done = subprocess.run(command, env={**os.environ, **env}, capture_output=True, text=True, timeout=600)
    assert done.returncode == rc, done.stdout + done.stderr
    return done


def checkout(folder: Path, omega: float) -> Path:
    """A plugin that imports what stands in src/ of its checkout."""
    (folder / "src").mkdir(parents=True)
    (folder / "bench").mkdir()
    (folder / "src/helpers.py").write_text(f"OMEGA = {omega}\n")
    (folder / "bench/mine.py").write_text(PLUGIN)
    return folder


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
def test_a_python_plugin_is_imported_from_its_own_checkout_with_its_own_defaults(tmp_path: Path) -> None:
    base, head = checkout(tmp_path / "with space", 1.0), checkout(tmp_path / "head", 1.5)
    told = builds("base", str(base), "bench/mine.py", PYTHONPATH="/lib/else").stdout
    told += builds("head", str(head), "bench/mine.py", "--python", ".venv/bin/python").stdout
    tables = tomllib.loads(told)["solver"]
    assert set(tables) == {"mine@base", "mine@head"}
    assert tables["mine@base"]["env"] == {
        PLUGIN_FILES: str(base / "bench/mine.py"),
        "PYTHONPATH": os.pathsep.join([str(base / "bench"), str(base / "src"), str(base), "/lib/else"]),
    }
    assert tables["mine@head"]["interpreter"] == str(head / ".venv/bin/python")
    assert "interpreter" not in tables["mine@base"]
    variants = tmp_path / "variants.toml"
    variants.write_text(told)
    (tmp_path / "head.py").write_text(PLUGIN.replace("from helpers import OMEGA", "OMEGA = 1.5"))
    assert known(tables, tmp_path / "head.py", variants) == {
        "mine@base": {"omega": 1.0, "rule": "bland"},  # seed is a word of the protocol, None is no value of a table
        "mine@head": {"omega": 1.5, "rule": "bland"},
    }


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
