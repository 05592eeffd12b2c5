"""`cpbench list solvers` and `cpbench doctor`: what is there, what is not and how to get it, whatever guests do."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from command_line import cpbench as in_process
from tiers import some_by_day

from cpbench.bench import availability
from cpbench.cli.terminal import table
from cpbench.solvers.base import probe, solvers
from cpbench_adapters.qp_tolerances import TABLE

PLUGIN = '''
from dataclasses import dataclass
from cpbench.solvers.base import Availability, Claim, Solver, SolverOutput, SolverSpec, register

@dataclass(frozen=True)
class Options:
    """`step` : how far."""

    step: float = 0.5
    max_steps: int = 10

class Plugged(Solver):
    def solve(self, prepared, budget, options, start=None, record=None):
        return SolverOutput(claim=Claim.FAILED)

def plug(name, **more):
    spec = SolverSpec(name=name, node="lcp", summary="does nothing", method="none", options=Options, **more)
    register(type("Plugged_" + name.replace("-", "_"), (Plugged,), {"spec": spec}))

plug("guest-absent", requires=("no_such_guest",), install="pip install no-such-guest")
plug("guest-broken", requires=("broken_guest",))
plug("guest-deadly", requires=("deadly_guest",))
plug("guest-well", requires=("well_guest",), licence="proprietary", publishing="ask first")
plug("guest-rare", requires=("well_guest",), by_default=False, known_failures={"case-x": "error 2e-3"})

@register
class Licensed(Plugged):
    spec = SolverSpec(name="guest-licensed", node="lcp", summary="asks", method="none", requires=("well_guest",))

    def availability(self):
        return Availability("licence", "the licence ended on 2020-01-01; get one at example.org")
'''
GUESTS = {
    "broken_guest": "raise ImportError('libguest.so.3: no such file')",
    "deadly_guest": "import os; os.abort()",
    "well_guest": "",
}


@pytest.fixture(scope="module")
def plugged(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """An environment in which cpbench has the solvers above, and the packages that they need, or nearly."""
    folder = tmp_path_factory.mktemp("guests")
    for name, body in GUESTS.items():
        (folder / f"{name}.py").write_text(body)
    plugin = folder / "plugin.py"
    plugin.write_text(PLUGIN)
    return {**os.environ, "PYTHONPATH": str(folder), "CPBENCH_PLUGINS": str(plugin)}


def cpbench(environment: dict[str, str], *arguments: str) -> str:
    command = [sys.executable, "-m", "cpbench", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, env=environment, timeout=600).stdout


@pytest.mark.nightly
def test_a_list_of_those_that_a_run_takes_says_how_many_more_there_are(plugged: dict[str, str]) -> None:
    told = cpbench(plugged, "list", "solvers", "lcp").splitlines()
    assert next(line for line in told if "guest-absent" in line).endswith("missing: pip install no-such-guest")
    assert next(line for line in told if "guest-broken" in line).endswith("installed"), "it was not imported"
    assert "proprietary*" in next(line for line in told if "guest-well" in line)
    assert not any(line.startswith("guest-rare") for line in told)
    assert "more run only when they are named" in told[-1]
    assert any(line.startswith("guest-rare") for line in cpbench(plugged, "list", "solvers", "--all").splitlines())


@pytest.mark.nightly
def test_the_doctor_tells_every_reason_once_with_what_to_do(plugged: dict[str, str]) -> None:
    told = cpbench(plugged, "doctor")
    assert "pip install no-such-guest" in told
    assert "libguest.so.3: no such file" in told
    assert "Traceback" in told
    assert "SIGABRT" in told
    assert "the licence ended on 2020-01-01" in told
    assert "guest-well" in told
    ok, _, rest = told.partition("\nlicence")
    assert "nsgs " in ok
    assert "guest-rare" in ok
    assert "guest-broken" not in ok
    assert "guest-broken" in rest


@pytest.mark.nightly
def test_the_sheet_of_a_solver_shows_its_options(plugged: dict[str, str]) -> None:
    told = cpbench(plugged, "list", "solvers", "guest-rare")
    assert "when named" in told
    assert "step" in told
    assert "0.1 to 0.9" in told
    assert "how far" in told
    assert "max_steps" in told
    assert "no" in told
    assert "error 2e-3" in told
    assert "publishing    ask first" in cpbench(plugged, "list", "solvers", "guest-well")


@pytest.mark.nightly
def test_a_guest_that_hangs_is_broken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(availability, "PATIENCE", 0.5)
    monkeypatch.setattr(availability, "_main", _sleep)
    found = list(availability.examine([solvers.get("osqp"), solvers.get("lemke")]))
    assert {one.name: one.state for one in found} == {"osqp": "broken", "lemke": "ok"}
    assert "after 0.5 s" in next(one.detail for one in found if one.name == "osqp")


def _sleep(*_: object) -> None:
    time.sleep(60.0)


def test_columns_are_as_wide_as_their_widest_cell() -> None:
    assert list(table([("a", "b", "c"), ("long", "b", "d e")])) == ["a     b  c", "long  b  d e"]
    assert list(table([])) == []


@pytest.mark.parametrize("arguments", some_by_day(["formats nsgs", "formats --all"], 1))
def test_what_makes_no_sense_is_refused(tmp_path: Path, arguments: str) -> None:
    done = in_process(tmp_path, "list", *arguments.split())
    assert done.returncode == 2
    assert done.stderr.startswith("cpbench: ")
    assert done.stderr.count("\n") == 1


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
