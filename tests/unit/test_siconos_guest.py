"""The guest that serves Siconos: its matrices, one process a problem, and what is said where there is no Siconos."""

from __future__ import annotations

import signal
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import planted
import psutil
import pytest
from tiers import some_by_day

from cpbench.bench.planning import plan
from cpbench.bench.slot import Slot
from cpbench.errors import Ended
from cpbench.formulations import FrictionContact
from cpbench.foundation import matrices
from cpbench.solvers import solvers
from cpbench.solvers.base import Budget, Claim
from cpbench.storage import save
from cpbench.verification import judge
from cpbench_adapters import siconos
from cpbench_adapters.siconos import SiconosSolver
from cpbench_adapters.siconos_families import SiconosContact
from cpbench_adapters.siconos_tolerances import NAME, Bound, limit, stopping

TABLES = [solver for solver in solvers if isinstance(solver, SiconosSolver)]


@pytest.fixture(scope="module", autouse=True)
def debian() -> None:
    found = siconos.about(siconos.interpreter())
    if "version" not in found:
        pytest.skip(f"needs Siconos: {found['detail']}")


def _nsgs(storage: str) -> SiconosSolver:
    row = solvers.get("siconos-fc3d-nsgs").row
    return SiconosContact(replace(row, name=storage, storage=storage))


@pytest.mark.nightly
@pytest.mark.parametrize("sparse", some_by_day([False, True], 1))
def test_a_matrix_is_the_same_in_every_storage(sparse: bool) -> None:
    """Nonsymmetric W: rows for columns would give another answer. The sweeps are the same up to rounding."""
    problem, _ = planted.fc(np.random.default_rng(5), 6, 3, "monotone", sparse=sparse)
    assert not np.allclose(matrices.dense(problem.W), matrices.dense(problem.W).T)
    answers = []
    for storage in ("dense", "blocks", "sparse", "given"):
        solver = _nsgs(storage)
        output = solver.run(problem, Budget(tolerance=1e-10))
        assert judge(problem, output.point, 1e-8).solved, storage
        answers.append(output.point.r)
        solver.close()
    np.testing.assert_allclose(answers, [answers[0]] * len(answers), atol=1e-9)


def test_a_problem_that_kills_is_the_last_of_its_process_alone() -> None:
    solver = solvers.get("siconos-fc3d-nsgs")
    good, _ = planted.fc(np.random.default_rng(0), 2, 3, "positive definite")
    bad = FrictionContact(W=np.diag([-1.0, 1, 1]), q=[-1.0, 1, 0], mu=[0.5], dimension=3)
    for _ in range(2):
        assert solver.run(good).claim is Claim.SOLVED
        with pytest.raises(Ended) as end:
            solver.run(bad)
        assert end.value.code == -signal.SIGABRT


def test_one_worker_and_one_interpreter_serve_a_whole_run(tmp_path: Path) -> None:
    """The child in which the guest holds a problem is no process left behind, and what it uses is charged."""
    name, started = "siconos-fc3d-nsgs", list[tuple[str, str]]()
    paths = [str(tmp_path / f"{k}.h5") for k in range(5)]
    for k, path in enumerate(paths):
        problem, _ = planted.fc(np.random.default_rng(k), 20, 3, "positive definite")
        save(problem, path)
    workers, guests, rows = set[int](), set[int](), list[Mapping[str, Any]]()
    with Slot() as slot:
        surveys = [slot.survey(path, [plan.exact()]) for path in paths]
        limits = plan.Limits(20.0, 2**32, 1, repeats=3)
        for pair in plan.pairs(surveys, [plan.parse_entry(name)], [plan.exact()], 1e-6, limits):
            slot.start({name: limits}, lambda *event: started.append(event))
            rows.append(slot.run(pair, slot.prepare(pair)))
            family = psutil.Process(slot.workers.children[0].pid).children(recursive=True)
            workers |= {family[0].pid}
            guests |= {family[1].pid}
    assert [row.status for row in rows] == ["solved"] * 5
    assert {row.flags for row in rows} == {""}
    assert (len(started), len(workers), len(guests)) == (1, 1, 1)


def test_tolerance_and_bound_are_always_set() -> None:
    assert stopping(SiconosContact.test, 1e-4, 1e-8).settings == {NAME: pytest.approx(1e-9)}
    assert stopping(SiconosContact.test, 1e-4, 1e-2).settings == {NAME: 1e-4}  # its own default
    assert limit(Budget(), Bound.NEWTON) == 1000
    assert limit(Budget(iterations=7), Bound.SWEEPS) == 7


def test_one_probe_for_the_whole_family(monkeypatch: pytest.MonkeyPatch) -> None:
    siconos.about.cache_clear()
    asked = []
    run = siconos.subprocess.run
    monkeypatch.setattr(siconos.subprocess, "run", lambda *a, **k: asked.append(a) or run(*a, **k))
    assert all(solver.availability().ok for solver in TABLES)
    assert len(asked) == 1


def test_a_python_without_siconos_names_what_to_install() -> None:
    found = siconos.about(sys.executable)
    assert found["state"] == "missing"
    assert "apt install python3-siconos" in found["detail"]
    assert siconos.about("/nowhere/python3")["state"] == "missing"


def test_a_siconos_that_cannot_be_imported_shows_why(tmp_path: Path) -> None:
    broken = tmp_path / "python3"
    (tmp_path / "siconos").mkdir()
    (tmp_path / "siconos" / "__init__.py").write_text("raise OSError('libsiconos_numerics.so.7: cannot open')\n")
    broken.write_text(f'#!/bin/sh\nPYTHONPATH={tmp_path} exec {sys.executable} "$@"\n')
    broken.chmod(0o755)
    found = siconos.about(str(broken))
    assert found["state"] == "broken"
    assert "libsiconos_numerics.so.7: cannot open" in found["detail"]
