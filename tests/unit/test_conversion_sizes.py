"""Sizes told before a conversion are kept, far bounds lose no digits."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench import graph
from cpbench.conversions.base import Conversion, conversions, make
from cpbench.formulations import GlobalFrictionContact, LCPPoint, Relay
from cpbench.foundation import matrices
from cpbench.testing.cases import cases

SAID = [n for n in conversions.names() if conversions.get(n).predict is not Conversion.predict]


@pytest.mark.parametrize("name", SAID)
def test_no_result_is_larger_than_predicted(name):
    edge = make(name)
    checked = 0
    for case in cases(edge.source):
        if edge.obstacle(case.problem) is None:
            size, target = edge.predict(case.problem), edge.apply(case.problem)[0]
            assert sum(matrices.nnz(v) for v in target.data().values() if v.ndim == 2) <= size.entries, case.name
            checked += 1
    assert checked


def test_the_size_of_a_delassus_operator_is_what_meets_at_the_bodies():
    """A chain of nc + 1 bodies, contact k between k and k + 1: two contacts meet at every body, one at both ends."""
    nc = 50
    pattern = sp.diags_array([np.ones(nc), -np.ones(nc)], offsets=[0, -1], shape=(nc + 1, nc))
    H = sp.csr_array(sp.kron(pattern, np.ones((3, 3))))
    M = sp.csr_array(sp.kron(sp.eye_array(nc + 1), np.ones((3, 3)) + 3.0 * np.eye(3)))
    chain = GlobalFrictionContact(M=M, H=H, f=np.zeros(3 * nc + 3), w=np.ones(3 * nc), mu=np.ones(nc))
    size = make("gfc-fc").predict(chain)
    assert (size.rows, size.entries) == (3 * nc, 36 * (nc - 1) + 2 * 9)


def test_a_far_bound_on_one_side_loses_nothing():
    problem = Relay(M=np.eye(2), q=[1.0, -2.0], lb=[-1e20, 0.0], ub=[1.0, 1e20])
    target = make("relay-lcp").step(problem)
    there = graph.push(target, LCPPoint(z=[-1.0, 2.0]))
    np.testing.assert_array_equal(graph.lift(target, there).z, [-1.0, 2.0])
    assert target.residuals(there).error == 0.0
