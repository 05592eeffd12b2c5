"""QP solvers written in JAX, called directly: jaxopt's OSQP and qpax.

qpsolvers' functions trace and compile them anew at every call, which takes 1.7 s; here a shape is compiled once a
process, in `setup`. They compute in double precision inside `jax.enable_x64`, which leaves JAX itself as it is.
Everything is dense, and bounds are rows.
"""

from __future__ import annotations

import warnings
from abc import abstractmethod
from collections.abc import Callable
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.qp import QP
from cpbench.solvers.adapters.qp_backend import BackendAnswer, QPBackend
from cpbench.solvers.adapters.qp_standard_form import StandardForm
from cpbench.solvers.adapters.qp_tolerances import Settings, translate
from cpbench.solvers.base import Availability, Budget, Claim, SolverSpec, Trait, register

KEPT = 64
"""Most compiled shapes that a process keeps."""

_SOLVED = 1
"""jaxopt.BoxOSQP.SOLVED."""


class JaxBackend(QPBackend):
    """A function of arrays that JAX compiles for their shapes."""

    sparse = False
    bounds_as_rows = True
    compiled_limit: ClassVar[bool] = False
    """Whether the most iterations are compiled in."""

    @abstractmethod
    def arrays(self, form: StandardForm) -> tuple[Any, ...]:
        """Return the arguments of the function."""

    @abstractmethod
    def function(self, iterations: int) -> Callable[..., Any]:
        """Return the function of these arrays, a tolerance and a limit of iterations, not compiled.

        `iterations` : that limit, for a function that must know it when it is compiled.
        """

    @abstractmethod
    def answer(self, form: StandardForm, results: tuple[Any, ...]) -> BackendAnswer:
        """Return the answer that its results, as NumPy arrays, stand for."""

    def availability(self) -> Availability:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # jaxopt says at its import that nobody maintains it
            return super().availability()

    def setup(self, problem: QP, budget: Budget, options: Any) -> StandardForm:
        form = super().setup(problem, budget, options)
        self._compiled(self.arrays(form), translate(self.spec.name, budget))
        return form

    def call(self, form: StandardForm, settings: Settings) -> BackendAnswer:
        import jax

        arrays = self.arrays(form)
        function = self._compiled(arrays, settings)
        with jax.enable_x64(True):
            results = function(*arrays, settings["tolerance"], settings["iterations"])
            return self.answer(form, tuple(np.asarray(value) for value in results))

    def _compiled(self, arrays: tuple[Any, ...], settings: Settings) -> Callable[..., Any]:
        limit = settings["iterations"] if self.compiled_limit else 0
        return _compile(self, limit, tuple(array.shape for array in arrays))


@lru_cache(maxsize=KEPT)
def _compile(backend: JaxBackend, iterations: int, shapes: tuple[tuple[int, ...], ...]) -> Callable[..., Any]:
    """Return the backend's function, compiled for arrays of these shapes."""
    import jax

    with jax.enable_x64(True):
        like = [jax.ShapeDtypeStruct(shape, np.float64) for shape in shapes]
        return jax.jit(backend.function(iterations)).lower(*like, 1e-6, 1).compile()


@register
class JaxoptOsqp(JaxBackend):
    """jaxopt.BoxOSQP, l ≤ Ax ≤ u, with its LU factorization instead of conjugate gradients.

    Its tests of infeasibility are off, as is its default for compiled loops: a step that leaves the multipliers as they
    are passes for a proof (x unconstrained: primal infeasible after one iteration).
    """

    spec = SolverSpec(
        name="jaxopt-osqp",
        node="qp",
        summary="OSQP's operator splitting (ADMM) in JAX, dense",
        method="ADMM",
        citation="Blondel et al., Efficient and modular implicit differentiation, NeurIPS 2022",
        requires=("jax", "jaxopt"),
        install="pip install cpbench[jax]",
        licence="Apache-2.0",
        traits=frozenset({Trait.DETERMINISTIC}),
        by_default=False,  # 1 to 2 s of compilation a shape
        known_failures={
            "maros-meszaros-HS118": "ends at its 20 000 iterations with an error of 2.2e-3",
            "maros-meszaros-QAFIRO": "ends at its 20 000 iterations with an error of 0.13",
        },
    )
    compiled_limit = True
    claims = {"solved": Claim.SOLVED, "iteration limit": Claim.MAX_ITER}

    def arrays(self, form: StandardForm) -> tuple[Any, ...]:
        k = 0 if form.b is None else form.b.size
        if form.A is None and form.G is None:  # it divides by ‖Ax‖, so that a void row must not be 0
            return form.P, form.q, np.eye(1, form.q.size), np.full(1, -np.inf), np.full(1, np.inf)
        matrix = np.vstack([M for M in (form.A, form.G) if M is not None])
        upper = np.concatenate([v for v in (form.b, form.h) if v is not None])
        lower = np.where(np.arange(upper.size) < k, upper, -np.inf)
        return form.P, form.q, matrix, lower, upper

    def function(self, iterations: int) -> Callable[..., Any]:
        import jaxopt

        def solve(P: Any, q: Any, A: Any, lower: Any, upper: Any, tol: Any, _: Any) -> Any:
            solver = jaxopt.BoxOSQP(
                eq_qp_solve="lu",
                check_primal_dual_infeasability=False,
                implicit_diff=False,
                jit=True,
                tol=tol,
                maxiter=iterations,
            )
            start = solver.init_params(None, (P, q), A, (lower, upper))
            result = solver.run(start, params_obj=(P, q), params_eq=A, params_ineq=(lower, upper))
            return result.params.primal[0], result.params.dual_eq, result.state.status, result.state.iter_num

        return solve

    def answer(self, form: StandardForm, results: tuple[Any, ...]) -> BackendAnswer:
        x, y, state, iterations = results
        k = 0 if form.b is None else form.b.size
        counters = {"iterations": int(iterations)}
        if not np.isfinite(x).all():
            return BackendAnswer(status="not finite", counters=counters)
        status = "solved" if state == _SOLVED else "iteration limit"
        return BackendAnswer(status=status, x=x, y=y[:k], z=y[k:], counters=counters)


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

    def function(self, iterations: int) -> Callable[..., Any]:
        import qpax

        return lambda *data: qpax.solve_qp(*data[:-2], solver_tol=data[-2], max_iter=data[-1])

    def answer(self, form: StandardForm, results: tuple[Any, ...]) -> BackendAnswer:
        x, _, z, y, converged, iterations = results
        counters = {"iterations": int(iterations)}
        if not all(np.isfinite(v).all() for v in (x, y, z)):
            return BackendAnswer(status="not finite", counters=counters)
        return BackendAnswer(status="converged" if converged else "iteration limit", x=x, z=z, y=y, counters=counters)
