"""De Saxcé's fixed point around Clarabel, for contacts with Coulomb friction and with rolling friction."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.rfc import RollingFrictionContact
from cpbench.solvers.adapters.conic_models import ClarabelModel, ConicModel
from cpbench.solvers.adapters.desaxce_fixed_point import ConicFixedPoint, DeSaxceOptions, ScaledContact
from cpbench.solvers.base import Budget, SolverSpec, Trait, register


class _Clarabel(ConicFixedPoint):
    def model(self, prepared: ScaledContact, budget: Budget) -> ConicModel:
        return ClarabelModel(prepared.P, prepared.q, prepared.A, prepared.b, prepared.cones, budget)


@register
class ClarabelDeSaxce(_Clarabel):
    """Every convex program is solved from scratch by an interior method, to errors of about 1e-8."""

    spec = SolverSpec(
        name="clarabel-de-saxce",
        node="fc",
        summary="fixed point on De Saxcé's term, every step a second-order cone program by Clarabel",
        method="fixed point",
        citation="Acary, Cadoux, Lemaréchal and Malick, ZAMM 91 (2011); Goulart and Chen, arXiv 2405.12762",
        requires=("clarabel",),
        install="pip install clarabel",
        licence="Apache-2.0",
        traits=frozenset({Trait.SPARSE, Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        quick=True,
        options=DeSaxceOptions,
    )

    def warmup(self) -> None:
        self.run(FrictionContact(W=np.eye(3), q=np.array([-1.0, 2.0, 0.0]), mu=np.array([0.5])))


@register
class ClarabelDeSaxceRolling(_Clarabel):
    """Every convex program is solved from scratch by an interior method, to errors of about 1e-8."""

    spec = SolverSpec(
        name="clarabel-de-saxce-rfc",
        node="rfc",
        summary="fixed point on De Saxcé's term with rolling friction, every step a cone program by Clarabel",
        method="fixed point",
        citation="Acary and Bourrier 2021, Eur. J. Mech. A/Solids 85:104046; Goulart and Chen, arXiv 2405.12762",
        requires=("clarabel",),
        install="pip install clarabel",
        licence="Apache-2.0",
        traits=frozenset({Trait.SPARSE, Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        quick=True,
        options=DeSaxceOptions,
    )

    def warmup(self) -> None:
        q = np.array([-1.0, 2.0, 0.0, 0.0, 1.0])
        self.run(RollingFrictionContact(W=np.eye(5), q=q, mu=np.array([0.5]), mu_r=np.array([0.1])))
