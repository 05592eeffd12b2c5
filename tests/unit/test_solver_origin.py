"""What makes a solver known to another command: a file to load. And whether it comes with cpbench."""

from __future__ import annotations

from pathlib import Path

import pytest

from cpbench import registry
from cpbench.errors import UnknownName
from cpbench.solvers.base import solvers
from cpbench.solvers.external import declared


@pytest.fixture(autouse=True)
def _nothing_declared(monkeypatch: pytest.MonkeyPatch) -> None:
    solvers.discover()
    monkeypatch.setattr(solvers, "_items", dict(solvers._items))
    monkeypatch.setattr(declared, "_declared", {})
    monkeypatch.delenv(registry.DECLARED, raising=False)


@pytest.mark.needs("cpbench_solvers")
def test_solvers_of_cpbench_need_no_file() -> None:
    assert declared.origin("pgs") == ""


def test_a_declared_solver_comes_from_its_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("[solver.mine]\nnode = 'lcp'\nserve = 'true'\n[solver.'mine@b']\nserve = 'false'\n")
    declared.declare_file(path)
    assert declared.origin("mine") == declared.origin("mine@b") == str(path)


def test_a_plugin_is_neither_a_native_solver_nor_an_adapter() -> None:
    """Only what comes with cpbench may write compiled loops into its cache, and has its version."""
    registry.load_plugin(Path(__file__).parents[1] / "reference" / "lemke.py")
    assert solvers.get("reference-lemke").origin == "plugin"
    assert {s.origin for s in solvers if "clarabel" in s.spec.requires} == {"adapter"}


def test_an_unknown_solver_may_be_one_of_a_file() -> None:
    with pytest.raises(UnknownName, match="needs --plugin FILE"):
        solvers.get("of-a-plan-file-elsewhere")
