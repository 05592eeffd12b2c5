"""Old names of solvers: they still work and say so once; old results are read under the new names."""

import logging
import sqlite3
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from edited_results import seal_anew

from cpbench import storage
from cpbench.bench.planning import plan
from cpbench.bench.planning.grids import entries
from cpbench.bench.results.store import Store
from cpbench.bench.slot import Slot
from cpbench.errors import DuplicateName
from cpbench.formulations import LCP
from cpbench.registry import Registry
from cpbench.solvers import solvers
from cpbench.solvers.renamed import RENAMED

LIMITS = plan.Limits(seconds=20.0, repeats=1)
OLD, NEW = "lcp-enumeration", "enumeration-lcp"


@pytest.mark.needs("cpbench_solvers")
def test_every_old_name_stands_for_a_solver_that_exists():
    names = set(solvers.names())
    assert set(RENAMED.values()) <= names
    assert not set(RENAMED) & names
    assert len(set(RENAMED.values())) == len(RENAMED)


def test_native_names_end_in_no_other_node_than_their_own():
    nodes = {solver.spec.node for solver in solvers} | {"contact", "cone", "global", "rolling"}
    for solver in solvers:
        first, _, last = solver.spec.name.rpartition("-")
        if first and last in nodes and type(solver).__module__.startswith("cpbench_solvers."):
            assert last == solver.spec.node, solver.spec.name


def test_an_old_name_works_and_says_so_once(caplog):
    registry = Registry("solver", renamed={"old": "new"})
    item = registry.add("new", object())
    with caplog.at_level(logging.WARNING):
        assert registry.get("old") is item
        assert registry.get("old") is item
    assert [record.getMessage() for record in caplog.records] == ["solver 'old' is now called 'new'"]
    assert "old" in registry
    assert registry.names() == ["new"]


def test_an_old_name_is_not_given_to_another_solver():
    registry = Registry("solver", renamed={"old": "new"})
    with pytest.raises(DuplicateName, match="old name of 'new'"):
        registry.add("old", object())


@pytest.mark.needs("cpbench_solvers")
def test_a_plan_names_solvers_as_they_are_called_now():
    assert [entry.label for entry in entries([OLD])] == [NEW]


@pytest.mark.needs("cpbench_solvers")
def test_results_written_under_an_old_name_are_read_and_resumed_under_the_new_one(tmp_path):
    """The names are put back in a file of today, with its seals, as an older cpbench would have written it."""
    storage.save(LCP(M=np.array([[2.0, 1.0], [1.0, 2.0]]), q=np.array([-5.0, -6.0])), tmp_path / "p.h5")
    asked = [plan.exact()]
    with Slot() as slot:
        survey = slot.survey(str(tmp_path / "p.h5"), asked)
        (pair,) = plan.pairs([survey], entries([NEW]), asked, 1e-6, LIMITS)
        outcome = slot.run(pair, slot.prepare(pair))
    path = tmp_path / "old.sqlite"
    with Store(path, create=True) as store:
        store.plan([pair])
        store.finish(pair.key, replace(outcome, status="solved"))
        store.set_meta(solvers={OLD: {"version": "0.1"}})
    with closing(sqlite3.connect(path)) as db:
        db.execute("UPDATE rows SET solver = ?, label = ?", (OLD, OLD))
        db.commit()
    seal_anew(path)

    with Store(path) as store:
        table = store.table()
        assert list(table["solver"]) == list(table["label"]) == [NEW]
        assert store.row(pair.key).label == NEW
        assert [row.solver for row in store.rows()] == [NEW]
        assert store.meta()["solvers"] == {NEW: {"version": "0.1"}}
        assert not store.audit().broken
    with Store(path, create=True) as store:
        store.plan([pair])  # the same pair, asked for by its new name
        assert store.pending() == set()
        assert len(store.table()) == 1
