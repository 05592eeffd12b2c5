"""Specs are readable without the guests; a missing and a broken package are told apart."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from tiers import some_by_day

from cpbench.formulations.base import Kind
from cpbench.solvers import solvers
from cpbench.solvers.base import probe
from cpbench_adapters.qp_tolerances import TABLE

ADAPTERS = sorted([*TABLE, "clarabel-relaxation"])
LICENCES = {
    "casadi-qpoases": "LGPL-2.1-or-later",
    "clarabel": "Apache-2.0",
    "clarabel-relaxation": "Apache-2.0",
    "copt": "proprietary",
    "cvxopt": "GPL-3.0-or-later",
    "daqp": "MIT",
    "gurobi": "proprietary",
    "highs": "MIT",
    "osqp": "Apache-2.0",
    "piqp": "BSD-2-Clause",
    "proxqp": "BSD-2-Clause",
    "pyqpmad": "BSD-3-Clause",
    "qpalm": "LGPL-3.0-or-later",
    "qtqp": "Apache-2.0",
    "quadprog": "GPL-2.0-or-later",
    "scs": "MIT",
    "sip": "MIT",
}
BLOCK_AND_LIST = """
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in GUESTS:
            raise ImportError("guest imported: " + name)
sys.meta_path.insert(0, Blocked())
from cpbench.solvers import solvers
print(*(name for name in solvers.names() if solvers.get(name).spec.requires))
"""


@pytest.fixture(autouse=True)
def _fresh_probe() -> Iterator[None]:
    probe.cache_clear()
    yield
    probe.cache_clear()


@pytest.mark.nightly
def test_specs_are_read_without_importing_a_guest() -> None:
    guests = {package for name in ADAPTERS for package in solvers.get(name).spec.requires}
    done = subprocess.run(
        [sys.executable, "-c", f"GUESTS = {guests!r}\n{BLOCK_AND_LIST}"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert set(ADAPTERS) <= set(done.stdout.split())


@pytest.mark.parametrize("name", ADAPTERS)
def test_spec(name: str) -> None:
    spec = solvers.get(name).spec
    assert spec.name == name
    assert spec.requires
    assert spec.licence == LICENCES[name]
    assert ("cpbench[gpl]" in spec.install) == spec.licence.startswith("GPL")
    assert (spec.kind is Kind.RELAXATION) == (name == "clarabel-relaxation")


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
