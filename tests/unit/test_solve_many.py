"""Many problems at once: answers against planted ones, and verdicts as arrays against the verdict on each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import cpbench as cp
from cpbench.errors import ProblemError
from cpbench.formulations.stack import Stack
from cpbench.verification import judge
from cpbench.verification.stacked import judge_stack

K = 60
TOLERANCE = 1e-8


def _positive_definite(rng: np.random.Generator, n: int) -> Any:
    A = rng.standard_normal((K, n, n))
    return A @ A.transpose(0, 2, 1) / n + 0.1 * np.eye(n)


def _half(rng: np.random.Generator, *shape: int) -> Any:
    """Positive numbers, about half of them 0."""
    return rng.uniform(0.5, 2.0, shape) * (rng.random(shape) < 0.5)


def _times(M: Any, x: Any) -> Any:
    return np.einsum("kij,kj->ki", M, x)


def lcp(rng: np.random.Generator) -> tuple[type, dict[str, Any], dict[str, Any]]:
    """Class, arrays and planted solutions; blocks of zeros make parts of their own, units are far apart."""
    M, z = _positive_definite(rng, 6), _half(rng, K, 6)
    M[: K // 2, :3, 3:] = M[: K // 2, 3:, :3] = 0.0
    unit = 10.0 ** rng.uniform(-2, 2, (K, 6))
    M = M * unit[:, :, None] * unit[:, None, :]
    w = np.where(z > 0, 0.0, _half(rng, K, 6) + 0.1) * unit
    return cp.LCP, {"M": M, "q": w - _times(M, z / unit)}, {"z": z / unit}


def mlcp(rng: np.random.Generator) -> tuple[type, dict[str, Any], dict[str, Any]]:
    """The same, with three free unknowns."""
    M, v, u = _positive_definite(rng, 7), _half(rng, K, 4), rng.standard_normal((K, 3))
    x = np.concatenate([u, v], axis=1)
    w = np.concatenate([np.zeros((K, 3)), np.where(v > 0, 0.0, 1.0)], axis=1)
    k = w - _times(M, x)
    data = {"A": M[:, :3, :3], "B": M[:, 3:, 3:], "C": M[:, :3, 3:], "D": M[:, 3:, :3], "a": k[:, :3], "b": k[:, 3:]}
    return cp.MLCP, data, {"u": u, "v": v}


def qp(rng: np.random.Generator) -> tuple[type, dict[str, Any], dict[str, Any]]:
    """Rows, an equality and bounds, in half of the problems parallel rows whose multipliers are large and cancel."""
    Q, z, mu = _positive_definite(rng, 5), rng.standard_normal((K, 5)), rng.standard_normal((K, 1))
    A, C, lam = rng.standard_normal((K, 4, 5)), rng.standard_normal((K, 1, 5)), _half(rng, K, 4)
    A[::2, 1] = -2.0 * A[::2, 0]
    lam[::2, :2] = [2e3, 1e3]
    at = rng.random((K, 5))
    lb, ub = np.where(at < 0.3, z, z - 1.0), np.where(at > 0.8, np.inf, z + 1.0)
    lb[:, 4] = np.where(at[:, 4] < 0.3, z[:, 4], -np.inf)
    nu = np.where(at < 0.3, 1.0, 0.0)
    b = _times(A, z) - np.where(lam > 0, 0.0, 1.0)
    p = -_times(Q, z) + _times(A.transpose(0, 2, 1), lam) + _times(C.transpose(0, 2, 1), mu) + nu
    data = {"Q": Q, "p": p, "A": A, "b": b, "C": C, "d": _times(C, z), "lb": lb, "ub": ub}
    return cp.QP, data, {"z": z, "lam": lam, "mu": mu, "nu": nu}


def fc(rng: np.random.Generator, dimension: int = 3) -> tuple[type, dict[str, Any], dict[str, Any]]:
    """Four contacts, open, sticking and sliding, μ up to 2 (Coulomb's law: sliding is against the reaction)."""
    nc, d = 4, dimension
    W, mu = _positive_definite(rng, nc * d), rng.uniform(0.1, 2.0, (K, nc))
    state = rng.integers(0, 3, (K, nc))
    normal, turn = rng.uniform(0.5, 2.0, (K, nc)), rng.standard_normal((K, nc, d - 1))
    turn /= np.linalg.norm(turn, axis=2, keepdims=True)
    share = np.where(state == 1, rng.uniform(0.0, 0.9, (K, nc)), 1.0)
    r = np.concatenate([normal[:, :, None], (share * mu * normal)[:, :, None] * turn], axis=2)
    r *= (state > 0)[:, :, None]
    u = np.zeros((K, nc, d))
    u[:, :, 0] = np.where(state == 0, 1.0, 0.0)
    u[:, :, 1:] = np.where(state == 2, -0.7, 0.0)[:, :, None] * turn
    r, u = r.reshape(K, -1), u.reshape(K, -1)
    return cp.FrictionContact, {"W": W, "q": u - _times(W, r), "mu": mu, "dimension": d}, {"r": r}


FAMILIES = {"lcp": lcp, "mlcp": mlcp, "qp": qp, "fc": fc, "fc-2d": lambda rng: fc(rng, 2)}


@pytest.mark.parametrize("name", FAMILIES)
def test_verdicts_of_a_stack_are_those_of_each_problem(name: str) -> None:
    rng = np.random.default_rng(7)
    kind, data, planted = FAMILIES[name](rng)
    stack = Stack.of_arrays(kind, data)
    # right ones, some off by about the tolerance or by far, and what is not a number
    size = 10.0 ** rng.choice([-np.inf, -13.0, -8.0, -7.0, -3.0], (K, 1))
    answers = {part: x + size * rng.standard_normal(x.shape) for part, x in planted.items()}
    first = next(iter(answers))
    answers[first][3], answers[first][4, 0], answers[first][5] = 0.0, np.nan, 1e200
    verdicts = judge_stack(stack, answers, TOLERANCE)
    assert 10 < verdicts.solved.sum() < K - 10
    for i in range(K):
        one = stack.problem(i)
        verdict = judge(one, one.point_type(**{part: x[i] for part, x in answers.items()}), TOLERANCE)
        assert verdicts.solved[i] == verdict.solved
        assert verdicts.unresolvable[i] == ("unresolvable" in verdict.flags)
        assert verdicts.error[i] == pytest.approx(verdict.error, rel=5e-3, abs=1e-12)  # units of one sweep more or less


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("name", FAMILIES)
def test_answers_are_the_planted_ones(name: str) -> None:
    """Matrices are definite, so that there is one answer; of contacts several, by the verdict of each."""
    kind, data, planted = FAMILIES[name](np.random.default_rng(8))
    solutions = cp.solve_many(kind, tolerance=TOLERANCE, **data)
    assert solutions.solved.all()
    assert solutions.one_by_one.size <= (2 if kind is cp.FrictionContact else 0)  # sweeps need long for some
    if name in ("lcp", "mlcp"):
        np.testing.assert_allclose(solutions.x, np.concatenate(list(planted.values()), axis=1), rtol=1e-8, atol=1e-10)
    elif name == "qp":
        np.testing.assert_allclose(solutions.x[:, :5], planted["z"], rtol=1e-6, atol=1e-8)
    for i in range(0, K, 7):
        assert cp.verify(solutions.stack.problem(i), solutions.x[i], tolerance=TOLERANCE).solved


@pytest.mark.needs("cpbench_solvers")
def test_problems_and_arrays_threads_and_none_give_the_same() -> None:
    kind, data, _ = lcp(np.random.default_rng(9))
    alone = cp.solve_many(kind, tolerance=TOLERANCE, **data)
    problems = [alone.stack.problem(i) for i in range(K)]
    for other in (cp.solve_many(problems, tolerance=TOLERANCE), cp.solve_many(kind, threads=2, **data)):
        np.testing.assert_array_equal(other.x, alone.x)
        np.testing.assert_array_equal(other.error, alone.error)


@pytest.mark.needs("cpbench_solvers")
def test_what_the_compiled_call_does_not_solve_goes_to_the_automatic_choice() -> None:
    """By hand: M = 0 with q < 0 has no solution; the unit matrix has z = −q."""
    M, q = np.array([np.eye(2), np.zeros((2, 2))]), np.array([[-1.0, -2.0], [-1.0, 1.0]])
    solutions = cp.solve_many(cp.LCP, M=M, q=q, tolerance=TOLERANCE)
    assert solutions.status.tolist() == ["solved", "infeasible"]
    assert solutions.one_by_one.tolist() == [1]
    assert solutions.x[0].tolist() == [1.0, 2.0]
    assert "1 of 2 solved" in repr(solutions)


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("n", [0, 1, 64])
def test_nothing_and_the_most(n: int) -> None:
    """By hand: z = 1; a program is as large as its z, whatever multipliers there are."""
    none, size = (np.zeros((0, n)), np.zeros(0)), np.ones((3, n))
    rows: dict[str, Any] = {
        "A": none[0],
        "b": none[1],
        "C": none[0],
        "d": none[1],
        "lb": np.zeros(n),
        "ub": np.full(n, 3.0),
    }
    for solutions in (
        cp.solve_many(cp.LCP, M=2.0 * np.eye(n), q=-2.0 * size, tolerance=TOLERANCE),
        cp.solve_many(cp.QP, Q=np.eye(n), p=-size, tolerance=TOLERANCE, **rows),
    ):
        assert solutions.solved.all()
        assert not solutions.one_by_one.size
        np.testing.assert_allclose(solutions.x[:, :n], size, rtol=1e-12)


@pytest.mark.needs("cpbench_solvers")
def test_a_program_that_is_not_convex_is_stationary() -> None:
    """min −½z² + z on [0, 1] has the stationary point z = 0, which is a local minimum, as min ½z² + z has."""
    none = np.zeros((0, 1)), np.zeros(0)
    data: dict[str, Any] = {
        "A": none[0],
        "b": none[1],
        "C": none[0],
        "d": none[1],
        "lb": [0.0],
        "ub": [1.0],
        "p": [1.0],
    }
    solutions = cp.solve_many(cp.QP, Q=np.array([[[1.0]], [[-1.0]]]), **data)
    assert solutions.status.tolist() == ["solved", "stationary"]
    assert cp.verify(solutions.stack.problem(1), solutions.x[1]).flags == ("stationary",)


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("problems", "arrays", "why"),
    [
        (cp.LCP, {"M": np.eye(2), "q": np.ones(2)}, "no problems"),
        (cp.LCP, {"M": np.ones((0, 2, 2)), "q": np.ones((0, 2))}, "of no problem"),
        (cp.LCP, {"M": np.ones((3, 2, 2)), "q": np.ones((2, 2))}, "2 and 3 problems"),
        (cp.LCP, {"M": np.ones((3, 2, 2)), "q": np.ones((3, 4))}, "n = 2"),
        (cp.LCP, {"M": np.ones((2, 1, 1)), "q": np.array([[1.0], [np.nan]])}, r"is nan at \(1, 0\)"),
        (cp.LCP, {"M": np.ones((3, 2, 2)), "W": np.ones((3, 2))}, "no field W"),
        (cp.LCP, {"M": np.ones((3, 65, 65)), "q": np.ones((3, 65))}, "65 unknowns, at most 64"),
        (cp.Relay, {"M": np.ones((1, 1, 1)), "q": np.ones((1, 1)), "lb": [0.0], "ub": [1.0]}, "are of relay"),
        ([], {}, "are none"),
        ([cp.LCP(M=np.eye(n), q=np.ones(n)) for n in (1, 2)], {}, "expected the same size"),
        ([cp.LCP(M=np.eye(1), q=np.ones(1))], {"q": np.ones(1)}, "go with a class"),
    ],
)
def test_what_is_no_stack_is_refused(problems: Any, arrays: dict[str, Any], why: str) -> None:
    with pytest.raises(ProblemError, match=why):
        cp.solve_many(problems, **arrays)
