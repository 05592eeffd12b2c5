"""Facts about matrices: against brute force by the definitions, matrices from the literature, and each other."""

from __future__ import annotations

from dataclasses import fields
from itertools import combinations

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from cpbench.formulations import LCP, MLCP, QP, FrictionContact, formulations
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.expressions import Builder
from cpbench_lab import facts
from cpbench_lab.facts import How
from cpbench_lab.facts.fact import Fact, decided, undecided
from cpbench_lab.facts.sign_classes import exact_minor, least_ratio
from cpbench_problems.generators.lcp_classics import csizmadia, fathi, murty

small_matrices = st.integers(1, 5).flatmap(
    lambda n: st.lists(st.integers(-2, 3), min_size=n * n, max_size=n * n).map(
        lambda entries: np.array(entries, dtype=float).reshape(n, n)
    )
)
"""Integer matrices: their minors are integers, so that determinants rounded are exact."""


def _value(found, name):
    return next(f for f in found if f.name == name).value


def _brute_p(M: np.ndarray) -> bool:
    """All 2ⁿ − 1 principal minors by LAPACK determinants, rounded to the integers they are."""
    n = len(M)
    return all(
        round(np.linalg.det(M[np.ix_(rows, rows)])) > 0
        for size in range(1, n + 1)
        for rows in combinations(range(n), size)
    )


@settings(max_examples=120, deadline=None)
@given(small_matrices)
def test_the_p_property_is_that_of_all_minors(M: np.ndarray) -> None:
    found = facts.p_matrix(M, "M", facts.definiteness(M, "M"))
    assert found.value == _brute_p(M)
    assert found.how is How.EXACT
    transposed = facts.p_matrix(sp.csr_array(M.T), "M", facts.definiteness(M, "M"))
    assert transposed.value == found.value


@settings(max_examples=80, deadline=None)
@given(small_matrices, st.booleans())
def test_definiteness_and_rank_are_those_of_numpy(M: np.ndarray, sparse: bool) -> None:
    values = np.linalg.eigvalsh((M + M.T) / 2)
    word = facts.definiteness(sp.csr_array(M) if sparse else M, "M")
    low, high = values[0] > 1e-9, values[-1] > 1e-9
    if low:
        assert word.value == "positive definite"
    elif values[0] > -1e-9:
        assert word.value == "positive semidefinite"
    else:
        assert word.value == ("indefinite" if high else "negative semidefinite")
    assert facts.rank(sp.csr_array(M) if sparse else M, "M").value == np.linalg.matrix_rank(M)


def test_classes_of_named_matrices() -> None:
    """Murty's P (Math. Prog. 7, 1978), Fathi's SPD (Math. Prog. 17, 1979), Csizmadia's P; and small known ones."""
    for n in (5, 10, 17, 60):
        M = murty(n).problem.M
        found = facts.of_matrix(M, "M")
        assert _value(found, "P-matrix") is True  # lower triangular: every block has one row, whatever n
        assert _value(found, "Z-matrix") is False
        assert _value(found, "symmetry") is False
        found = facts.of_matrix(fathi(n).problem.M, "M")
        assert _value(found, "definiteness") == "positive definite"
        assert _value(found, "P-matrix") is True
        found = facts.of_matrix(csizmadia(n).problem.M, "M")
        assert _value(found, "P-matrix") is True
    # Cottle, Pang, Stone 1992, section 3.3: P, but xᵀMx < 0 at (1, 1)
    found = facts.of_matrix(np.array([[1.0, -3], [0, 1]]), "M")
    assert _value(found, "P-matrix") is True
    assert _value(found, "definiteness") == "indefinite"
    found = facts.of_matrix(np.array([[1.0, 2], [2, 1]]), "M")
    assert _value(found, "P-matrix") is False


def test_a_counterexample_is_a_minor_that_anyone_can_check() -> None:
    rng = np.random.default_rng(3)
    failed = 0
    for _ in range(60):
        M = rng.standard_normal((9, 9)) + 2.2 * np.eye(9)
        found = facts.p_matrix(M, "M", facts.definiteness(M, "M"))
        assert found.value == all(
            np.linalg.det(M[np.ix_(r, r)]) > 0 for k in range(1, 10) for r in combinations(range(9), k)
        )
        if found.value is False:
            failed += 1
            words = found.evidence.removeprefix("principal minor of row").removeprefix("s").removesuffix(" is")
            rows = [int(word) - 1 for word in words.split(",")]
            assert float(exact_minor(M, rows)) == found.number <= 0
            assert np.linalg.det(M[np.ix_(rows, rows)]) == pytest.approx(found.number, abs=1e-12)
    assert 5 < failed < 55


def test_rounding_is_not_taken_for_a_sign() -> None:
    """The minors of aaᵀ + δI are exact rationals: the recursion is asked, and rational arithmetic answers."""
    a = np.array([1.0, 3, 5, 7])
    singular = np.outer(a, a)
    assert facts.p_matrix(singular, "M", facts.definiteness(singular, "M")).value is False
    M = np.array([[1.0, 1, 1], [1, 1 + 2e-16, 1], [1, 1, 3.0]])
    assert exact_minor(M, [0, 1]) > 0
    found = facts.p_matrix(M, "M", facts.definiteness(M, "M"))
    assert found.value is None
    assert found.how is How.UNDECIDED
    assert "too near 0" in found.evidence
    assert least_ratio(np.eye(3)) == (1.0, None)


def test_large_p_matrices_by_what_suffices() -> None:
    n = 400
    spd = sp.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(n, n), format="csr")
    skew = sp.diags_array([3.0, -3.0], offsets=[1, -1], shape=(n, n), format="csr")
    monotone = sp.csr_array(spd + skew)
    found = facts.of_matrix(monotone, "M")
    assert _value(found, "P-matrix") is True
    assert next(f for f in found if f.name == "P-matrix").evidence == "positive definite"
    laplacian = sp.csr_array(sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(5000, 5000)))
    found = facts.of_matrix(laplacian, "M")
    assert [_value(found, name) for name in ("Z-matrix", "P-matrix")] == [True, True]
    assert _value(found, "definiteness") == "positive definite"
    least = next(f for f in found if f.name == "definiteness").number
    assert least == pytest.approx(1 - np.cos(np.pi / 5001), rel=1e-3)  # of the matrix with unit diagonal
    hidden = np.random.default_rng(1).standard_normal((40, 40)) + 5 * np.eye(40)
    undecided = facts.p_matrix(hidden, "M", facts.definiteness(hidden, "M"))
    assert undecided.value is None
    assert "40 rows" in undecided.evidence


@pytest.mark.parametrize("n", [40, 1500])
@pytest.mark.parametrize("rows", [None, 7])
def test_large_ranks_and_definiteness_of_planted_matrices(n: int, rows: int | None) -> None:
    """Low-rank W = HᵀH, and a sparse path of bodies: known ranks."""
    rng = np.random.default_rng(n)
    if rows is not None:
        H = rng.standard_normal((rows, n))
        assert facts.rank(H, "H").value == rows
        assert facts.rank(sp.csr_array(H.T), "H").value == rows
        return
    incidence = sp.csr_array(sp.diags_array([1.0, -1.0], offsets=[0, 1], shape=(n - 1, n)))
    doubled = sp.csr_array(sp.vstack([incidence, incidence[: n // 2]]))
    assert facts.rank(doubled, "H").value == n - 1
    W = sp.csr_array(doubled @ doubled.T)
    known = facts.definiteness(W, "W")
    assert known.value == "positive semidefinite"
    assert facts.rank(W, "W", known=known).value == n - 1
    indefinite = sp.csr_array(W - 0.5 * sp.eye_array(W.shape[0]))
    word = facts.definiteness(indefinite, "W")
    assert word.value == "indefinite"


@pytest.mark.nightly
def test_beyond_every_limit_a_fact_is_not_decided() -> None:
    rng = np.random.default_rng(5)
    n = 30000
    J = sp.random_array((n, n), density=4 / n, rng=rng, format="csr")
    W = sp.csr_array(J @ J.T)  # no component, no band
    word = facts.definiteness(W, "W")
    for found in (word, facts.rank(W, "W", known=word)):
        assert found.value is None
        assert found.how is How.UNDECIDED


def test_facts_of_problems() -> None:
    J = np.random.default_rng(0).standard_normal((9, 4))
    contact = FrictionContact(W=J @ J.T, q=np.zeros(9), mu=[0.0, 0.3, 0.0], dimension=3)
    by_subject = {f.subject: f for f in facts.of_problem(contact)}
    assert by_subject["rank of W"].value == 4
    assert by_subject["hyperstaticity"].value == 5
    assert by_subject["frictionless contacts"].value == 2
    assert by_subject["definiteness of W"].value == "positive semidefinite"
    assert by_subject["definiteness of W_cc"].value == "positive definite"
    nonconvex = QP.build(Q=np.diag([1.0, -1]), p=np.zeros(2), C=np.ones((2, 2)), d=np.zeros(2))
    by_subject = {f.subject: f for f in facts.of_problem(nonconvex)}
    assert by_subject["definiteness of Q"].value == "indefinite"
    assert by_subject["rank of C"].value == 1
    singular = MLCP(A=np.zeros((1, 1)), B=np.eye(1), C=np.ones((1, 1)), D=-np.ones((1, 1)), a=[0.0], b=[0.0])
    by_subject = {f.subject: f for f in facts.of_problem(singular)}
    assert by_subject["rank of A"].value == 0
    assert by_subject["definiteness of [[A, C], [D, B]]"].value == "positive semidefinite"


@pytest.mark.parametrize("node", formulations.names())
def test_facts_of_empty_problems(node: str) -> None:
    """n = 0 has facts, all of them decided."""
    cls = formulations.get(node)
    data = {}
    for f in cls._data_fields():
        shape = [int(s) if s.isdigit() else 0 for s in f.metadata["shape"]]
        data[f.name] = np.zeros(shape)
    for f in fields(cls):
        if "map" in f.metadata:
            build = Builder(0)
            data[f.name] = build.finish([build.constant(0.0)] * (f.metadata["map"][0] == "1"))
    extra = {"dimension": cls.dimensions[0]} if issubclass(cls, ContactProblem) else {}
    for found in facts.of_problem(cls(**data, **extra)):
        assert found.how is not How.UNDECIDED
        assert str(found)


# ---------------------------------------------------------------------------------------- the ends of the numbers


def test_subnormal_entries_are_judged_in_their_own_units() -> None:
    """diag(1e-309, 1) and (1e-310) are positive definite by definition, and so a P-matrix."""
    for M in (np.diag([1e-309, 1.0]), np.array([[1e-310]]), np.diag([5e-324, 1.0])):
        found = {fact.name: fact for fact in facts.of_problem(LCP(M=M, q=np.zeros(len(M))))}
        assert found["definiteness"].value == "positive definite"
        assert (found["rank"].value, found["P-matrix"].value) == (len(M), True)
    indefinite = facts.of_problem(LCP(M=np.diag([-1e-309, 1.0]), q=np.zeros(2)))
    assert {fact.name: fact.value for fact in indefinite}["definiteness"] == "indefinite"


@pytest.mark.parametrize(
    "M",
    [
        [[1e308, 1.7e308], [1.7e308, 1.0]],  # M + Mᵀ is no finite number
        [[1e308, -1e308], [1e308, 1e308]],
        [[5e-324, 1e300], [1e300, 5e-324]],
        [[5e-324, 0.0], [0.0, 1e308]],
        [[0.0, 1e-320], [1e-320, 0.0]],
    ],
)
@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")
def test_no_fact_rests_on_a_number_that_is_none(M: list[list[float]]) -> None:
    for fact in facts.of_problem(LCP(M=M, q=np.zeros(2))):
        assert fact.number is None or not np.isnan(fact.number), str(fact)
        if fact.name == "definiteness":
            assert fact.value is None, str(fact)


def test_a_fact_whose_number_is_nan_is_not_decided() -> None:
    assert decided(Fact("rank", "M", 1, How.EXACT, float("nan"))) == undecided(
        "rank", "M", "the numbers of the matrix overflow or underflow in the test"
    )
    known = Fact("rank", "M", 1, How.EXACT, 0.5)
    assert decided(known) is known


@pytest.mark.parametrize("seed", range(0, 60, 3))
def test_facts_have_no_units(seed: int) -> None:
    """Integer matrices, semidefinite, singular or with one eigenvalue pushed below 0, in units of 2^±60 a row."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    G = rng.integers(-3, 4, (n, max(1, n - int(rng.integers(0, 3))))).astype(float)
    M = G @ G.T - np.diag(rng.integers(0, 2, n) * rng.integers(0, 2))
    unit = np.ldexp(1.0, rng.integers(-60, 61, n))
    scaled = unit[:, None] * M * unit
    expected = [f.value for f in facts.of_matrix(M, "M") if f.name != "rank"]
    for stored in (scaled, sp.csr_array(scaled)):
        assert [f.value for f in facts.of_matrix(stored, "M") if f.name != "rank"] == expected
