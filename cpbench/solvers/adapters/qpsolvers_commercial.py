"""Commercial QP backends, called through qpsolvers: copt, gurobi, mosek.

None of them is run unless it is named. Without a licence Gurobi and COPT solve small problems only (2000 variables or
rows); what they say of a larger one is a missing licence, as is what MOSEK says of all problems.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from functools import cache
from typing import Any, ClassVar

from cpbench.errors import Unavailable
from cpbench.solvers.adapters.qp_backend import BackendAnswer, QPSolversBackend
from cpbench.solvers.adapters.qp_standard_form import StandardForm
from cpbench.solvers.adapters.qp_tolerances import Settings
from cpbench.solvers.base import Availability, Claim, SolverSpec, Trait, register

_COPT_LICENCE = 4
"""COPT's code for its licence, for which coptpy has no name."""
_MOSEK_LICENCE = range(1000, 1041)
"""The codes of MOSEK's answers that are about its licence."""


class LicensedBackend(QPSolversBackend):
    """A backend that may refuse to work for want of a licence.

    `words` : what its status numbers mean.
    """

    words: ClassVar[Mapping[int, str]] = {}

    @abstractmethod
    def licence(self) -> str:
        """Return what is wrong with the licence, "" when a small problem could be solved. Asked once a process."""

    @abstractmethod
    def refused(self, cause: Exception) -> bool:
        """Return whether an exception of the backend is about its licence."""

    def availability(self) -> Availability:
        state = super().availability()
        why = _licence(type(self)) if state.ok else ""
        return Availability("licence", why) if why else state

    def status(self, solution: Any, settings: Settings) -> str:
        value = int(solution.extras["status"])
        return self.words.get(value, f"status {value}")

    def call(self, form: StandardForm, settings: Settings) -> BackendAnswer:
        try:
            return super().call(form, settings)
        except Exception as cause:
            if self.refused(cause):
                raise Unavailable("licence", _one_line(cause)) from cause
            raise


@cache
def _licence(backend: type[LicensedBackend]) -> str:
    return backend().licence()


def _one_line(cause: Exception) -> str:
    return " ".join(str(cause).split())


@register
class Copt(LicensedBackend):
    """COPT prints where it looked for a licence to stdout, whatever it is asked."""

    spec = SolverSpec(
        name="copt",
        node="qp",
        summary="COPT's barrier method for convex QP",
        method="interior point",
        citation="Ge, Huangfu, Wang, Wu and Ye, Cardinal Optimizer (COPT) user guide",
        requires=("qpsolvers", "coptpy"),
        install="pip install cpbench[commercial]",
        licence="proprietary",
        publishing="ask the vendor: GAMS' licence demands written consent to publish comparisons with COPT; COPT's own "
        "was not read",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
        by_default=False,
        known_failures={
            "unbounded-qp": "calls z = 0 optimal for min ½z₁² − z₂, z ≥ 0, where the bounds are rows, as qpsolvers "
            "writes them too; unbounded where they are bounds",
            "case-z-unit-1e-08": "claims a QP with entries of Q of 1e16 solved at ε = 1e-4 that is not",
        },
    )
    sparse = None
    bounds_as_rows = True
    words = {
        0: "unstarted",
        1: "optimal",
        2: "infeasible",
        3: "unbounded",
        4: "infeasible or unbounded",
        5: "numerical trouble",
        7: "imprecise",
        8: "time limit",
        9: "unfinished",
        10: "interrupted",
        11: "iteration limit",
    }
    claims = {
        "optimal": Claim.SOLVED,
        "imprecise": Claim.INACCURATE,
        "infeasible": Claim.INFEASIBLE,
        "unbounded": Claim.UNBOUNDED,
        "time limit": Claim.MAX_ITER,
        "iteration limit": Claim.MAX_ITER,
    }

    def licence(self) -> str:
        import coptpy

        try:
            coptpy.Envr()
        except coptpy.CoptError as cause:
            return _one_line(cause)
        return ""

    def refused(self, cause: Exception) -> bool:
        import coptpy

        return isinstance(cause, coptpy.CoptError) and cause.retcode == _COPT_LICENCE


@register
class Gurobi(LicensedBackend):
    """Gurobi says once a process, on stdout, which licence it found."""

    spec = SolverSpec(
        name="gurobi",
        node="qp",
        summary="Gurobi's barrier method for convex QP",
        method="interior point",
        citation="Gurobi Optimization, Gurobi Optimizer reference manual",
        requires=("qpsolvers", "gurobipy"),
        install="pip install cpbench[commercial]",
        licence="proprietary",
        publishing="forbidden by the licence in its package: 'You will not publish any benchmark testing results on "
        "the Product'; ask the vendor",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
        by_default=False,
        known_failures={
            "case-z-unit-1e-08": "claims a QP with entries of Q of 1e16 solved at ε = 1e-6 that is not",
            "case-many-units": "claims a QP with entries of Q from 1e-8 to 1e8 solved at ε = 1e-6 that is not",
        },
    )
    sparse = None
    bounds_as_rows = True
    words = {
        2: "optimal",
        3: "infeasible",
        4: "infeasible or unbounded",
        5: "unbounded",
        7: "iteration limit",
        9: "time limit",
        12: "numerical trouble",
        13: "suboptimal",
    }
    claims = {
        "optimal": Claim.SOLVED,
        "suboptimal": Claim.INACCURATE,
        "infeasible": Claim.INFEASIBLE,
        "unbounded": Claim.UNBOUNDED,
        "iteration limit": Claim.MAX_ITER,
        "time limit": Claim.MAX_ITER,
    }

    def licence(self) -> str:
        import gurobipy

        try:
            with gurobipy.Env(params={"OutputFlag": 0}):
                return ""
        except gurobipy.GurobiError as cause:
            return _one_line(cause)

    def refused(self, cause: Exception) -> bool:
        import gurobipy

        about = (gurobipy.GRB.Error.NO_LICENSE, gurobipy.GRB.Error.SIZE_LIMIT_EXCEEDED)
        return isinstance(cause, gurobipy.GurobiError) and cause.errno in about


@register
class Mosek(LicensedBackend):
    """MOSEK by CVXOPT's interface, as qpsolvers does; what it does with a licence has not been seen here."""

    spec = SolverSpec(
        name="mosek",
        node="qp",
        summary="MOSEK's homogeneous interior-point method for convex QP",
        method="interior point",
        citation="Andersen and Andersen, The MOSEK interior point optimizer for linear programming, 2000",
        requires=("qpsolvers", "cvxopt", "mosek"),
        install="pip install Mosek cvxopt, and a licence file",
        licence="proprietary",
        publishing="ask the vendor: its licence agreement was not read",
        traits=frozenset({Trait.SPARSE}),
        by_default=False,
    )
    sparse = None
    bounds_as_rows = True
    needs_inequality = True  # qpsolvers answers an unconstrained QP with SciPy's LSQR in its name
    claims = {
        "optimal": Claim.SOLVED,
        "near optimal": Claim.INACCURATE,
        "primal infeasible": Claim.INFEASIBLE,
        "dual infeasible": Claim.UNBOUNDED,
    }

    def licence(self) -> str:
        import mosek

        try:
            with mosek.Env() as env:
                env.checkoutlicense(mosek.feature.pton)
        except mosek.Error as cause:
            return f"{cause.errno}: no licence for MOSEK; put one where MOSEKLM_LICENSE_FILE says"
        return ""

    def refused(self, cause: Exception) -> bool:
        import mosek

        return isinstance(cause, mosek.Error) and int(cause.errno) in _MOSEK_LICENCE

    def guest_function(self) -> Any:
        import mosek
        from qpsolvers.solvers.mosek_ import mosek_solve_problem

        def solve(problem: Any, **settings: Any) -> Any:
            named = {getattr(mosek.dparam, key, None) or getattr(mosek.iparam, key): v for key, v in settings.items()}
            return mosek_solve_problem(problem, mosek=named)

        return solve

    def status(self, solution: Any, settings: Settings) -> str:
        return str(solution.extras["status"])

    def counters(self, solution: Any) -> Mapping[str, int]:
        return {}
