"""De Saxcé's fixed point around SCS, for contacts with Coulomb friction and with rolling friction."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.rfc import RollingFrictionContact
from cpbench.solvers.adapters.conic_models import ConicModel, ScsModel
from cpbench.solvers.adapters.desaxce_fixed_point import ConicFixedPoint, DeSaxceOptions, ScaledContact
from cpbench.solvers.base import Budget, SolverSpec, Trait, register


class _Scs(ConicFixedPoint):
    def model(self, prepared: ScaledContact, budget: Budget) -> ConicModel:
        return ScsModel(prepared.P, prepared.q, prepared.A, prepared.b, prepared.cones, budget)


@register
class ScsDeSaxce(_Scs):
    """Every convex program starts from the solution of the last one, with the same factorization."""

    spec = SolverSpec(
        name="scs-de-saxce",
        node="fc",
        summary="fixed point on De Saxcé's term, every step a second-order cone program by SCS",
        method="fixed point",
        citation="Acary, Cadoux, Lemaréchal and Malick, ZAMM 91 (2011); O'Donoghue, SIAM J. Optim. 31 (2021)",
        requires=("scs",),
        install="pip install scs",
        licence="MIT",
        traits=frozenset({Trait.SPARSE, Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=DeSaxceOptions,
    )

    def warmup(self) -> None:
        self.run(FrictionContact(W=np.eye(3), q=np.array([-1.0, 2.0, 0.0]), mu=np.array([0.5])))


@register
class ScsDeSaxceRolling(_Scs):
    """Every convex program starts from the solution of the last one, with the same factorization."""

    spec = SolverSpec(
        name="scs-de-saxce-rfc",
        node="rfc",
        summary="fixed point on De Saxcé's term with rolling friction, every step a cone program by SCS",
        method="fixed point",
        citation="Acary and Bourrier 2021, Eur. J. Mech. A/Solids 85:104046; O'Donoghue, SIAM J. Optim. 31 (2021)",
        requires=("scs",),
        install="pip install scs",
        licence="MIT",
        traits=frozenset({Trait.SPARSE, Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=DeSaxceOptions,
    )

    def warmup(self) -> None:
        q = np.array([-1.0, 2.0, 0.0, 0.0, 1.0])
        self.run(RollingFrictionContact(W=np.eye(5), q=q, mu=np.array([0.5]), mu_r=np.array([0.1])))
