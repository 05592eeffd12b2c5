"""Commercial QP backends, called through qpsolvers: copt and gurobi.

None of them is run unless it is named. Without a licence they solve small problems only (2000 variables or rows); what
they say of a larger one is a missing licence.
"""

from __future__ import annotations

from abc import abstractmethod
from functools import cache

from cpbench.errors import Unavailable
from cpbench.solvers.base import Availability, solvers
from cpbench_adapters.qp_backend import BackendAnswer
from cpbench_adapters.qp_standard_form import StandardForm
from cpbench_adapters.qp_tolerances import Settings
from cpbench_adapters.qpsolvers_backends import TabledBackend, table

_COPT_LICENCE = 4
"""COPT's code for its licence, for which coptpy has no name."""


class LicensedBackend(TabledBackend):
    """A backend that may refuse to work for want of a licence."""

    @abstractmethod
    def licence(self) -> str:
        """Return what is wrong with the licence, "" when a small problem could be solved. Asked once a process."""

    @abstractmethod
    def refused(self, cause: Exception) -> bool:
        """Return whether an exception of the backend is about its licence."""

    def availability(self) -> Availability:
        state = super().availability()
        why = _licence(self) if state.ok else ""
        return Availability("licence", why) if why else state

    def call(self, form: StandardForm, settings: Settings) -> BackendAnswer:
        try:
            return super().call(form, settings)
        except Exception as cause:
            if self.refused(cause):
                raise Unavailable("licence", _one_line(cause)) from cause
            raise


@cache
def _licence(backend: LicensedBackend) -> str:
    return backend.licence()


def _one_line(cause: Exception) -> str:
    return " ".join(str(cause).split())


class Copt(LicensedBackend):
    """COPT prints where it looked for a licence to stdout, whatever it is asked."""

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


class Gurobi(LicensedBackend):
    """Gurobi says once a process, on stdout, which licence it found."""

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


CLASSES = {"copt": Copt, "gurobi": Gurobi}
for _row in table("licensed"):
    solvers.add(_row["name"], CLASSES[_row["name"]](_row))
