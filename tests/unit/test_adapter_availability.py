"""Specs are readable without the guests; a missing and a broken package are told apart."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from tiers import some_by_day

from cpbench.solvers import solvers
from cpbench.solvers.base import probe
from cpbench_adapters.qp_tolerances import TABLE

ADAPTERS = sorted([*TABLE, "clarabel-relaxation"])


@pytest.fixture(autouse=True)
def _fresh_probe() -> Iterator[None]:
    if find_spec("qpsolvers"):
        import qpsolvers  # noqa: F401  it asks once what is there, which must not be while a test hides something
    probe.cache_clear()
    yield
    probe.cache_clear()


@pytest.mark.parametrize("name", ADAPTERS)
def test_a_missing_guest_is_missing(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = solvers.get(name).spec
    monkeypatch.setitem(sys.modules, spec.requires[-1], None)  # find_spec then finds nothing
    state = solvers.get(name).availability()
    assert (state.state, state.detail) == ("missing", spec.install)


def test_a_guest_that_fails_to_import_is_broken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "daqp"
    package.mkdir()
    (package / "__init__.py").write_text("raise RuntimeError('libgomp is not there')\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "daqp", raising=False)
    state = solvers.get("daqp").availability()
    assert state.state == "broken"
    assert "RuntimeError: libgomp is not there" in state.detail


@pytest.mark.parametrize("name", some_by_day(ADAPTERS, 12))
def test_version_is_that_of_the_guest(name: str) -> None:
    solver = solvers.get(name)
    if solver.availability().ok:
        assert solver.version()[0].isdigit()
