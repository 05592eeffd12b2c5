"""What every edge must keep: data untouched, traces that travel, storage class, empty problems, names, tolerances."""

from __future__ import annotations

import dataclasses

import numpy as np
import planted
import pytest
import scipy.sparse as sp
from tiers import some_by_day

from cpbench import graph
from cpbench.conversions.base import Conversion, conversions, find_via, make
from cpbench.errors import NotApplicable, UnknownName
from cpbench.formulations import (
    MLCP,
    Kind,
)
from cpbench.formulations.expressions import Builder
from cpbench.foundation import matrices
from cpbench.graph.routes import nodes_of_maps
from cpbench.testing.cases import Case, cases

NAMES = conversions.names()
ELIMINATING = ("fcm-fc", "gfc-fc", "gfc-fcm", "grfc-rfc", "mlcp-lcp-schur", "qp-qp-dual")
"""Edges whose target may fill up; then it is dense."""


def taken(name: str) -> list[Case]:
    """Planted cases that the edge takes."""
    edge = make(name)
    return [c for c in cases(edge.source) if edge.obstacle(c.problem) is None]


def planted_for(name: str, *, sparse: bool):
    """A problem that the edge takes, stored sparse or dense, with its solution."""
    case = max(taken(name), key=lambda c: sum(v.size for v in c.point.arrays().values()))
    change = matrices.sparse if sparse else matrices.dense
    stored = {k: change(v) for k, v in case.problem.data().items() if v.ndim == 2}
    return dataclasses.replace(case.problem, **stored), case.point


def nothing(name: str, like):
    """The problem of the edge's source with no unknowns."""
    problem = taken(name)[0].problem
    sizes = dict.fromkeys(problem.sizes(), 0)
    data = {
        f.name: np.zeros([sizes.get(symbol, 2) for symbol in f.metadata["shape"]]) for f in type(problem)._data_fields()
    }
    maps = {  # a map to ℝ¹ is constant, the others have no rows
        f.name: (build := Builder(0)).finish([build.constant(0.0)] * (f.metadata["map"][0] == "1"))
        for f in dataclasses.fields(problem)
        if "map" in f.metadata
    }
    return dataclasses.replace(problem, **maps, **{k: like(v) if v.ndim == 2 else v for k, v in data.items()})


@pytest.mark.parametrize("name", [n for n in NAMES if n not in ELIMINATING and make(n).source not in nodes_of_maps()])
@pytest.mark.parametrize("sparse", [False, True])
def test_storage_class_is_kept(name, sparse):
    """Matrices without rows may be either."""
    problem, _ = planted_for(name, sparse=sparse)
    target = make(name).step(problem)
    assert all(matrices.is_sparse(M) == sparse for M in target.data().values() if M.ndim == 2 and M.shape[0])


def test_elimination_stays_sparse_until_it_fills_up(rng):
    n = 30
    A, C = sp.diags_array(np.full(n, 2.0)), sp.eye_array(n)
    problem = MLCP(A=A, B=A, C=C, D=-C, a=np.ones(n), b=np.ones(n))
    M = make("mlcp-lcp-schur").step(problem).M
    assert matrices.is_sparse(M)
    np.testing.assert_allclose(matrices.dense(M), 2.5 * np.eye(n))
    full, _ = planted.mlcp(rng, 4, 4, "positive definite", sparse=True)
    assert not matrices.is_sparse(make("mlcp-lcp-schur").step(full).M)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("like", some_by_day([np.asarray, sp.csr_array], 1), ids=["dense", "sparse"])
def test_empty_and_zero_problems(name, like):
    problem, edge = nothing(name, like), make(name)
    assert edge.obstacle(problem) is None
    assert edge.exactness(problem).rank <= edge.kind.rank
    target = edge.step(problem)
    there = graph.push(target, problem.zero_point())
    target.check_point(there)
    problem.check_point(graph.lift(target, there))


def test_find_via():
    assert find_via("mlcp-lcp-schur") == ["mlcp-lcp-schur"]
    assert find_via("inner") == ["fc-lcp-inner"]
    assert find_via("outer") == ["fc-lcp-outer", "fc-mlcp-outer"]
    with pytest.raises(UnknownName, match="did you mean inner"):
        find_via("iner")


def test_unknown_knob():
    with pytest.raises(UnknownName, match="did you mean facets"):
        make("fc-lcp-inner", {"facet": 8})


def test_push_is_optional(rng):
    class OneWay(Conversion):
        name, source, target, kind, cost = "a-b", "a", "b", Kind.ONE_WAY, 1.0

        def apply(self, problem):
            return problem, {}

        def lift(self, point, trace):
            return point

    with pytest.raises(NotApplicable, match="a-b: has no push"):
        OneWay().push(None, {})
