"""A run keeps the exact proofs of its statuses, and they are checked again when it is judged again."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from command_line import cpbench
from judged_again import judged_again

from cpbench import storage
from cpbench.bench.results.merge import merge
from cpbench.bench.results.store import Store
from cpbench.formulations import LCP, QP
from cpbench.proofs import holds, unpacked

PANG = LCP(M=np.array([[0.0, -1, -1], [1, 0, 0], [-1, 0, 1]]), q=[-1e-4, -1, 1], name="pang")
NEAR = LCP(M=np.array([[1.0, -1.0], [-1.0, 1.0 + 1.9e-12]]), q=[-0.5, -0.5], name="near")
FALLING = QP.build(np.diag([1.0, 0.0]), [0.0, -1.0], A=np.array([[-1.0, 1.0]]), b=[-1.0], name="falling")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("proofs")
    for problem in (PANG, NEAR, FALLING):
        storage.save(problem, folder / f"{problem.name}.h5")
    chosen = [part for name in ("lemke", "lemke-mlcp", "interior-point-qp") for part in ("-s", name)]
    done = cpbench(folder, "run", ".", *chosen, "--no-report", "-q", "-o", "r.sqlite")
    assert done.returncode == 0, done.stderr
    return folder / "r.sqlite"


def statuses(path: Path) -> Mapping[tuple[str, str], tuple[str, str, str]]:
    with Store(path) as store:
        return {(row.problem, row.solver): (row.status, row.claim, row.message) for row in store.rows()}


@pytest.mark.nightly
def test_statuses_are_those_that_are_proved(results: Path) -> None:
    found = statuses(results)
    for solver in ("lemke", "lemke-mlcp"):  # the second by a conversion, whose data are others
        status, claim, message = found["pang", solver]
        assert (status, claim) == ("infeasible", "infeasible")
        assert ("proved" in message) == (status == "infeasible")
        status, claim, message = found["near", solver]
        assert (status, claim) == ("failed", "infeasible")
        assert "no certificate of it holds beyond rounding" in message
    assert found["falling", "interior-point-qp"][:2] == ("unbounded", "unbounded")
    assert found["falling", "lemke-mlcp"][:2] == ("unbounded", "infeasible")  # its conditions of optimality have none


@pytest.mark.needs("cpbench_solvers")
def test_proofs_are_kept_and_hold(results: Path) -> None:
    problems = {problem.name: problem for problem in (PANG, NEAR, FALLING)}
    with Store(results) as store:
        rows = {row.key: row for row in store.rows()}
        kept = list(store.certificates())
    assert {rows[key].status for key, _, _ in kept} == {"infeasible", "unbounded"}
    assert len(kept) == sum(row.status in ("infeasible", "unbounded") for row in rows.values())
    for key, kind, data in kept:
        assert kind == rows[key].status
        assert holds(problems[rows[key].problem], unpacked(kind, data))


@pytest.mark.needs("cpbench_solvers")
def test_merged_files_keep_the_proofs(results: Path, tmp_path: Path) -> None:
    merge([results], tmp_path / "m.sqlite")
    with Store(results) as before, Store(tmp_path / "m.sqlite") as after:
        assert list(before.certificates()) == list(after.certificates())


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    "change",
    [
        "UPDATE certificates SET proof = x'00'",
        "UPDATE certificates SET kind = 'unbounded' WHERE kind = 'infeasible'",
        "DELETE FROM certificates",
    ],
)
def test_judging_again_checks_the_proofs(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: str
) -> None:
    monkeypatch.chdir(results.parent)
    follows, told = judged_again(results)
    assert follows
    assert "no change" in told[0]
    copy = tmp_path / "copy.sqlite"
    shutil.copy(results, copy)
    with closing(sqlite3.connect(copy)) as db, db:
        db.execute(change)
    with Store(results) as store:
        touched = sum(kind == "infeasible" or "WHERE" not in change for _, kind, _ in store.certificates())
    follows, told = judged_again(copy)
    assert not follows
    named = [line for line in told if "-> failed, error inf" in line]
    assert len(named) == touched > 0


@pytest.mark.needs("cpbench_solvers")
def test_a_row_that_is_run_again_loses_its_proof(results: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.sqlite"
    with closing(sqlite3.connect(results)) as source, closing(sqlite3.connect(copy)) as target:
        source.backup(target)
    with Store(copy, create=True) as store:
        store.reset()
        assert list(store.certificates()) == []
