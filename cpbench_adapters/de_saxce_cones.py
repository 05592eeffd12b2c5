"""De Saxcé's fixed point around Clarabel and SCS, for contacts with Coulomb friction and with rolling friction."""

from __future__ import annotations

from dataclasses import replace

from cpbench.formulations.contact import LocalContact
from cpbench.solvers.base import Budget, SolverSpec, Trait, register
from cpbench.solvers.stopping import Stopping
from cpbench_adapters.conic_models import ClarabelModel, ConicModel, ScsModel
from cpbench_adapters.desaxce_fixed_point import ConicFixedPoint, DeSaxceOptions, ScaledContact

COULOMB = "Acary, Cadoux, Lemaréchal and Malick, ZAMM 91 (2011)"
ROLLING = "Acary and Bourrier 2021, Eur. J. Mech. A/Solids 85:104046"
CLARABEL = "Goulart and Chen, arXiv 2405.12762"
SCS = "O'Donoghue, SIAM J. Optim. 31 (2021)"


@register
class ClarabelDeSaxce(ConicFixedPoint):
    """The fixed point whose convex programs are solved from scratch by an interior method, to errors of about 1e-8."""

    spec = SolverSpec(
        name="clarabel-de-saxce",
        node="fc",
        summary="fixed point on De Saxcé's term, every step a second-order cone program by Clarabel",
        method="fixed point",
        citation=f"{COULOMB}; {CLARABEL}",
        requires=("clarabel",),
        install="pip install clarabel",
        licence="Apache-2.0",
        traits=frozenset({Trait.SPARSE, Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        quick=True,
        options=DeSaxceOptions,
    )

    def model(self, prepared: ScaledContact, budget: Budget) -> ConicModel:
        return ClarabelModel(prepared.P, prepared.q, prepared.A, prepared.b, prepared.cones, budget)

    def stopping(self, tolerance: float, problem: LocalContact | None = None) -> Stopping:
        return ClarabelModel.stopping(tolerance)


@register
class ClarabelDeSaxceRolling(ClarabelDeSaxce):
    """The same with rolling friction."""

    spec = replace(
        ClarabelDeSaxce.spec,
        name="clarabel-de-saxce-rfc",
        node="rfc",
        summary="fixed point on De Saxcé's term with rolling friction, every step a cone program by Clarabel",
        citation=f"{ROLLING}; {CLARABEL}",
    )


@register
class ScsDeSaxce(ConicFixedPoint):
    """The fixed point whose convex programs start from the solution of the last one, with the same factorization."""

    spec = SolverSpec(
        name="scs-de-saxce",
        node="fc",
        summary="fixed point on De Saxcé's term, every step a second-order cone program by SCS",
        method="fixed point",
        citation=f"{COULOMB}; {SCS}",
        requires=("scs",),
        install="pip install scs",
        licence="MIT",
        traits=frozenset({Trait.SPARSE, Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=DeSaxceOptions,
    )

    def model(self, prepared: ScaledContact, budget: Budget) -> ConicModel:
        return ScsModel(prepared.P, prepared.q, prepared.A, prepared.b, prepared.cones, budget)

    def stopping(self, tolerance: float, problem: LocalContact | None = None) -> Stopping:
        return ScsModel.stopping(tolerance)


@register
class ScsDeSaxceRolling(ScsDeSaxce):
    """The same with rolling friction."""

    spec = replace(
        ScsDeSaxce.spec,
        name="scs-de-saxce-rfc",
        node="rfc",
        summary="fixed point on De Saxcé's term with rolling friction, every step a cone program by SCS",
        citation=f"{ROLLING}; {SCS}",
    )
