"""Answers to the linear formulations as systems for `backward_error`: unknowns, rows, terms and sets of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import Problem
from cpbench.matrices import Matrix, Vector
from cpbench.verification import sets
from cpbench.verification.backward_error import System, Terms
from cpbench.verification.parallel_rows import relief

_TERMS: WeakKeyDictionary[Problem, Any] = WeakKeyDictionary()


def kept(problem: Problem, make: Callable[[], Terms]) -> Terms:
    """The sizes of a problem's terms, made once: many answers to it are judged."""
    if problem not in _TERMS:
        _TERMS[problem] = make()
    return _TERMS[problem]


def stack(blocks: list[list[Matrix | None]]) -> Any:
    """|K| of a matrix of blocks, None being zero."""
    return abs(sp.csr_array(sp.block_array([[None if B is None else sp.csr_array(B) for B in row] for row in blocks])))


def lcp(problem: Any, point: Any) -> System:
    z, q = point.z, problem.q
    return scalar(
        problem, z, problem.M @ z + q, np.abs(q), lambda: abs(problem.M), [sets.Box.of(np.arange(z.size), 0.0, np.inf)]
    )


def relay(problem: Any, point: Any) -> System:
    z, q = point.z, problem.q
    box = sets.Box.of(np.arange(z.size), problem.lb, problem.ub)
    return scalar(problem, z, problem.M @ z + q, np.abs(q), lambda: abs(problem.M), [box])


def mlcp(problem: Any, point: Any) -> System:
    P, u, v = problem, point.u, point.v
    f = np.concatenate([P.A @ u + P.C @ v + P.a, P.D @ u + P.B @ v + P.b])
    n = u.size
    boxes: list[sets.Set] = [
        sets.Box.of(np.arange(n), -np.inf, np.inf),
        sets.Box.of(np.arange(n, n + v.size), 0.0, np.inf),
    ]
    constants = np.abs(np.concatenate([P.a, P.b]))
    return scalar(P, np.concatenate([u, v]), f, constants, lambda: stack([[P.A, P.C], [P.D, P.B]]), boxes)


def avi(problem: Any, point: Any) -> System:
    return _with_rows(problem, point, problem.M, problem.q)


def qp(problem: Any, point: Any) -> System:
    return _with_rows(problem, point, problem.Q, problem.p)


def _with_rows(P: Any, point: Any, M: Matrix, q: Vector) -> System:
    """Mz + q − Aᵀλ − Cᵀμ beside the box of z, Az − b beside λ, Cz − d beside μ; ν, where given, is the first."""
    z, mu = point.z, point.mu
    # a side from 1e19 on is none: nothing holds there, and its multiplier certifies nothing
    bound = P.b > -sets.INFINITE
    lam, b = np.where(bound, point.lam, 0.0), np.where(bound, P.b, 0.0)
    force = M @ z + q - P.A.T @ lam - P.C.T @ mu
    n, m, k = z.size, lam.size, mu.size
    nu = getattr(point, "nu", None)

    def sizes() -> Any:
        A, C = sp.csr_array(P.A), sp.csr_array(P.C)
        return stack([[M, A.T, C.T], [A, sp.csr_array((m, m)), sp.csr_array((m, k))], [C, None, sp.csr_array((k, k))]])

    return System(
        x=np.concatenate([z, lam, mu]),
        f=np.concatenate([force, np.where(bound, P.A @ z - b, 0.0), P.C @ z - P.d]),
        block=np.arange(n + m + k),
        terms=kept(P, lambda: Terms.of(sizes())),
        constants=np.abs(np.concatenate([q, b, P.d])),
        sets=[
            sets.Box.of(np.arange(n), P.lb, P.ub),
            sets.Box.of(np.arange(n, n + m), 0.0, np.inf),
            sets.Box.of(np.arange(n + m, n + m + k), -np.inf, np.inf),
        ],
        relief=np.concatenate([relief(P, lam, mu, np.abs(M @ z) + np.abs(q)), np.zeros(m + k)]),
        multiplier=np.arange(n + m + k) >= n,
        also=None if nu is None else (force - nu, np.arange(n)),
    )


def scalar(
    problem: Problem, x: Vector, f: Vector, constants: Vector, make: Callable[[], Any], boxes: list[Any]
) -> System:
    """A system of single unknowns."""
    return System(x, f, np.arange(x.size), kept(problem, lambda: Terms.of(make())), constants, boxes)
