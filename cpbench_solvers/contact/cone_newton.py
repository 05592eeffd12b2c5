"""Semismooth Newton on functions of the cone that De Saxcé's change of variable gives: K*_μ ∋ û ⟂ r ∈ K_μ."""

from __future__ import annotations

from typing import ClassVar

from cpbench.solvers.base import SolverSpec, register
from cpbench_solvers.contact.newton_equation import ContactFunction
from cpbench_solvers.contact.semismooth_newton import ContactNewton, newton_spec


@register
class NaturalMapContact(ContactNewton):
    """The method of newton-alart-curnier, on r − P_K(r − ϱû): û has a kink where a contact begins to slide, the
    derivative there is that without the shift."""

    function = ContactFunction.NATURAL_MAP
    spec: ClassVar[SolverSpec] = newton_spec(
        name="newton-natural-map",
        summary="semismooth Newton on the natural map of the friction cone, from a start by Gauss-Seidel",
        citation="De Saxcé and Feng 1998, Math. Comput. Modelling 28:225; Acary, Brémond and Huber 2018, LNACM 92:205",
        by_default=False,
    )


@register
class FischerBurmeisterContact(ContactNewton):
    """The method of newton-alart-curnier, on a + b − (a∘a + b∘b)^½ in the Jordan algebra of the second-order cone,
    of reactions a = (μr_N, r_T) and velocities b = ϱ(û_N, μu_T); a contact without friction has the function of
    Fischer."""

    function = ContactFunction.FISCHER_BURMEISTER
    spec: ClassVar[SolverSpec] = newton_spec(
        name="newton-fb-fc",
        summary="semismooth Newton on the Fischer-Burmeister function of the second-order cone, after Gauss-Seidel",
        citation="Fukushima, Luo and Tseng 2001, SIAM J. Optim. 12:436; Acary, Brémond and Huber 2018, LNACM 92:205",
        by_default=False,
    )
