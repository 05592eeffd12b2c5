"""The compiled congruence against SciPy's products, sizes told beforehand, and index types."""

from __future__ import annotations

import numpy as np
import planted
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from cpbench import graph
from cpbench.conversions import congruence, facets
from cpbench.conversions.base import Conversion, Size, conversions, make
from cpbench.conversions.congruence import Congruence, index_dtype
from cpbench.errors import ProblemError
from cpbench.formulations import LCP, FrictionContact, GlobalFrictionContact, LCPPoint, Relay
from cpbench.foundation import matrices
from cpbench.testing.cases import cases

quick = settings(max_examples=60, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32 - 1)
EDGES = ("fc-lcp-inner", "fc-lcp-outer", "fc-mlcp-outer")


def delassus(rng: np.random.Generator, nc: int, d: int, how: str) -> sp.csr_array:
    """A sparse W, (nc d, nc d): full blocks, single entries, zeros stored, or contacts without any entry."""
    pattern = sp.random_array((nc, nc), density=min(1.0, 3 / max(nc, 1)), rng=rng) if nc else sp.csr_array((0, 0))
    if how != "no diagonal":
        pattern = pattern + sp.eye_array(nc)
    W = sp.csr_array(sp.kron(pattern, np.ones((d, d))))
    W.sum_duplicates()
    W.data = rng.standard_normal(W.nnz)
    if how == "entries":
        W.data *= rng.random(W.nnz) < 0.4
        W.eliminate_zeros()
    elif how == "zeros":
        W.data *= rng.random(W.nnz) < 0.4
    return matrices.matrix(W)


def planes(rng: np.random.Generator, d: int) -> Congruence:
    """Random small blocks with zeros, zero columns included; the second block of K has coefficients."""
    k, width = rng.integers(1, 8, 2)
    left, right = rng.standard_normal((d, k)), rng.standard_normal((d, width))
    left *= rng.random((d, k)) < 0.6
    right *= rng.random((d, width)) < 0.6
    blocks = rng.standard_normal((2, k, width)) * (rng.random((2, k, width)) < 0.3)
    return Congruence(left, right, blocks)


def reference(form: Congruence, W: sp.csr_array, coefficients: np.ndarray) -> np.ndarray:
    nc, s = coefficients.shape
    E, F = np.kron(np.eye(nc), form.left), np.kron(np.eye(nc), form.right)
    K = sum(
        (np.kron(np.diag(coefficients[:, i]), form.blocks[i]) for i in range(s)), np.zeros((E.shape[1], F.shape[1]))
    )
    return E.T @ W.toarray() @ F + K


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every sparse W goes through the compiled loop."""
    monkeypatch.setattr(congruence, "COMPILED_ABOVE", -1)


HOW = st.sampled_from(["full", "entries", "zeros", "no diagonal"])


@quick
@given(seeds, st.integers(0, 7), st.sampled_from([2, 3, 5]), HOW, st.booleans())
def test_general_blocks(seed: int, nc: int, d: int, how: str, by_kernel: bool) -> None:
    rng = np.random.default_rng(seed)
    W, form, coefficients = delassus(rng, nc, d, how), planes(rng, d), rng.uniform(0.0, 2.0, (nc, 2))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(congruence, "COMPILED_ABOVE", -1 if by_kernel else 10**9)
        M = form.assemble(W, coefficients)
        room = form.size(W)
    expected = reference(form, W, coefficients)
    np.testing.assert_allclose(M.toarray(), expected, rtol=0, atol=1e-13 * max(1.0, np.abs(expected).max(initial=0.0)))
    np.testing.assert_allclose(form.assemble(W.toarray(), coefficients), expected, rtol=0, atol=1e-12)
    plain = sp.csr_array((M.data, M.indices, M.indptr), shape=M.shape)
    assert plain.has_canonical_format
    assert M.data.all()
    assert room.rows == M.shape[0]
    assert M.nnz <= room.entries
    assert M.data.nbytes + M.indices.nbytes + M.indptr.nbytes <= room.bytes
    if how == "full" and form.left.all() and form.right.all():
        assert M.nnz == room.entries


@pytest.mark.parametrize(
    "edge", [make(name, {"facets": n}) for name in EDGES for n in (4, 8, 10)], ids=lambda e: e.label
)
def test_facet_edges_by_the_compiled_loop(edge, rng, compiled) -> None:
    """The same structure and numbers as SciPy's products; bounds that are met."""
    problem, _ = planted.fc(rng, 12, 3, "nonsymmetric", sparse=True)
    target = edge.step(problem)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(congruence, "COMPILED_ABOVE", 10**9)
        by_products = edge.step(problem)
    size, held = edge.predict(problem), 0
    for name, M in target.data().items():
        if M.ndim == 1:
            continue
        other = getattr(by_products, name)
        assert (M.indptr == other.indptr).all()
        assert (M.indices == other.indices).all()
        np.testing.assert_allclose(M.data, other.data, rtol=0, atol=1e-14 * np.abs(other.data).max())
        held += M.data.nbytes + M.indices.nbytes + M.indptr.nbytes
    assert held <= size.bytes
    assert size.rows == sum(target.point_sizes.values())


def test_products_that_cancel_are_not_stored(compiled) -> None:
    """Directions at right angles do not see each other through W = 1: cos(π/2) is 0 and stays out."""
    nc = 4
    problem = FrictionContact(W=sp.eye_array(3 * nc, format="csr"), q=np.zeros(3 * nc), mu=np.full(nc, 0.5))
    M = make("fc-lcp-inner", {"facets": 4}).step(problem).M
    assert M.data.all()
    assert M.nnz == nc * (1 + 4 * 3 + 5)  # r_N alone; β_i with itself, its opposite and λ; μ and four times −1


def test_a_large_problem_takes_the_compiled_loop_and_no_copy(rng) -> None:
    nc = 2580
    W = sp.block_diag([sp.csr_array(rng.standard_normal((90, 90))) for _ in range(nc // 30)], format="csr")
    assert W.nnz > congruence.COMPILED_ABOVE
    problem = FrictionContact(W=W, q=rng.standard_normal(3 * nc), mu=np.full(nc, 0.3))
    form = facets.congruence(facets.directions(8, 0.0))
    M = form.assemble(problem.W, facets.coefficients(problem.mu))
    held = LCP(M=M, q=np.zeros(M.shape[0])).M
    assert np.shares_memory(held.data, M.data)
    with pytest.raises(ValueError, match="read-only"):
        held.data[0] = 1.0
    assert M.nnz <= form.size(problem.W).entries == nc * 30 * 81 + nc * 17


def test_entries_that_overflow_are_found(compiled) -> None:
    W = sp.csr_array(np.full((3, 3), 1e308))
    problem = FrictionContact(W=W, q=np.zeros(3), mu=np.array([0.5]))
    with np.errstate(all="ignore"), pytest.raises(ProblemError, match="non-finite"):
        make("fc-lcp-outer", {"facets": 4}).step(problem)


def test_indices_of_both_widths_give_the_same(rng, compiled, monkeypatch) -> None:
    W, form = delassus(rng, 8, 3, "entries"), facets.congruence(facets.directions(8, 0.3))
    coefficients = facets.coefficients(rng.uniform(0, 1, 8))
    narrow = form.assemble(W, coefficients)
    size = form.size(W)
    monkeypatch.setattr(congruence, "index_dtype", lambda *_: np.int64)
    wide = form.assemble(W, coefficients)
    assert (narrow != wide).nnz == 0
    assert form.size(W) == size


def test_index_type() -> None:
    assert index_dtype() is np.int32
    assert index_dtype(2**31 - 1, 5) is np.int32
    assert index_dtype(5, 2**31) is np.int64


def test_sizes() -> None:
    assert Size.dense(3, 4) == Size(3, 12, 96)
    assert Size.sparse(10, 10, 20).bytes == 20 * 12 + 11 * 4
    assert Size.sparse(10, 10, 2**31).bytes == 2**31 * 16 + 11 * 8
    assert str(Size(7, 11, 1_500_000_000)) == "7 rows, 11 entries, 1.5 GB at most"


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
