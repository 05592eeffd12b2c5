"""QP solvers written in JAX, called directly: qpax.

qpsolvers' function traces and compiles it anew at every call, which takes 1.7 s; here a shape is compiled once a
process, in `setup`. It computes in double precision inside `jax.enable_x64`, which leaves JAX itself as it is.
Everything is dense, and bounds are rows.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from cpbench.formulations.qp import QP
from cpbench.solvers.base import Budget, Claim, SolverSpec, Trait, register
from cpbench_adapters.qp_backend import BackendAnswer, QPBackend
from cpbench_adapters.qp_standard_form import StandardForm
from cpbench_adapters.qp_tolerances import Settings

KEPT = 64
"""Most compiled shapes that a process keeps."""


class JaxBackend(QPBackend):
    """A function of arrays that JAX compiles for their shapes."""

    sparse = False
    bounds_as_rows = True

    @abstractmethod
    def arrays(self, form: StandardForm) -> tuple[Any, ...]:
        """Return the arguments of the function."""

    @abstractmethod
    def function(self) -> Callable[..., Any]:
        """Return the function of these arrays, a tolerance and a limit of iterations, not compiled."""

    @abstractmethod
    def answer(self, form: StandardForm, results: tuple[Any, ...]) -> BackendAnswer:
        """Return the answer that its results, as NumPy arrays, stand for."""

    def setup(self, problem: QP, budget: Budget, options: Any) -> StandardForm:
        form = super().setup(problem, budget, options)
        _compile(self, _shapes(self.arrays(form)))
        return form

    def call(self, form: StandardForm, settings: Settings) -> BackendAnswer:
        import jax

        arrays = self.arrays(form)
        function = _compile(self, _shapes(arrays))
        with jax.enable_x64(True):
            results = function(*arrays, settings["tolerance"], settings["iterations"])
            return self.answer(form, tuple(np.asarray(value) for value in results))


def _shapes(arrays: tuple[Any, ...]) -> tuple[tuple[int, ...], ...]:
    return tuple(array.shape for array in arrays)


@lru_cache(maxsize=KEPT)
def _compile(backend: JaxBackend, shapes: tuple[tuple[int, ...], ...]) -> Callable[..., Any]:
    """Return the backend's function, compiled for arrays of these shapes."""
    import jax

    with jax.enable_x64(True):
        like = [jax.ShapeDtypeStruct(shape, np.float64) for shape in shapes]
        return jax.jit(backend.function()).lower(*like, 1e-6, 1).compile()


@register
class Qpax(JaxBackend):
    """qpax's explicit method; it keeps s and z above 1.5e-8, so that large multipliers are never small products sz."""

    spec = SolverSpec(
        name="qpax",
        node="qp",
        summary="predictor-corrector interior point in JAX, dense",
        method="interior point",
        citation="Tracy and Manchester, On the differentiability of the primal-dual interior-point method, 2024",
        requires=("jax", "qpax"),
        install="pip install cpbench[jax]",
        licence="Apache-2.0",
        traits=frozenset({Trait.DETERMINISTIC}),
        by_default=False,  # 1 to 2 s of compilation a shape
        known_failures={
            "planted-unconstrained-psd": "its Cholesky factor of Q + GᵀDG is not finite where that is singular",
            "maros-meszaros-HS52": "not finite: Q is singular and nothing but equalities adds to it",
            "maros-meszaros-CVXQP2_S": "not finite in its 100 iterations",
        },
    )
    needs_inequality = True  # without one it solves a single KKT system and calls whatever comes out converged
    claims = {"converged": Claim.SOLVED, "iteration limit": Claim.MAX_ITER}

    def arrays(self, form: StandardForm) -> tuple[Any, ...]:
        n = form.q.size
        none = np.zeros((0, n)), np.zeros(0)
        A, b = none if form.A is None else (form.A, form.b)
        G, h = none if form.G is None else (form.G, form.h)
        return form.P, form.q, A, b, G, h

    def function(self) -> Callable[..., Any]:
        import qpax

        return lambda *data: qpax.solve_qp(*data[:-2], solver_tol=data[-2], max_iter=data[-1])

    def answer(self, form: StandardForm, results: tuple[Any, ...]) -> BackendAnswer:
        x, _, z, y, converged, iterations = results
        counters = {"iterations": int(iterations)}
        if not all(np.isfinite(v).all() for v in (x, y, z)):
            return BackendAnswer(status="not finite", counters=counters)
        return BackendAnswer(status="converged" if converged else "iteration limit", x=x, z=z, y=y, counters=counters)
